"""State machines: twins of conditions and states, their text, and that state is hashed, recorded and resumed."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, AGENT_HEAT, LineSensor, RobotDesign, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import (
    Approach,
    Avoid,
    Chance,
    Condition,
    Explore,
    Follow,
    Halt,
    HeatSensed,
    OffMark,
    OnMark,
    Retreat,
    RobotsSeen,
    Seen,
    Senses,
    StateMachine,
    Subsumption,
    Transition,
    Unseen,
    behaviour,
)
from mesa_swarm.fire import FightFire
from mesa_swarm.model.state_hash import written_state_hash
from support.made_senses import ROBOT, ROBOTS, decided, known_to, made_drivers, made_senses
from support.scenes import empty

KINDS = ("obstacle", "robot", "fire", "load")
GATHERING = """search: Avoid(distance=5), Approach(), Explore()
part: Avoid(distance=5), Retreat(), Explore(speed=0.5, turn_interval=7)
stay: Halt()
search -> stay: RobotsSeen(number=3)
stay -> part: Chance(probability=0.02)
part -> search: Chance(probability=0.05)
"""


def gathering(**options):
    model = empty(300, 300, rng=4, **options)
    model.add_robots(AGENT9, 12)
    model.control = StateMachine.read(GATHERING)
    return model


shares = st.floats(0, 1)
sensed_kinds = st.sampled_from([*KINDS, "anything"]) | st.integers(0, 9)
conditions = st.one_of(
    st.builds(Chance, probability=shares),
    st.builds(OnMark, probability=shares),
    st.builds(OffMark, probability=shares),
    st.builds(HeatSensed, probability=shares, above=shares),
    st.builds(Seen, probability=shares, kind=sensed_kinds, within=st.floats(0, 1e6)),
    st.builds(Unseen, probability=shares, kind=sensed_kinds, within=st.floats(0, 1e6)),
    st.builds(
        RobotsSeen, probability=shares, number=st.floats(0, 1000), steepness=st.floats(0, 1000), fewer=st.booleans()
    ),
)
names_of_layers = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=8)
layers = st.one_of(
    st.just(Halt()),
    st.builds(Halt, name=names_of_layers),
    st.builds(Avoid, distance=st.floats(0, 1e6), turn=st.sampled_from(["translational", "stationary"])),
    st.builds(Explore, speed=shares, turn_interval=st.integers(0, 2000)),
    st.builds(Follow, gap=st.none() | st.floats(0, 1e6)),
    st.builds(Approach, target=st.sampled_from([*KINDS, "heat", "goal"]), critical_angle_degrees=st.floats(0, 180)),
    st.builds(Retreat, target=st.sampled_from([*KINDS, "heat", "goal"])),
)
names_of_states = st.sampled_from(["a", "search", "go home", "stay-put", "Züge 2", "_"])


@st.composite
def machines(draw):
    states = draw(st.dictionaries(names_of_states, st.lists(layers, min_size=1, max_size=3), min_size=1, max_size=4))
    name = st.sampled_from(sorted(states))
    transitions = st.lists(st.builds(Transition, source=name, target=name, condition=conditions), max_size=6)
    return StateMachine(states, draw(transitions))


@given(machines())
@settings(max_examples=30, deadline=None)
def test_the_text_of_a_machine_reads_back_as_the_same_machine(machine):
    again = StateMachine.read(machine.text())
    assert again == machine
    assert again.text() == str(machine) == machine.text()
    assert again.names == machine.names


def expected_chance(condition, me):
    """Return the probability of a condition as its documentation states it."""
    if isinstance(condition, RobotsSeen):
        sign = -1 if condition.fewer else 1
        exponent = sign * condition.steepness * (condition.number - np.count_nonzero(me.kind == ROBOT))
        return condition.probability / (1 + math.exp(exponent)) if exponent < 700 else 0.0
    if isinstance(condition, Seen):
        wanted = me.kind >= 0
        if condition.kind != "anything":
            code = condition.kind if isinstance(condition.kind, int) else KINDS.index(condition.kind)
            wanted = me.kind == code
        seen = bool((wanted & (me.distance <= condition.within)).any())
        return condition.probability * (seen != isinstance(condition, Unseen))
    return condition.probability * isinstance(condition, Chance | OffMark)


@given(seed=st.integers(0, 10_000), condition=conditions)
@settings(max_examples=25, deadline=None)
def test_chances_are_those_of_the_definition(seed, condition):
    senses = made_senses(seed)
    found = condition.chances(senses)
    expected = [expected_chance(condition, known_to(senses, i)) for i in range(ROBOTS)]
    assert found == pytest.approx(expected, abs=1e-12)


def test_marks_and_heat_are_sensed():
    walker = RobotDesign(name="walker", sensors=(*AGENT_HEAT.sensors, LineSensor()))
    model = SwarmModel(map="openspace", rng=1)
    model.add_obstacle(disc((100, 100), 30, contact=False))
    model.add_fire((400, 300), radius=10)
    model.add_robots(walker, poses=[(100, 100, 0.0), (370, 300, 0.0), (600, 500, 0.0)])
    model.sense()
    senses = Senses.of(model.swarm)
    assert OnMark(probability=0.5).chances(senses).tolist() == [0.5, 0.0, 0.0]
    assert OffMark(probability=0.5).chances(senses).tolist() == [0.0, 0.5, 0.5]
    assert HeatSensed().chances(senses).tolist() == [0.0, 1.0, 0.0]
    assert HeatSensed(above=1).chances(senses).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("seed", range(4))
def test_robots_approach_the_weighted_sum_of_what_they_see_and_retreat_from_it(seed):
    senses, drivers = made_senses(seed), made_drivers(seed)
    for layer, sign in ((Approach(target="load"), 1), (Retreat(target="load"), -1)):
        command, won = decided(layer, senses, drivers)
        for i in range(ROBOTS):
            me = known_to(senses, i)
            eyes = np.flatnonzero(me.kind == KINDS.index("load"))
            sum_of = (np.exp(1j * me.bearing[eyes]) / (1 + me.distance[eyes])).sum() * sign
            if drivers[i] >= 0 or not len(eyes) or abs(sum_of) < 1e-9:
                assert won[i] == drivers[i] or abs(sum_of) < 1e-9
                continue
            bearing, speed = np.angle(sum_of), me.max_speed
            rim = min(abs(bearing) * me.radius, speed)
            turn = (-rim, rim) if bearing > 0 else (rim, -rim)
            wanted = (speed, speed) if abs(bearing) <= math.radians(20) else turn
            assert won[i] == 7
            assert np.abs(command[i]) == pytest.approx(np.abs(wanted))
            assert command[i] == pytest.approx(wanted) or abs(abs(bearing) - math.pi) < 1e-9


def test_a_halt_stops_robots_that_no_layer_drives():
    drivers = made_drivers(1)
    command, won = decided(Halt(), made_senses(1), drivers)
    assert (command[drivers < 0] == 0).all()
    assert (won == np.where(drivers < 0, 7, drivers)).all()


class TwinOfMachine:
    """The rule of the documentation, robot by robot, with the machine's own random numbers."""

    def __init__(self, machine, rng):
        self.machine, self.rng = machine, rng
        self.state = [0] * ROBOTS

    def decide(self, senses):
        names, transitions = self.machine.state_names, self.machine.transitions
        most = max(sum(one.source == name for one in transitions) for name in names)
        draws, fired = self.rng.random((ROBOTS, most)), []
        for i in range(ROBOTS):
            leaving = [k for k, one in enumerate(transitions) if one.source == names[self.state[i]]]
            chances = [expected_chance(transitions[k].condition, known_to(senses, i)) for k in leaving]
            taken = [k for k, draw, chance in zip(leaving, draws[i], chances, strict=False) if draw < chance]
            fired.append(taken[0] if taken else -1)
            if taken:
                self.state[i] = names.index(transitions[taken[0]].target)
        return fired


