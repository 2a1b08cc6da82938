"""Sensors of fields and emitters into them: where they are on a robot, what they read and give, what is refused."""

from dataclasses import dataclass

import numpy as np
import pytest

from mesa_swarm import (
    AGENT3,
    Actuator,
    Emitter,
    Field,
    FieldSensor,
    Radio,
    Recording,
    RobotDesign,
    SwarmModel,
    rectangle,
)
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, SwarmError
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.recording import verify

ANTENNAE = FieldSensor(field="trail", mount=(5, 2)), FieldSensor(field="trail", mount=(5, -2))
ANT = RobotDesign(name="ant", sensors=ANTENNAE, actuators=(Emitter(field="trail", mount=(-5, 0), rate=3.0),))


def world(cell=10.0, **options):
    model = SwarmModel(rng=1, **options)
    field = model.add_field(Field("trail", cell=cell))
    field.values = np.random.default_rng(1).random(field.values.shape)
    return model, field


def at_mount(model, x, y):
    cos, sin = np.cos(model.swarm.heading), np.sin(model.swarm.heading)
    return model.swarm.position + np.column_stack([cos * x - sin * y, sin * x + cos * y])


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_antennae_read_the_field_where_they_are(engine):
    model, field = world(engine=engine)
    model.add_robots(ANT, 20)
    model.sense()
    assert model.swarm.trail.shape == (20, 2)
    np.testing.assert_allclose(model.swarm.trail[:, 0], field.at(at_mount(model, 5, 2)), rtol=1e-12)
    np.testing.assert_allclose(model.swarm.trail[:, 1], field.at(at_mount(model, 5, -2)), rtol=1e-12)


def test_robots_without_antennae_read_nan():
    model, _ = world()
    model.add_robots(AGENT3, 2)
    model.add_robots(ANT, 2)
    model.sense()
    assert np.isnan(model.swarm.trail[:2]).all()
    assert np.isfinite(model.swarm.trail[2:]).all()


def test_antennae_beyond_the_border_read_the_nearest_cell():
    model, field = world()
    (robot,) = model.add_robots(ANT, poses=[(796, 300, 0.0)])
    model.sense()
    assert robot.trail[0] == pytest.approx(field.at((800, 302))[0])


def test_an_emitter_deposits_its_rate_behind_the_robot_before_that_moves():
    model, field = world()
    field.values = np.zeros(field.values.shape)
    (robot,) = model.add_robots(ANT, poses=[(100, 305, 0.0)])
    model.swarm.columns["command"][:] = 1.0
    model.swarm.columns["act.trail"][:] = 0.5
    model.step()
    assert field.values[30, 9] == pytest.approx(1.5)
    assert robot.position[0] > 100
    assert field.total == pytest.approx(1.5)


def test_an_emitter_in_a_wall_deposits_on_the_robots_side():
    model, field = world()
    model.add_obstacle(rectangle((60, 200), (94, 400)))
    field.values = np.zeros(field.values.shape)
    model.add_robots(ANT, poses=[(99.5, 305, 0.0)])
    model.swarm.columns["act.trail"][:] = 1.0
    model.step()
    assert field.values[30, 9] == pytest.approx(3.0)


@behaviour
def follow(me):
    me.act.trail = 1.0
    if me.trail[0] > me.trail[1]:
        return 0.5, 1.0
    return 1.0, 1.0


class Following(SwarmModel):
    """Robots with a rule that reads and emits."""

    def __init__(self, *, n_robots=6, map="openspace", rng=None):
        super().__init__(map=map, rng=rng)
        self.add_field(Field("trail", diffusion=1.0, evaporation=0.02))
        self.add_robots(ANT, n_robots)
        self.control = Subsumption(follow)


def test_a_rule_reads_antennae_and_emits(tmp_path):
    model = Following(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(20)
    expected = sum(6 * 3.0 * 0.98**age for age in range(1, 21))
    assert model.fields["trail"].total == pytest.approx(expected, rel=1e-9)
    assert verify(Recording(tmp_path / "run.arrow"), Following).same
    assert Recording(tmp_path / "run.arrow").checkpoints == (0,)
    again = Following.resume(tmp_path / "run.arrow")
    assert again.run(5).state_hash() == model.run(5).state_hash()


def test_less_than_nothing_cannot_be_emitted():
    model, field = world()
    model.add_robots(ANT, 2)
    model.swarm.columns["act.trail"][1] = -1.0
    before = field.total
    with pytest.raises(BehaviourError, match=r"act.trail of robot \d+ would deposit -3; expected 0 to") as caught:
        model.step()
    assert "\n" not in str(caught.value)
    assert field.total == before


def test_robots_with_a_part_for_a_missing_field_are_refused_in_one_line_that_names_the_fields():
    model = SwarmModel(rng=1)
    before = model.state_hash()
    with pytest.raises(SwarmError, match=r"^unknown field 'trail'; add it with model.add_field\(Field\(...\)\)$"):
        model.add_robots(RobotDesign(sensors=(FieldSensor(field="trail"),)), 1)
    assert model.state_hash() == before
    assert not model.swarm.designs
    model, _ = world()
    with pytest.raises(SwarmError, match=r"^unknown field 'trial'; did you mean 'trail'.*"):
        model.add_robots(RobotDesign(actuators=(Emitter(field="trial"),)), 1)
    assert not len(model.robots)
    assert model.run(2).steps == 2
    model.add_field(Field("trial"))
    assert len(model.add_robots(RobotDesign(actuators=(Emitter(field="trial"),)), 1)) == 1


def test_a_custom_part_may_refuse_a_model_before_robots_are_added():
    @dataclass(frozen=True, kw_only=True)
    class Beeper(Actuator):
        name: str = "beep"

        def check_model(self, model):
            if model.communication is None:
                raise InvalidValueError("a Beeper needs model.communication; set it first")

    model = SwarmModel(rng=1)
    with pytest.raises(InvalidValueError, match=r"^a Beeper needs model.communication"):
        model.add_robots(RobotDesign(actuators=(Beeper(),)), 1)
    model.communication = Radio(range=100)
    assert len(model.add_robots(RobotDesign(actuators=(Beeper(),)), 1)) == 1


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: FieldSensor(field="two words"),
        lambda: FieldSensor(field="trail", mount=None),
        lambda: FieldSensor(field="trail", mount=(1, np.nan)),
        lambda: Emitter(field=3),
        lambda: Emitter(field="trail", rate=-1.0),
        lambda: Emitter(field="trail", rate=np.inf),
        lambda: RobotDesign(sensors=(FieldSensor(field="heading"),)),
    ],
)
def test_wrong_parts_are_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as caught:
        wrong()
    assert "\n" not in str(caught.value)


def test_parts_are_named_after_their_field_unless_they_have_a_name():
    assert FieldSensor(field="trail").name == "trail"
    assert FieldSensor(field="trail", name="nose").name == "nose"
    assert Emitter(field="trail") == Emitter(field="trail", name="trail")
