"""The command line: `mesa-swarm`. Every error is one line and exit status 2; a traceback only with --debug."""

import errno
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, TextIO

import typer

from mesa_swarm.cli.study import MOST_KEPT, MOST_STEPS, Quiet, Settings, study, work
from mesa_swarm.errors import InvalidValueError, SwarmError, check_choice, in_words
from mesa_swarm.gallery import model_names

INTERRUPTED = 130
DIFFERENT = 1
DISK_FULL = (errno.ENOSPC, errno.EFBIG)

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
maps = typer.Typer(help="Look at maps and convert them.", rich_markup_mode=None)
app.add_typer(maps, name="map")
app.add_typer(study)

JOB = ".toml"


def main(arguments: Sequence[str] | None = None) -> None:
    """Do what was typed and exit with status 0, 2 for an error, 130 after Ctrl-C.

    With 1 if `verify` finds a difference, or a run of a job fails.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default what follows the program's name on the command line.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        status = _status(lambda: _typed(words), debug)
    sys.exit(status)


def _typed(words: list[str]) -> int:
    """Let Typer find the command and return its exit status; --debug may stand anywhere."""
    command = typer.main.get_command(app)
    arguments = [word for word in words if word != "--debug"]
    status = command.main(arguments, prog_name="mesa-swarm", standalone_mode=False)
    if status == INTERRUPTED:  # newer versions of Typer return this after Ctrl-C, older ones raise Abort
        raise KeyboardInterrupt
    sys.stdout.flush()
    return status if isinstance(status, int) else 0


def _status(work: Callable[[], int], debug: bool) -> int:
    try:
        return work()
    except (KeyboardInterrupt, typer.Abort):
        return _complain("interrupted; nothing more was written", INTERRUPTED)
    except BrokenPipeError:  # whoever read the output, such as `head`, has seen enough
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
    """Return one line about an error: ours as they are, the system's with the file, others by name."""
    if hasattr(error, "format_message"):  # what was typed is not a command
        return f"{error.format_message()} (mesa-swarm --help says what is possible)"
    if isinstance(error, SwarmError):
        return in_words(error).replace("overwrite=True (--force)", "--force")  # what one types, not what one calls
    if isinstance(error, OSError):
        # What we write has a name, what we print has none.
        unnamed = "standard output or a temporary file" if error.errno in DISK_FULL else None
        return ": ".join(str(part) for part in (error.filename or unnamed, error.strerror or error) if part)
    return f"{in_words(error)} (with --debug, mesa-swarm shows where)"


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    print(f"mesa-swarm: warning: {' '.join(str(message).split())}", file=sys.stderr)


def _print_version(wanted: bool) -> None:
    if wanted:
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
    _help_if_alone(context)


@maps.callback(invoke_without_command=True)
def _map(context: typer.Context) -> None:
    _help_if_alone(context)