def test_the_first_transition_that_is_fulfilled_is_taken_and_the_layers_of_the_new_state_drive():
    machine = StateMachine(
        {"a": (Avoid(distance=20), Explore()), "b": Halt(), "c": (Follow(),)},
        [
            Transition(source="b", target="a", condition=Unseen(kind="robot", within=30, probability=0.5)),
            Transition(source="a", target="b", condition=RobotsSeen(number=1.5, steepness=2)),
            Transition(source="a", target="c", condition=Seen(kind="load", within=25, probability=0.7)),
            Transition(source="c", target="a", condition=Chance(probability=0.3)),
            Transition(source="a", target="a", condition=Chance(probability=0.3)),
        ],
    )
    model = empty(2000, 2000)
    model.add_robots(AGENT9, ROBOTS)
    model.control = machine
    control = model.control
    twin = TwinOfMachine(machine, np.random.default_rng(5))
    control._rng = np.random.default_rng(5)
    senses = made_senses(0)
    first = {"a": 0, "b": 2, "c": 3}
    alone = {"a": Subsumption(Avoid(distance=20), Explore()), "b": Subsumption(Halt()), "c": Subsumption(Follow())}
    for seed in range(1, 12):
        senses = made_senses(seed, senses)
        command, layer = np.full((ROBOTS, 2), 9.0), np.full(ROBOTS, 9)
        control.decide(senses, command, layer)
        assert model.swarm.columns["0.state.fired"].tolist() == twin.decide(senses)
        assert control.now.tolist() == twin.state
        for number, name in enumerate(machine.state_names):
            wanted, won = np.empty((ROBOTS, 2)), np.empty(ROBOTS, np.int64)
            alone[name].decide(senses, wanted, won)
            here = control.now == number
            assert (command[here] == wanted[here]).all()
            assert (layer[here] == np.where(won < 0, -1, won + first[name])[here]).all()


