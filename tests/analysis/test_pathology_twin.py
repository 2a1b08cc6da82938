"""Pathologies against a twin that follows the definitions robot by robot and step by step, with plain loops."""

import math
from itertools import combinations

import numpy as np
import pytest

from mesa_swarm.analysis.pathology import KINDS, find_pathologies
from support.tracks import CENTROID, CORRIDOR, HEAD_ON, STUCK, THRESHOLD

ROBOT, SOLID = 1, (0, 2, 3)
FLIPS, WINDOW, STEPS = 3, 9, 4
LIMITS = {
    "near": 15.0, "window": WINDOW, "fewest_flips": FLIPS, "fewest_steps": STEPS, "slow_share": 0.3,
    "turned_degrees": 50.0, "stuck_share": 0.2, "forward_share": 0.3, "facing_degrees": 25.0, "gap": 4.0,
}  # fmt: skip
K, N = 60, 4


def scene(seed):
    """Return a track of robots that turn, drive to and fro, drive on and rest by turns, and hardly get anywhere."""
    rng = np.random.default_rng(seed)
    command = np.zeros((K, N, 2))
    for i in range(N):
        begin = 0
        while begin < K:
            end = begin + int(rng.integers(5, 25))
            side = rng.choice([-1.0, 1.0], (K, 1)) if rng.random() < 0.5 else (-1.0) ** np.arange(K)[:, None]
            regimes = side * [-1, 1], side * [1, 1], side * [-0.4, 0.4] + side[::-1] * 0.5, np.ones((K, 2)) * 0.7
            command[begin:end, i] = (*regimes, np.zeros((K, 2)))[rng.integers(5)][begin:end]
            begin = end
    pace = rng.choice([0.0, 0.02, 0.06, 0.3], N)
    position = np.cumsum(
        rng.normal(0, 1, (K, N, 2)) * pace[:, None] + rng.normal(0, 0.4, (N, 2)) * pace[:, None], axis=0
    )
    # Two and two face each other, at gaps of up to 6, along any line.
    line = rng.uniform(-math.pi, math.pi)
    ahead = np.array([math.cos(line), math.sin(line)])
    place = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * [10 + rng.uniform(0, 6), 200]
    position += place @ np.array([ahead, [-ahead[1], ahead[0]]])
    heading = line + np.array([0, math.pi, 0, math.pi]) + np.cumsum(rng.normal(0, 0.05, (K, N)), axis=0)
    kind = rng.choice([-1, 0, 1, 1, 2, 3], (K, N, 3))
    if rng.random() < 0.5:  # robots alone, which change from sensor to sensor
        kind = np.where(rng.random((K, N, 3)) < 0.5, 1, -1)
    return {
        "steps": np.arange(7, K + 7),
        "position": position,
        "heading": heading,
        "command": command,
        "layer": rng.integers(-1, 2, (K, N)),
        "distance": np.where(kind < 0, -1.0, rng.uniform(0, 25, kind.shape)),
        "kind": kind,
        "radius": rng.uniform(1, 6, N),
        "max_speed": rng.uniform(0.9, 1.1, N),
        "forward": np.array([[0, 1, 2], [2, 0, 1], [-1, 0, 1], [0, 1, 2]]),
    }


