"""The model: the same seed gives the same bits everywhere, and looking changes nothing."""

import inspect
import math
import os
import subprocess
import sys
from itertools import permutations

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, AGENT_FIRE, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from support.furniture import furnished, noisy
from support.scenes import ahead, empty

# Everything random at once: places, slip, noise, random turns, fires; walls, discs, two designs.
PROGRAM = """
import sys
from mesa_swarm import AGENT9, AGENT_FIRE, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
model = SwarmModel(map="original", rng=int(sys.argv[1]))
model.add_fire((700, 80), radius=20)
noisy = AGENT9.with_proximity(error_probability=0.2, error_magnitude=0.3, hold=3, range=30)
model.add_robots(noisy.with_slip(probability=0.1, magnitude=0.5), 25)
model.add_robots(AGENT_FIRE, 5)
model.control = Subsumption(Avoid(distance=12), Explore(turn_interval=40))
model.run(int(sys.argv[2]))
assert model.total_collisions > 0
print(model.state_hash())
"""


def hash_of(seed=1, steps=1000, python=sys.executable, **environment):
    """Run the program above in a fresh process and return what it prints."""
    result = subprocess.run(
        [python, "-c", PROGRAM, str(seed), str(steps)],
        env={**os.environ, **environment}, capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    return result.stdout.strip()


@pytest.fixture(scope="module")
def known_hash():
    return hash_of(NUMBA_NUM_THREADS="1", PYTHONHASHSEED="1")


# ---- the same seed


@pytest.mark.slow
def test_fresh_processes_give_the_same_state_whatever_their_hash_seed_and_number_of_threads(known_hash):
    assert hash_of(NUMBA_NUM_THREADS="2", PYTHONHASHSEED="12345") == known_hash
    assert len(known_hash) == 32


def test_another_python_and_mesa_give_the_same_state(known_hash):
    python = os.environ.get("MESA_SWARM_OTHER_PYTHON")
    if not python:
        pytest.skip("MESA_SWARM_OTHER_PYTHON names no other Python that has the package")
    assert hash_of(python=python) == known_hash


@pytest.mark.slow
def test_the_order_in_which_things_were_created_does_not_change_the_state():
    hashes = {
        order: furnished(order).run(1000).state_hash()
        for which in ("obstacles", "backwards")
        for order in permutations((which, "fires", "robots"))
    }
    assert len(hashes) == 12
    assert len(set(hashes.values())) == 1


def test_another_seed_gives_another_state():
    first, again, other = (furnished(("obstacles", "robots"), seed).run(100).state_hash() for seed in (3, 3, 4))
    assert first == again != other


def test_robots_created_in_another_order_take_the_same_way():
    poses = [(30 + 24 * (k % 14), 40 + 30 * (k // 14), 2.2 * k) for k in range(40)]
    ends = []
    for order in (slice(None), slice(None, None, -1)):
        model = empty()
        model.add_robots(AGENT9, poses=poses[order], tendency="left")
        model.control = Subsumption(Avoid(distance=8), Explore())
        ends.append(model.run(100).swarm.position[order])
        assert model.total_collisions > 0
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_two_models_side_by_side_do_not_disturb_each_other():
    def one():
        return furnished(("obstacles", "fires", "robots"))

    alone = one().run(60).state_hash()
    a, b = one(), one()
    for _ in range(60):
        a.step()
        b.step()
    assert a.state_hash() == b.state_hash() == alone


# ---- streams


@pytest.mark.slow
def test_looking_does_not_change_the_run():
    def run(look):
        model = SwarmModel(map="original", rng=1)
        model.add_fire((700, 80), radius=20)
        model.add_robots(noisy(probability=0.2, magnitude=0.5), 20)
        model.add_robots(AGENT_FIRE.with_proximity(period=3, hold=2, error_probability=0.5, error_magnitude=0.1), 5)
        model.control = Subsumption(Avoid(), Explore(turn_interval=30))
        for _ in range(80):
            look(model)
            model.step()
            look(model)
        return model.state_hash()

    def stare(model):
        model.sense()
        _ = model.contacts, model.robots, model.obstacles, model.agents, model.state_hash()
        _ = model.space.agent_positions
        for robot in model.robots:
            _ = robot.position, robot.distance, robot.kind, robot.tendency, robot.get_neighbors_in_radius(50)
        model.datacollector.get_model_vars_dataframe()

    assert run(lambda model: None) == run(stare)


def test_looking_between_two_additions_of_robots_does_not_change_the_run():
    hashes = []
    for look in (False, True):
        model = empty()
        model.add_robots(noisy(), 5)
        if look:
            model.sense()
        model.add_robots(noisy(), 5)
        model.control = Subsumption(Avoid(), Explore())
        hashes.append(model.run(5).state_hash())
    assert hashes[0] == hashes[1]


def test_strategies_a_and_b_face_the_same_start():
    a, b = (FireFighting(strategy=strategy, rng=7) for strategy in "AB")
    for name in ("position", "heading", "tendency"):
        assert (getattr(a.swarm, name) == getattr(b.swarm, name)).all()
    assert (a.fires.temperature == b.fires.temperature).all()
    assert (a.fires.position == b.fires.position).all()


def test_slip_does_not_change_the_draws_of_sensor_noise():
    errors = []
    for slip in ({}, {"probability": 0.5, "magnitude": 0.5}):
        model = empty(rng=9)
        model.add_robots(noisy(**slip), 10)
        model.control = Subsumption(ahead)
        rows = []
        for _ in range(20):
            model.step()
            rows.append(model.swarm.error.copy())
        errors.append(np.array(rows))
    assert (errors[0] == errors[1]).all()
    assert (errors[0] != 0).any()


def test_noise_does_not_change_where_robots_start_nor_their_tendencies():
    starts = []
    for design in (AGENT9, noisy(), AGENT3):
        model = empty(rng=9)
        model.add_robots(design, 10)
        starts.append(np.column_stack([model.swarm.position, model.swarm.heading, model.swarm.tendency]))
    assert (starts[0] == starts[1]).all()
    assert (starts[0] == starts[2]).all()


# ---- the seed


def start_of(rng):
    model = empty(rng=rng)
    model.add_robots(AGENT9, 5)
    return model.state_hash()


def test_an_integer_and_its_seed_sequence_are_the_same_seed():
    assert start_of(5) == start_of(np.random.SeedSequence(5)) == start_of(5)
    assert start_of(5) != start_of(6)


def test_an_integer_of_numpy_is_the_same_seed_as_one_of_python():
    assert start_of(np.int64(5)) == start_of(5)


def test_spawned_seed_sequences_give_different_worlds_each_time_the_same():
    first, second = np.random.SeedSequence(5).spawn(2)
    again = np.random.SeedSequence(5).spawn(2)
    assert start_of(first) != start_of(second)
    assert [start_of(s) for s in again] == [start_of(first), start_of(second)]


def test_generators_in_the_same_state_give_the_same_world_and_go_on():
    one, two = np.random.default_rng(5), np.random.default_rng(5)
    assert start_of(one) == start_of(two)
    assert start_of(one) != start_of(np.random.default_rng(5))


def test_no_seed_gives_another_world_each_time():
    assert start_of(None) != start_of(None)


@pytest.mark.parametrize("rng", ["abc", -1, 1.5, math.nan, {}, object(), [-1], b"1"])
def test_what_is_not_a_seed_is_refused_on_one_line(rng):
    with pytest.raises(InvalidValueError, match=r"^rng is .*expected a whole number") as caught:
        SwarmModel(rng=rng)
    assert "\n" not in str(caught.value)


def test_a_method_that_a_part_answers_has_the_signature_and_the_docstring_of_the_part():
    model = SwarmModel(rng=1)
    for method, of_part in (
        (model.add_body, model.parts.bodies.add_body),
        (model.add_fire, model.parts.fires.add_fire),
    ):
        assert inspect.signature(method) == inspect.signature(of_part)
        assert inspect.getdoc(method) == inspect.getdoc(of_part)