def test_states_are_hashed_recorded_resumed_and_the_same_for_the_same_seed(tmp_path):
    model = gathering()
    recording = model.record(tmp_path / "run.arrow")
    model.run(40)
    recording.close()
    assert len(set(model.control.now.tolist())) == 3
    assert gathering().run(40).state_hash() == model.state_hash()
    again = SwarmModel.resume(tmp_path / "run.arrow", step=25)
    assert isinstance(again.control, StateMachine)
    assert again.control == model.control
    assert again.run(15).state_hash() == model.state_hash()
    changed = gathering().run(40)
    changed.swarm.columns["0.state.now"][0] += 1
    assert changed.state_hash() != model.state_hash()


def test_an_explanation_names_the_state_and_the_transition_that_was_taken():
    model = gathering()
    model.watch()
    model.run(60)
    texts = [str(model.explain(robot, step)) for robot in model.robots for step in range(1, 61)]
    assert any("part: Retreat: stay -> part as p = 0.02; it goes away from each robot" in text for text in texts)
    assert any("stay: Halt: search -> stay as robots >= 3; it is to stand" in text for text in texts)
    assert any(text.endswith("stay: Halt: it is to stand") for text in texts)


def test_a_machine_drives_one_group_of_a_team_and_leaves_the_states_of_others():
    model = empty(200, 200, rng=2)
    model.add_robots(AGENT9, 6, group="gathering")
    model.add_robots(AGENT3, 6)
    model.control = {"gathering": StateMachine.read(GATHERING), AGENT3: Subsumption(Avoid(), Explore())}
    model.watch()
    model.run(80)
    machine = model.control["gathering"]
    assert machine.now[:6].any()
    assert not machine.now[6:].any()
    assert (model.swarm.layer[6:] >= len(machine.layers)).all()
    assert model.control.noted == machine.noted


