"""Arbiters, layers and custom rules."""

from mesa_swarm.control.arbiter import Arbiter, Subsumption, VectorSum
from mesa_swarm.control.avoid import Avoid
from mesa_swarm.control.behaviour import PASS, behaviour
from mesa_swarm.control.explore import Explore
from mesa_swarm.control.flocking import Align, Cohere, Cruise, MatchVelocity, Separate
from mesa_swarm.control.follow import Follow
from mesa_swarm.control.gather import Gather
from mesa_swarm.control.head_on import HeadOn
from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.control.perimeter import Perimeter
from mesa_swarm.control.push import Push
from mesa_swarm.control.respond import Respond
from mesa_swarm.control.team import Team
from mesa_swarm.robots.reasons import Moment, Reason

__all__ = [
    "PASS",
    "Align",
    "Arbiter",
    "Avoid",
    "Cohere",
    "Cruise",
    "Explore",
    "Follow",
    "Gather",
    "HeadOn",
    "Layer",
    "MatchVelocity",
    "Moment",
    "Perimeter",
    "Push",
    "Reason",
    "Respond",
    "Senses",
    "Separate",
    "Subsumption",
    "Team",
    "VectorSum",
    "behaviour",
]
