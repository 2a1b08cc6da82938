"""The model: the same seed gives the same bits everywhere, looking changes nothing, and wrong input is refused."""

import math
import os
import subprocess
import sys
from itertools import permutations

import numpy as np
import pytest

from mesa_swarm import (
    AGENT3,
    AGENT9,
    AGENT_FIRE,
    Map,
    ProximitySensor,
    RobotDesign,
    SwarmModel,
    disc,
    polygon,
    rectangle,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import InvalidValueError, PlacementError, SwarmError, UnknownNameError
from mesa_swarm.models.fire_fighting import FireFighting
from scenes import ahead, blind, circle, empty

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


def test_fresh_processes_give_the_same_state_whatever_their_hash_seed_and_number_of_threads(known_hash):
    assert hash_of(NUMBA_NUM_THREADS="2", PYTHONHASHSEED="12345") == known_hash
    assert len(known_hash) == 32


def test_another_python_and_mesa_give_the_same_state(known_hash):
    python = os.environ.get("MESA_SWARM_OTHER_PYTHON")
    if not python:
        pytest.skip("MESA_SWARM_OTHER_PYTHON names no other Python that has the package")
    assert hash_of(python=python) == known_hash


def furnished(order, seed=3):
    """Return a world to which obstacles, fires and robots with given poses were added in this order."""
    model = empty(rng=seed)
    solids = [rectangle((100, 100), (140, 200)), disc((250, 80), 20), rectangle((300, 150), (320, 300))]
    add = {
        "obstacles": lambda: [model.add_obstacle(s) for s in solids],
        "backwards": lambda: [model.add_obstacle(s) for s in solids[::-1]],
        "fires": lambda: [model.add_fire((200 + 60 * k, 250), radius=15) for k in range(2)],
        "robots": lambda: model.add_robots(AGENT_FIRE, poses=[(30 + 24 * k, 40, 2.2 * k) for k in range(14)]),
    }
    for name in order:
        add[name]()
    model.control = Subsumption(Avoid(distance=8), Explore(turn_interval=60))
    return model


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


def noisy(**slip):
    design = AGENT9.with_proximity(error_probability=0.3, error_magnitude=0.5)
    return design.with_slip(**slip) if slip else design


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


# ---- running and collecting


def test_run_takes_so_many_steps_and_returns_the_model():
    model = empty()
    assert model.run(7) is model
    assert model.run(0).steps == 7


def test_a_progress_bar_is_shown_when_asked_for_only(capsys):
    empty().run(3)
    assert capsys.readouterr().err == ""
    empty().run(3, progress=True)
    shown = capsys.readouterr().err
    assert "3/3 steps" in shown
    assert "left, done at" in shown


def test_run_stops_when_the_model_stops_running():
    class Short(SwarmModel):
        def step(self):
            super().step()
            self.running = self.steps < 4

    assert Short(rng=1).run(100).steps == 4


@pytest.mark.parametrize("steps", [-1, 2.5, math.nan, "3", None, True])
def test_a_wrong_number_of_steps_is_refused(steps):
    with pytest.raises(InvalidValueError, match="steps is"):
        empty().run(steps)


def test_data_are_collected_once_a_step_with_reporters_of_ones_own():
    model = empty(
        model_reporters={"mean_x": lambda m: float(m.swarm.position[:, 0].mean())},
        agent_reporters={"x": lambda a: float(a.position[0])},
    )
    model.add_robots(blind(), poses=[(385, 100, 0.0), (200, 200, 0.0)])
    model.control = Subsumption(ahead)
    model.run(12)
    frame = model.datacollector.get_model_vars_dataframe()
    assert list(frame) == ["collisions", "total_collisions", "mean_x"]
    expected = [(min(385 + k, 395) + 200 + k) / 2 for k in range(1, 13)]
    assert frame["mean_x"].tolist() == pytest.approx(expected, abs=1e-6)
    assert frame["collisions"].tolist() == [0] * 10 + [1] * 2
    assert frame["total_collisions"].iloc[-1] == model.total_collisions == 2
    agents = model.datacollector.get_agent_vars_dataframe()
    assert len(agents) == 24
    assert agents.loc[(12, 1), "x"] == pytest.approx(395, abs=1e-6)


# ---- contacts


def touching():
    """Return a model after a step in which robots met a wall, each other, a fire, the border, and nothing."""
    model = empty()
    other, wall = model.add_obstacle(disc((50, 250), 5)), model.add_obstacle(rectangle((200, 0), (220, 50)))
    fire = model.add_fire((300, 150), radius=20, temperature=1.0)
    poses = [(194.6, 25, 0.0), (100, 100, 0.0), (111, 100, math.pi), (274.5, 150, 0.0), (394.8, 250, 0.0)]
    poses.append((100, 200, 0.0))
    robots = model.add_robots(blind(), poses=poses)
    model.control = Subsumption(ahead)
    model.step()
    return model, robots, (other, wall, fire)


def test_contacts_name_who_met_what_where_and_how_deep():
    model, robots, (_, wall, fire) = touching()
    contacts, ids = model.contacts, [robot.unique_id for robot in robots]
    assert contacts.robot.tolist() == ids[:5]
    assert contacts.kind.tolist() == [0, 1, 1, 2, 0]
    assert contacts.other.tolist() == [wall.unique_id, ids[2], ids[1], fire.unique_id, -1]
    assert contacts.normal == pytest.approx(np.array([[-1, 0], [-1, 0], [1, 0], [-1, 0], [-1, 0]]), abs=1e-9)
    assert contacts.depth == pytest.approx([0.6, 1, 1, 0.5, 0.8], abs=1e-9)
    assert model.collisions == model.total_collisions == 5
    assert model.swarm.collided.tolist() == [True] * 5 + [False]


@pytest.mark.parametrize("gone", ["obstacle", "robot"])
def test_contacts_still_name_the_right_ones_when_something_else_is_removed_after_the_step(gone):
    model, robots, (other, *_) = touching()
    before = dict(zip(model.contacts.robot.tolist(), model.contacts.other.tolist(), strict=True))
    first = robots[0].unique_id
    (other if gone == "obstacle" else robots[0]).remove()
    after = dict(zip(model.contacts.robot.tolist(), model.contacts.other.tolist(), strict=True))
    if gone == "robot":
        del before[first]
    assert after == before


def test_contacts_are_of_the_last_step_only():
    model, _, _ = touching()
    model.control = Subsumption(circle(left=-1.0, right=-1.0))
    model.run(3)
    assert len(model.contacts.robot) == 0
    assert model.total_collisions == 5


# ---- wrong input


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"engine": "compild"}, "did you mean 'compiled'"),
        ({"engine": "Shapely"}, "did you mean 'shapely'"),
        ({"engine": 5}, "unknown engine 5"),
        ({"engine": None}, "unknown engine None"),
        ({"map": "orignal"}, "did you mean 'original'"),
        ({"map": 5}, "expected a Map"),
        ({"turn_angle_degrees": 91}, "turn_angle_degrees is 91"),
        ({"turn_angle_degrees": math.nan}, "turn_angle_degrees is nan"),
        ({"extinguish_range": -1}, "extinguish_range is -1"),
        ({"history_every": -1}, "history_every is -1"),
        ({"history_every": 1.5}, "history_every is 1.5"),
        ({"fire_constants": "weak"}, "fire_constants is 'weak'"),
        ({"fire_constants": {"k1": 1}}, "fire_constants is"),
    ],
)
def test_a_wrong_option_of_the_model_is_refused_on_one_line(options, words):
    with pytest.raises(SwarmError, match=words) as caught:
        SwarmModel(**options)
    assert "\n" not in str(caught.value)


