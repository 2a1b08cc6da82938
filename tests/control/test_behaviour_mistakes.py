"""Rules that are wrong are refused with the robot, the step and what was expected."""

import math

import pytest

from mesa_swarm import AGENT9, RobotDesign, SwarmModel
from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control import PASS, Explore, Subsumption, behaviour
from support.rules import SEEN, facing_a_disc, step_with


@behaviour
def careless(me, which=99):
    """Read a sensor that is not there."""
    return me.distance[which], 0.0


def test_a_rule_that_returns_nan_is_reported_with_the_robot_the_rule_and_the_step():
    @behaviour
    def late(me):
        return (math.nan if me.distance[me.front] < 10.0 else 0.0), 1.0

    model, robot = facing_a_disc()
    model.control = Subsumption(late, Explore())
    model.run(1)
    robot.position = (203, 150)
    with pytest.raises(
        BehaviourError, match=rf"^rule late failed for robot {robot.unique_id} in step 2: it returned .nan, 1"
    ):
        model.step()


WRONG_RETURNS = {
    "one wheel": (lambda me: 1.0, "returned 1.0"),
    "three wheels": (lambda me: (1.0, 1.0, 1.0), "returned (1.0, 1.0, 1.0)"),
    "one wheel in a tuple": (lambda me: (1.0,), "returned (1.0,)"),
    "nothing": (lambda me: None, "returned None (a branch without return?)"),
    "a text": (lambda me: "ab", "returned 'ab'"),
    "texts": (lambda me: ("1", "2"), "returned ('1', '2')"),
    "complex": (lambda me: (1j, 1.0), "returned (1j, 1.0)"),
    "nested": (lambda me: ((1.0, 2.0), 1.0), "returned ((1.0, 2.0), 1.0)"),
    "yes and no": (lambda me: (True, False), "returned (True, False)"),
    "nan": (lambda me: (math.nan, 1.0), "returned (nan, 1)"),
    "half a PASS": (lambda me: (math.inf, 1.0), "returned (inf, 1)"),
    "the other half": (lambda me: (1.0, math.inf), "returned (1, inf)"),
}


@pytest.mark.slow
@pytest.mark.parametrize("plain", [False, True], ids=["compiled", "plain"])
@pytest.mark.parametrize("name", WRONG_RETURNS)
def test_what_no_wheel_can_do_is_refused_with_robot_rule_step_what_was_got_and_what_is_expected(name, plain):
    function, words = WRONG_RETURNS[name]

    def slow(me):
        SEEN.append(f"{me.radius}")
        return function(me)

    model, robot = facing_a_disc()
    model.control = Subsumption(behaviour(slow if plain else function))
    with pytest.raises(BehaviourError) as caught:
        model.step()
    message = str(caught.value)
    rule = "slow" if plain else "<lambda>"
    assert message.startswith(
        f"rule {rule} failed for robot {robot.unique_id} in step 1: it {words}; expected two finite"
    )
    assert "\n" not in message


def test_a_branch_that_no_robot_has_come_to_is_refused_too():
    def three_when_hot(me):
        if me.hot:
            return 1.0, 1.0, 1.0
        return PASS

    def writes_when_hot(me):
        if me.hot:
            me.distance[0] = 5.0
        return PASS

    def misspelt_when_hot(me):
        if me.hot:
            return me.maxspeed, 0.0
        return PASS

    with pytest.raises(BehaviourError, match="step 1: it does not return two wheel speeds in every branch"):
        step_with(behaviour(three_when_hot))
    with pytest.raises(BehaviourError, match="step 1: it changes its readings"):
        step_with(behaviour(writes_when_hot))
    with pytest.raises(BehaviourError, match=r"step 1: it uses an unknown field of me 'maxspeed'.* mean 'max_speed'"):
        step_with(behaviour(misspelt_when_hot))


@pytest.mark.parametrize("plain", [False, True], ids=["compiled", "plain"])
def test_an_error_of_the_rule_is_reported_with_the_robot_and_attached_as_its_cause(plain):
    def careful(me, slow=plain):
        if slow:
            SEEN.append("")
        if me.radius > 4.5:
            raise ValueError("too wide\nfor this")
        return PASS

    model, _ = facing_a_disc()
    model.remove_robots(model.robots)
    model.add_robots(RobotDesign(radius=4.0), poses=[(50, 50, 0.0)])
    (wide,) = model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(behaviour(careful))
    with pytest.raises(
        BehaviourError, match=rf"robot {wide.unique_id} in step 1: it raised ValueError: too wide for"
    ) as caught:
        model.step()
    assert isinstance(caught.value.__cause__, ValueError)


@pytest.mark.parametrize("which", [99, 9, -2])
def test_a_rule_that_reads_a_sensor_that_is_not_there_is_reported_instead_of_reading_elsewhere(which):
    with pytest.raises(BehaviourError, match="IndexError: this sensor does not exist") as caught:
        step_with(careless(which=which))
    assert isinstance(caught.value.__cause__, IndexError)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("field", "cure"),
    [
        ("send.count", "there is no radio with messages; set model.communication = Radio(range=100, message="),
        ("heard.n", "there is no radio with messages; set model.communication = Radio(range=100, message="),
        ("act.lamp", "no robot has an actuator; give the design some, as in RobotDesign(actuators=(Lamp(),))"),
        ("memory.n", "the rule has no memory; declare it, as in @behaviour(memory={'count': 0})"),
    ],
)
@pytest.mark.parametrize("plain", ["", "str({})"])
def test_a_part_that_is_missing_is_named_rather_than_a_field_of_a_similar_name(field, cure, plain):
    space = {"PASS": PASS}
    exec(f"def rule(me):\n    {plain}\n    return (0.0, 0.0) if me.{field} > 1 else PASS\n", space)
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, 1)
    model.control = Subsumption(behaviour(space["rule"]))
    with pytest.raises(BehaviourError) as caught:
        model.run(1)
    assert f"it uses me.{field.partition('.')[0]}, but {cure}" in str(caught.value)
    assert "did you mean" not in str(caught.value)
