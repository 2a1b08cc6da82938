"""What counts as a pathology, and what just does not: written arrays, and episodes in words."""

import math

import numpy as np
import pytest

from mesa_swarm.analysis.pathology import Episode, Pathologies, find_pathologies
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from support.tracks import CENTROID, CORRIDOR, HEAD_ON, STUCK, THRESHOLD, flipping, only, still


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


@pytest.mark.parametrize(("kind", "count"), [(0, 1), (1, 0), (2, 1), (3, 1)])
def test_obstacles_fires_and_loads_make_a_corridor_and_robots_alone_do_not(kind, count):
    assert find_pathologies(**flipping(20, kind=kind)).counts()[CORRIDOR] == count


def test_flips_on_the_way_to_somewhere_are_none():
    moving = flipping(30)
    moving["position"][:, 0, 0] = 0.25 * np.arange(100)
    assert len(find_pathologies(**moving)) == 0
    moving["position"][:, 0, 0] = 0.15 * np.arange(100)
    assert len(find_pathologies(**moving)) == 1


@pytest.mark.parametrize(("speed", "count"), [(0.08, 1), (0.09, 0), (0.19, 0)])
def test_stretches_that_get_nowhere_and_joined_make_a_journey_are_none(speed, count):
    moving = flipping(980, k=1000)
    moving["position"][:, 0, 0] = speed * np.arange(1000)
    assert len(find_pathologies(**moving)) == count


def test_the_journey_is_cut_out_of_what_is_none():
    moving = flipping(980, k=1000)
    moving["position"][:, 0, 0] = 0.15 * np.clip(np.arange(1000) - 400, 0, 200)
    before, after = only(find_pathologies(**moving), CORRIDOR)
    assert (before.first_step, after.last_step) == (12, 991)
    assert 370 <= before.last_step <= 405
    assert 597 <= after.first_step <= 632
    assert before.flips == before.steps


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


def test_episodes_describe_which_robot_did_what_when_and_by_which_layer():
    episode = Episode(kind=HEAD_ON, robots=(2, 5), first_step=3, last_step=90, layers=(0, 1))
    assert episode.describe() == (
        "Robots 2 and 5 faced each other at close quarters and blocked each other's way, "
        "in steps 3 to 90 (layers 0, 1)."
    )
    ids = [10, 11, 12, 13, 14, 15]
    assert episode.describe(ids).startswith("Robots 12 and 15 faced each other")
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
        ({"steps": np.arange(100) * 10}, "expected every step"),
        ({"position": np.zeros((100, 2, 2))}, "position has the shape"),
        ({"heading": np.full((100, 1), math.inf)}, "heading holds an infinity"),
        ({"radius": [math.nan]}, "radius is nan at"),
        ({"forward": [[0, 1, 3]]}, "forward has an invalid sensor"),
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
