"""What models, robots, obstacles and fires show of themselves, and that columns cannot be replaced."""

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.models.fire_fighting import FireFighting
from support.scenes import empty


def test_a_robot_shows_its_id_and_pose_and_that_it_was_removed():
    (robot,) = empty().add_robots(AGENT9, poses=[(12, 40.5, 0.52361)])
    assert repr(robot) == "<Robot 1 at (12.0, 40.5), heading 0.52>"
    robot.remove()
    assert repr(robot) == "<Robot 1, removed>"


def test_an_obstacle_shows_its_kind_and_place_and_that_it_was_removed():
    model = empty()
    obstacle = model.add_obstacle(disc((100, 50.25), 5))
    mark = model.add_obstacle(rectangle((10, 10), (30, 20), contact=False))
    assert repr(obstacle) == "<Obstacle 1, disc at (100.0, 50.25)>"
    assert repr(mark) == "<Obstacle 2, rectangle at (20.0, 15.0), a mark>"
    obstacle.remove()
    assert repr(obstacle) == "<Obstacle 1, removed>"


def test_a_fire_shows_its_place_and_temperature_and_that_it_is_out_or_removed():
    model = empty()
    fire = model.add_fire((100, 50), radius=5, temperature=0.12345)
    assert repr(fire) == "<Fire 1 at (100.0, 50.0), temperature 0.123>"
    model.fires.own["out"][0] = True
    assert repr(fire) == "<Fire 1 at (100.0, 50.0), out>"
    fire.remove()
    assert repr(fire) == "<Fire 1, removed>"


def test_a_swarm_shows_its_designs_and_a_model_its_map_step_and_numbers():
    model = empty()
    assert repr(model.swarm) == "<Swarm of 0 robots>"
    model.add_robots(AGENT9, 2)
    model.add_robots(AGENT3, 1)
    assert repr(model.swarm) == "<Swarm of 3 robots (AGENT9, AGENT3)>"
    fighting = FireFighting(n_robots=2, rng=1).run(3)
    assert repr(fighting) == "<FireFighting on map openspace_fire, step 3: 2 robots, 7 fires>"


def test_a_column_cannot_be_replaced():
    model = empty()
    model.add_robots(AGENT9, 2)
    before = model.swarm.position.copy()
    for name in ("position", "heading", "temperature"):
        with pytest.raises(InvalidValueError, match=f"^swarm.{name} cannot be replaced; change a robot by its handle"):
            setattr(model.swarm, name, np.zeros(2))
    assert np.array_equal(model.swarm.position, before)
