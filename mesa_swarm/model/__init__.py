"""The model: its parts, its plan, its step, its fingerprint; Mesa's model of any version."""

from typing import TYPE_CHECKING

from mesa_swarm.base.moved import moved_name

if not TYPE_CHECKING:  # with this, a type checker would take any name for one of this module

    def __getattr__(name: str) -> object:
        """Return a name that was in this module before, from where it is now; `from` asks twice, which warns once."""
        return globals().setdefault(name, moved_name(__name__, name))
