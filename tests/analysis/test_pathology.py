"""Pathologies: each scene provokes one kind, in the simulator, and the others stay silent."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, disc
from mesa_swarm.analysis.pathology import KINDS, Episode, Pathologies, find_pathologies
from mesa_swarm.control import Avoid, Explore, Subsumption, behaviour
from mesa_swarm.errors import InvalidValueError, UnknownNameError
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from scenes import ahead, blind, circle, corridor, empty

CORRIDOR, CENTROID, HEAD_ON, THRESHOLD, STUCK = KINDS
KEPT = ("position", "heading", "command", "layer", "distance", "kind")


@behaviour
def shy(me, distance=20.0):
    """Drive ahead, and backwards from what is too near."""
    speed = -me.max_speed if 0.0 <= me.distance[me.front] < distance else me.max_speed
    return speed, speed


@behaviour
def drawn(me, kind_of_robots=1.0):
    """Turn on the spot to the side on which a robot is seen."""
    if me.left < 0:
        return 0.0, 0.0
    if me.kind[me.left] == kind_of_robots:
        return -me.max_speed, me.max_speed
    if me.kind[me.right] == kind_of_robots:
        return me.max_speed, -me.max_speed
    return 0.0, 0.0


def recorded(model, steps):
    """Run a model and return what the detector takes."""
    kept = {name: [] for name in KEPT}
    for _ in range(steps):
        model.step()
        for name in KEPT:
            kept[name].append(getattr(model.swarm, name).copy())
    swarm = model.swarm
    return {
        **{name: np.array(frames) for name, frames in kept.items()},
        "steps": np.arange(model.steps - steps + 1, model.steps + 1),
        "radius": swarm.radius,
        "max_speed": swarm.max_speed,
        "forward": swarm.table.forward[swarm.design],
    }


def only(found, kind):
    """Return the episodes, asserting that there are some and that all are of this kind."""
    assert found.counts() == {**dict.fromkeys(KINDS, 0), kind: len(found)}
    assert len(found) > 0
    return found


def in_corridor(turn, width=22.0):
    model = corridor(width=width)
    model.add_robots(AGENT3, poses=[(150, 150, 0.1)], tendency="left")
    model.control = Subsumption(Avoid(distance=15, turn=turn), Explore())
    return recorded(model, 2000)


def test_turning_on_the_spot_in_a_narrow_corridor_is_one_long_corridor_flip():
    (episode,) = only(find_pathologies(**in_corridor("stationary")), CORRIDOR)
    assert episode.robots == (0,)
    assert episode.first_step < 10
    assert episode.last_step == 2000
    assert episode.flips > 1900
    assert episode.layers == (0,)


@pytest.mark.parametrize("width", [16, 22, 26, 30])
def test_stopping_one_wheel_in_the_same_corridor_is_no_pathology(width):
    assert len(find_pathologies(**in_corridor("translational", width))) == 0


@pytest.mark.parametrize("seed", [0, 1])
def test_robots_that_avoid_each_other_in_open_space_are_healthy(seed):
    model = CollisionAvoidance(n_robots=10, map="openspace", rng=seed)
    assert len(find_pathologies(**recorded(model, 2000))) == 0


def driving_at_each_other():
    model = empty()
    model.add_robots(AGENT9, poses=[(100, 150, 0.0), (200, 150, math.pi)])
    model.control = Subsumption(ahead)
    return recorded(model, 300)


def test_two_robots_that_drive_at_each_other_are_a_head_on_pair():
    (episode,) = only(find_pathologies(**driving_at_each_other()), HEAD_ON)
    assert episode.robots == (0, 1)
    assert 40 <= episode.first_step <= 50
    assert episode.last_step == 300


def test_a_robot_that_drives_at_a_wall_is_stuck():
    model = empty()
    model.add_robots(AGENT9, poses=[(300, 150, 0.0)])
    model.control = Subsumption(ahead)
    (episode,) = only(find_pathologies(**recorded(model, 300)), STUCK)
    assert 90 <= episode.first_step <= 100
    assert episode.last_step == 300


def test_a_robot_that_goes_back_at_a_threshold_goes_back_and_forth():
    model = empty()
    model.add_obstacle(disc((300, 150), 20))
    model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(shy)
    (episode,) = only(find_pathologies(**recorded(model, 300)), THRESHOLD)
    assert 50 <= episode.first_step <= 60
    assert episode.last_step == 300
    assert episode.flips == 301 - episode.first_step


def test_a_robot_that_is_drawn_to_two_robots_by_turns_flips_towards_their_centroid():
    model = empty()
    model.add_robots(AGENT3, poses=[(200, 150, 0.1)])
    beside = 40 * np.array([math.cos(math.radians(15)), math.sin(math.radians(15))])
    model.add_robots(blind(), poses=[(200 + beside[0], 150 + side * beside[1], 0.0) for side in (1, -1)])
    model.control = Subsumption(drawn)
    (episode,) = only(find_pathologies(**recorded(model, 200)), CENTROID)
    assert episode.robots == (0,)
    assert episode.flips > 150


@pytest.mark.parametrize("radius", [10.0, 30.0])
def test_a_robot_that_drives_in_a_circle_comes_back_but_is_not_stuck(radius):
    model = empty()
    model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(circle(left=(radius - 5) / (radius + 5), right=1.0))
    steps = round(2 * math.pi * (radius + 5))
    found = find_pathologies(**recorded(model, 3 * steps), fewest_steps=steps)
    assert len(found) == 0


def test_a_robot_that_slides_along_a_disc_is_not_stuck():
    model = empty()
    model.add_obstacle(disc((300, 150), 60))
    model.add_robots(AGENT9, poses=[(200, 170, 0.0)])
    model.control = Subsumption(ahead)
    assert not find_pathologies(**recorded(model, 170)).of(0)


# ---- written arrays: what counts, and what just does not


def still(k=100, n=1, **changes):
    """Return what robots did that stood still at the origin, with one sensor ahead that reads nothing."""
    return {
        "steps": np.arange(1, k + 1),
        "position": np.zeros((k, n, 2)),
        "heading": np.zeros((k, n)),
        "command": np.zeros((k, n, 2)),
        "layer": np.zeros((k, n), int),
        "distance": np.full((k, n, 3), -1.0),
        "kind": np.full((k, n, 3), -1),
        "radius": np.full(n, 5.0),
        "max_speed": np.ones(n),
        "forward": np.tile([0, 1, 2], (n, 1)),
        **changes,
    }


def flipping(flips, period=1, k=100, kind=0, distance=10.0):
    """Return a robot that turns away from its left and its right by turns, so many times, from step 11 on."""
    track = still(k)
    for turn in range(flips + 1):
        now = slice(10 + turn * period, 10 + (turn + 1) * period)
        side = 1 if turn % 2 else -1
        track["command"][now, 0] = [-side, side]
        seen = 2 if side > 0 else 1
        track["distance"][now, 0, seen], track["kind"][now, 0, seen] = distance, kind
    return track


def test_as_many_flips_as_asked_for_are_an_episode_and_one_fewer_are_none():
    (episode,) = only(find_pathologies(**flipping(10), fewest_flips=10), CORRIDOR)
    assert (episode.first_step, episode.last_step, episode.flips, episode.steps) == (12, 21, 10, 10)
    assert len(find_pathologies(**flipping(9), fewest_flips=10)) == 0


def test_flips_that_come_too_slowly_are_none():
    slow = flipping(12, period=6)
    assert len(find_pathologies(**slow, fewest_flips=10, window=54)) == 1
    assert len(find_pathologies(**slow, fewest_flips=10, window=53)) == 0


def test_flips_away_from_what_is_too_far_are_none():
    assert len(find_pathologies(**flipping(20, distance=19.9))) == 1
    assert len(find_pathologies(**flipping(20, distance=20.0))) == 0


@pytest.mark.parametrize(("kind", "count"), [(0, 1), (1, 0), (2, 1)])
def test_obstacles_and_fires_make_a_corridor_and_robots_alone_do_not(kind, count):
    assert find_pathologies(**flipping(20, kind=kind)).counts()[CORRIDOR] == count


def test_flips_on_the_way_to_somewhere_are_none():
    moving = flipping(60)
    moving["position"][:, 0, 0] = 0.25 * np.arange(100)
    assert len(find_pathologies(**moving)) == 0
    moving["position"][:, 0, 0] = 0.15 * np.arange(100)
    assert len(find_pathologies(**moving)) == 1


def test_flips_of_a_robot_that_turns_away_in_the_end_are_none():
    turning = flipping(60)
    turning["heading"][:, 0] = np.radians(60.1 / 9) * np.arange(100) % (2 * math.pi) - math.pi
    assert len(find_pathologies(**turning)) == 0
    turning["heading"][:, 0] = np.radians(59.9 / 9) * np.arange(100) % (2 * math.pi) - math.pi
    assert len(find_pathologies(**turning)) == 1


def test_turns_with_pauses_between_them_flip_as_well():
    pausing = flipping(30, period=2)
    for name, nothing in (("command", 0.0), ("distance", -1.0), ("kind", -1)):
        pausing[name][11::2] = nothing
    (episode,) = only(find_pathologies(**pausing), CORRIDOR)
    assert episode.flips == 30


def test_turns_towards_robots_are_no_episode_if_the_same_sensors_see_them_all_the_time():
    track = flipping(30, kind=1)
    track["command"] = track["command"][..., ::-1]
    assert find_pathologies(**track).counts()[CENTROID] == 1
    track["kind"][:], track["distance"][:] = 1, 10.0
    assert len(find_pathologies(**track)) == 0


def test_a_step_belongs_to_one_kind_and_the_first_of_the_list_takes_it():
    both = flipping(30)
    both["command"][10:41, 0] *= 0.5
    both["command"][10:41:2, 0] += 0.4
    both["command"][11:41:2, 0] -= 0.4
    only(find_pathologies(**both), CORRIDOR)
    both["kind"][:] = -1
    only(find_pathologies(**both), THRESHOLD)


def test_a_robot_that_is_stuck_before_and_after_it_flips_has_three_episodes():
    track = flipping(30, k=200)
    track["command"][1:10], track["command"][45:] = 1.0, 1.0
    found = find_pathologies(**track, fewest_steps=9)
    assert [(e.kind, e.first_step, e.last_step) for e in found] == [
        (STUCK, 2, 10),
        (CORRIDOR, 12, 41),
        (STUCK, 46, 200),
    ]


@pytest.mark.parametrize(("share", "count"), [(0.09, 1), (0.11, 0)])
def test_stuck_is_who_moves_by_less_than_a_share_of_what_is_commanded(share, count):
    track = still(command=np.ones((100, 1, 2)))
    track["position"][:, 0, 1] = share * np.arange(100)
    assert find_pathologies(**track).counts()[STUCK] == count


@pytest.mark.parametrize(("speed", "count"), [(0.25, 1), (0.24, 0), (-1.0, 0)])
def test_who_is_hardly_commanded_forwards_is_not_stuck(speed, count):
    assert len(find_pathologies(**still(command=np.full((100, 1, 2), speed)))) == count


@pytest.mark.parametrize(("steps", "count"), [(31, 1), (30, 0)])
def test_stuck_lasts_its_fewest_steps_after_the_first_frame(steps, count):
    assert len(find_pathologies(**still(steps, command=np.ones((steps, 1, 2))), fewest_steps=30)) == count


def pair(gap=1.0, bearing_degrees=0.0, command=1.0):
    """Return two robots that face each other, the second one turned away by an angle."""
    track = still(n=2, command=np.full((100, 2, 2), command))
    track["position"][:, 1, 0] = 10.0 + gap
    track["heading"][:, 1] = math.pi - math.radians(bearing_degrees)
    return track


@pytest.mark.parametrize(
    ("options", "kind"),
    [
        ({"gap": 4.9}, HEAD_ON),
        ({"gap": 5.1}, STUCK),
        ({"bearing_degrees": 29.9}, HEAD_ON),
        ({"bearing_degrees": 30.1}, STUCK),
    ],
)
def test_a_head_on_pair_is_near_and_faces_each_other(options, kind):
    only(find_pathologies(**pair(**options)), kind)


def test_two_robots_that_face_each_other_and_want_nothing_are_no_pair():
    assert len(find_pathologies(**pair(command=0.0))) == 0
    assert len(find_pathologies(**pair(command=-1.0))) == 0


def test_two_robots_that_turn_to_and_fro_before_each_other_are_a_pair():
    track = pair(command=0.0)
    track["command"][:, :, 0] = np.where(np.arange(100) % 2, 1.0, -1.0)[:, None]
    track["command"][:, :, 1] = -track["command"][:, :, 0]
    only(find_pathologies(**track), HEAD_ON)


@pytest.fixture(scope="module")
def crowd():
    return recorded(CollisionAvoidance(n_robots=30, map="original", rng=1, turn="stationary"), 400)


def test_who_stands_in_which_row_is_nothing(crowd):
    order = np.random.default_rng(0).permutation(30)
    by_row = {name: crowd[name][order] for name in ("radius", "max_speed", "forward")}
    there = {name: crowd[name][:, order] for name in KEPT}
    here, other = find_pathologies(**crowd), find_pathologies(**{**crowd, **by_row, **there})
    assert len(here) > 5

    def outline(found, row):
        return sorted(
            (e.kind, sorted(int(row[r]) for r in e.robots), e.first_step, e.last_step, e.flips) for e in found
        )

    assert outline(here, np.arange(30)) == outline(other, order)


@settings(max_examples=10)
@given(st.floats(-math.pi, math.pi), st.tuples(st.floats(-500, 500), st.floats(-500, 500)))
def test_where_it_happens_is_nothing(crowd, turn, shift):
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    moved = {"position": crowd["position"] @ rotation.T + shift, "heading": crowd["heading"] + turn}
    assert find_pathologies(**{**crowd, **moved}) == find_pathologies(**crowd)


def test_left_and_right_are_alike(crowd):
    mirrored = {
        "position": crowd["position"] * [1, -1],
        "heading": -crowd["heading"],
        "command": crowd["command"][..., ::-1],
        "forward": crowd["forward"][:, [0, 2, 1]],
    }
    assert find_pathologies(**{**crowd, **mirrored}) == find_pathologies(**crowd)


def test_every_step_of_a_robot_belongs_to_one_episode_at_most(crowd):
    for row in range(30):
        episodes = sorted((e.first_step, e.last_step) for e in find_pathologies(**crowd).of(row))
        assert all(a[1] < b[0] for a, b in pairwise(episodes))


def test_episodes_say_who_did_what_when_and_who_drove():
    episode = Episode(kind=HEAD_ON, robots=(2, 5), first_step=3, last_step=90, layers=(0, 1))
    assert episode.describe() == (
        "Robots 2 and 5 faced each other at close quarters and blocked each other's way, "
        "in steps 3 to 90 (layers 0, 1)."
    )
    assert "12 times" in Episode(kind=CORRIDOR, robots=(2,), first_step=3, last_step=90, flips=12).describe()


def test_episodes_are_found_by_row_and_by_kind():
    pair, alone = (Episode(kind=k, robots=r, first_step=1, last_step=9) for k, r in ((HEAD_ON, (1, 2)), (STUCK, (2,))))
    found = Pathologies((pair, alone))
    assert found.of(1) == (pair,)
    assert found.of(2) == (pair, alone)
    assert found.of_kind(STUCK) == (alone,)
    assert found[1] is alone
    assert list(found) == [pair, alone]
    with pytest.raises(UnknownNameError, match="did you mean 'stuck'"):
        found.of_kind("stuk")


@pytest.mark.parametrize(("k", "n"), [(0, 2), (1, 2), (5, 0)])
def test_nothing_is_found_where_nothing_was_kept(k, n):
    assert len(find_pathologies(**still(k, n))) == 0


def test_robots_that_cannot_move_are_healthy():
    assert len(find_pathologies(**still(n=2, max_speed=np.zeros(2)))) == 0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"steps": np.arange(100) * 10}, "keep every step"),
        ({"position": np.zeros((100, 2, 2))}, "position has the shape"),
        ({"heading": np.full((100, 1), math.nan)}, "heading is nan at"),
        ({"forward": [[0, 1, 3]]}, "forward names sensors"),
        ({"kind": np.full((100, 1, 2), -1)}, "kind has the shape"),
        ({"near": -1}, "near is -1"),
        ({"window": 1}, "window is 1"),
        ({"fewest_flips": 1.5}, "fewest_flips"),
        ({"fewest_steps": 0}, "fewest_steps is 0"),
        ({"stuck_share": 0}, "stuck_share is 0"),
        ({"turned_degrees": 181}, "turned_degrees is 181"),
        ({"facing_degrees": -1}, "facing_degrees is -1"),
    ],
)
def test_wrong_arrays_and_parameters_are_refused_in_words(changes, words):
    with pytest.raises(InvalidValueError, match=words):
        find_pathologies(**{**still(), **changes})
