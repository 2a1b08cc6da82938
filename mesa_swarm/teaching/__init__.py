"""For notebooks: exercises that check themselves, pictures, and small runs for a quick pass."""

from typing import TYPE_CHECKING

from mesa_swarm.base.moved import moved_name
from mesa_swarm.teaching.checks import check_estimate, check_function, check_model, check_rule, check_settings
from mesa_swarm.teaching.pictures import picture, sized
from mesa_swarm.teaching.verdicts import Criterion, Verdict

__all__ = [
    "Criterion",
    "Verdict",
    "check_estimate",
    "check_function",
    "check_model",
    "check_rule",
    "check_settings",
    "picture",
    "sized",
]


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> object:
        """Return a name by which a part of this package was called before; `from` asks twice, which warns once."""
        return globals().setdefault(name, moved_name(__name__, name))
