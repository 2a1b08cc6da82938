"""A model that is played: speed, pictures of the past, errors, and threads that stop on request."""

import re

import numpy as np
import pytest

from mesa_swarm import disc
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES, BREATH, LONGEST_DEBT, PlayLoop
from mesa_swarm.viewing.player import PackedFrame, Player, RecentPast
from support.clock import Clock
from support.waiting import threads, wait_until


class Spectator:
    """A viewer that keeps what it is shown, unless it has seen something later."""

    def __init__(self, ready: bool = True) -> None:
        self.ready, self.seen = ready, []

    def push(self, number: int, frame: PackedFrame) -> None:
        if not self.seen or number > self.seen[-1][0]:
            self.seen.append((number, frame.step))


class Breaks(CollisionAvoidance):
    """Breaks in its fourth step."""

    def step(self) -> None:
        if self.steps == 3:
            raise ZeroDivisionError("nothing left\nto share")
        super().step()


def test_what_is_kept_is_bounded_and_the_oldest_goes_first():
    past, world = RecentPast(most_bytes=11_000), {}
    for step in range(50):
        past.append(PackedFrame(step, b"x" * 100, world))
    assert (len(past), past.first_step, past.last_step, past.shown.step) == (10, 40, 49, 49)
    past.append(PackedFrame(50, b"x" * 15_000, world))
    assert len(past) == 2


@pytest.mark.slow
def test_worlds_and_empty_frames_take_room_in_the_past_too():
    past = RecentPast(most_bytes=1_000_000)
    for step in range(3000):
        past.append(PackedFrame(step, b""))
    assert 500 < len(past) <= 1000
    for step in range(3000, 4000):
        past.append(PackedFrame(step, b"", {"obstacles": list(range(10_000))}))
    assert len(past) < 10


def test_a_picture_replaces_one_of_the_same_step():
    past = RecentPast()
    past.append(PackedFrame(0, b"a"))
    past.append(PackedFrame(0, b"b", fingerprint="mark"))
    assert (len(past), past.shown.fingerprint) == (1, "mark")


@pytest.mark.parametrize("speed", [40.0, 200.0])
def test_it_plays_at_the_requested_speed(speed):
    assert Clock().times(500, speed=speed) == pytest.approx(np.arange(500) / speed, abs=1.01 * BREATH)


@pytest.mark.parametrize(("cost", "pace"), [(0.004, 100.0), (0.02, 48.0)])
def test_steps_that_take_time_are_made_up_for_as_long_as_the_machine_can(cost, pace):
    clock = Clock()

    def step(stop):
        clock.now += cost
        return True

    times = clock.times(500, step, speed=100.0)
    assert 499 / (times[-1] - times[0]) == pytest.approx(pace, rel=0.03)


def test_what_a_machine_missed_while_it_was_held_up_is_not_all_made_up_for():
    clock = Clock()

    def step(stop):
        if clock.now == 0.0:
            clock.now += 10.0
        return True

    times = clock.times(100, step, speed=100.0)
    at_once = sum(time < 10.01 + 1.5 * BREATH for time in times) - 1  # the wait after the first one had begun
    assert at_once == pytest.approx(100.0 * LONGEST_DEBT, abs=1)


def test_slow_motion_takes_its_first_step_at_once_and_answers_pause_quickly():
    clock = Clock()
    assert clock.times(3, speed=0.5) == pytest.approx([0.0, 2.0, 4.0], abs=1.01 * BREATH)
    assert clock.longest <= 0.25
    steps = []
    loop = PlayLoop(lambda stop: steps.append(0) or not stop.is_set(), lambda: None, lambda: None)
    loop.speed = 0.001
    loop.play()
    wait_until(lambda: len(steps) == 1)
    loop.pause()
    wait_until(lambda: not threads("play"))
    assert len(steps) == 1


def test_play_advances_until_pause_and_reports_the_rate():
    player = Player(CollisionAvoidance(rng=1))
    player.loop.speed = AS_FAST_AS_IT_GOES
    player.play()
    wait_until(lambda: player.model.steps > 200 and player.loop.rate > 0)
    player.pause()
    at_rest = player.model.steps
    assert (player.playing, player.loop.rate, player.past.shown.step) == (False, 0.0, at_rest)
    wait_until(lambda: not threads("play"))
    assert player.model.steps == at_rest


def test_play_and_pause_in_quick_succession_never_step_after_pause():
    player = Player(CollisionAvoidance(rng=1))
    player.loop.speed = AS_FAST_AS_IT_GOES
    for _ in range(100):
        player.play()
        player.pause()
        at_rest = player.model.steps
        assert not player.playing
        assert player.model.steps == at_rest
    wait_until(lambda: not threads("play"))


