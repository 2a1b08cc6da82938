"""Fires: constants, thermodynamics, and the strategies of the robots that fight them."""

from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.constants import FireConstants, design_constants, robots_needed
from mesa_swarm.fire.fires import Fire, Fires
from mesa_swarm.fire.strategy import FightFire

__all__ = ["Burning", "FightFire", "Fire", "FireConstants", "Fires", "design_constants", "robots_needed"]
