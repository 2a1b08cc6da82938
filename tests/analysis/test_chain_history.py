"""Chains over time: births, ends, mergers, splits, reversals, meetings and their outcomes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm.analysis.chain_history import follow_chains, settle_links
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError

seeds = st.integers(0, 2**32 - 1)
GAP, LINK = 10.0, 15.0


def followed(x, heading=0.0, y=0.0, **options):
    """Follow robots on a line: x, heading and y of shape (k, n), or what broadcasts to it."""
    x = np.asarray(x, dtype=float)
    position = np.stack([x, np.broadcast_to(y, x.shape)], axis=-1)
    headings = np.broadcast_to(heading, x.shape)
    return follow_chains(position, headings, np.arange(len(x)), **{"link_distance": LINK, "patience": 1, **options})


def events_of(history, *kinds):
    """Return kind, step, robots and chains of the events, of these kinds if any are named."""
    return [(e.kind, e.step, e.robots, e.chains) for e in history.events if not kinds or e.kind in kinds]


def columns(frames, *places):
    """Return positions (frames, n) of robots that stand still."""
    return np.tile(np.array(places, dtype=float), (frames, 1))


def test_a_chain_that_goes_on_is_no_event_and_keeps_its_number():
    history = followed(np.arange(50)[:, None] + [20, 10, 0])
    assert history.events == ()
    assert (history.chain == 0).all()
    assert (history.place == [0, 1, 2]).all()
    assert (history.leader == [-1, 0, 1]).all()


def test_robots_that_were_alone_and_line_up_are_a_birth_and_their_parting_is_an_end():
    x = columns(6, 0, 40)
    x[2:4, 1] = 10
    assert events_of(followed(x)) == [("birth", 2, (1, 0), (0,)), ("end", 4, (1, 0), (0,))]


def test_two_chains_that_become_one_are_a_merger_and_the_longer_one_keeps_its_number():
    x = columns(4, 100, 90, 60, 50, 40)
    x[2:, 2:] += 20
    history = followed(x)
    assert events_of(history) == [("merge", 2, (0, 1, 2, 3, 4), (0, 1))]
    assert history.chain[0].tolist() == [1, 1, 0, 0, 0]
    assert history.chain[2].tolist() == [0] * 5


def test_three_chains_that_become_one_at_a_time_are_one_merger():
    x = columns(3, 100, 90, 70, 60, 40, 30)
    x[1:] = [100, 90, 80, 70, 60, 50]
    assert events_of(followed(x)) == [("merge", 1, (0, 1, 2, 3, 4, 5), (0, 1, 2))]


def test_a_chain_that_becomes_two_is_a_split_and_the_longer_part_keeps_the_number():
    x = columns(4, 40, 30, 20, 10, 0)
    x[2:, :2] += 20
    history = followed(x)
    assert events_of(history) == [("split", 2, (0, 1, 2, 3, 4), (0, 1))]
    assert history.chain[2].tolist() == [1, 1, 0, 0, 0]


def test_a_split_and_merger_backwards_in_time_are_each_other():
    x = columns(4, 40, 30, 20, 10, 0)
    x[2:, :2] += 20
    there, back = followed(x), followed(x[::-1])
    assert [e.kind for e in there.events] == ["split"]
    assert [e.kind for e in back.events] == ["merge"]


def test_two_chains_that_exchange_their_hind_parts_split_and_merge():
    x = columns(2, 30, 20, 10, 0, 30, 20, 10, 0)
    y = columns(2, 0, 0, 0, 0, 50, 50, 50, 50)
    y[1, [2, 3]], y[1, [6, 7]] = 50, 0
    history = followed(x, y=y)
    assert events_of(history) == [
        ("merge", 1, (0, 1, 6, 7), (0, 1)),
        ("merge", 1, (4, 5, 2, 3), (0, 1)),
        ("split", 1, (0, 1, 2, 3), (0, 1)),
        ("split", 1, (4, 5, 6, 7), (0, 1)),
    ]


def test_one_robot_that_joins_or_leaves_is_no_event():
    x = columns(6, 20, 10, -50)
    x[2:4, 2] = 0
    history = followed(x)
    assert history.events == ()
    assert history.mean_length.tolist() == [2, 2, 3, 3, 2, 2]


@pytest.mark.parametrize(("gone", "events"), [(4, []), (5, ["end", "birth"])])
def test_a_link_that_breaks_for_less_than_patience_frames_never_broke(gone, events):
    y = columns(40, 0, 0)
    y[10 : 10 + gone, 0] = 40
    history = followed(columns(40, 10, 0), y=y, patience=5)
    assert [e.kind for e in history.events] == events
    assert [e.step for e in history.events] == [10, 15][: len(events)]


@pytest.mark.parametrize(("there", "events"), [(4, 0), (5, 2)])
def test_a_link_that_is_there_for_less_than_patience_frames_never_was(there, events):
    x = columns(40, 40, 0)
    x[10 : 10 + there, 0] = 10
    assert len(followed(x, patience=5).events) == events


def test_a_change_that_the_record_ends_too_soon_for_does_not_count():
    x = columns(20, 10, 0)
    x[16:, 0] = 40
    assert followed(x, patience=5).events == ()
    assert [e.step for e in followed(x, patience=4).of("end")] == [16]


def test_a_chain_whose_robots_all_turn_round_is_reversed():
    heading = np.zeros((10, 3))
    heading[5:] = math.pi
    history = followed(columns(10, 20, 10, 0), heading)
    assert events_of(history) == [("reversal", 5, (2, 1, 0), (0,))]
    assert history.place[9].tolist() == [2, 1, 0]


def turning(frames_between):
    """Return headings of three robots that stand in a line and turn round slowly, on the spot."""
    heading = np.zeros((20 + frames_between, 3))
    heading[10:-10] = np.linspace(0, math.pi, frames_between)[:, None]
    heading[-10:] = math.pi
    return heading


def test_a_chain_that_broke_while_its_robots_turned_round_is_reversed_when_it_is_there_again():
    heading = turning(21)
    history = followed(columns(len(heading), 20, 10, 0), heading)
    assert [e.kind for e in history.events] == ["end", "birth", "reversal"]
    assert history.events[-1].robots == (2, 1, 0)
    assert history.events[-1].chains == (0, 1)


def test_after_the_window_it_is_forgotten_who_was_ahead():
    heading = turning(60)
    assert len(followed(columns(len(heading), 20, 10, 0), heading, window=200).of("reversal")) == 1
    assert len(followed(columns(len(heading), 20, 10, 0), heading, window=20).of("reversal")) == 0


def test_a_chain_that_turns_round_twice_is_reversed_twice():
    heading = np.zeros((30, 3))
    heading[10:20] = math.pi
    assert [e.step for e in followed(columns(30, 20, 10, 0), heading).of("reversal")] == [10, 20]


def test_a_chain_that_is_there_again_in_its_old_order_is_not_reversed():
    x = columns(20, 20, 10, 0)
    x[5:8] = [100, 50, 0]
    assert [e.kind for e in followed(x).events] == ["end", "birth"]


def test_a_chain_whose_head_leads_it_round_a_bend_is_not_reversed():
    azimuth = np.arange(120)[:, None] * 0.05 - 0.3 * np.arange(4)
    position = 30 * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    history = follow_chains(position, azimuth + math.pi / 2, np.arange(120), link_distance=LINK, patience=1)
    assert history.events == ()
    assert history.lengths[-1].tolist() == [4]


def test_a_chain_that_backs_up_is_reversed_where_it_had_come_farthest():
    way = np.concatenate([np.arange(20), np.arange(20, -1, -1), np.arange(30)])
    history = followed(way[:, None] + [20, 10, 0])
    assert events_of(history) == [("reversal", 20, (0, 1, 2), (0,)), ("reversal", 41, (0, 1, 2), (0,))]


def test_a_chain_that_wavers_by_less_than_the_reversal_distance_is_not_reversed():
    way = 5 * np.sin(np.arange(100))
    assert followed(way[:, None] + [20, 10, 0], reversal_distance=10.1).events == ()


def head_on(frames=60, speed=1.0):
    """Return x and heading of two robots that drive at each other and meet half-way."""
    t = np.arange(frames)[:, None]
    return np.hstack([speed * t, 100 - speed * t]), np.tile([0.0, math.pi], (frames, 1))


def test_two_robots_that_drive_at_each_other_meet_once_when_they_are_near():
    x, heading = head_on(46)
    history = followed(x, heading, meeting_distance=50)
    assert events_of(history) == [("meeting", 25, (0, 1), ())]
    assert history.outcome(history.events[0]) == "unresolved"


def test_robots_that_meet_and_drive_apart_disperse():
    x, heading = head_on(110)
    x[45:] = x[44] + (np.arange(65)[:, None] + 1) * [-1, 1]
    heading[45:] = [math.pi, 0]
    history = followed(x, heading, meeting_distance=50, parting_distance=75)
    assert history.outcomes() == {"merged": 0, "dispersed": 1, "unresolved": 0}
    soon = followed(x, heading, meeting_distance=50, parting_distance=75, window=20)
    assert soon.outcomes()["unresolved"] == 1


def merging(together):
    """Return x and heading of two robots that meet, of which one turns round and is followed for a while."""
    x, heading = head_on(45 + together + 60)
    x[45 : 45 + together] = x[44] + (np.arange(together)[:, None] + 1)
    heading[45 : 45 + together] = 0
    x[45 + together :] = x[44 + together] + (np.arange(60)[:, None] + 1) * [-1, 1]
    heading[45 + together :] = [math.pi, 0]
    return x, heading


@pytest.mark.parametrize(("together", "outcome"), [(5, "merged"), (4, "dispersed")])
def test_robots_that_meet_and_follow_each_other_for_patience_frames_merge(together, outcome):
    x, heading = merging(together)
    history = followed(x, heading, patience=5)
    (meeting,) = history.of("meeting")
    assert history.outcome(meeting) == outcome


def test_a_pair_that_meets_again_without_having_parted_met_once_and_after_parting_twice():
    there = np.concatenate([np.arange(40), np.arange(40, 20, -1), np.arange(20, 40)])
    x = np.column_stack([there, 100 - there])
    heading = np.tile([0.0, math.pi], (len(there), 1))
    assert len(followed(x, heading, meeting_distance=50, parting_distance=75).of("meeting")) == 1
    assert len(followed(x, heading, meeting_distance=50, parting_distance=55).of("meeting")) == 2


@pytest.mark.parametrize(
    ("x", "heading", "y"),
    [
        (head_on(46)[0][::-1], [0, math.pi], 0),
        (head_on(46)[0], [0, math.pi / 2], 0),
        (head_on(46)[0], [0, 0], 0),
        (head_on(46)[0], [0, math.pi], [0, 30]),
    ],
    ids=["driving apart", "only one faces the other", "one after the other", "passing by"],
)
def test_robots_that_do_not_drive_at_each_other_do_not_meet(x, heading, y):
    assert followed(x, np.broadcast_to(heading, x.shape), y, meeting_distance=50).of("meeting") == ()


def test_heads_of_chains_meet_and_those_behind_them_do_not():
    t = np.arange(45)[:, None]
    x = np.hstack([t, t - 10, 100 - t, 110 - t])
    history = followed(x, np.tile([0, 0, math.pi, math.pi], (45, 1)), meeting_distance=60)
    assert events_of(history) == [("meeting", 20, (0, 2), (0, 1))]


def scene(seed, frames=60, n=20):
    """Return the track of robots that wander, turn and meet."""
    rng = np.random.default_rng(seed)
    heading = rng.choice([0.0, math.pi], n) + rng.normal(0, 0.05, (frames, n)).cumsum(axis=0)
    step = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return rng.uniform(0, 100, (n, 2)) + step.cumsum(axis=0), heading


def outline(history, order=None):
    """Return the events with robots in the words of another order of rows, and without numbers."""
    order = np.arange(1000) if order is None else order
    robots = [tuple(int(order[r]) for r in e.robots) for e in history.events]
    robots = [tuple(sorted(r)) if e.kind == "meeting" else r for e, r in zip(history.events, robots, strict=True)]
    return sorted((e.kind, e.step, r) for e, r in zip(history.events, robots, strict=True))


@pytest.mark.slow
@settings(max_examples=20)
@given(seeds, st.floats(-math.pi, math.pi), st.tuples(st.floats(-500, 500), st.floats(-500, 500)))
def test_what_happens_knows_no_place_and_no_direction(seed, turn, shift):
    position, heading = scene(seed)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    here = follow_chains(position, heading, np.arange(60), link_distance=20, patience=3)
    there = follow_chains(position @ rotation.T + shift, heading + turn, np.arange(60), link_distance=20, patience=3)
    assert here.events == there.events
    assert here.fates == there.fates


@pytest.mark.slow
@settings(max_examples=20)
@given(seeds)
def test_the_order_of_the_rows_changes_nothing_but_numbers(seed):
    position, heading = scene(seed)
    order = np.random.default_rng(seed).permutation(heading.shape[1])
    here = follow_chains(position, heading, np.arange(60), link_distance=20, patience=3)
    there = follow_chains(position[:, order], heading[:, order], np.arange(60), link_distance=20, patience=3)
    assert outline(here) == outline(there, order)
    assert here.outcomes() == there.outcomes()
    assert np.array_equal(here.mean_length, there.mean_length, equal_nan=True)


@pytest.mark.slow
@settings(max_examples=20)
@given(seeds)
def test_every_chain_has_a_birth_or_a_parent_and_an_end_or_an_heir(seed):
    position, heading = scene(seed)
    history = follow_chains(position, heading, np.arange(60), link_distance=20, patience=3)
    made = {c for e in history.events if e.kind in ("birth", "merge", "split") for c in e.chains}
    unmade = {c for e in history.events if e.kind in ("end", "merge", "split") for c in e.chains}
    for number in range(history.chain.max() + 1):
        there = (history.chain == number).any(axis=1)
        assert there[0] or number in made
        assert there[-1] or number in unmade
        assert np.count_nonzero(np.diff(there, prepend=False)) <= 2


@given(seeds, st.integers(1, 6))
def test_settled_links_are_those_that_came_and_went_for_patience_frames(seed, patience):
    rng = np.random.default_rng(seed)
    seen = np.array([flickering(rng) for _ in range(40)])
    kept = settle_links(seen, patience)
    assert kept.tolist() == [list(row) for row in zip(*(settled_by_hand(c, patience) for c in seen.T), strict=True)]
    for row in kept:
        followed_by = row[row >= 0]
        assert len(set(followed_by)) == len(followed_by)


def flickering(rng):
    """Return who follows whom among five robots, none followed by two, mostly the same."""
    leader = np.array([-1, 0, 1, 2, 3])
    if rng.random() < 0.4:
        leader = rng.permutation(5)
        leader[(leader == np.arange(5)) | (rng.random(5) < 0.3)] = -1
    return leader


def settled_by_hand(leader, patience):
    """Return one robot's settled leader, by asking of each link alone when it came and went."""
    kept = [-1] * len(leader)
    for j in set(leader.tolist()) - {-1}:
        on = False
        for t in range(len(leader)):
            ahead = leader[t : t + patience] == j
            if len(ahead) == patience and (ahead.all() or not ahead.any()):
                on = bool(ahead[0])
            if on:
                kept[t] = j
    return kept


