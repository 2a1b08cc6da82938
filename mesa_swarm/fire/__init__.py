"""Fires: constants, thermodynamics, and the strategies of the robots that fight them.

Names are imported when they are first used: `design_constants` needs neither Mesa nor Numba.
"""

from typing import TYPE_CHECKING

from mesa_swarm.base.lazy import lazy_names

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.fire.burning import Burning, is_hot, next_temperature
    from mesa_swarm.fire.constants import FireConstants, design_constants, robots_needed
    from mesa_swarm.fire.fires import Fire, Fires
    from mesa_swarm.fire.spreading import Spreading
    from mesa_swarm.fire.strategy import FightFire, SeekHeat

# Module: the public names that live in it.
_MODULES = {
    "fire.burning": "Burning is_hot next_temperature",
    "fire.constants": "FireConstants design_constants robots_needed",
    "fire.fires": "Fire Fires",
    "fire.spreading": "Spreading",
    "fire.strategy": "FightFire SeekHeat",
}

__all__ = [
    "Burning",
    "FightFire",
    "Fire",
    "FireConstants",
    "Fires",
    "SeekHeat",
    "Spreading",
    "design_constants",
    "is_hot",
    "next_temperature",
    "robots_needed",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