@dataclass(frozen=True, kw_only=True, slots=True)
class Alone(Condition):
    """No robot is seen."""

    def chances(self, senses):
        return self.probability * ~(senses.kind == ROBOT).any(axis=1)


@dataclass(frozen=True, kw_only=True, slots=True)
class Broken(Condition):
    def chances(self, senses):
        return np.full(len(senses.design), 1.5)


def test_a_custom_condition_acts_like_the_one_of_the_package_that_it_restates():
    text = GATHERING.replace("Chance(probability=0.05)", "Unseen(kind='robot', within=1000, probability=0.5)")
    model, own = gathering(), gathering()
    model.control = StateMachine.read(text)
    own.control = StateMachine.read(
        text.replace("Unseen(kind='robot', within=1000, probability=0.5)", "Alone(probability=0.5)"), parts=[Alone]
    )
    assert written_state_hash(own.run(60)) == written_state_hash(model.run(60))
    assert len(set(model.control.now.tolist())) > 1


def test_a_custom_condition_is_refused_unless_it_returns_probabilities():
    model = gathering()
    model.control = StateMachine({"a": Halt()}, [Transition(source="a", target="a", condition=Broken())])
    with pytest.raises(InvalidValueError, match=r"chances of Broken .* expected 12 numbers from 0 to 1"):
        model.step()


@dataclass(frozen=True, kw_only=True, slots=True)
class SeenAtNight(Seen):
    """Robots that see something, by a probability of its own."""

    def chances(self, senses):
        return np.ones(len(senses.design))


def test_a_condition_that_inherits_from_one_of_the_package_acts_by_its_own_chances():
    model = gathering()
    own = [Transition(source="a", target="b", condition=SeenAtNight(kind="fire"))]
    model.control = StateMachine({"a": Halt(), "b": Halt()}, own)
    model.step()
    assert (model.control.now == 1).all()
    assert Seen(kind="fire").code != SeenAtNight.code


def test_a_condition_without_chances_is_refused_where_it_is_used():
    with pytest.raises(InvalidValueError, match=r"Condition\(probability=1.0\) has no method chances"):
        Transition(source="a", target="b", condition=Condition())


def test_numbers_of_numpy_are_plain_numbers_in_the_text():
    machine = StateMachine(
        {"a": Avoid(distance=np.float64(3.5)), "b": Halt()},
        [Transition(source="a", target="b", condition=RobotsSeen(number=np.float32(2.5), fewer=np.bool_(True)))],
    )
    assert machine.text() == "a: Avoid(distance=3.5)\nb: Halt()\na -> b: RobotsSeen(number=2.5, fewer=True)\n"
    assert StateMachine.read(machine.text()) == machine


@dataclass(frozen=True, kw_only=True, slots=True)
class Listed(Condition):
    """A condition with a value that no text can hold."""

    numbers: object = None

    def chances(self, senses):
        return np.ones(len(senses.design))


@pytest.mark.parametrize("value", [math.inf, object(), Halt()])
def test_a_value_that_cannot_be_read_back_has_no_text(value):
    own = [Transition(source="a", target="a", condition=Listed(numbers=value))]
    with pytest.raises(InvalidValueError, match=r"Listed's numbers is .*; expected a number, text, True"):
        StateMachine({"a": Halt()}, own).text()


@pytest.mark.filterwarnings("error")
def test_a_text_with_doubtful_escapes_is_read_without_a_warning():
    assert StateMachine.read("a: Halt(name='\\d')").layers[0].name == "\\d"


@pytest.mark.parametrize("parts", [3, [3], [dict], ["Halt"]])
def test_parts_that_are_no_classes_of_layers_or_conditions_are_refused(parts):
    with pytest.raises(InvalidValueError, match=r"parts .*; expected classes of layers and conditions"):
        StateMachine.read("a: Halt()", parts=parts)