def test_series_are_counted_in_each_frame():
    x = columns(3, 30, 20, 10, 0)
    x[1, :2], x[2] = [130, 120], [300, 200, 100, 0]
    history = followed(x)
    assert [lengths.tolist() for lengths in history.lengths] == [[4], [2, 2], []]
    assert history.count.tolist() == [1, 2, 0]
    assert history.chained.tolist() == [1, 1, 0]
    assert history.mean_length[:2].tolist() == [4, 2]
    assert math.isnan(history.mean_length[2])


@pytest.mark.parametrize("shape", [(0, 3), (4, 0), (1, 1)])
def test_without_steps_or_robots_there_is_no_history(shape):
    history = follow_chains(np.zeros((*shape, 2)), np.zeros(shape), np.arange(shape[0]), link_distance=15)
    assert history.events == ()
    assert history.chain.shape == shape
    assert history.counts() == dict.fromkeys(history.counts(), 0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"steps": [0, 0]}, "steps do not ascend"),
        ({"steps": [0, 1.5]}, "fractions"),
        ({"heading": np.zeros((2, 3))}, "heading has the shape"),
        ({"patience": 0}, "patience is 0"),
        ({"window": -1}, "window is -1"),
        ({"parting_distance": 10}, "parting_distance is 10"),
        ({"meeting_distance": 0}, "meeting_distance is 0"),
        ({"meeting_angle_degrees": 91}, "meeting_angle_degrees is 91"),
        ({"reversal_distance": 0}, "reversal_distance is 0"),
        ({"link_distance": math.inf}, "link_distance is inf"),
    ],
)
def test_wrong_arrays_and_parameters_are_refused_in_words(options, words):
    right = {"position": np.zeros((2, 2, 2)), "heading": np.zeros((2, 2)), "steps": [0, 1], "link_distance": 15}
    with pytest.raises(InvalidValueError, match=words):
        follow_chains(**{**right, **options})


def test_only_meetings_of_the_same_history_have_an_outcome():
    x = columns(6, 0, 40)
    x[2:, 1] = 10
    history = followed(x)
    with pytest.raises(InvalidValueError, match="not a meeting of this history"):
        history.outcome(history.events[0])
    with pytest.raises(UnknownNameError, match="did you mean 'merge'"):
        history.of("merg")
