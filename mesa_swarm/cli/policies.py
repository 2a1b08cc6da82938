"""Controllers as files: policy export."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesa_swarm.base.errors import (
    InvalidValueError,
    LearningError,
    UnknownNameError,
    check_choice,
    shortened,
    unknown_name,
)
from mesa_swarm.base.files import check_apart, check_writable, show_path
from mesa_swarm.cli.options import Force

if TYPE_CHECKING:
    from mesa_swarm.control.state_machine import StateMachine
    from mesa_swarm.robots.design import RobotDesign

FORMATS = ("c", "onnx")
LARGEST_TEXT = 400_000  # bytes

commands = typer.Typer(help="Export controllers.", rich_markup_mode=None)


@commands.callback(invoke_without_command=True)
def _policy(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


@commands.command("export")
def export_policy_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A policy, .npz, or the text of a state machine, .txt.")],
    *,
    to: Annotated[str, typer.Option(help="c (C99 source and header) or onnx.")] = "c",
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path(),
    name: Annotated[
        str | None, typer.Option(help="Of the files and of functions in C; the name of FILE by default.")
    ] = None,
    number: Annotated[str, typer.Option(help="Floating-point numbers in C: double or float.")] = "double",
    copy: Annotated[int | None, typer.Option(min=0, help="One of several sets of weights; all by default.")] = None,
    design: Annotated[
        str, typer.Option(help="Robots of a state machine: AGENT9 and the like, or package.module:NAME.")
    ] = "AGENT9",
    force: Force = False,
) -> None:
    """Write a policy or a state machine as C99 for microcontrollers, or a policy as an ONNX graph."""
    from mesa_swarm.learning.c_machines import export_machine
    from mesa_swarm.learning.c_source import NUMBERS, export_c
    from mesa_swarm.learning.onnx_files import export_onnx
    from mesa_swarm.learning.policy_files import load_policy

    check_choice("format", to, FORMATS)
    check_choice("number", number, NUMBERS)
    stem = name_in_c(file.stem) if name is None else _checked_stem(name, to)
    if file.suffix == ".txt" and copy is not None:
        raise InvalidValueError(f"copy is {copy}; a state machine has no sets of weights; leave --copy out")
    targets = [check_writable(out) / f"{stem}{ending}" for ending in ((".c", ".h") if to == "c" else (".onnx",))]
    for target in targets:
        check_apart(target, [file])
        if target.exists() and not force:
            raise InvalidValueError(f"{target} exists already; choose another name or add --force")
    if file.suffix == ".txt":
        if to != "c":
            raise InvalidValueError(f"format is {to!r}; a state machine is exported to c only")
        export_machine(machine_in(file), design_named(design), targets[0], number=number)
        print("\n".join(map(str, targets)))
        return
    policy = load_policy(file)
    if to == "c":
        export_c(policy, targets[0], number=number, copy=copy)
    else:
        export_onnx(policy, targets[0], copy=copy)
    print("\n".join(map(str, targets)))


def _checked_stem(name: str, to: str) -> str:
    """Return the name of the files, which are written to their folder and to no other."""
    from mesa_swarm.learning.c_source import checked_name

    if to == "c":
        return checked_name(name)
    if not name.isprintable() or Path(f"{name}.onnx").name != f"{name}.onnx" or not name:
        raise InvalidValueError(f"the name is {shortened(name)}; expected that of a file, without a folder")
    return name


def machine_in(file: Path) -> "StateMachine":
    """Return the state machine that a file describes."""
    from mesa_swarm.control.state_machine import StateMachine

    try:
        if file.exists() and not file.is_file():  # a pipe would be waited for
            raise OSError
        if file.stat().st_size > LARGEST_TEXT:
            raise LearningError(f"{show_path(file)} has more than {LARGEST_TEXT:,} bytes; expected a state machine")
        return StateMachine.read(file.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise LearningError(f"there is no file {show_path(file)}; write machine.text() to one") from None
    except (OSError, UnicodeDecodeError):
        raise LearningError(f"{show_path(file)} cannot be read; expected the text of a state machine") from None


def design_named(name: str) -> "RobotDesign":
    """Return a design of the package by its name, or another one by its address."""
    from mesa_swarm.model.gallery import is_address, object_at
    from mesa_swarm.robots import design as designs

    known = {key: value for key, value in vars(designs).items() if isinstance(value, designs.RobotDesign)}
    if name not in known and not is_address(name):
        raise UnknownNameError(unknown_name("design", name, known))
    found = known[name] if name in known else object_at(name)
    if not isinstance(found, designs.RobotDesign):
        raise InvalidValueError(f"{name} is {shortened(found)}; expected a RobotDesign")
    return found


def name_in_c(text: str) -> str:
    """Return a name that can begin names in C.

    Examples
    --------
    >>> name_in_c("2-wheel Robot")
    'policy_2_wheel_robot'
    """
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return plain if re.match("[a-z]", plain) else f"policy_{plain}".rstrip("_")
