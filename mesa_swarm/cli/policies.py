"""Trained controllers as files: policy export."""

import re
from pathlib import Path
from typing import Annotated

import typer

from mesa_swarm.cli.options import Force
from mesa_swarm.errors import InvalidValueError, check_choice
from mesa_swarm.files import check_writable

FORMATS = ("c", "onnx")

commands = typer.Typer(help="Export trained controllers.", rich_markup_mode=None)


@commands.callback(invoke_without_command=True)
def _policy(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


@commands.command("export")
def export(
    file: Annotated[Path, typer.Argument(metavar="FILE.npz", help="A policy, written by `save_policy`.")],
    *,
    to: Annotated[str, typer.Option(help="c (C99 source and header) or onnx.")] = "c",
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path(),
    name: Annotated[
        str | None, typer.Option(help="Of the files and of functions in C; the name of FILE by default.")
    ] = None,
    number: Annotated[str, typer.Option(help="Floating-point numbers in C: double or float.")] = "double",
    copy: Annotated[int | None, typer.Option(min=0, help="One of several sets of weights; all by default.")] = None,
    force: Force = False,
) -> None:
    """Write a policy as C99 for microcontrollers, or as an ONNX graph."""
    from mesa_swarm.learning.c_source import NUMBERS, export_c
    from mesa_swarm.learning.onnx_files import export_onnx
    from mesa_swarm.learning.policy_files import load_policy

    check_choice("format", to, FORMATS)
    check_choice("number", number, NUMBERS)
    stem = name_in_c(file.stem) if name is None else name
    targets = [check_writable(out) / f"{stem}{ending}" for ending in ((".c", ".h") if to == "c" else (".onnx",))]
    for target in targets:
        if target.exists() and not force:
            raise InvalidValueError(f"{target} exists already; choose another name or add --force")
    policy = load_policy(file)
    if to == "c":
        export_c(policy, targets[0], number=number, copy=copy)
    else:
        export_onnx(policy, targets[0], copy=copy)
    print("\n".join(map(str, targets)))


def name_in_c(text: str) -> str:
    """Return a name that can begin names in C.

    Examples
    --------
    >>> name_in_c("2-wheel Robot")
    'policy_2_wheel_robot'
    """
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return plain if re.match("[a-z]", plain) else f"policy_{plain}".rstrip("_")
