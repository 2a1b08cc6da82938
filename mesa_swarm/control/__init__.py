"""Arbiters, layers and custom rules. Layers are imported when they are first used."""

from typing import TYPE_CHECKING

from mesa_swarm.base.lazy import lazy_names
from mesa_swarm.control.behaviour import PASS, behaviour  # named like its module, which would else replace it

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.control.approach import Approach, Halt, Retreat
    from mesa_swarm.control.arbiter import Arbiter, Subsumption, VectorSum
    from mesa_swarm.control.avoid import Avoid
    from mesa_swarm.control.conditions import Chance, Condition, HeatSensed, OffMark, OnMark, RobotsSeen, Seen, Unseen
    from mesa_swarm.control.explore import Explore
    from mesa_swarm.control.flocking import Align, Cohere, Cruise, MatchVelocity, Separate
    from mesa_swarm.control.follow import Follow
    from mesa_swarm.control.gather import Gather, Lead
    from mesa_swarm.control.head_on import HeadOn
    from mesa_swarm.control.layer import Layer, Senses
    from mesa_swarm.control.perimeter import Perimeter
    from mesa_swarm.control.push import Push
    from mesa_swarm.control.respond import Respond
    from mesa_swarm.control.state_machine import StateMachine, Transition
    from mesa_swarm.control.team import Team
    from mesa_swarm.robots.reasons import Moment, Reason

# Module: the public names that live in it.
_MODULES = {
    "control.approach": "Approach Halt Retreat",
    "control.arbiter": "Arbiter Subsumption VectorSum",
    "control.avoid": "Avoid",
    "control.conditions": "Chance Condition HeatSensed OffMark OnMark RobotsSeen Seen Unseen",
    "control.explore": "Explore",
    "control.flocking": "Align Cohere Cruise MatchVelocity Separate",
    "control.follow": "Follow",
    "control.gather": "Gather Lead",
    "control.head_on": "HeadOn",
    "control.layer": "Layer Senses",
    "control.perimeter": "Perimeter",
    "control.push": "Push",
    "control.respond": "Respond",
    "control.state_machine": "StateMachine Transition",
    "control.team": "Team",
    "robots.reasons": "Moment Reason",
}

__all__ = [
    "PASS",
    "Align",
    "Approach",
    "Arbiter",
    "Avoid",
    "Chance",
    "Cohere",
    "Condition",
    "Cruise",
    "Explore",
    "Follow",
    "Gather",
    "Halt",
    "HeadOn",
    "HeatSensed",
    "Layer",
    "Lead",
    "MatchVelocity",
    "Moment",
    "OffMark",
    "OnMark",
    "Perimeter",
    "Push",
    "Reason",
    "Respond",
    "Retreat",
    "RobotsSeen",
    "Seen",
    "Senses",
    "Separate",
    "StateMachine",
    "Subsumption",
    "Team",
    "Transition",
    "Unseen",
    "VectorSum",
    "behaviour",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
