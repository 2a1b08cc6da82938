"""Two worlds, one clock: they step together, both show the same step, and errors are shown."""

import re

from mesa_swarm.dashboard.compare.comparing import Pair
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES
from mesa_swarm.viewing.player import PackedFrame, RecentPast
from support.waiting import threads, wait_until


class Breaks(CollisionAvoidance):
    """Breaks in its fourth step."""

    def step(self) -> None:
        if self.steps == 3:
            raise ZeroDivisionError("nothing left")
        super().step()


class EndsEarly(CollisionAvoidance):
    """Is done after three steps."""

    def step(self) -> None:
        super().step()
        self.running = self.steps < 3


class Spectator:
    """A viewer that keeps the steps that it is shown, unless it has seen something later."""

    def __init__(self, ready: bool = True) -> None:
        self.ready, self.steps, self._latest = ready, [], 0

    def push(self, number: int, frame: PackedFrame) -> None:
        if number > self._latest:
            self._latest = number
            self.steps.append(frame.step)


def pair_of(first, second) -> Pair:
    pair = Pair()
    pair.place(first, second)
    return pair


def steps_of(pair: Pair) -> list[int]:
    return [side.model.steps for side in pair.sides]


def shown_by(pair: Pair) -> list[int]:
    return [side.past.shown.step for side in pair.sides]


def test_the_past_is_looked_at_by_step():
    past = RecentPast()
    for step in (0, 2, 4, 8):
        past.append(PackedFrame(step, b""))
    shown = []
    for step in (5, 8, 99, -1, 2):
        past.look_at(step)
        shown.append(past.shown.step)
    assert shown == [4, 8, 8, 0, 2]
    assert past.step_after() == 4


def test_both_step_together_and_as_each_would_alone():
    pair = pair_of(FireFighting(strategy="A", rng=1), FireFighting(strategy="B", rng=1))
    for _ in range(20):
        pair.step()
    alone = [FireFighting(strategy=strategy, rng=1).run(20).state_hash() for strategy in "AB"]
    assert [side.model.state_hash() for side in pair.sides] == alone
    pair.close()


def test_while_they_are_played_both_have_taken_the_same_steps_at_every_pause():
    pair = pair_of(CollisionAvoidance(rng=1), CollisionAvoidance(rng=2))
    pair.set_speed(AS_FAST_AS_IT_GOES)
    for _ in range(5):
        target = pair.sides[0].model.steps + 20
        pair.play()
        wait_until(lambda target=target: pair.sides[1].model.steps >= target)
        pair.pause()
        first, second = steps_of(pair)
        assert first == second
        assert shown_by(pair) == [first, first]
    pair.close()


def test_one_steps_back_in_both_and_goes_on_from_there_to_the_present():
    pair = pair_of(CollisionAvoidance(rng=1), CollisionAvoidance(rng=2))
    for _ in range(4):
        pair.step()
    pair.back()
    pair.back()
    assert (shown_by(pair), steps_of(pair)) == ([2, 2], [4, 4])
    pair.step()
    assert shown_by(pair) == [3, 3]
    pair.step()
    pair.step()
    assert (shown_by(pair), steps_of(pair)) == ([5, 5], [5, 5])
    pair.look(0)
    assert shown_by(pair) == [0, 0]
    pair.close()


def test_a_world_that_is_done_waits_while_the_other_goes_on():
    pair = pair_of(EndsEarly(rng=1), CollisionAvoidance(rng=1))
    for _ in range(6):
        pair.step()
    assert (steps_of(pair), pair.finished, pair.past.last_step) == ([3, 6], False, 6)
    pair.look(pair.past.index - 4)
    assert shown_by(pair) == [2, 2]
    for _ in range(3):
        pair.step()
    assert shown_by(pair) == [3, 5]
    pair.close()


def test_playing_stops_by_itself_when_both_are_done():
    pair = pair_of(EndsEarly(rng=1), EndsEarly(rng=2))
    pair.set_speed(AS_FAST_AS_IT_GOES)
    pair.play()
    wait_until(lambda: not threads("play"))
    assert (pair.playing, pair.finished, steps_of(pair)) == (False, True, [3, 3])
    pair.close()


def test_an_error_in_one_world_stops_both_and_is_shown():
    pair = pair_of(CollisionAvoidance(rng=1), Breaks(rng=1))
    pair.set_speed(AS_FAST_AS_IT_GOES)
    pair.play()
    wait_until(lambda: pair.error)
    assert re.fullmatch(r"B: test_pair\.py, line \d+: ZeroDivisionError: nothing left", pair.error)
    wait_until(lambda: not threads("play"))
    before = steps_of(pair)
    pair.step()
    pair.play()
    assert (steps_of(pair), pair.playing) == (before, False)
    pair.place(CollisionAvoidance(rng=1), CollisionAvoidance(rng=1))
    pair.step()
    assert (pair.error, steps_of(pair)) == ("", [1, 1])
    pair.close()


def test_viewers_of_the_clock_are_notified_the_step_and_both_fingerprints():
    pair, spectator = pair_of(CollisionAvoidance(rng=1), CollisionAvoidance(rng=2)), Spectator()
    pair.add_viewer(spectator)
    pair.step()
    assert spectator.steps[-1] == 1
    marks = [side.model.state_hash() for side in pair.sides]
    assert pair._shown().fingerprint == "-".join(marks)
    pair.remove_viewer(spectator)
    pair.step()
    assert spectator.steps[-1] == 1
    pair.close()


def test_closing_lets_go_of_both_worlds():
    pair = pair_of(CollisionAvoidance(rng=1), CollisionAvoidance(rng=2))
    pair.play()
    pair.close()
    assert [side.model for side in pair.sides] == [None, None]
    assert [len(side.past) for side in pair.sides] == [0, 0]
    pair.step()
    pair.play()
    assert not pair.playing