def test_layers_of_other_rooms_are_read_when_they_are_given():
    text = "fight: FightFire(), Explore()\n"
    with pytest.raises(UnknownNameError, match="line 1: unknown layer or condition 'FightFire'"):
        StateMachine.read(text)
    assert StateMachine.read(text, parts=[FightFire]).text() == text


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a: Halt", "line 2 is 'a: Halt'; expected name: Layer"),
        ("a: Halt(1)", "line 2 is"),
        ("a: Halt(**{})", "line 2 is"),
        ("a: print()", "line 2: unknown layer or condition 'print'"),
        ("a: Halt(name=open('x'))", r"line 2: Halt's name is open\('x'\); expected a number, text, True"),
        ("a: Avoid(distance=nan)", "line 2: Avoid's distance is nan; expected a number, text, True"),
        ("a: Avoid(front={[]: 1})", "line 2: Avoid's front is .*; expected a number, text, True"),
        ("a: Halt(name='b', name='c')", "line 2: Halt has two values for name; remove one"),
        ("a: Chance()", r"line 2: a state has Chance\(.*; expected layers such as Avoid"),
        ("a: Avoid(distance=-1)", "line 2: Avoid's distance is -1"),
        ("a: Avoid(speed=1)", "line 2: unknown parameter of Avoid 'speed'; .*known: distance"),
        ("a", "line 2 is 'a'"),
        ("a+b: Halt()", "line 2: name of a state is 'a\\+b'"),
        ("first: Halt()", "line 2: the state 'first' is there twice"),
        ("first -> first: Halt()", r"line 2: condition is Halt\(.*expected one such as Chance"),
        ("first -> second: Chance()", "line 2: unknown state 'second'"),
        ("second -> first: Chance()", "line 2: unknown state 'second'"),
    ],
)
def test_what_is_not_a_machine_is_refused_by_one_line(line, message):
    with pytest.raises((InvalidValueError, UnknownNameError), match=message) as caught:
        StateMachine.read(f"first: Halt()\n{line}\n")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 300


@pytest.mark.parametrize("text", ["", "# nothing\n"])
def test_a_text_without_a_state_is_refused(text):
    with pytest.raises(InvalidValueError, match="text has no state; expected a line such as"):
        StateMachine.read(text)


def test_parts_that_are_none_are_refused():
    for states in ({}, None, [Halt()], {"a": ()}, {"a": "Halt"}, {"": Halt()}, {"a": Halt}):
        with pytest.raises(InvalidValueError):
            StateMachine(states)
    for transitions in (5, [Halt()], Chance()):
        with pytest.raises(InvalidValueError):
            StateMachine({"a": Halt()}, transitions)
    with pytest.raises(InvalidValueError, match="drives no robots"):
        _ = StateMachine({"a": Halt()}).now


def test_a_rule_is_a_state_but_has_no_text():
    @behaviour
    def spin(me):
        return me.max_speed, -me.max_speed

    model = gathering()
    model.control = StateMachine({"spin": spin})
    assert (model.run(3).swarm.command == [model.swarm.max_speed[0], -model.swarm.max_speed[0]]).all()
    with pytest.raises(InvalidValueError, match="Behaviour spin is not a dataclass, and has no text"):
        model.control.text()


def test_wrong_values_of_conditions_are_refused():
    for make in (
        lambda: Chance(probability=1.1),
        lambda: RobotsSeen(number=-1),
        lambda: RobotsSeen(steepness=math.nan),
        lambda: RobotsSeen(fewer=1),
        lambda: Seen(kind="wall"),
        lambda: Seen(kind=-1),
        lambda: Unseen(kind=True),
        lambda: Unseen(within=-1),
        lambda: HeatSensed(above=2),
        lambda: Approach(target="wall"),
        lambda: Retreat(critical_angle_degrees=181),
        lambda: replace(Halt(), name=""),
    ):
        with pytest.raises((InvalidValueError, UnknownNameError)):
            make()
