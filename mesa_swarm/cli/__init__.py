"""The command line: `mesa-swarm`. Every error is one line and exit status 2; a traceback only with --debug."""

import errno
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from mesa_swarm.base.errors import SwarmError, error_line, locate_error
from mesa_swarm.base.work_line import summarise_work
from mesa_swarm.cli import compare, design, draw, info, learn, listing, page, parameter_searches, policies, run
from mesa_swarm.cli.installed import command_of, installed_commands
from mesa_swarm.cli.lines import any_letters

INTERRUPTED = 130
DISK_FULL = (errno.ENOSPC, errno.EFBIG)


class Commands(TyperGroup):
    """The commands, and those of installed packages.

    The end of a file is not the end of what a user types, as Typer takes it.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        self._add_installed()
        return super().list_commands(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that is named, and the words after it."""
        if args[0] not in self.commands:
            self._add_installed(args[0])
        return super().resolve_command(ctx, args)

    def _add_installed(self, name: str = "") -> None:
        """Add the installed command of this name, or else all of them, of which the nearest is suggested."""
        found = {each: points for each, points in installed_commands().items() if each not in self.commands}
        for each in [name] if name in found else sorted(found):
            self.commands[each] = command_of(each, found[each])

    def invoke(self, ctx: Any) -> Any:
        """Run the command that is named."""
        try:
            return super().invoke(ctx)
        except EOFError as error:
            raise OSError(f"a file or the input ended too early: {error_line(error)} (--debug shows where)") from error


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for group in (listing, info, run, compare, parameter_searches, draw, learn, design, page):
    app.add_typer(group.commands)
app.add_typer(draw.map_commands, name="map")
app.add_typer(policies.commands, name="policy")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command, by default that of the command line; exit with status 0, 2 for an error, 130 after Ctrl-C.

    The status is 1 if `verify` finds a difference, or a run of a job fails.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    with any_letters(), warnings.catch_warnings():
        warnings.showwarning = _shown_once()
        status = _status(lambda: _run_command(words), debug)
    sys.exit(status)


def _run_command(words: list[str]) -> int:
    """Let Typer find the command and return its exit status; --debug may stand anywhere."""
    command = typer.main.get_command(app)
    arguments = [word for word in words if word != "--debug"]
    with summarise_work():
        status = command.main(arguments, prog_name="mesa-swarm", standalone_mode=False)
    if status == INTERRUPTED:  # newer versions of Typer return this after Ctrl-C, older ones raise Abort
        raise KeyboardInterrupt
    sys.stdout.flush()
    return status if isinstance(status, int) else 0


def _status(command: Callable[[], int], debug: bool) -> int:
    try:
        return command()
    except (KeyboardInterrupt, typer.Abort):
        return _complain("interrupted; nothing more was written", INTERRUPTED)
    except BrokenPipeError:  # a reader of the output, such as `head`, has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as error:
        if debug:
            traceback.print_exc()
        return _complain(_in_words(error))
    return 0


def _complain(text: str, status: int = 2) -> int:
    print(f"mesa-swarm: {' '.join(text.split())}", file=sys.stderr)
    return status


def _in_words(error: Exception) -> str:
    """Return one line about an error: ours unchanged, the system's with the file, others with their class."""
    if hasattr(error, "format_message"):  # Typer does not know the command or option
        command = getattr(getattr(error, "ctx", None), "command_path", "mesa-swarm")
        return f"{error.format_message()}{_range_of(error)} ({command} --help lists what is possible)"
    if isinstance(error, SwarmError):
        return error_line(error).replace("overwrite=True (--force)", "--force")  # the option, not the Python parameter
    if isinstance(error, OSError):
        unnamed = "standard output or a temporary file" if error.errno in DISK_FULL else None
        return ": ".join(str(part) for part in (error.filename or unnamed, error.strerror or error) if part)
    return f"{locate_error(error)} (--debug shows where)"


def _range_of(error: Exception) -> str:
    """Return the range of an option whose value is refused, of which Typer may name one end only."""
    option: Any = getattr(error, "param", None)
    limits: Any = option if hasattr(option, "min") else getattr(option, "type", None)  # of older versions of Typer
    low, high = (getattr(limits, end, None) for end in ("min", "max"))
    return "" if low is None or high is None else f"; expected {low:,} to {high:,}"


def _shown_once() -> Callable[..., None]:
    """Return what shows warnings of one command: many runs with the same file warn of it once."""
    shown: set[str] = set()

    def show_warning(message: Warning | str, *_: object, **__: object) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            _complain(f"warning: {message}")

    return show_warning


def _print_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        print(f"mesa-swarm {version('mesa-swarm')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def mesa_swarm(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show where an error comes from.")] = False,
) -> None:
    """Swarms of small mobile robots in a continuous plane: a Mesa extension."""
    if context.invoked_subcommand is None:
        print(context.get_help())
