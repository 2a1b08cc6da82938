"""What is wrong is refused on one line, and nothing is added."""

import math

import pytest

from mesa_swarm import AGENT3, AGENT9, Map, RobotDesign, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError, PlacementError, SwarmError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from support.scenes import ahead, blind, empty


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"engine": "compild"}, "did you mean 'compiled'"),
        ({"engine": "Shapely"}, "did you mean 'shapely'"),
        ({"engine": 5}, "unknown engine 5"),
        ({"engine": None}, "unknown engine None"),
        ({"map": "orignal"}, "did you mean 'original'"),
        ({"map": 5}, "expected a Map"),
        ({"turn_angle_degrees": 91}, "turn_angle_degrees is 91"),
        ({"turn_angle_degrees": math.nan}, "turn_angle_degrees is nan"),
        ({"extinguish_range": -1}, "extinguish_range is -1"),
        ({"history_every": -1}, "history_every is -1"),
        ({"history_every": 1.5}, "history_every is 1.5"),
        ({"collect_every": -1}, "collect_every is -1"),
        ({"collect_every": None}, "collect_every is None"),
        ({"fire_constants": "weak"}, "fire_constants is 'weak'"),
        ({"fire_constants": {"k1": 1}}, "fire_constants is"),
    ],
)
def test_a_wrong_option_of_the_model_is_refused_on_one_line(options, words):
    with pytest.raises(SwarmError, match=words) as caught:
        SwarmModel(**options)
    assert "\n" not in str(caught.value)


BAD_ROBOTS = [
    ({}, "give exactly one"),
    ({"n": 1, "poses": []}, "give exactly one"),
    ({"n": -1}, "n is -1"),
    ({"n": 2.5}, "whole number"),
    ({"n": math.nan}, "n is nan"),
    ({"n": "3"}, "n is '3'"),
    ({"n": True}, "n is True"),
    ({"n": 10**400}, "n is "),
    ({"n": 10**9}, "would"),
    ({"poses": 5}, "expected"),
    ({"poses": [5]}, "expected"),
    ({"poses": "abc"}, "expected"),
    ({"poses": [(1, 2)]}, "expected"),
    ({"poses": [(10, 20), (30, 40), (50, 60)]}, "expected"),
    ({"poses": [10, 20, 30]}, "expected"),
    ({"poses": [(50, 50, 0.0), (401, 50, 0.0)]}, "not on map empty"),
    ({"poses": [(math.nan, 50, 0.0)]}, "not on map empty"),
    ({"poses": [(50, 50, math.inf)]}, "heading is inf"),
    ({"poses": [(50, 50, "north")]}, "expected"),
    ({"n": 2, "tendency": "lft"}, "did you mean 'left'"),
    ({"n": 2, "tendency": ["left"]}, "names 1 sides for 2 robots"),
    ({"n": 2, "tendency": 5}, "tendency"),
    ({"n": 2, "tendency": [1, -1]}, "tendency"),
]


@pytest.mark.parametrize(("options", "words"), BAD_ROBOTS, ids=[f"{k}-{b[1][:12]}" for k, b in enumerate(BAD_ROBOTS)])
def test_wrong_robots_are_refused_on_one_line_and_none_is_added(options, words):
    model = empty()
    model.add_robots(AGENT3, 2)
    before = model.state_hash()
    with pytest.raises(SwarmError, match=words) as caught:
        model.add_robots(AGENT9, **options)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 250
    assert (len(model.robots), len(model.agents), model.state_hash()) == (2, 2, before)


@pytest.mark.parametrize("design", ["AGENT9", None, RobotDesign, 5, (AGENT9,)])
def test_what_is_not_a_design_is_refused(design):
    with pytest.raises(InvalidValueError, match="expected a RobotDesign such as AGENT9"):
        empty().add_robots(design, 1)


@pytest.mark.parametrize("shape", ["disc", None, (50, 50), disc, Map(name="m", bounds=(0, 0, 9, 9))])
def test_what_is_not_a_shape_is_refused(shape):
    model = empty()
    with pytest.raises(InvalidValueError, match="expected disc"):
        model.add_obstacle(shape)
    assert len(model.agents) == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda: disc((1, 2), -1),
        lambda: disc((1, math.nan), 1),
        lambda: rectangle((0, 0), (0, 5)),
        lambda: polygon([(0, 0), (10, 10), (10, 0), (0, 10)]),
        lambda: polygon([(0, 0), (10, 10)]),
    ],
    ids=["radius", "nan", "area", "bow-tie", "two points"],
)
def test_a_wrong_shape_is_refused_before_it_reaches_the_model(make):
    with pytest.raises(InvalidValueError):
        make()


