"""After every step no two bodies overlap, loads included, whatever pushes them and wherever to."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from support.pushing import note_returns
from support.scenes import PROMISED, ahead, blind, circle, empty, wedge, worst_load_overlap, worst_overlap
from support.tables import farthest_from

# Loads overlap nothing but by rounding, map units.
ROUNDING = 1e-7
BENT = polygon([(100, 60), (140, 60), (140, 100), (125, 100), (125, 70), (100, 70)])


def check(model, steps, rule=ahead):
    """Run and assert the guarantee after every step; return how far the loads went in all."""
    model.control = Subsumption(rule)
    way = 0.0
    for _ in range(steps):
        before = [load.pose for load in model.loads]
        model.step()
        assert worst_overlap(model) <= PROMISED
        assert worst_load_overlap(model) <= ROUNDING
        way += sum(farthest_from(load, pose) for load, pose in zip(model.loads, before, strict=True))
    return way


def star(rng, centre):
    """Return a polygon, concave as a rule, with or without a hole."""
    n = int(rng.integers(3, 9))
    azimuth = rng.uniform(0, 6) + np.arange(n) * 2 * math.pi / n
    points = rng.uniform(8, 28, n)[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    return polygon(centre + points, [centre + 0.4 * points] if rng.random() < 0.3 else [])


def random_load(rng):
    centre, kind = rng.uniform((15, 15), (205, 145)), rng.integers(3)
    if kind == 0:
        return disc(centre, rng.uniform(3, 22))
    if kind == 1:
        return rectangle(centre - rng.uniform(2, 25, 2), centre + rng.uniform(2, 25, 2))
    return star(rng, centre)


def cluttered(rng, n_loads):
    """Return a room with a few obstacles, perhaps a fire, and as many loads as found room."""
    model = empty(220, 160)
    model.add_obstacle(BENT)
    for _ in range(rng.integers(3)):
        model.add_obstacle(disc(rng.uniform((20, 20), (200, 140)), rng.uniform(2, 15)))
    for _ in range(rng.integers(2)):
        model.add_fire(rng.uniform((20, 20), (200, 140)), radius=8)
    for _ in range(n_loads):
        try:
            model.add_load(random_load(rng), resistance=rng.uniform(0.05, 2.5))
        except InvalidValueError as problem:
            assert "load" in str(problem)
    return model


def check_crowd(seed, n, radius, speed, n_loads, steps):
    rng = np.random.default_rng(seed)
    model = cluttered(rng, n_loads)
    n = min(n, int(0.25 * 220 * 160 / (math.pi * radius**2)))
    poses = np.column_stack([rng.uniform((0, 0), (220, 160), (n, 2)), rng.uniform(-3, 3, n)])
    model.add_robots(blind(radius, speed * radius), poses=poses)
    try:
        check(model, steps, circle(left=float(rng.uniform(0.6, 1))))
    except ValueError as problem:
        assert "no room is left" in str(problem)


@pytest.mark.slow
@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32),
    n=st.integers(1, 40),
    radius=st.floats(2, 10),
    speed=st.sampled_from([0.1, 0.3, 1.0, 3.0]),
    n_loads=st.integers(1, 8),
)
def test_no_body_overlaps_another_in_random_crowds_around_loads(seed, n, radius, speed, n_loads):
    check_crowd(seed, n, radius, speed, n_loads, 6)


@pytest.mark.long
@settings(max_examples=400)
@given(
    seed=st.integers(0, 2**32),
    n=st.integers(1, 40),
    radius=st.floats(2, 10),
    speed=st.floats(0.05, 6),
    n_loads=st.integers(1, 8),
)
def test_no_body_overlaps_another_in_hundreds_of_crowds_around_loads(seed, n, radius, speed, n_loads):
    check_crowd(seed, n, radius, speed, n_loads, 30)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.5, 5.0, 15.0])
def test_a_box_is_turned_on_its_way_through_a_crowd(speed):
    model = empty()
    load = model.add_load(rectangle((150, 100), (170, 200)), resistance=0.3)
    model.add_robots(blind(5, speed), poses=[(145 - 11 * k, 180, 0.0) for k in range(3)])
    model.add_robots(blind(5, speed), poses=[(190 + 11 * (k // 5), 120 + 11 * (k % 5), 1.2) for k in range(25)])
    assert check(model, 60) > 10
    assert load.heading != 0.0


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1.0, 15.0])
@pytest.mark.parametrize("shape", [disc((300, 200), 40), rectangle((260, 170), (340, 230))], ids=["disc", "box"])
def test_a_crowd_shoves_a_load_into_a_corner_with_robots_before_it(shape, speed):
    model = empty()
    load = model.add_load(shape, resistance=0.7)
    model.add_robots(blind(5, speed), poses=[(200 + 11 * (k % 4), 110 + 11 * (k // 4), 0.7) for k in range(24)])
    model.add_robots(blind(5, 0.0), poses=[(394, 294, 0.0), (380, 260, 0.0), (355, 290, 0.0)])
    assert check(model, 120) > 10
    assert load.shape.bounds[2] <= 400 + ROUNDING


def test_a_load_is_pressed_into_a_wedge():
    model = wedge(50)
    load = model.add_load(disc((200, 150), 18), resistance=0.7)
    model.add_robots(blind(), poses=[(176, 145, 0.0), (176, 156, 0.0)])
    assert check(model, 150) > 20
    assert not load.moved


def test_robots_between_two_loads_that_are_pushed_at_each_other_are_not_squeezed():
    model = empty()
    model.add_load(rectangle((150, 100), (170, 200)), resistance=0.5)
    model.add_load(rectangle((230, 100), (250, 200)), resistance=0.5)
    model.add_robots(blind(), poses=[(145, 130, 0.0), (145, 170, 0.0), (255, 130, math.pi), (255, 170, math.pi)])
    model.add_robots(blind(max_speed=0.0), poses=[(200, 110 + 20 * k, 0.0) for k in range(5)])
    assert check(model, 80) > 40
    gap = model.loads[1].shape.bounds[0] - model.loads[0].shape.bounds[2]
    assert gap == pytest.approx(10, abs=1.0)


def test_a_load_that_followed_one_that_is_taken_back_is_taken_back_with_it():
    model = empty()
    front = model.add_load(rectangle((350, 100), (389, 200)), resistance=0.5)
    behind = model.add_load(rectangle((330, 130), (350, 170)), resistance=0.5)
    model.add_robots(blind(), poses=[(325, 140, 0.0), (325, 160, 0.0), (345, 110, 0.0), (345, 190, 0.0)])
    model.add_robots(blind(max_speed=0.0), poses=[(394, 150, 0.0)])
    assert check(model, 10) == pytest.approx(2.0, abs=1e-6)
    assert not front.moved
    assert not behind.moved
    assert (front.pushers, behind.pushers) == (2, 2)


def test_several_loads_in_a_row_are_pushed_from_one_end():
    model = empty(600, 200)
    for k in range(4):
        model.add_load(rectangle((150 + 60 * k, 80), (190 + 60 * k, 120)), resistance=0.5)
    model.add_robots(blind(), poses=[(145, 90 + 20 * k, 0.0) for k in range(2)])
    model.add_robots(blind(max_speed=0.0), poses=[(200 + 60 * k, 100, 0.0) for k in range(3)])
    assert check(model, 120) > 5


def test_robots_in_the_hole_of_a_load_push_it_from_inside():
    model = empty()
    ring = polygon([(100, 100), (200, 100), (200, 200), (100, 200)], [[(110, 110), (190, 110), (190, 190), (110, 190)]])
    load = model.add_load(ring, resistance=1.5)
    model.add_robots(blind(), poses=[(180, 140, 0.0), (180, 160, 0.0)])
    assert check(model, 60) > 50
    assert load.position == pytest.approx((200, 150), abs=10.0)
    assert load.position[0] > 195


def test_far_from_the_origin_loads_move_and_keep_the_guarantee():
    far = 1e7
    model = SwarmModel(map=Map(name="far", bounds=(far, far, far + 200, far + 150)), rng=1)
    model.add_load(rectangle((far + 90, far + 40), (far + 110, far + 110)), resistance=0.5)
    model.add_robots(blind(), poses=[(far + 84, far + 60 + 15 * k, 0.1) for k in range(3)])
    assert check(model, 40) > 20


def test_a_load_smaller_than_the_robots_is_pushed_about():
    model = empty()
    model.add_load(disc((200, 150), 1.5), resistance=0.1)
    model.add_load(rectangle((250, 149), (251, 160)), resistance=0.1)
    model.add_robots(blind(12, 6.0), poses=[(180, 150, 0.02), (180, 110, 0.5), (290, 150, 3.0)])
    assert check(model, 60) > 20


def test_the_crowds_above_include_those_where_loads_are_taken_back(monkeypatch):
    taken = note_returns(monkeypatch)
    for seed in range(6):
        check_crowd(seed, 40, 8.0, 3.0, 8, 5)
    assert taken