BAD_ROBOTS = [
    ({}, "give exactly one"),
    ({"n": 1, "poses": []}, "give exactly one"),
    ({"n": -1}, "n is -1"),
    ({"n": 2.5}, "whole number"),
    ({"n": math.nan}, "n is nan"),
    ({"n": "3"}, "n is '3'"),
    ({"n": True}, "n is True"),
    ({"n": 10**400}, "n is "),
    ({"n": 10**9}, "would"),
    ({"poses": 5}, "expected"),
    ({"poses": [5]}, "expected"),
    ({"poses": "abc"}, "expected"),
    ({"poses": [(1, 2)]}, "expected"),
    ({"poses": [(10, 20), (30, 40), (50, 60)]}, "expected"),
    ({"poses": [10, 20, 30]}, "expected"),
    ({"poses": [(50, 50, 0.0), (401, 50, 0.0)]}, "not on map empty"),
    ({"poses": [(math.nan, 50, 0.0)]}, "not on map empty"),
    ({"poses": [(50, 50, math.inf)]}, "heading is inf"),
    ({"poses": [(50, 50, "north")]}, "expected"),
    ({"n": 2, "tendency": "lft"}, "did you mean 'left'"),
    ({"n": 2, "tendency": ["left"]}, "names 1 sides for 2 robots"),
    ({"n": 2, "tendency": 5}, "tendency"),
    ({"n": 2, "tendency": [1, -1]}, "tendency"),
]


@pytest.mark.parametrize(("options", "words"), BAD_ROBOTS, ids=[f"{k}-{b[1][:12]}" for k, b in enumerate(BAD_ROBOTS)])
def test_wrong_robots_are_refused_on_one_line_and_none_is_added(options, words):
    model = empty()
    model.add_robots(AGENT3, 2)
    before = model.state_hash()
    with pytest.raises(SwarmError, match=words) as caught:
        model.add_robots(AGENT9, **options)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 250
    assert (len(model.robots), len(model.agents), model.state_hash()) == (2, 2, before)


