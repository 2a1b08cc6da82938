"""Chance in rules: of the model's seed, and of nothing else."""

import random
from random import Random

import numpy as np
import pytest
from numpy.random import default_rng

from mesa_swarm import AGENT9
from mesa_swarm.base.errors import BehaviourError, UncompiledBehaviourWarning
from mesa_swarm.control import Explore, Subsumption, behaviour
from support.rules import facing_a_disc, timid, wander
from support.scenes import empty


def wander_of(rule, *above, below=(), seed=1, steps=5):
    """Return the commands of three robots in every step."""
    model = empty(rng=seed)
    model.add_robots(AGENT9, poses=[(50, 50, 0.0), (150, 50, 0.0), (250, 50, 0.0)])
    model.control = Subsumption(*above, rule, *below)
    commands = []
    for _ in range(steps):
        model.step()
        commands.append(model.swarm.command.copy())
    return np.array(commands)


def test_chance_is_new_for_every_robot_and_step_and_the_same_for_the_same_seed():
    left, right = np.moveaxis(wander_of(wander), -1, 0)
    assert np.array_equal(left, right)
    assert len(np.unique(left)) == left.size
    assert ((left >= 0) & (left < 1)).all()
    assert np.array_equal(wander_of(wander)[..., 0], left)
    assert not np.array_equal(wander_of(wander, seed=2)[..., 0], left)


def test_chance_does_not_depend_on_other_layers():
    assert np.array_equal(wander_of(wander, timid(distance=0)), wander_of(wander))
    assert np.array_equal(wander_of(wander, below=[Explore(turn_interval=1)]), wander_of(wander))


def test_chance_is_drawn_only_for_rules_that_ask_for_it():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid, wander)
    model.run(3)
    states = model.streams.state()
    assert states["decide.wander"] != states["decide.timid"]
    fresh = np.random.Generator(np.random.PCG64(1))
    timid_stream, wander_stream = (model.streams[f"decide.{name}"] for name in ("timid", "wander"))
    assert has_drawn(wander_stream)
    assert not has_drawn(timid_stream)
    assert not has_drawn(fresh)


def has_drawn(generator):
    """Return whether a generator is not where its seed put it."""
    seeds = generator.bit_generator.seed_seq
    return np.random.PCG64(seeds).state != generator.bit_generator.state


def test_chance_is_uniform():
    drawn = wander_of(wander, steps=400)[..., 0].ravel()
    counts = np.histogram(drawn, bins=8, range=(0, 1))[0]
    assert abs(counts - 150).max() < 60  # five standard deviations


GENERATOR, BITS = np.random.default_rng(1), np.random.PCG64(1)


def own_chance():
    return random.random()


def imports_it(me):
    from numpy import random as chances  # noqa: PLC0415

    return chances.random(), 1.0  # noqa: NPY002


def imports_the_module(me):
    import random as chances  # noqa: PLC0415

    return chances.random(), 1.0


def imports_the_part(me):
    import numpy.random  # noqa: PLC0415

    return numpy.random.random(), 1.0  # noqa: NPY002


def imports_no_chance(me):
    import numpy  # noqa: PLC0415

    return numpy.hypot(0.3, 0.4), np.hypot(0.3, 0.4)


OWN_RANDOMNESS = {
    "np.random": lambda me: (np.random.random(), 1.0),  # noqa: NPY002
    "random": lambda me: (random.random(), 1.0),
    "GENERATOR": lambda me: (GENERATOR.random(), 1.0),
    "numpy": imports_it,
    "numpy.random": imports_the_part,
    "Random": lambda me: (Random(1).random(), 1.0),
    "default_rng": lambda me: (default_rng(1).random(), 1.0),
    "BITS": lambda me: (BITS.random_raw() / 2**64, 1.0),
}


@pytest.mark.parametrize("name", OWN_RANDOMNESS)
def test_random_numbers_that_the_seed_does_not_govern_are_refused_with_the_cure(name):
    model, _ = facing_a_disc()
    with pytest.raises(BehaviourError, match=f"uses {name}, which .*; use me.chance"):
        model.control = Subsumption(behaviour(OWN_RANDOMNESS[name]))


def test_a_module_of_chance_that_the_rule_imports_itself_is_refused_and_arithmetic_is_not():
    model, _ = facing_a_disc()
    with pytest.raises(BehaviourError, match="uses random, which"):
        model.control = Subsumption(behaviour(imports_the_module))
    model.control = Subsumption(behaviour(imports_no_chance))
    with pytest.warns(UncompiledBehaviourWarning):
        model.step()
    assert model.swarm.command == pytest.approx(np.array([[0.5, 0.5]]))


def test_random_numbers_of_a_helper_are_refused_too():
    inner = GENERATOR.random

    def enclosing(me):
        return inner(), 1.0

    model, _ = facing_a_disc()
    for rule in (enclosing, lambda me: (own_chance(), 1.0)):
        with pytest.raises(BehaviourError, match="which the model's seed does not govern"):
            model.control = Subsumption(behaviour(rule))
