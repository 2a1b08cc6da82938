"""Commands of installed packages: entry points of `mesa_swarm.commands`, loaded when they are run or listed."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import typer

from mesa_swarm.base.errors import InvalidValueError, SwarmError, locate_error, shortened, without_middle

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "mesa_swarm.commands"
# What a command that cannot be loaded is called with.
ANY_WORDS = {"ignore_unknown_options": True, "allow_extra_args": True}


def installed_commands() -> "dict[str, list[EntryPoint]]":
    """Return by name the entry points of installed packages, of which more than one may have the same."""
    from importlib.metadata import entry_points

    found: dict[str, list[EntryPoint]] = {}
    for point in entry_points(group=GROUP):
        found.setdefault(point.name, []).append(point)
    return found


def command_of(name: str, points: "list[EntryPoint]") -> Any:
    """Return an installed command as Typer has it; one that cannot be loaded is refused when it is run."""
    application = typer.Typer(add_completion=False, rich_markup_mode=None)
    try:
        _add(application, name, _loaded(points))
        return typer.main.get_group(application).commands[name]
    except (Exception, SystemExit) as error:
        reason = str(error) if isinstance(error, SwarmError) else f"cannot be loaded: {locate_error(error)}"
        refusing = typer.Typer(add_completion=False, rich_markup_mode=None)
        refusing.command(name, help=reason, context_settings=ANY_WORDS)(_refusal(name, points[0], reason))
        return typer.main.get_group(refusing).commands[name]


def _loaded(points: "list[EntryPoint]") -> object:
    if len(points) > 1:
        packages = " and ".join(sorted(point.dist.name if point.dist else point.value for point in points))
        raise InvalidValueError(f"is of more than one package: {packages}; uninstall all but one")
    return points[0].load()


def _add(application: typer.Typer, name: str, value: object) -> None:
    """Add a function as a command, or a Typer with its commands as a group."""
    if isinstance(value, typer.Typer):
        application.add_typer(value, name=name)
    elif callable(value) and not isinstance(value, type):
        application.command(name)(value)
    else:
        raise InvalidValueError(f"is {shortened(value)}; expected a function or a typer.Typer")


def _refusal(name: str, point: "EntryPoint", reason: str) -> Callable[[], None]:
    def refuse() -> None:
        raise SwarmError(without_middle(f"the command {name} ({point.value}) {reason}"))

    return refuse
