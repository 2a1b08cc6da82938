"""Custom sensors: what they read, where their readings appear, and what is refused."""

import copy
import math
import pickle
import warnings
from dataclasses import dataclass, fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, ProximitySensor, RadiationSensor, Recording, RobotDesign, Sensor, SwarmModel
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, UncompiledBehaviourWarning, UnknownNameError
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.control.custom_fields import WRITTEN
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.rule import Me
from mesa_swarm.recording.layout import FIRST_COLUMNS, TABLES
from mesa_swarm.robots import swarm
from mesa_swarm.robots.devices import OF_FUNCTIONS, RESERVED
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from mesa_swarm.robots.sensors import LineSensor


@dataclass(frozen=True, kw_only=True)
class Compass(Sensor):
    name: str = "compass"
    gain: float = 1.0
    minimum: float = -math.pi
    maximum: float = math.pi

    @staticmethod
    def read(heading, gain, out):
        for i in range(len(out)):
            out[i, 0] = -heading[i] * gain


@dataclass(frozen=True, kw_only=True)
class Pair(Sensor):
    name: str = "pair"
    width: int = 2

    @staticmethod
    def read(position, rows, far, out):
        for i in range(len(out)):
            out[i, 0] = rows[i]
            out[i, 1] = position[i, 0] + far

    def arguments(self, model):
        return {"far": 1000.0 * model.steps}


WITH = RobotDesign(name="with", sensors=(Compass(),))
TWICE = RobotDesign(name="twice", sensors=(Compass(gain=2.0), ProximitySensor(), Compass(gain=3.0)))
POSES = [(100.0 + 50 * k, 100.0, 0.1 * k) for k in range(4)]


def mixed(**options):
    model = SwarmModel(rng=1, **options)
    for design, pose in zip((WITH, AGENT9, TWICE, WITH), POSES, strict=True):
        model.add_robots(design, poses=[pose])
    return model


def test_every_sensor_is_a_sensor():
    assert all(isinstance(one, Sensor) for one in (ProximitySensor(), RadiationSensor(), LineSensor(), Compass()))


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_robots_without_a_sensor_read_nan_and_sensors_of_one_name_stand_side_by_side(engine):
    model = mixed(engine=engine)
    model.sense()
    nan, heading = math.nan, model.swarm.heading
    expected = [[-heading[0], nan], [nan, nan], [-2.0 * heading[2], -3.0 * heading[2]], [-heading[3], nan]]
    np.testing.assert_array_equal(model.swarm.compass, expected)
    assert [robot.compass.shape for robot in model.robots] == [(1,), (0,), (2,), (1,)]


def test_a_sensor_gets_the_rows_of_its_robots_and_what_its_arguments_return():
    model = SwarmModel(rng=1)
    for design, pose in zip((AGENT9, RobotDesign(sensors=(Pair(),))), POSES, strict=False):
        model.add_robots(design, poses=[pose])
    model.run(2).sense()
    assert model.swarm.pair[1].tolist() == [1.0, 2000.0 + model.swarm.position[1, 0]]


@given(st.permutations(range(4)))
@settings(max_examples=10, deadline=None)
def test_readings_do_not_depend_on_the_order_in_which_robots_are_added(order):
    model = SwarmModel(rng=1)
    designs = (WITH, AGENT9, TWICE, WITH)
    for k in order:
        model.add_robots(designs[k], poses=[POSES[k]])
    expected = mixed()
    for one in (model, expected):
        one.sense()
    np.testing.assert_array_equal(model.swarm.compass, expected.swarm.compass[list(order)])


def test_a_reading_is_that_of_now_though_only_what_it_reads_has_changed():
    model = SwarmModel(rng=1)
    model.prey = 1.0

    @dataclass(frozen=True, kw_only=True)
    class Smell(Sensor):
        name: str = "smell"

        @staticmethod
        def read(prey, out):
            out[:, 0] = prey

        def arguments(self, model):
            return {"prey": model.prey}

    (robot,) = model.add_robots(RobotDesign(sensors=(Smell(),)), 1)
    model.sense()
    model.prey = 2.0
    model.sense()
    assert robot.smell.tolist() == [2.0]