BAD_FIRES = [
    (((50, 50),), {}, "neither radius nor area"),
    (((50, 50),), {"radius": 0}, "radius is 0"),
    (((50, 50),), {"radius": -1}, "radius is -1"),
    (((50, 50),), {"radius": math.nan}, "radius is nan"),
    (((50, 50),), {"radius": "5"}, "radius is '5'"),
    (((50, 50),), {"radius": 1e7}, "radius is 1e"),
    (((50, 50),), {"area": 0}, "area is 0"),
    (((50, 50),), {"area": math.inf}, "area is inf"),
    (((50, 50),), {"radius": 5, "area": "1"}, "area is '1'"),
    (((50, 50),), {"radius": 5, "temperature": 0}, "temperature is 0"),
    (((50, 50),), {"radius": 5, "temperature": 1.1}, "temperature is 1.1"),
    (((50, 50),), {"radius": 5, "temperature": math.nan}, "temperature is nan"),
    (((401, 50),), {"radius": 5}, "not on map empty"),
    (((math.nan, 50),), {"radius": 5}, "not on map empty"),
    (((1, 2, 3),), {"radius": 5}, "not on map empty"),
    ((None,), {"radius": 5}, "position"),
    ((5,), {"radius": 5}, "position"),
    (("ab",), {"radius": 5}, "position"),
    ((("a", "b"),), {"radius": 5}, "position"),
]


@pytest.mark.parametrize(
    ("place", "options", "words"), BAD_FIRES, ids=[f"{k}-{b[2][:12]}" for k, b in enumerate(BAD_FIRES)]
)
def test_a_wrong_fire_is_refused_on_one_line_and_none_is_added(place, options, words):
    model = empty()
    with pytest.raises(InvalidValueError, match=words) as caught:
        model.add_fire(*place, **options)
    assert "\n" not in str(caught.value)
    assert len(model.agents) == len(model.fires) == len(model.fires.radius) == 0


@pytest.mark.parametrize("control", ["Avoid", Avoid(), 5, Subsumption, [Avoid(), Explore()]])
def test_what_is_not_an_arbiter_is_refused_and_the_old_one_stays(control):
    model = empty()
    model.control = Subsumption(ahead)
    old = model.control
    with pytest.raises(InvalidValueError, match="expected an arbiter"):
        model.control = control
    assert model.control is old


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_robots_put_where_no_room_is_left_are_refused(engine):
    model = empty(30, 30, engine=engine)
    model.add_robots(blind(), poses=[(15, 15, 0.0)] * 9)
    with pytest.raises(PlacementError, match="no room is left"):
        model.run(3)


@pytest.mark.parametrize(
    ("corner", "size", "radius"),
    [(1e9 - 100, 100, 3.9), (-1e6, 1, 0.003), (0, 400, 1e-6), (0, 1e-11, 9e-13), (0, 1e-150, 1e-151)],
)
def test_robots_smaller_than_what_positions_resolve_are_refused(corner, size, radius):
    model = SwarmModel(map=Map(name="far", bounds=(corner, 0, corner + size, size)))
    for where in ({"n": 1}, {"poses": [(corner, 0, 0)]}):
        with pytest.raises(InvalidValueError, match=r"^radius of a robot is .* expected at least .*: bring") as caught:
            model.add_robots(blind(radius, radius), **where)
        assert len(str(caught.value)) <= 300
    assert not len(model.swarm)


def test_obstacles_too_far_for_small_robots_are_refused_and_marks_are_not():
    model, far = empty(), [(100, 100), (9e8, 100), (9e8, 300)]
    model.add_robots(blind(1.0), 1)
    with pytest.raises(InvalidValueError, match=r"coordinates up to 9e\+08; expected at least 3\.6"):
        model.add_obstacle(polygon(far))
    model.add_obstacle(polygon(far, contact=False))
    other = empty()
    other.add_obstacle(polygon(far))
    with pytest.raises(InvalidValueError, match=r"coordinates up to 9e\+08; expected at least 3\.6"):
        other.add_robots(blind(1.0), 1)
    other.add_robots(blind(5.0), 1)


def test_unknown_names_are_of_the_family_of_errors():
    assert issubclass(UnknownNameError, SwarmError)
    assert issubclass(InvalidValueError, ValueError)


def test_a_seed_given_as_seed_is_refused_with_the_name_that_it_has():
    with pytest.raises(InvalidValueError, match="seed was given to FireFighting; the seed of a model is rng"):
        FireFighting(seed=5)


def test_a_model_may_have_a_parameter_of_this_name():
    class Seeded(SwarmModel):
        def __init__(self, *, seed=3, rng=None):
            super().__init__(rng=rng)
            self.seed = seed

    assert Seeded(seed=5).seed == 5
