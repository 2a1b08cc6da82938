import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, AGENT_FIRE, LineSensor, ProximitySensor, RadiationSensor, RobotDesign, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.environments.scores import ObservationEncoder
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import ExtinguishFires, FindFires
from mesa_swarm.world.statics import FIRE, OBSTACLE, ROBOT
from support.scenes import empty

EYE = RobotDesign(name="EYE", sensors=(ProximitySensor(range=40), RadiationSensor(range=60), LineSensor()))


def observed(model: SwarmModel, observer: ObservationEncoder) -> np.ndarray:
    model.sense()
    out = np.full((len(model.swarm), observer.width), np.nan)
    observer.observe(model.swarm.columns, out)
    return out


def test_a_reading_is_a_share_of_the_range_and_nothing_seen_is_1():
    model = empty()
    model.add_robots(EYE, poses=[(100, 100, 0.0), (200, 200, 0.0)])
    model.add_obstacle(disc((135, 100), 10))
    assert np.allclose(observed(model, ObservationEncoder(EYE, encoding="distance"))[:, 0], [20 / 40, 1.0])


@pytest.mark.parametrize("kind", [OBSTACLE, ROBOT, FIRE])
def test_a_typed_observation_has_a_block_for_each_kind(kind):
    model = empty()
    model.add_robots(EYE, poses=[(100, 100, 0.0)])
    if kind == OBSTACLE:
        model.add_obstacle(disc((130, 100), 5))
    elif kind == ROBOT:
        model.add_robots(EYE, poses=[(130, 100, 0.0)])
    else:
        model.add_fire((130, 100), radius=5, temperature=0.25)
    row = observed(model, ObservationEncoder(EYE, encoding="typed"))[0]
    assert np.allclose(row[:4], [0.5, kind == OBSTACLE, kind == ROBOT, kind == FIRE])
    assert row[4] == (0.25 if kind == FIRE else 0.0)


def test_a_line_sensor_is_observed_as_0_or_1():
    model = empty()
    model.add_robots(EYE, poses=[(100, 100, 0.0), (200, 200, 0.0)])
    model.add_obstacle(disc((100, 100), 3, contact=False))
    assert observed(model, ObservationEncoder(EYE, encoding="distance"))[:, 2].tolist() == [1.0, 0.0]


def test_the_body_reports_its_temperature_and_whether_it_is_hot_takes_heat_and_extinguishes():
    model = empty()
    model.add_robots(AGENT_FIRE, 4)
    columns = model.swarm.columns
    columns["temperature"][:] = [0, 25, 50, 80]
    columns["hot"][2:] = True
    columns["heat"][1:3] = 0.5
    columns["fire"][1] = 0
    out = observed(model, ObservationEncoder(AGENT_FIRE, encoding="distance", body=True, leave=50.0))
    assert out[:, -4:].tolist() == [[0, 0, 0, 0], [0.5, 0, 1, 1], [1, 1, 1, 0], [1, 1, 0, 0]]


@pytest.mark.slow
@given(st.integers(0, 10_000), st.sampled_from(["distance", "typed"]))
def test_observations_agree_with_numpy_and_lie_within_0_and_1(seed, encoding):
    task = FindFires(n_robots=40, encoding=encoding)
    world = TaskWorld(task=task, commanded=40, rng=seed)
    out = np.full((40, task.observer().width), np.nan, np.float32)
    world.observe(out)
    swarm = world.swarm
    blocks = [np.where(swarm.kind < 0, 1.0, swarm.distance / 50.0)]
    if encoding == "typed":
        blocks += [swarm.kind == kind for kind in (OBSTACLE, ROBOT, FIRE)]
    assert np.array_equal(out, np.hstack([*blocks, swarm.radiation]).astype(np.float32))
    assert (out >= 0).all()
    assert (out <= 1).all()


def test_pose_and_slip_are_not_observed():
    task = ExtinguishFires(n_robots=5)
    world = TaskWorld(task=task, commanded=5, rng=1)
    before, after = np.empty((2, 5, 41), np.float32)
    world.observe(before)
    world.swarm.columns["position"] += 0.123
    world.swarm.columns["slip"][:] = 0.5
    world.swarm.columns["number"] += 7
    world.observe(after)
    assert np.array_equal(before, after)


@pytest.mark.parametrize("sensors", [(), (ProximitySensor(range=0),), (RadiationSensor(),)])
def test_a_design_that_sees_nothing_is_refused(sensors):
    with pytest.raises(InvalidValueError, match=r"^design blind has no proximity sensors, or one of range 0"):
        FindFires(design=RobotDesign(name="blind", sensors=sensors))


def test_an_unknown_encoding_is_refused():
    with pytest.raises(UnknownNameError, match=r"^unknown encoding 'type'; did you mean 'typed'\?"):
        ObservationEncoder(AGENT9, encoding="type")