class Twin:
    """The definitions, one robot and step at a time."""

    def __init__(self, track):
        self.track, self.taken, self.found = track, set(), []
        for kind in (CORRIDOR, CENTROID):
            self.turning(kind)
        self.head_on()
        for i in range(N):
            flips = [t for t in range(K) if self.flips(self.travel, i, t)]
            self.note(THRESHOLD, [((i,), run, flips) for run in stretches(self.flipping(i, flips))])
        for i in range(N):
            self.note(STUCK, [((i,), run, ()) for run in stretches(self.slow(i, self.drives_on, self.is_stuck))])

    def note(self, kind, episodes):
        for robots, (first, last), flips in episodes:
            self.found.append((kind, robots, first + 7, last + 7, sum(first <= t <= last for t in flips)))
            self.taken |= {(i, t) for i in robots for t in range(first, last + 1)}

    def turn(self, i, t):
        left, right = self.track["command"][t, i]
        return int(np.sign(right - left))

    def travel(self, i, t):
        left, right = self.track["command"][t, i]
        return int(np.sign(left + right)) if abs(left + right) > 1e-12 else 0

    def before(self, sign, i, t):
        return next((b for b in range(t - 1, -1, -1) if sign(i, b)), None)

    def flips(self, sign, i, t):
        b = self.before(sign, i, t)
        return b is not None and sign(i, t) * sign(i, b) < 0

    def reads(self, i, t, which, kinds):
        sensor = self.track["forward"][i, which]
        near = sensor >= 0 and 0 <= self.track["distance"][t, i, sensor] < LIMITS["near"]
        return near and int(self.track["kind"][t, i, sensor]) in kinds

    def turns_away(self, i, t, kinds):
        side = 2 if self.turn(i, t) > 0 else 1
        return self.turn(i, t) != 0 and (self.reads(i, t, side, kinds) or self.reads(i, t, 0, kinds))

    def is_drawn(self, i, t):
        left, right = (self.reads(i, t, which, (ROBOT,)) for which in (1, 2))
        away = (self.turn(i, t) > 0 and right and not left) or (self.turn(i, t) < 0 and left and not right)
        return ROBOT in self.track["kind"][t, i] and not away

    def is_corridor_flip(self, i, t):
        b = self.before(self.turn, i, t)
        every = (ROBOT, *SOLID)
        solid = self.turns_away(i, t, SOLID) or self.turns_away(i, b, SOLID)
        return self.turns_away(i, t, every) and self.turns_away(i, b, every) and solid

    def is_centroid_flip(self, i, t):
        b = self.before(self.turn, i, t)
        now, then = (self.track["kind"][when, i] == ROBOT for when in (t, b))
        return self.is_drawn(i, t) and self.is_drawn(i, b) and (now != then).any()

    def way(self, i, first, last):
        return math.dist(self.track["position"][last, i], self.track["position"][first, i])

    def gets_nowhere(self, i, first, last):
        most = min(self.track["radius"][i], LIMITS["slow_share"] * self.track["max_speed"][i] * (last - first))
        turned = math.remainder(self.track["heading"][last, i] - self.track["heading"][first, i], math.tau)
        return self.way(i, first, last) < most and abs(turned) < math.radians(LIMITS["turned_degrees"])

    def flipping(self, i, flips):
        """Return the steps between enough flips in a row of a robot that gets nowhere."""
        flips = [t for t in flips if (i, t) not in self.taken]
        steps = set()
        for first, last in zip(flips, flips[FLIPS - 1 :], strict=False):
            free = all((i, t) not in self.taken for t in range(first, last + 1))
            if free and last - first <= WINDOW and self.gets_nowhere(i, first, last):
                steps |= set(range(first, last + 1))
        return steps

    def turning(self, kind):
        found = []
        counts = self.is_corridor_flip if kind == CORRIDOR else self.is_centroid_flip
        for i in range(N):
            flips = [t for t in range(K) if self.flips(self.turn, i, t) and counts(i, t)]
            steps = self.flipping(i, flips)
            for first, last in stretches(steps):
                length = min(WINDOW, last - first)
                for t in range(first, last - length + 1):
                    if self.way(i, t, t + length) >= self.track["radius"][i]:
                        steps -= set(range(t, t + length + 1))
            runs = [run for run in stretches(steps) if sum(run[0] <= t <= run[1] for t in flips) >= FLIPS]
            found += [((i,), run, flips) for run in runs]
        self.note(kind, found)

    def slow(self, i, acts, is_slow):
        """Return the steps of a robot in which it acts so for long enough, and is slow."""
        steps = set()
        for first in range(1, K - STEPS + 1):
            stretch = range(first, first + STEPS)
            if all(acts(i, t) and (i, t) not in self.taken for t in stretch) and is_slow(i, first, first + STEPS - 1):
                steps |= set(stretch)
        return steps

    def drives_on(self, i, t):
        return self.track["command"][t, i].mean() >= LIMITS["forward_share"] * self.track["max_speed"][i]

    def is_stuck(self, i, first, last):
        least = LIMITS["stuck_share"] * self.track["command"][first : last + 1, i].mean(axis=1).sum()
        along = 0.0
        for t in range(first, last + 1):
            (x, y), old, new = (self.track["position"][t, i] - self.track["position"][t - 1, i]), *(
                self.track["heading"][when, i] for when in (t - 1, t)
            )  # fmt: skip
            along += (x * (math.cos(old) + math.cos(new)) + y * (math.sin(old) + math.sin(new))) / 2
        return self.way(i, first - 1, last) < least and along < least

    def head_on(self):
        def acts(i, t):
            return self.travel(i, t) > 0 or (self.travel(i, t) == 0 and self.turn(i, t) != 0)

        def is_slow(i, first, last):
            return self.way(i, first - 1, last) < LIMITS["stuck_share"] * self.track["max_speed"][i] * STEPS

        slow = [self.slow(i, acts, is_slow) for i in range(N)]
        found = []
        for i, j in combinations(range(N), 2):
            together = {t for t in slow[i] & slow[j] if self.faces(i, j, t) and self.faces(j, i, t)}
            found += [((i, j), run, ()) for run in stretches(together) if run[1] - run[0] + 1 >= STEPS]
        self.note(HEAD_ON, found)

    def faces(self, i, j, t):
        x, y = self.track["position"][t, j] - self.track["position"][t, i]
        bearing = math.remainder(math.atan2(y, x) - self.track["heading"][t, i], math.tau)
        near = math.hypot(x, y) <= self.track["radius"][i] + self.track["radius"][j] + LIMITS["gap"]
        return near and abs(bearing) <= math.radians(LIMITS["facing_degrees"])


def stretches(steps):
    """Return the first and last of each stretch of consecutive steps."""
    first = [t for t in sorted(steps) if t - 1 not in steps]
    return list(zip(first, [t for t in sorted(steps) if t + 1 not in steps], strict=True))


@pytest.mark.slow
def test_in_random_tracks_the_episodes_are_those_of_the_definitions():
    counts = dict.fromkeys(KINDS, 0)
    for seed in range(60):
        track = scene(seed)
        found = find_pathologies(**track, **LIMITS)
        assert sorted((e.kind, e.robots, e.first_step, e.last_step, e.flips) for e in found) == sorted(
            Twin(track).found
        )
        for episode in found:
            counts[episode.kind] += 1
            frames = slice(episode.first_step - 7, episode.last_step - 6)
            assert episode.layers == tuple(sorted(set(track["layer"][frames, list(episode.robots)].ravel().tolist())))
        order = [(e.first_step, KINDS.index(e.kind), e.robots) for e in found]
        assert order == sorted(order)
    assert min(counts.values()) >= 5, counts