def _help_if_alone(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command("list")
def list_models() -> None:
    """List the models, their parameters and the defaults."""
    work().list_models()


@app.command()
def run(
    model: Annotated[str, typer.Argument(help="One of `mesa-swarm list`, or a job file.", metavar="MODEL|JOB.toml")],
    *,
    setting: Settings = None,
    steps: Annotated[
        int | None, typer.Option(min=1, max=MOST_STEPS, help="How many at most; 3000 unless given.")
    ] = None,
    rng: Annotated[
        int | None, typer.Option(min=0, max=2**63 - 1, help="Seed; the same one gives the same run; 1 unless given.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write every step to it; {seed} and {name} are filled in."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
    quiet: Quiet = False,
) -> None:
    """Run a model, or the runs of a job file; print the results and final fingerprint of each."""
    if model.lower().endswith(JOB):
        _refuse_beside_job({"--set": setting, "--steps": steps, "--rng": rng})
        if not work("job_commands").run(model, progress=not quiet, record=record, force=force):
            raise typer.Exit(DIFFERENT)
        return
    check_choice("model", model, model_names())
    steps, rng = 3000 if steps is None else steps, 1 if rng is None else rng
    work().run(model, setting or [], steps=steps, rng=rng, progress=not quiet, record=record, force=force)


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `mesa-swarm run --record` wrote.")],
    *,
    quiet: Quiet = False,
) -> None:
    """Run a recording again; name the first step and robot that differ (exit status 1), or say that none does."""
    if not work("recording_commands").verify(file, progress=not quiet):
        raise typer.Exit(DIFFERENT)


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `mesa-swarm run --record` wrote.")],
    *,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Where the page is served; 0 is any free one.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only serve, and print the address.")] = False,
) -> None:
    """Play a recording in the browser: at any speed, to and fro, from event to event."""
    work("replay_commands").replay(file, port=port, browser=not no_browser)


@app.command()
def export(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `mesa-swarm run --record` wrote.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A .png .svg .gif .mp4 .html .csv or .parquet file.")],
    *,
    steps: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Stills or rows of these steps; stills: else the last.")
    ] = None,
    every: Annotated[int | None, typer.Option(min=1, max=MOST_STEPS, help="All steps that are multiples.")] = None,
    first: Annotated[int | None, typer.Option("--from", min=0, max=MOST_STEPS, help="No steps before.")] = None,
    last: Annotated[int | None, typer.Option("--to", min=0, max=MOST_STEPS, help="No steps after.")] = None,
    sheet: Annotated[bool, typer.Option("--sheet", help="Several stills on one sheet.")] = False,
    animate: Annotated[bool, typer.Option("--animate", help="Make an .svg move.")] = False,
    fps: Annotated[float | None, typer.Option(min=1, max=120, help="Frames a second of what moves.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels of a .png .gif or .mp4.")] = None,
    sectors: Annotated[bool, typer.Option("--sectors", help="Draw where proximity sensors look.")] = False,
    trails: Annotated[int, typer.Option(min=0, max=MOST_KEPT, help="Draw ways over so many steps.")] = 0,
    table: Annotated[str | None, typer.Option(help="robots, fires, contacts or loads, as .csv or .parquet.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
    quiet: Quiet = False,
) -> None:
    """Write a recording as pictures, a film, a page or a table, by the ending of OUT."""
    work("export_commands").export(
        file,
        out,
        steps=steps,
        every=every,
        first=first,
        last=last,
        sheet=sheet,
        animate=animate,
        fps=fps,
        size=size,
        sectors=sectors,
        trails=trails,
        table=table,
        force=force,
        progress=not quiet,
    )


def _refuse_beside_job(options: dict[str, object]) -> None:
    for name, value in options.items():
        if value is not None:
            raise InvalidValueError(f"{name} is given beside a job file, which says so itself; leave it out")


@maps.command("import")
def import_map(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A .svg, .map or .toml file, or a built-in name.")],
    out: Annotated[
        Path | None, typer.Argument(metavar="[OUT.toml]", help="By default FILE's name, here, as .toml.")
    ] = None,
    *,
    force: Annotated[bool, typer.Option("--force", help="Replace OUT if it exists.")] = False,
) -> None:
    """Write a map as TOML, or as SVG if OUT ends in .svg."""
    work("map_commands").import_map(file, out, force)


@maps.command("show")
def show_map(
    file: Annotated[str, typer.Argument(metavar="FILE|NAME", help="A map file or a built-in name.")],
    *,
    out: Annotated[Path | None, typer.Option(help="Draw it as this .png.")] = None,
) -> None:
    """Print what is on a map, and draw it if asked."""
    work("map_commands").show_map(file, out)


@app.command()
def dashboard(
    model: Annotated[str, typer.Argument(help="The model to show first.", metavar="[MODEL]")] = "fire_fighting",
    *,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Where the page is served.")] = 8765,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but this machine's own asks for a token, which is printed.")
    ] = "127.0.0.1",
    recordings: Annotated[
        Path | None, typer.Option(metavar="PATH", help="A recording, or a folder of them, to replay on the page.")
    ] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only serve; open no browser.")] = False,
) -> None:
    """Look at a model in the browser."""
    check_choice("model", model, model_names())
    work().dashboard(model, port=port, browser=not no_browser, host=host, recordings=recordings)


if __name__ == "__main__":
    main()
