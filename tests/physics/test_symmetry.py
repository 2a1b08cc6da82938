"""The physics knows no preferred place, direction, side or order of robots."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mesa_swarm import LineSensor
from support.pace import in_time
from support.random_worlds import DESIGNS, crowd, differences, outcome, random_world

EXACT = 1e-9
NUDGE, JUMP = 1e-10, 1e-6
PROMISED = 1e-6
FAR = 1e7

seeds = st.integers(0, 2**32 - 1)
few, deep = settings(max_examples=40), settings(max_examples=in_time(300))


def shifted(world, by):
    """Return a world moved by a vector."""
    return world.moved(lambda points: points + by, lambda heading: heading)


def quarter_turned(world):
    """Return a world turned left by 90 degrees about the origin."""
    return world.moved(
        lambda points: np.stack([-points[..., 1], points[..., 0]], axis=-1),
        lambda heading: heading + math.pi / 2,
    )


def mirrored(world):
    """Return a world mirrored in the x axis: left is right for sensors, wheels and tendencies."""
    image = world.moved(lambda points: points * [1.0, -1.0], lambda heading: -heading)
    return replace(
        image,
        designs=tuple(map(mirrored_design, world.designs)),
        commands=world.commands[:, ::-1],
        tendency=-world.tendency,
    )


def mirrored_design(design):
    """Return a design whose every sensor is on the other side."""
    return replace(design, sensors=tuple(map(mirrored_sensor, design.sensors)))


def mirrored_sensor(sensor):
    """Return the sensor on the other side, looking the other way."""
    mount = None if sensor.mount is None else (sensor.mount[0], -sensor.mount[1])
    if isinstance(sensor, LineSensor):
        return replace(sensor, mount=mount)
    return replace(sensor, mount=mount, bearing_degrees=-sensor.bearing_degrees)


def settled(world):
    """Return a world whose robots are free: looking for room has preferred directions, and an order."""
    model = replace(world, commands=np.zeros_like(world.commands)).model()
    model.step()
    return replace(world, poses=np.column_stack([model.swarm.position, model.swarm.heading]))


def after(found, undo):
    """Return an outcome with its positions and headings taken back to the world that was transformed."""
    position, heading = undo(found["position"], found["heading"])
    return {**found, "position": position, "heading": np.mod(heading + math.pi, 2 * math.pi) - math.pi}


def generic_outcome(world):
    """Return the outcome of a world, if it does not jump when the robots are moved very slightly."""
    found = outcome(world.model())
    nudged = outcome(world.nudged(NUDGE).model())
    assume(max(differences(found, nudged).values()) < JUMP)
    return found


def check_same(world, image, undo):
    """Assert that the image of a world steps into the image of its outcome."""
    here, there = generic_outcome(world), outcome(image.model())
    found = differences(here, after(there, undo))
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=EXACT)


@pytest.mark.slow
@few
@given(seeds, st.tuples(*[st.floats(-500, 500)] * 2))
def test_a_shifted_world_does_the_same_elsewhere(seed, by):
    world = settled(random_world(seed))
    check_same(world, shifted(world, np.array(by)), lambda position, heading: (position - by, heading))


@pytest.mark.slow
@few
@given(seeds)
def test_a_world_turned_by_a_quarter_does_the_same_turned(seed):
    world = settled(random_world(seed))

    def undo(position, heading):
        return np.stack([position[:, 1], -position[:, 0]], axis=-1), heading - math.pi / 2

    check_same(world, quarter_turned(world), undo)


@pytest.mark.slow
@few
@given(seeds)
def test_a_mirrored_world_does_the_same_mirrored(seed):
    world = settled(random_world(seed))
    here, there = generic_outcome(world), outcome(mirrored(world).model())
    there = after(there, lambda position, heading: (position * [1.0, -1.0], -heading))
    there["slip"] = there["slip"][:, ::-1]
    found = differences(here, there)
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=EXACT)


def check_order(world, order):
    """Assert that robots created in another order do the same."""
    here, there = generic_outcome(world), outcome(world.reordered(order).model())
    found = differences({name: column[order] for name, column in here.items()}, there)
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=EXACT)


@pytest.mark.slow
@few
@given(seeds)
def test_the_order_in_which_robots_were_created_is_nothing(seed):
    world = settled(random_world(seed))
    check_order(world, np.random.default_rng(seed).permutation(len(world.poses)))


@pytest.mark.slow
@few
@given(seeds)
def test_the_order_in_which_robots_were_created_is_nothing_in_a_jam(seed):
    check_order(settled(crowd(seed, n=12, size=62.0)), np.arange(12)[::-1])


@pytest.mark.long
@deep
@given(seeds)
def test_the_order_in_which_robots_were_created_is_nothing_in_hundreds_of_jams(seed):
    check_order(settled(crowd(seed, n=12, size=62.0)), np.random.default_rng(seed).permutation(12))


@pytest.mark.slow
@few
@given(seeds)
def test_far_from_the_origin_no_robot_overlaps_anything_after_a_step(seed):
    world = shifted(crowd(seed, n=12, size=70.0), FAR)
    model = world.model()
    for _ in range(5):
        model.step()
        assert deepest_overlap(model) < PROMISED


def deepest_overlap(model):
    """Return the deepest overlap as a share of the radius, by Shapely."""
    centres, radius = shapely.points(model.swarm.position), model.swarm.radius
    gaps = [shapely.distance(centres[:, None], centres) - radius + np.diag(np.full(len(radius), math.inf))]
    gaps += [shapely.distance(centres, o.shape.geometry)[:, None] - o.shape.radius for o in model.obstacles]
    gaps += [shapely.distance(centres, shapely.box(*model.map.bounds).exterior)[:, None]]
    return ((radius - np.hstack(gaps).min(axis=1)) / radius).max()


def test_every_design_is_its_own_image_mirrored_twice():
    assert tuple(mirrored_design(mirrored_design(design)) for design in DESIGNS) == DESIGNS
