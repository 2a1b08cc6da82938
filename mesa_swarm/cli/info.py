"""What a model is, how it works, and what to try, as text: info."""

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from mesa_swarm.base.wording import in_brief
from mesa_swarm.cli.lines import terminal_width, wrapped
from mesa_swarm.cli.options import Model, prepare

if TYPE_CHECKING:
    from mesa_swarm.model.info import ModelInfo

# Longer lines are hard to read.
WIDEST = 100
# Of files and pipes.
USUAL = 80

commands = typer.Typer()


@commands.command("info")
def info_command(
    model: Model,
    *,
    code: Annotated[bool, typer.Option("--code", help="Print the code of its rules as well.")] = False,
    odd: Annotated[bool, typer.Option("--odd", help="Print its description by the ODD protocol, as Markdown.")] = False,
) -> None:
    """Explain a model: what it is, how it works, what to watch, and commands to try."""
    prepare()
    from mesa_swarm.model.info import model_info
    from mesa_swarm.model.odd import odd as description_of

    if odd:
        print(description_of(model_info(model)), end="")
        return
    print("\n".join(explained(model_info(model), terminal_width(), code=code)))


def explained(about: "ModelInfo", columns: int | None, *, code: bool) -> Iterator[str]:
    """Yield the lines of an explanation: text wrapped, equations and parameters in a terminal only, code never."""
    width = min(columns or USUAL, WIDEST)
    yield about.title
    yield from _wrapped(about.what, width)
    for title, text in (("How it works", about.how), ("What to watch", about.watch)):
        if text:
            yield from ("", title, *_wrapped(text, width))
    if about.presets:
        yield from ("", "Things to try")
        for one in about.presets:
            yield from ("", *_wrapped(f"{one.label}. {one.text}", width), f"    {about.command(one)}")
    if about.equations:
        yield from ("", "Equations")
        for equation in about.equations:
            yield from ("", *wrapped(f"    {equation.latex}", columns), *_wrapped(equation.text, width))
    if about.source:
        yield from ("", "Source", *_wrapped(about.source, width))
    yield from ("", "Parameters, set by --set NAME=VALUE")
    for parameter in about.parameters.values():
        line = f"  {f'{parameter.name}={in_brief(parameter.default)}':28} {parameter.help}".rstrip()
        yield from wrapped(line, columns, 29)
    for listing in about.code if code else ():
        yield from ("", f"{listing.name} ({listing.module})", "", *listing.code.splitlines())


def _wrapped(text: str, width: int) -> Iterator[str]:
    for number, paragraph in enumerate(text.splitlines()):
        # Of docstrings of a user's, whose lines may be a list or an example.
        yield from textwrap.wrap(paragraph, width - 2, initial_indent="  ", subsequent_indent="  ") or [""] * (
            number > 0
        )
