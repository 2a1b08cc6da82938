"""What handles return cannot be written to, and is an array like any other in all else."""

import copy
import operator
import pickle

import mesa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import AGENT9, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.recording import record
from mesa_swarm.world.read_only import ReadOnlyArray, read_only

OPERATORS = [operator.iadd, operator.isub, operator.imul, operator.itruediv, operator.imod]
ROWS = arrays(np.float64, (2,), elements=st.floats(0.5, 100))


def world():
    """Return a model with a thing of each kind, some steps after its beginning."""
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(RobotDesign(name="charged", battery=100, sensors=AGENT9.sensors), 3)
    model.control = Subsumption(Avoid(), Explore())
    model.add_fire((400, 300), radius=20)
    model.add_load(disc((200, 200), 10), resistance=1)
    model.add_obstacle(rectangle((600, 400), (640, 420)))
    model.add_body(disc((500, 100), 5), kind="puck")
    ContinuousSpaceAgent(model.space, model).position = (50, 50)
    model.run(5)
    model.event("began")
    return model


def properties_of(owner):
    """Return the values of all public properties by name."""
    names = [name for name in dir(type(owner)) if isinstance(getattr(type(owner), name), property)]
    return {name: getattr(owner, name) for name in names if not name.startswith("_")}


def arrays_of(owner):
    return {name: value for name, value in properties_of(owner).items() if isinstance(value, np.ndarray)}


def owners(model):
    agents = {type(agent).__name__: agent for agent in model.agents}
    return {**agents, "Swarm": model.swarm, "Fires": model.fires, "EventLog": model.events}


def test_no_array_that_a_handle_or_a_table_returns_can_be_written_to():
    model, seen = world(), set()
    before = model.state_hash()
    for kind, owner in owners(model).items():
        for name, value in arrays_of(owner).items():
            seen.add(f"{kind}.{name}")
            with pytest.raises(ValueError, match=r"set the property as a whole|read-only"):
                value[...] = 0
    assert {"Robot.position", "Fire.position", "Obstacle.position", "Load.position", "Driven.position"} <= seen
    assert {"ContinuousSpaceAgent.position", "Swarm.battery", "EventLog.value", "Fires.discs", "Robot.slip"} <= seen
    assert model.state_hash() == before


@given(ROWS, ROWS, st.sampled_from(OPERATORS))
def test_an_augmented_assignment_makes_an_ordinary_array_with_the_same_values(row, other, compute):
    value = read_only(row.copy())
    result = compute(value, other)
    assert type(result) is np.ndarray
    assert result.tolist() == compute(row.copy(), other).tolist()
    assert value.tolist() == row.tolist()


@given(ROWS)
def test_whatever_is_computed_copied_or_pickled_is_an_ordinary_array(row):
    value = read_only(row.copy())
    made = [value + 1, value.copy(), copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))]
    made += [np.hypot(value, 1), np.concatenate([value, value]), np.array(value), value @ np.eye(2)]
    assert {type(array) for array in made} == {np.ndarray}
    assert all(array.flags.writeable for array in made)
    assert type(value.sum()) is np.float64
    assert repr(value) == repr(row)


def test_a_robot_a_door_and_an_agent_of_mesa_are_moved_by_augmented_assignment():
    model = world()
    door = next(body for body in model.bodies if body.kind == "puck")
    (agent,) = model.agents_by_type[ContinuousSpaceAgent]
    for thing in (model.robots[0], door, agent):
        place = thing.position.copy()
        thing.position += (2.0, 1.0)
        model.run(0)
        aim = door.movers.aim[door.row] if thing is door else thing.position
        assert aim.tolist() == [place[0] + 2.0, place[1] + 1.0]


def test_what_was_read_can_be_declared_state_and_is_stored(tmp_path):
    class Home(mesa.Agent):
        """Remembers a place."""

    model = world()
    model.state["home"] = model.robots[0].position
    Home(model).place = model.robots[1].position
    with record(model, tmp_path / "run.arrow", rerun=False) as recorder:
        model.run(2)
    assert recorder.why_no_checkpoint == ""
    assert isinstance(model.state["home"], ReadOnlyArray)


def test_the_error_names_the_way_to_change_the_thing():
    (robot,) = SwarmModel(rng=1).add_robots(AGENT9, 1)
    with pytest.raises(InvalidValueError, match=r"set the property as a whole, as in robot\.position = \(x, y\)"):
        robot.position[0] = 77.0
