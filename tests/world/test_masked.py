"""What is masked is not there: coordinates and amounts that are masked are refused, whatever lies beneath."""

from types import SimpleNamespace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, Field, Radio, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.control import behaviour
from mesa_swarm.control.conditions import own_chances
from mesa_swarm.environments.actions import shares
from mesa_swarm.experiments.controllers import _actions_of
from mesa_swarm.experiments.runs import numbers_of
from mesa_swarm.learning import QPolicy, ReflexPolicy
from mesa_swarm.learning.actions import boltzmann
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.model.looks import Chart


def masked(*numbers, at=0):
    """Return numbers of which one is masked."""
    return np.ma.array(numbers, mask=[k == at for k in range(len(numbers))])


@pytest.fixture
def model():
    """Return a model with a robot, a door and a field."""
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, poses=[(100, 100, 0)])
    model.add_body(rectangle((300, 300), (310, 340)), kind="door")
    model.add_field(Field("trail", cell=50.0))
    return model


TABLE = np.ma.array([[100.0, 200.0, 0.0], [150.0, 200.0, 0.0]], mask=[[0, 0, 0], [1, 1, 1]])
OUTLINE = np.ma.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0], [5.0, 9.0]], mask=[[0, 0], [0, 0], [0, 0], [1, 1]])
REFUSED = {
    "a pose of a table": lambda model: model.add_robots(AGENT9, poses=TABLE),
    "a pose of a list": lambda model: model.add_robots(AGENT9, poses=list(TABLE)),
    "a heading of a pose": lambda model: model.add_robots(AGENT9, poses=[masked(150.0, 200.0, 0.0, at=2)]),
    "a number of a pose": lambda model: model.add_robots(AGENT9, poses=[(150.0, np.ma.masked, 0.0)]),
    "a robot's position": lambda model: setattr(model.robots[0], "position", masked(200.0, 200.0)),
    "a robot's heading": lambda model: setattr(model.robots[0], "heading", np.ma.masked),
    "a body's position": lambda model: setattr(model.bodies[-1], "position", masked(200.0, 200.0)),
    "where a body is to move": lambda model: model.bodies[-1].move_to(masked(200.0, 200.0, 0.0, at=2)),
    "a beacon": lambda model: setattr(model, "communication", Radio(range=100, beacons=(masked(1.0, 2.0),))),
    "where something is deposited": lambda model: model.fields["trail"].deposit(masked(200.0, 200.0), 1.0),
    "how much is deposited": lambda model: model.fields["trail"].deposit([(200, 200), (9, 9)], masked(1.0, 2.0)),
    "where a field is read": lambda model: model.fields["trail"].at([masked(200.0, 200.0)]),
    "a field's values": lambda model: setattr(
        model.fields["trail"], "values", np.ma.masked_equal(np.ones_like(model.fields["trail"].values), 1.0)
    ),
    "the centre of a disc": lambda model: disc(masked(1.0, 2.0), 3),
    "the radius of a disc": lambda model: disc((1.0, 2.0), np.ma.masked),
    "a corner": lambda model: rectangle((0, 0), masked(10.0, 20.0)),
    "an outline as a table": lambda model: polygon(OUTLINE),
    "a point of an outline": lambda model: polygon([(0, 0), (9, 0), masked(0.0, 9.0)]),
    "a hole": lambda model: polygon([(0, 0), (9, 0), (0, 9)], [[masked(1.0, 1.0), (2, 1), (1, 2)]]),
    "an action": lambda model: shares("wheels", np.ma.array([[0.5, 0.5]], mask=[[0, 1]]), (1,), False, 2),
    "the number of an action": lambda model: shares(5, masked(1, 2), (2,), False, 2),
    "the start of a search": lambda model: Evolution(masked(0.0, 1.0, 2.0), sigma=1.0, population=4, seed=1),
    "a value": lambda model: boltzmann(masked(0.0, 1.0), 1.0),
    "memory of a rule": lambda model: behaviour(memory={"opinion": masked(1, 2)})(lambda me: None),
}


@pytest.mark.parametrize("what", REFUSED)
@pytest.mark.filterwarnings("ignore:Warning. converting a masked element to nan")
def test_what_is_masked_is_refused_in_one_line(what, model):
    before = model.state_hash()
    with pytest.raises(SwarmError) as caught:
        REFUSED[what](model)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 300
    assert model.state_hash() == before


def test_a_pose_that_is_nan_is_refused_as_a_masked_one_is():
    for poses in (TABLE, TABLE.filled(np.nan), TABLE.filled(np.nan).tolist()):
        with pytest.raises(InvalidValueError, match="is not on map openspace; expected x and y within"):
            SwarmModel(rng=1).add_robots(AGENT9, poses=poses)


def test_poses_whose_mask_masks_nothing_are_those_without_it():
    one, two = SwarmModel(rng=1), SwarmModel(rng=1)
    one.add_robots(AGENT9, poses=TABLE.data)
    two.add_robots(AGENT9, poses=np.ma.array(TABLE.data))
    assert one.state_hash() == two.state_hash()
    assert polygon(np.ma.array([[0.0, 0], [9, 0], [0, 9]])) == polygon([(0, 0), (9, 0), (0, 9)])


def test_masked_numbers_of_a_user_are_none():
    assert numbers_of({"mean": np.ma.masked, "share": np.ma.array(0.5), "none": np.ma.array(0.5, mask=True)}) == {
        "mean": None,
        "share": 0.5,
        "none": None,
    }
    assert _actions_of(np.ma.array([[0.5, 0.5]], mask=[[0, 1]]), 1, "wheels", 2) is None
    assert np.isnan(Chart("x", lambda model: np.ma.masked).measure(None)).all()


def test_masked_readings_kinds_and_weights_of_a_policy_are_refused():
    policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    sensors, readings = policy.sensors, np.full((1, 3), 9.0)
    gone = np.ma.array(readings, mask=[[0, 1, 0]])
    with pytest.raises(InvalidValueError, match=r"^readings hold NaN or infinity"):
        sensors.check_readings(gone, None)
    with pytest.raises(InvalidValueError, match=r"^readings are .* and kinds"):
        sensors.check_readings(readings, np.ma.array([[0, 1, 0]], mask=[[0, 1, 0]]))
    weights = np.ma.array(np.ones((4, 2)), mask=np.eye(4, 2))
    with pytest.raises(InvalidValueError, match="weights that are not finite"):
        ReflexPolicy.reflex(sensors, weights)


class Half:
    """A condition of which one chance is masked."""

    def chances(self, senses):
        """Return a masked number."""
        return masked(0.5, 0.5)


def test_masked_chances_of_a_condition_are_refused():
    with pytest.raises(InvalidValueError, match=r"^chances of Half returned"):
        own_chances(Half(), SimpleNamespace(design=np.zeros(2)))
