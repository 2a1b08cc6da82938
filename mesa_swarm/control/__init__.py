"""Arbiters, layers and rules of one's own."""

from mesa_swarm.control.avoid import Avoid
from mesa_swarm.control.behaviour import PASS, behaviour
from mesa_swarm.control.explore import Explore
from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.control.respond import Respond
from mesa_swarm.control.subsumption import Subsumption

__all__ = ["PASS", "Avoid", "Explore", "Layer", "Respond", "Senses", "Subsumption", "behaviour"]