def test_steps_go_back_through_what_is_kept_and_forward_to_the_present():
    player = Player(CollisionAvoidance(rng=1))
    for _ in range(3):
        player.step()
    marks = [player.past.shown.fingerprint]
    player.back()
    player.back()
    assert (player.past.shown.step, player.model.steps) == (1, 3)
    player.step()
    assert (player.past.shown.step, player.model.steps) == (2, 3)
    player.step()
    player.step()
    assert (player.past.shown.step, player.model.steps) == (4, 4)
    assert player.past.shown.fingerprint not in marks


def test_play_from_the_past_goes_on_into_the_present():
    player = Player(CollisionAvoidance(rng=1))
    for _ in range(5):
        player.step()
    player.look(0)
    player.play()
    wait_until(lambda: player.model.steps > 10)
    player.pause()
    assert player.past.is_present


def test_looking_at_a_run_does_not_change_it():
    watched, alone = Player(FireFighting(rng=1)), FireFighting(rng=1)
    for _ in range(30):
        watched.step()
    watched.back()
    assert watched.model.state_hash() == alone.run(30).state_hash()


def test_playing_stops_by_itself_when_the_model_is_done():
    player = Player(FireFighting(initial_temperature=0.01, n_robots=50, rng=1))
    player.loop.speed = AS_FAST_AS_IT_GOES
    player.play()
    wait_until(lambda: not threads("play"))  # its last deed is the picture at rest
    assert (player.playing, player.finished) == (False, True)
    assert player.past.shown.readings[0] == ("Fires burning", "0 of 7")
    assert player.past.shown.fingerprint == player.model.state_hash()
    steps = player.model.steps
    player.play()
    assert not player.playing
    assert player.model.steps == steps


def test_an_error_in_a_step_is_reported_and_the_model_left_alone():
    player = Player(Breaks(rng=1))
    errors = []
    player.changed.add(lambda: errors.append(player.error))
    player.loop.speed = AS_FAST_AS_IT_GOES
    player.play()
    wait_until(lambda: errors and errors[-1])
    assert re.fullmatch(r"test_player\.py, line \d+: ZeroDivisionError: nothing left to share", player.error)
    wait_until(lambda: not threads("play"))
    player.step()
    player.play()
    assert (player.model.steps, player.playing) == (3, False)


def test_an_error_in_a_picture_is_reported_at_any_speed(monkeypatch):
    player, errors = Player(CollisionAvoidance(rng=1)), []
    player.add_viewer(Spectator())
    player.changed.add(lambda: errors.append(player.error))
    monkeypatch.setattr("mesa_swarm.viewing.player.readings_of", lambda model: 1 / 0)
    player.loop.speed = AS_FAST_AS_IT_GOES
    player.play()
    wait_until(lambda: errors and errors[-1].endswith("ZeroDivisionError: division by zero"))


def test_viewers_that_are_busy_are_not_waited_for_and_see_the_end():
    player, busy = Player(CollisionAvoidance(rng=1)), Spectator(ready=False)
    player.add_viewer(busy)
    player.play()
    wait_until(lambda: player.model.steps > 5)
    player.pause()
    assert busy.seen[-1][1] == player.model.steps
    assert len(busy.seen) < 5
    numbers = [number for number, _ in busy.seen]
    assert numbers == sorted(set(numbers))


def test_a_robot_that_is_added_changes_the_world_that_is_drawn():
    player = Player(CollisionAvoidance(rng=1))
    before = player.past.shown.world
    player.step()
    assert player.past.shown.world is before
    with player.lock:
        player.model.remove_robots(list(player.model.robots)[:1])
    player.step()
    assert player.past.shown.world is not before


def test_an_obstacle_in_place_of_another_is_drawn():
    player = Player(CollisionAvoidance(rng=1))
    obstacle = player.model.add_obstacle(disc((100, 100), 20))
    player.step()
    obstacle.remove()
    player.model.add_obstacle(disc((300, 300), 20))
    player.step()
    assert player.past.shown.world["shapes"][-1] == {"disc": [300.0, 300.0, 20.0]}


def test_closing_lets_go_of_everything():
    player, spectator = Player(CollisionAvoidance(rng=1)), Spectator()
    player.add_viewer(spectator)
    player.play()
    player.close()
    seen = len(spectator.seen)
    wait_until(lambda: not threads("play"))
    player.step()
    player.play()
    player.pause()
    assert (player.model, len(player.past), player.error, len(spectator.seen)) == (None, 0, "", seen)