@pytest.mark.parametrize("design", ["AGENT9", None, RobotDesign, 5, (AGENT9,)])
def test_what_is_not_a_design_is_refused(design):
    with pytest.raises(InvalidValueError, match="expected a RobotDesign such as AGENT9"):
        empty().add_robots(design, 1)


@pytest.mark.parametrize("shape", ["disc", None, (50, 50), disc, Map(name="m", bounds=(0, 0, 9, 9))])
def test_what_is_not_a_shape_is_refused(shape):
    model = empty()
    with pytest.raises(InvalidValueError, match="expected disc"):
        model.add_obstacle(shape)
    assert len(model.agents) == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda: disc((1, 2), -1),
        lambda: disc((1, math.nan), 1),
        lambda: rectangle((0, 0), (0, 5)),
        lambda: polygon([(0, 0), (10, 10), (10, 0), (0, 10)]),
        lambda: polygon([(0, 0), (10, 10)]),
    ],
    ids=["radius", "nan", "area", "bow-tie", "two points"],
)
def test_a_wrong_shape_is_refused_before_it_reaches_the_model(make):
    with pytest.raises(InvalidValueError):
        make()


BAD_FIRES = [
    (((50, 50),), {}, "neither radius nor area"),
    (((50, 50),), {"radius": 0}, "radius is 0"),
    (((50, 50),), {"radius": -1}, "radius is -1"),
    (((50, 50),), {"radius": math.nan}, "radius is nan"),
    (((50, 50),), {"radius": "5"}, "radius is '5'"),
    (((50, 50),), {"radius": 1e7}, "radius is 1e"),
    (((50, 50),), {"area": 0}, "area is 0"),
    (((50, 50),), {"area": math.inf}, "area is inf"),
    (((50, 50),), {"radius": 5, "area": "1"}, "area is '1'"),
    (((50, 50),), {"radius": 5, "temperature": 0}, "temperature is 0"),
    (((50, 50),), {"radius": 5, "temperature": 1.1}, "temperature is 1.1"),
    (((50, 50),), {"radius": 5, "temperature": math.nan}, "temperature is nan"),
    (((401, 50),), {"radius": 5}, "not on map empty"),
    (((math.nan, 50),), {"radius": 5}, "not on map empty"),
    (((1, 2, 3),), {"radius": 5}, "not on map empty"),
    ((None,), {"radius": 5}, "position"),
    ((5,), {"radius": 5}, "position"),
    (("ab",), {"radius": 5}, "position"),
    ((("a", "b"),), {"radius": 5}, "position"),
]


@pytest.mark.parametrize(
    ("place", "options", "words"), BAD_FIRES, ids=[f"{k}-{b[2][:12]}" for k, b in enumerate(BAD_FIRES)]
)
def test_a_wrong_fire_is_refused_on_one_line_and_none_is_added(place, options, words):
    model = empty()
    with pytest.raises(InvalidValueError, match=words) as caught:
        model.add_fire(*place, **options)
    assert "\n" not in str(caught.value)
    assert len(model.agents) == len(model.fires) == len(model.fires.radius) == 0


@pytest.mark.parametrize("control", ["Avoid", Avoid(), 5, Subsumption, [Avoid(), Explore()]])
def test_what_is_not_an_arbiter_is_refused_and_the_old_one_stays(control):
    model = empty()
    model.control = Subsumption(ahead)
    old = model.control
    with pytest.raises(InvalidValueError, match="expected an arbiter"):
        model.control = control
    assert model.control is old


def test_robots_put_where_there_is_no_room_at_all_are_refused_in_words():
    model = empty(30, 30)
    model.add_robots(blind(), poses=[(15, 15, 0.0)] * 9)
    with pytest.raises(PlacementError, match="no room is left"):
        model.run(3)


def test_unknown_names_are_of_the_family_of_errors():
    assert issubclass(UnknownNameError, SwarmError)
    assert issubclass(InvalidValueError, ValueError)


def test_a_design_with_a_sensor_of_the_longest_range_sees_across_the_world():
    model = empty()
    model.add_robots(RobotDesign(sensors=(ProximitySensor(range=1e6),)), poses=[(100, 150, 0.0)])
    model.sense()
    assert model.swarm.distance.tolist() == [[295.0]]


def test_a_model_goes_on_after_a_step_that_failed():
    class Stumbles(SwarmModel):
        def step(self):
            if self.steps == 3:
                raise RuntimeError
            super().step()

    model = Stumbles(rng=1).run(2)
    with pytest.raises(RuntimeError):
        model.step()
    model.run(3)
    assert (model.steps, model.completed) == (6, 5)
