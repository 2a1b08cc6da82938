"""Policies that ten robots learn at fires: skills by one table, wheel actions by networks that all share."""

from collections.abc import Sequence
from typing import TypeVar, cast

from mesa_swarm import AGENT_FIRE, Map, SwarmModel
from mesa_swarm.control import Layer, Subsumption
from mesa_swarm.errors import check_count
from mesa_swarm.gallery import find_model
from mesa_swarm.learning import FireWheelPolicy, LearnFires, LearnFireWheels, SkillPolicy
from mesa_swarm.world.random_map import random_map

ROBOTS, FIRES = 10, 5
# Maps of the training of wheel actions.
TRAINING = range(12_000, 12_010)
SKILL_STEPS, WHEEL_STEPS = 60_000, 30_000
Learning = TypeVar("Learning", LearnFires, LearnFireWheels)


def trained_skills(seed: int, steps: int = SKILL_STEPS) -> SkillPolicy:
    """Return what ten robots of the model `learning_fires` learn with a seed, in one table for all."""
    model = find_model("learning_fires")(rng=seed).run(check_count("steps", steps, minimum=1))
    return _learner_of(model, LearnFires).policy()


def trained_wheels(seed: int, steps: int = WHEEL_STEPS) -> FireWheelPolicy:
    """Return the Q-networks that ten robots share after they drove on ten generated maps, one after the other."""
    first, parts = len(TRAINING) * check_count("seed", seed), len(TRAINING)
    count = max(check_count("steps", steps, minimum=1) // parts, 1)
    policy: FireWheelPolicy | None = None
    for number, world in enumerate(TRAINING):
        model = fire_world((LearnFireWheels(start=policy),), random_map(world, fires=FIRES), first + number)
        model.run(count)
        policy = _learner_of(model, LearnFireWheels).policy()
    return cast(FireWheelPolicy, policy)


def _learner_of(model: SwarmModel, kind: type[Learning]) -> Learning:
    """Return the layer of a model that learns."""
    layers = model.control.layers if model.control else ()
    return next(layer for layer in layers if isinstance(layer, kind))


def fire_world(layers: Sequence[Layer], world: Map | str, seed: int) -> SwarmModel:
    """Return a model of ten robots at the fires of a map."""
    model = SwarmModel(map=world, rng=seed, history_every=0)
    model.add_robots(AGENT_FIRE, ROBOTS)
    model.control = Subsumption(*layers)
    return model
