"""The ways to turn away that the thesis rejects (5.2.2), beside a twin of plain Python."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.gallery import find_model
from mesa_swarm_studies.thesis.avoidance import corridor_run, wall_run
from support.made_senses import ROBOTS, made_senses, model_of_three_designs
from support.scenes import empty

NEAR = 15.0


def at_post(x=220.0, y=150.0, **options):
    """Return a model with a robot at (200, 150) that heads right, and a small post."""
    model = empty()
    model.add_obstacle(disc((x, y), 2))
    model.add_robots(AGENT3, poses=[(200, 150, 0.0)], tendency="left")
    model.control = Subsumption(Avoid(distance=NEAR, **options), Explore())
    return model


def turns_of(model, steps):
    """Return the command of the first robot in each step, as right minus left."""
    return [float(np.subtract(*model.run(1).swarm.command[0][::-1])) for _ in range(steps)]


def test_a_random_side_is_drawn_in_every_step_and_both_come_alike_often():
    model = empty(2000, 2000)
    places = [(50.0 + 40 * (k % 40), 50.0 + 40 * (k // 40), 0.0) for k in range(400)]
    for x, y, _ in places:
        model.add_obstacle(disc((x + 12, y), 1))
    model.add_robots(AGENT3, poses=places, tendency="left")
    model.control = Subsumption(Avoid(distance=NEAR, front="random"))
    left = [model.run(1).swarm.command[:, 1] > model.swarm.command[:, 0] for _ in range(2)]
    assert (model.swarm.layer >= 0).sum() > 300
    assert left[0].mean() == pytest.approx(0.5, abs=0.1)
    assert not np.array_equal(*left)


@pytest.mark.slow
def test_a_random_side_in_front_of_a_wall_has_hardly_a_net_turn_and_the_robot_runs_into_it():
    turned, struck = [], []
    for rng in range(10_000, 10_030):
        run = wall_run(rng, front="random")
        turned.append(run["turned"])
        struck.append(run["collisions"] > 0)
    assert 1.0 < wall_run(10_000)["turned"] <= 2.0 + 1e-9
    assert wall_run(10_000)["collisions"] == 0
    # 0.1 |S_k| for k = 20: 0.1 * 20 * C(20, 10) / 2 ** 20.
    assert np.mean(turned) == pytest.approx(2 * math.comb(20, 10) / 2**20, abs=0.15)
    assert np.mean(struck) > 0.5


def test_a_robot_backs_up_and_turns_for_given_steps_whatever_it_sees():
    model = at_post(front="back up", back_steps=3, turn_steps=4, turn="stationary")
    commands = [model.run(1).swarm.command[0].tolist() for _ in range(7)]
    assert commands == [[-1.0, -1.0]] * 3 + [[-1.0, 1.0]] * 4
    for obstacle in list(model.obstacles):
        obstacle.remove()
    assert model.run(1).swarm.command[0].tolist() == [1.0, 1.0]


def test_what_comes_from_the_side_meanwhile_does_not_end_it_and_what_is_aside_is_turned_from_as_ever():
    model = at_post(front="back up", back_steps=5, turn_steps=0).run(2)
    model.add_obstacle(disc((200, 170), 5))
    assert [tuple(model.run(1).swarm.command[0]) for _ in range(3)] == [(-1.0, -1.0)] * 3
    aside = at_post(200 + 18 * math.cos(0.9), 150 + 18 * math.sin(0.9), front="back up")
    assert turns_of(aside, 1) == [-1.0]


@pytest.mark.slow
@pytest.mark.parametrize(("sides", "side"), [("last", 1.0), ("ignore both", 0.0)])
def test_two_activated_sides_are_ignored_where_so_chosen(sides, side):
    model = empty()
    for sign in (1, -1):
        model.add_obstacle(disc((200 + 18 * math.cos(0.9), 150 + 18 * sign * math.sin(0.9)), 3))
    model.add_robots(AGENT3, poses=[(200, 150, 0.0)])
    model.control = Subsumption(Avoid(distance=NEAR, sides=sides), Explore())
    assert turns_of(model, 1) == [side]
    assert model.swarm.layer[0] == (0 if side else 1)


def decided(senses, i, avoid):
    """Return what a robot does by plain Python: the side of its turn, 0 for none, by the words of `Avoid`."""
    d = senses.design[i]
    fears = [k for k in range(4) if not (k == 2 and avoid.fires == "never") and not (k == 3 and avoid.loads == "never")]
    seen = [
        s >= 0 and senses.kind[i, s] in [-1, *fears] and 0 <= senses.distance[i, s] < NEAR for s in senses.forward[d]
    ]
    front, left, right = seen
    ahead = senses.tendency[i] if front else 0.0
    if left and right and avoid.sides == "ignore both":
        return ahead
    return 1.0 if right else -1.0 if left else ahead


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["last", "ignore both"]),
    st.sampled_from(["always", "never"]),
    st.sampled_from(["always", "never"]),
)
@settings(max_examples=25)
def test_the_sides_are_those_of_a_twin_of_plain_python(seed, sides, fires, loads):
    avoid, senses = Avoid(distance=NEAR, sides=sides, fires=fires, loads=loads), made_senses(seed)
    command, layer = np.zeros((ROBOTS, 2)), np.full(ROBOTS, -1)
    avoid.decide(senses, command, layer, 0)
    expected = [decided(senses, i, avoid) for i in range(ROBOTS)]
    assert np.sign(command[:, 1] - command[:, 0]).tolist() == expected
    assert (layer == 0).tolist() == [side != 0 for side in expected]


def test_in_a_corridor_the_choice_between_two_sides_decides_whether_a_robot_gets_out():
    runs = {name: corridor_run(10_001, steps=400, **how) for name, how in (
        ("stationary", {"turn": "stationary"}), ("translational", {}), ("ignoring", {"sides": "ignore both"})
    )}  # fmt: skip
    assert {name: run["out"] for name, run in runs.items()} == {"stationary": 0, "translational": 1, "ignoring": 1}
    assert runs["ignoring"]["changes per 100 steps"] < 20 < runs["translational"]["changes per 100 steps"]


@pytest.mark.slow
@pytest.mark.parametrize("front", ["random", "back up"])
def test_a_recorded_run_is_verified_and_resumed_in_the_middle_of_it(front, tmp_path):
    def model():
        return find_model("collision_avoidance")(n_robots=20, front=front, rng=2)

    recorded = model()
    with recorded.record(tmp_path / "run.arrow", checkpoint_every=10):
        recorded.run(40)
    assert type(recorded).verify(tmp_path / "run.arrow").same
    assert type(recorded).resume(tmp_path / "run.arrow", step=25).run(15).state_hash() == recorded.state_hash()


def test_one_arbiter_drives_two_models_without_mixing_their_manoeuvres():
    control, hashes = Subsumption(Avoid(distance=NEAR, front="back up"), Explore()), []
    models = [SwarmModel(map="sparse", rng=5) for _ in range(2)]
    for model in models:
        model.add_robots(AGENT3, 8)
        model.control = control
    for _ in range(100):
        for model in models:
            model.step()
    hashes = [model.state_hash() for model in models]
    assert hashes[0] == hashes[1]


def test_reasons_name_what_was_met():
    model = at_post(front="back up", back_steps=2, turn_steps=2, turn="stationary")
    model.watch()
    for _ in range(4):
        words = str(model.run(1).explain(model.robots[0]))
        assert "Avoid: " in words
    assert "does not look" in str(model.explain(model.robots[0], step=1))
    both = model_of_three_designs(Subsumption(Avoid(distance=NEAR, sides="ignore both")))
    both.watch()
    both.run(1)
    driven = [robot for robot in both.robots if robot.layer == 0]
    assert all("sensor" in str(both.explain(robot)) for robot in driven)


@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        ({"front": "left"}, UnknownNameError, "front"),
        ({"sides": "none"}, UnknownNameError, "sides"),
        ({"back_steps": -1}, InvalidValueError, "back_steps"),
        ({"turn_steps": 1.5}, InvalidValueError, "turn_steps"),
        ({"back_steps": math.nan}, InvalidValueError, "back_steps"),
    ],
)
def test_wrong_values_are_refused_in_one_line(wrong, error, words):
    with pytest.raises(error, match=words) as caught:
        Avoid(**wrong)
    assert "\n" not in str(caught.value)
