"""Readings that err: noise, how long it is held, how often a sensor looks (PHYSICS 3)."""

import math
from itertools import pairwise

import numpy as np
import pytest

from mesa_swarm import AGENT9, LineSensor, ProximitySensor, RadiationSensor, RobotDesign, disc, rectangle
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from support.scenes import ahead, empty
from support.sensing_robots import OBSTACLE, carrying


def noisy_world(n=400, probability=0.5, magnitude=0.2, distance=25.0, **more):
    """Return a world of many robots that each see one disc at this distance."""
    model = empty(100 * 20, 100 * (n // 20))
    sensor = ProximitySensor(
        range=50, field_of_view_degrees=10, error_probability=probability, error_magnitude=magnitude, **more
    )
    model.add_robots(carrying(sensor), poses=[(20 + 100 * (k % 20), 50 + 100 * (k // 20), 0.0) for k in range(n)])
    for k in range(n if distance else 0):
        model.add_obstacle(disc((25 + distance + 5 + 100 * (k % 20), 50 + 100 * (k // 20)), 5))
    return model


def test_a_reading_errs_with_its_probability_by_its_magnitude_up_or_down():
    model = noisy_world(probability=0.3)
    model.sense()
    distance = model.swarm.distance[:, 0]
    up, down, right = (np.isclose(distance, d, atol=1e-9) for d in (30, 20, 25))
    assert (up | down | right).all()
    sigma = math.sqrt(0.3 * 0.7 * 400)
    assert abs((up | down).sum() - 120) < 4 * sigma
    assert abs(int(up.sum()) - int(down.sum())) < 4 * math.sqrt(120)


def test_a_reading_that_errs_stays_between_nought_and_the_range():
    for magnitude, values in ((1.5, {0.0, 50.0}), (1.0, {0.0, 50.0}), (1e6, {0.0, 50.0})):
        model = noisy_world(100, 1.0, magnitude)
        model.sense()
        assert set(np.round(model.swarm.distance[:, 0], 9)) == values


def test_errors_neither_invent_nor_lose_a_detection():
    nothing = noisy_world(100, 1.0, 0.9, distance=0)
    nothing.sense()
    assert (nothing.swarm.distance == -1).all()
    edge = noisy_world(100, 1.0, 0.9, distance=49.9)
    edge.sense()
    assert (edge.swarm.kind == OBSTACLE).all()
    assert (edge.swarm.distance >= 0).all()


@pytest.mark.parametrize("hold", [1, 4])
def test_an_error_is_held_for_as_many_steps_as_asked_for(hold):
    model = noisy_world(100, 0.5, 0.2, hold=hold)
    rows = []
    for _ in range(12):
        model.sense()
        rows.append(model.swarm.distance[:, 0].copy())
        model.step()
    changed = [bool((a != b).any()) for a, b in pairwise(rows)]
    assert changed == [(k + 1) % hold == 0 for k in range(11)]


def test_a_reading_is_refreshed_once_a_period():
    model = empty()
    sensors = (ProximitySensor(range=100), ProximitySensor(range=100, period=3))
    model.add_robots(carrying(*sensors), poses=[(100, 150, 0.0)])
    model.add_obstacle(rectangle((180, 0), (200, 300)))
    model.control = Subsumption(ahead)
    for k in range(10):
        model.sense()
        assert model.swarm.distance[0] == pytest.approx((75 - k, 75 - k + k % 3), abs=1e-9)
        model.step()


def test_reading_twice_gives_the_same():
    model = noisy_world(40, 0.5, 0.2, hold=2, period=3)
    for _ in range(5):
        model.sense()
        first = model.swarm.distance.copy(), model.swarm.kind.copy(), model.swarm.error.copy()
        for _ in range(3):
            model.swarm.disturbed = True  # no short cut
            model.sense()
        assert (first[0] == model.swarm.distance).all()
        assert (first[1] == model.swarm.kind).all()
        assert (first[2] == model.swarm.error).all()
        model.step()


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_held_reading_that_imperfections_disturb_is_the_same_however_often_it_is_read(engine):
    """It is what was read before, disturbed once more: noted anew, it would be disturbed for each time it is read."""
    models = []
    for times in (1, 3):
        model = empty(engine=engine)
        model.add_robots(carrying(ProximitySensor(range=100), ProximitySensor(range=100, period=3)), 6)
        model.add_obstacle(rectangle((180, 0), (200, 300)))
        model.imperfections = Imperfections(sensing=Imperfection(error=0.2))
        model.control = Subsumption(ahead)
        for _ in range(8):
            for _ in range(times):
                model.parts.robots.forget_readings()
                model.sense()
            model.step()
        models.append(model)
    assert models[0].state_hash() == models[1].state_hash()


def test_a_sensor_s_noise_does_not_change_the_walk_of_robots_that_do_not_look():
    places = []
    for probability in (0.0, 0.5):
        model = empty(rng=4)
        design = AGENT9.with_slip(probability=0.3, magnitude=0.5)
        model.add_robots(design.with_proximity(error_probability=probability, error_magnitude=0.3), 10)
        model.control = Subsumption(Explore(turn_interval=7))
        places.append(model.run(60).swarm.position.copy())
    assert (places[0] == places[1]).all()


def test_more_sensors_do_not_change_the_walk():
    places = []
    for more in ((), (ProximitySensor(error_probability=0.5, error_magnitude=0.5), LineSensor(), RadiationSensor())):
        model = empty(rng=4)
        design = AGENT9.with_slip(probability=0.3, magnitude=0.5)
        model.add_robots(RobotDesign(sensors=(*design.sensors, *more), slip_probability=0.3, slip_magnitude=0.5), 10)
        model.control = Subsumption(Explore(turn_interval=7))
        places.append(model.run(60).swarm.position.copy())
    assert (places[0] == places[1]).all()