def test_rules_layers_copies_and_recordings_see_the_readings(tmp_path):
    @behaviour
    def north(me):
        return (1.0, 0.5) if me.compass[0] < 0 else (0.5, me.compass[me.line.size - 1] * 0.0 + 1.0)

    model = SwarmModel(rng=1)
    model.add_robots(RobotDesign(sensors=(Compass(), LineSensor())), 5)
    model.control = Subsumption(north)
    copies = [copy.deepcopy(model), pickle.loads(pickle.dumps(Senses.of(model.swarm)))]
    with model.record(tmp_path / "run.swarm", columns=("heading", "compass")):
        model.run(5)
    assert copies[0].run(5).state_hash() == model.state_hash()
    assert copies[1].own["compass"].shape == (5, 1)
    recording = Recording(tmp_path / "run.swarm")
    # Recorded are the readings after the step, for the poses that are recorded with them.
    np.testing.assert_allclose(recording["compass"][..., 0], -recording["heading"], atol=1e-6)


def test_what_is_not_there_reads_nan_in_a_rule():
    @behaviour
    def rule(me):
        ok = math.isnan(me.compass[-1]) and math.isnan(me.compass[1])
        return (1.0, 1.0) if ok else (0.0, 0.0)

    model = mixed()
    model.control = Subsumption(rule)
    model.step()
    assert model.swarm.command[:, 0].tolist() == [1.0, 1.0, 0.0, 1.0]


def test_imperfections_spoil_readings_within_their_limits_and_alike_for_every_reading_of_a_step():
    model = SwarmModel(rng=1)
    model.add_robots(WITH, 200)
    model.imperfections = Imperfections(sensing=Imperfection(error=0.5, dropout=0.3, outliers=0.3))
    model.sense()
    first = model.swarm.compass.copy()
    model.sense()
    np.testing.assert_array_equal(first, model.swarm.compass)
    lost = np.isnan(first).mean()
    assert 0.2 < lost < 0.4
    assert np.nanmax(np.abs(first)) <= math.pi
    model.imperfections = None
    model.sense()
    np.testing.assert_array_equal(model.swarm.compass[:, 0], -model.swarm.heading)
    assert not [name for name in model.swarm.columns if name.startswith("body.")]


def test_readings_come_late_where_imperfections_have_a_period():
    model = SwarmModel(rng=1)
    model.add_robots(WITH, poses=[(200, 200, 0.5)])
    model.imperfections = Imperfections(sensing=Imperfection(period=3))
    model.control = Subsumption(behaviour(lambda me: (0.5, 1.0)))
    model.sense()
    before = model.swarm.compass.copy()
    model.run(2).sense()
    assert model.swarm.compass == before
    model.run(1).sense()
    assert model.swarm.compass == -model.swarm.heading


def test_a_sensor_that_cannot_be_compiled_reads_the_same_with_one_warning():
    class Slow(Compass):
        @staticmethod
        def read(heading, out):
            assert str(open)
            for i in range(len(out)):
                out[i, 0] = -heading[i]

    model = SwarmModel(rng=1)
    model.add_robots(RobotDesign(sensors=(Slow(),)), 3)
    with pytest.warns(UncompiledBehaviourWarning, match="Slow.read cannot be compiled and runs as plain Python"):
        model.sense()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.run(2).sense()
    np.testing.assert_array_equal(model.swarm.compass[:, 0], -model.swarm.heading)


