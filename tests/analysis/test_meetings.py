"""Meetings of robots against a twin that asks of every pair in every frame; windows to the step."""

import math

import numpy as np
import pytest

from mesa_swarm.analysis import follow_chains

FAR, NEAR, NARROW = 40.0, 30.0, 35.0


def scene(seed, frames=70, n=9):
    """Return the track of robots that drive to the right or to the left and sometimes turn round."""
    rng = np.random.default_rng(seed)
    turns = np.where(rng.random((frames, n)) < 0.04, math.pi, 0.0).cumsum(axis=0)
    heading = (
        rng.choice([0.0, math.pi], n) + turns + rng.normal(0, 0.03, (frames, n)).cumsum(axis=0) + rng.uniform(-3, 3)
    )
    heading = np.remainder(heading + math.pi, math.tau) - math.pi
    step = np.stack([np.cos(heading), np.sin(heading)], axis=-1) * rng.uniform(0.5, 2)
    return rng.uniform(0, 70, (n, 2)) + step.cumsum(axis=0), heading, rng.integers(1, 4, frames).cumsum() + 100


def ahead(position, heading, i):
    """Return the nearest robot before robot i, or None."""
    seen = []
    for j, place in enumerate(position.tolist()):
        x, y = place[0] - position[i, 0], place[1] - position[i, 1]
        bearing = math.remainder(math.atan2(y, x) - heading[i], math.tau)
        if j != i and math.hypot(x, y) <= NEAR and abs(bearing) <= math.radians(NARROW):
            seen.append((math.hypot(x, y), j))
    return min(seen, default=(0, None))[1]


def met(position, heading, chain):
    """Return (frame, row, row) of every meeting, pair by pair."""
    found, n = [], heading.shape[1]
    for i in range(n):
        for j in range(i + 1, n):
            gap = [math.dist(*frame[[i, j]]) for frame in position]
            known = False
            for t in range(1, len(position)):
                known = known and gap[t] <= FAR
                facing = ahead(position[t], heading[t], i) == j and ahead(position[t], heading[t], j) == i
                together = chain[t, i] == chain[t, j] >= 0
                if facing and gap[t] < gap[t - 1] and not together and not known:
                    found.append((t, i, j))
                    known = True
    return found


def outcome(meeting, position, chain, steps, window, patience):
    """Return the outcome of a meeting, frame by frame."""
    start, i, j = meeting
    for t in range(start, len(steps)):
        if steps[t] > steps[start] + window:
            return "unresolved"
        one, other = chain[t : t + patience, i], chain[t : t + patience, j]
        if len(one) == patience and ((one == other) & (one >= 0)).all():
            return "merged"
        if math.dist(*position[t, [i, j]]) > FAR:
            return "dispersed"
    return "unresolved"


@pytest.mark.slow
def test_meetings_and_their_outcomes_are_those_of_every_pair_in_every_frame():
    outcomes = []
    for seed in range(30):
        position, heading, steps = scene(seed)
        options = {"link_distance": 12, "patience": 3, "window": 25, "meeting_distance": NEAR, "parting_distance": FAR}
        history = follow_chains(position, heading, steps, meeting_angle_degrees=NARROW, **options)
        expected = met(position, heading, history.chain)
        assert sorted((e.step, *e.robots) for e in history.of("meeting")) == sorted(
            (int(steps[t]), i, j) for t, i, j in expected
        )
        for meeting in expected:
            t, *rows = meeting
            event = next(e for e in history.of("meeting") if e.step == steps[t] and e.robots == tuple(rows))
            assert event.chains == tuple(sorted({int(c) for c in history.chain[t, rows]} - {-1}))
            assert history.outcome(event) == outcome(meeting, position, history.chain, steps, 25, 3)
            outcomes.append(history.outcome(event))
    assert min(map(outcomes.count, ("merged", "dispersed", "unresolved"))) >= 3


def line(frames, *places):
    """Return positions of robots that stand still on a line."""
    x = np.tile(np.array(places, dtype=float), (frames, 1))
    return np.stack([x, np.zeros_like(x)], axis=-1)


@pytest.mark.parametrize(("window", "reversed_"), [(50, 1), (49, 0)])
def test_who_was_ahead_counts_up_to_as_many_steps_ago_as_the_window(window, reversed_):
    position, heading = line(12, 20, 10, 0), np.zeros((12, 3))
    position[5:9, :, 1], heading[9:] = [0, 100, 200], math.pi
    steps = 1000 + 10 * np.arange(12)
    history = follow_chains(position, heading, steps, link_distance=15, patience=1, window=window)
    assert [e.step for e in history.of("reversal")] == [1090] * reversed_


@pytest.mark.parametrize(("distance", "steps"), [(7.0, [1014]), (7.01, [])])
@pytest.mark.parametrize("heading", [0.0, math.pi / 2, 2.5])
def test_a_chain_that_backs_up_is_reversed_from_exactly_the_distance_on(distance, steps, heading):
    way = np.concatenate([np.arange(15), np.arange(13, 6, -1), np.full(5, 7)])[:, None] + [20.0, 10.0, 0.0]
    position = way[..., None] * [math.cos(heading), math.sin(heading)]
    options = {"link_distance": 15, "patience": 1, "reversal_distance": distance * (1 - 1e-9)}
    history = follow_chains(position, np.full(way.shape, heading), 1000 + np.arange(len(way)), **options)
    assert [(e.kind, e.step, e.robots) for e in history.events] == [("reversal", step, (0, 1, 2)) for step in steps]


def test_two_robots_that_come_to_be_exactly_the_parting_distance_apart_have_not_parted():
    gap = np.concatenate([np.arange(60, 18, -2), np.arange(20, 42, 2)])
    x = np.stack([np.zeros(len(gap)), gap], axis=1)
    heading = np.tile([0.0, math.pi], (len(gap), 1))
    for parting, outcome in ((40, "unresolved"), (39.9, "dispersed")):
        history = follow_chains(
            np.stack([x, 0 * x], axis=-1), heading, np.arange(len(gap)),
            link_distance=15, meeting_distance=30, parting_distance=parting,
        )  # fmt: skip
        assert history.outcome(*history.of("meeting")) == outcome
        assert history.of("meeting")[0].step == 15


def test_a_ring_that_opens_and_closes_reverses_no_order():
    azimuth = math.tau * np.arange(6) / 6
    ring = 20 * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    position, heading = np.tile(ring, (9, 1, 1)), np.tile(azimuth + math.pi / 2, (9, 1))
    position[3:6, 0] *= 5
    options = {"link_distance": 25, "half_angle_degrees": 60.0, "patience": 1}
    history = follow_chains(position, heading, np.arange(9), **options)
    assert history.lengths[0].tolist() == history.lengths[-1].tolist() == [6]
    assert history.lengths[4].tolist() == [5]
    assert history.events == ()
