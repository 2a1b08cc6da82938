"""Chance in rules: of the model's seed, and of nothing else."""

import random
from dataclasses import replace
from random import Random
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit
from numpy.random import default_rng

from mesa_swarm import AGENT9
from mesa_swarm.base.errors import BehaviourError, UncompiledBehaviourWarning
from mesa_swarm.control import PASS, Chance, Explore, Halt, StateMachine, Subsumption, Transition, behaviour
from mesa_swarm.kernels.draws import draw_at
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
    drawn = wander_of(wander)
    assert len(np.unique(drawn)) == drawn.size  # of both wheels, each of which reads it
    assert ((drawn >= 0) & (drawn < 1)).all()
    assert np.array_equal(wander_of(wander), drawn)
    assert not np.isin(wander_of(wander, seed=2), drawn).any()


def test_each_read_is_another_number_which_does_not_depend_on_how_often_others_read():
    @behaviour
    def wander_after_reads(me, reads=0):
        """Draw as often as asked, and twice more."""
        total = 0.0
        for _ in range(reads):
            total += me.chance
        return total * 0.0 + me.chance, me.chance

    often = np.array([wander_of(wander_after_reads(reads=reads), steps=3) for reads in range(4)])
    # With one number read before, the left wheel gets what was the right one's.
    assert np.array_equal(often[1:, ..., 0], often[:-1, ..., 1])
    stream = empty(rng=1).streams["decide.wander_after_reads"]
    for step in range(3):
        key = stream.integers(2**64, dtype=np.uint64)
        assert often[0][step].tolist() == [[draw_at(key, robot, read) for read in (0, 1)] for robot in (0, 1, 2)]


def test_a_robot_draws_the_same_when_others_read_more_or_are_driven_by_another_layer():
    @behaviour
    def wander_but_first(me, radius=0.0):
        """Draw, the larger robots many times."""
        for _ in range(50 if me.radius > radius else 0):
            wasted = me.chance
        return me.chance + 0.0 * wasted if me.radius > radius else me.chance, 0.0

    def drawn(radius):
        model = empty(rng=1)
        model.add_robots(replace(AGENT9, radius=9.0), poses=[(50, 50, 0.0)])
        model.add_robots(AGENT9, poses=[(150, 50, 0.0), (250, 50, 0.0)])
        model.control = Subsumption(wander_but_first(radius=radius))
        model.step()
        return model.swarm.command[:, 0].copy()

    assert np.array_equal(drawn(100.0)[1:], drawn(8.0)[1:])
    assert drawn(100.0)[0] != drawn(8.0)[0]


def test_two_layers_of_one_name_draw_from_streams_of_their_own():
    @behaviour
    def pass_half(me):
        """Leave every other robot to the layers below."""
        return PASS if me.chance < 0.5 else (me.chance, 1.0)

    model = empty(rng=1)
    model.add_robots(AGENT9, 40)
    model.control = Subsumption(pass_half, pass_half)
    model.step()
    second = model.swarm.layer == 1
    assert 0.15 < second.mean() < 0.35  # the same draws would leave none to it
    assert {"decide.pass_half", "decide.pass_half#2"} <= set(model.streams.state())


def test_in_plain_python_each_read_is_the_number_of_compiled_rules():
    @behaviour
    def plainly(me):
        """Draw twice in a way that Numba refuses."""
        drawn = [value for value in (me.chance, str(me.radius) and me.chance)]
        return drawn[0], {"right": drawn[1]}["right"]

    with pytest.warns(UncompiledBehaviourWarning):
        plain = wander_of(plainly)
    model = empty(rng=1)
    stream = model.streams["decide.plainly"]
    for step in plain:
        key = stream.integers(2**64, dtype=np.uint64)
        assert step.tolist() == [[draw_at(key, robot, read) for read in (0, 1)] for robot in (0, 1, 2)]


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


@njit
def hop(me):
    return me.chance


TOOLS = SimpleNamespace(hop=hop)


@behaviour
def by_function(me):
    """Draw in a function that is called by its name."""
    return hop(me), 0.5


@behaviour
def by_name(me):
    """Draw by the name of the field."""
    return getattr(me, "chance"), 0.5  # noqa: B009


@pytest.mark.parametrize("rule", [by_function, by_name])
def test_a_rule_that_passes_me_on_draws_what_is_read_there(rule):
    drawn = wander_of(rule)[..., 0]
    assert len(np.unique(drawn)) == drawn.size
    stream = empty(rng=1).streams[f"decide.{rule.name}"]
    for step in drawn:
        key = stream.integers(2**64, dtype=np.uint64)
        assert step.tolist() == [draw_at(key, robot, 0) for robot in (0, 1, 2)]


def test_in_plain_python_a_rule_that_passes_me_on_draws_too():
    @behaviour
    def by_object(me):
        """Draw in a function that is found in an object."""
        return TOOLS.hop.py_func(me), 0.5

    with pytest.warns(UncompiledBehaviourWarning):
        drawn = wander_of(by_object)[..., 0]
    assert len(np.unique(drawn)) == drawn.size


def test_a_rule_named_state_does_not_draw_from_the_stream_of_its_machine():
    @behaviour
    def state(me):
        """Drive at random."""
        return me.chance, me.chance

    machine = StateMachine(
        {"go": state, "stay": Halt()}, [Transition(source="go", target="stay", condition=Chance(probability=0.01))]
    )
    model = empty(rng=1)
    model.add_robots(AGENT9, 3)
    model.control = machine
    model.run(5)
    assert {"decide.state", "decide.#state"} <= set(model.streams.state())