@pytest.mark.parametrize("compiles", [True, False])
def test_an_error_in_a_sensor_names_it_in_one_line(compiles):
    class Wrong(Compass):
        @staticmethod
        def read(heading, out):
            out[len(heading), 0] = 1.0 if compiles else len(str(open))

    model = SwarmModel(rng=1)
    model.add_robots(RobotDesign(sensors=(Wrong(),)), 3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(BehaviourError, match="sensor compass failed in step 0: it raised IndexError"):
            model.sense()


def test_a_sensor_cannot_change_what_it_reads():
    class Writes(Compass):
        @staticmethod
        def read(heading, out):
            heading[0] = 1.0

    model = SwarmModel(rng=1)
    model.add_robots(RobotDesign(sensors=(Writes(),)), 3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(BehaviourError, match="read-only"):
            model.sense()


class NoRead(Sensor):
    name = "none"


class WithoutOut(Compass):
    @staticmethod
    def read(heading):
        pass


class AMethod(Compass):
    def read(self, out):
        pass


class Stars(Compass):
    @staticmethod
    def read(*out):
        pass


@dataclass(kw_only=True)
class Changeable(Sensor):
    name: str = "compass"
    read = Compass.__dict__["read"]


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        (lambda: Compass(name="heading"), "robots have already"),
        (lambda: Compass(name="no word"), "expected one word"),
        (lambda: Compass(name="lambda"), "expected one word"),
        (lambda: Compass(name=3), "expected one word"),
        (lambda: Pair(width=0), "at least 1"),
        (lambda: Pair(width=math.nan), "whole number"),
        (NoRead, "has no function read"),
        (WithoutOut, "takes no parameter out"),
        (AMethod, "staticmethod"),
        (Stars, "expected plain names"),
        (Changeable, "cannot be hashed"),
        (lambda: Compass, "expected sensors"),
    ],
)
def test_a_sensor_that_cannot_be_used_is_refused_by_the_design(sensor, words):
    with pytest.raises(InvalidValueError, match=words):
        RobotDesign(sensors=(sensor(),))


class Mistyped(Compass):
    @staticmethod
    def read(headng, out):
        pass


def test_an_unknown_parameter_is_refused_with_the_nearest_name_before_anything_is_added():
    model = SwarmModel(rng=1)
    before = model.state_hash()
    with pytest.raises(
        UnknownNameError, match=r"unknown parameter of Mistyped.read 'headng'; did you mean 'heading'\?"
    ):
        model.add_robots(RobotDesign(sensors=(Mistyped(),)), 1)
    assert model.state_hash() == before
    assert len(model.swarm) == 0


def test_an_unknown_name_of_a_robot_stays_an_attribute_error():
    (robot,) = SwarmModel(rng=1).add_robots(WITH, 1)
    with pytest.raises(AttributeError, match="'Robot' object has no attribute 'compas'"):
        _ = robot.compas


def test_no_sensor_can_have_a_name_that_rules_layers_or_recordings_have():
    model = SwarmModel(rng=1)
    (robot,) = model.add_robots(WITH, 1)
    senses = {field.name for field in fields(Senses)}
    recorded = {*TABLES, *FIRST_COLUMNS}
    own = {*dir(model.swarm), *vars(model.swarm), *dir(robot), *vars(robot)}
    known = {*Me._fields, *WRITTEN, *senses, *recorded, *own, *OF_FUNCTIONS} - {"compass"}
    assert {name for name in known if not name.startswith("_")} == RESERVED


def test_a_name_that_was_reserved_after_the_design_was_made_is_refused_before_anything_is_added(monkeypatch):
    design, model = RobotDesign(sensors=(Compass(name="gyro"),)), SwarmModel(rng=1)
    monkeypatch.setattr(swarm, "RESERVED", {*RESERVED, "gyro"})
    with pytest.raises(InvalidValueError, match=r"^name of sensor Compass is 'gyro', which robots have already"):
        model.add_robots(design, 1)
    assert not model.swarm.designs


def test_a_sensor_with_the_name_of_something_else_of_the_swarm_is_refused():
    model = SwarmModel(rng=1)
    model.swarm.remember("energy", (), float, 1.0)
    with pytest.raises(InvalidValueError, match="sensor energy has the name of something else"):
        model.add_robots(RobotDesign(sensors=(Compass(name="energy"),)), 1)
    assert len(model.swarm) == 0
