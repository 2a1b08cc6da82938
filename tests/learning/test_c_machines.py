"""Exported state machines: compiled without a warning, the same states and wheels as in Python for the same chances."""

import copy
import ctypes
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, LineSensor, RadiationSensor, RobotDesign
from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.control import Avoid, Cohere, Condition, Explore, Halt, Senses, StateMachine, Transition
from mesa_swarm.learning.c_machines import export_machine, machine_source
from mesa_swarm.robots.drive import HolonomicDrive, OmniDrive
from support.c_code import compiled_machine, needs_cc, place
from support.scenes import empty

ROBOTS, STEPS = 250, 40
FULL = RobotDesign(
    name="full",
    radius=4.0,
    max_speed=0.5,
    sensors=(
        *AGENT9.sensors,
        *(RadiationSensor(bearing_degrees=b, range=100) for b in (30, -30)),
        *(LineSensor(mount=(3, y)) for y in (1, -1)),
    ),
)
MACHINES = {
    "gathering": """
search: Avoid(distance=5), Approach(), Explore()
part: Avoid(distance=20, sides='ignore both'), Retreat(), Explore(speed=0.5, turn_interval=2)
stay: Halt()
search -> stay: RobotsSeen(number=3, probability=0.5)
search -> part: Unseen(kind='robot', within=30)
stay -> part: Chance(probability=0.2)
part -> search: RobotsSeen(number=2, steepness=0.7, fewer=True)
""",
    "following": """
follow: Follow(gap=None, critical_angle_degrees=35), Explore(turn_interval=3, largest_turn_degrees=20)
chase: Follow(gap=20, critical_angle_degrees=60), Avoid(turn='stationary', fires='never', loads='never')
wander: Avoid(front='random', distance=30), Explore(turn_interval=1)
follow -> chase: Seen(kind='robot', within=25, probability=0.6)
follow -> wander: Seen(within=2)
chase -> wander: Seen(kind='load', within=40, probability=0.3)
wander -> follow: Unseen(within=10, probability=0.4)
""",
    "heat": """
to: Approach(target='heat', critical_angle_degrees=5), Explore(speed=0.2)
from it: Retreat(target='heat'), Retreat(target='fire')
stay: Approach(target='load'), Approach(target='obstacle')
to -> from it: HeatSensed(above=0.7, probability=0.5)
to -> stay: OnMark(probability=0.5)
stay -> to: OffMark(probability=0.2)
from it -> to: Chance(probability=0.3)
""",
}


def driven(machine, design):
    """Return a model whose machine drives robots of a design."""
    model = empty(2000, 2000, rng=1)
    model.add_robots(design, poses=[(20.0 + 40 * (k % 40), 20.0 + 40 * (k // 40), 0.0) for k in range(ROBOTS)])
    model.control = machine
    model.sense()
    return model


def decide_noting_chances(control, senses, command, layer):
    """Let a machine decide, and return the numbers that it and its layers have drawn, (n, c), in their order."""
    streams = [part._rng for part in (control, *control.layers) if hasattr(part, "_rng")]
    before = copy.deepcopy(streams)
    control.decide(senses, command, layer)
    drawn = [before[0].random((ROBOTS, control._most))]
    for former, stream in zip(before[1:], streams[1:], strict=True):
        if former.bit_generator.state != stream.bit_generator.state:
            drawn.append(former.random((ROBOTS, 1)))
    return np.hstack(drawn)


def made(senses, rng):
    """Return random readings of all sensors."""
    shape = senses.distance.shape
    kind = np.where(rng.random(shape) < 0.4, rng.integers(0, 4, shape), -1).astype(senses.kind.dtype)
    distance = np.where(kind < 0, -1.0, np.round(rng.uniform(0.0, 50.0, shape) * rng.integers(0, 2, shape), 1))
    radiation = rng.random(senses.radiation.shape) * (rng.random(senses.radiation.shape) < 0.7)
    return replace(senses, distance=distance, kind=kind, radiation=radiation, line=rng.random(senses.line.shape) < 0.3)


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("design", [FULL, AGENT9], ids=["full", "agent9"])
@pytest.mark.parametrize("name", MACHINES)
def test_compiled_c_changes_states_and_drives_as_the_machine(name, design, tmp_path):
    machine, rng = StateMachine.read(MACHINES[name]), np.random.default_rng(1)
    source = export_machine(machine, design, tmp_path / "robot.c")[0]
    library, model = compiled_machine(source), driven(machine, design)
    chances = int(source.with_suffix(".h").read_text().split("ROBOT_CHANCES ")[1].split()[0])
    sides = model.swarm.columns["tendency"].astype(np.int8)
    library.reset_all(ctypes.c_int(ROBOTS), place(sides))
    command, layer = np.empty((ROBOTS, 2)), np.empty(ROBOTS, np.int64)
    now, wheels, visited = np.empty(ROBOTS, np.int8), np.empty((ROBOTS, 2)), set()
    for _ in range(STEPS):
        senses = made(Senses.of(model.swarm), rng)
        drawn = decide_noting_chances(model.control, senses, command, layer)
        arrays = senses.distance, senses.kind.astype(np.int8), senses.line.astype(np.uint8), senses.radiation
        library.act_all(ctypes.c_int(ROBOTS), *map(place, (*arrays, drawn, now, wheels)))
        assert drawn.shape[1] == chances
        assert (now == model.control.now).all()
        assert np.abs(wheels - command / design.max_speed).max() <= 1e-6
        visited |= set(now.tolist())
    # Without sensors of heat and marks, no transition out of the first state can be taken.
    assert len(visited) == (1 if (name, design) == ("heat", AGENT9) else 3)


@needs_cc
@pytest.mark.parametrize("name", MACHINES)
def test_single_precision_compiles_without_a_warning(name, tmp_path):
    machine = StateMachine.read(MACHINES[name])
    library = compiled_machine(export_machine(machine, FULL, tmp_path / "robot.c", number="float")[0])
    library.reset_all(ctypes.c_int(3), place(np.ones(3, np.int8)))


def test_the_header_has_the_machine_and_the_numbers_of_its_states():
    header = machine_source(StateMachine.read(MACHINES["heat"]), FULL, "robot")["robot.h"]
    assert " *   to -> stay: OnMark(probability=0.5)\n" in header
    assert "    ROBOT_STATE_TO,\n    ROBOT_STATE_FROM_IT,\n    ROBOT_STATE_STAY\n" in header


def test_names_that_are_equal_in_c_get_numbers_and_no_comment_ends_early():
    machine = StateMachine({"go on": Halt(name="*/ int x;"), "go-on": Halt()})
    files = machine_source(machine, AGENT3, "robot")
    assert "ROBOT_STATE_GO_ON_0,\n    ROBOT_STATE_GO_ON_1\n" in files["robot.h"]
    assert "*/ int x" not in files["robot.h"] + files["robot.c"]


def test_equal_names_with_numbers_do_not_become_equal_to_another_one():
    machine = StateMachine({"go on": Halt(), "go-on": Halt(), "go on 0": Halt()})
    names = re.findall(r"ROBOT_STATE_\w+", machine_source(machine, AGENT3, "robot")["robot.h"])
    assert len(names) == len(set(names)) == 3


def test_no_comment_begins_within_a_comment():
    files = machine_source(StateMachine({"a": Halt(name="/* x")}), AGENT3, "robot")
    assert all(line.count("/*") == 0 for line in files["robot.h"].splitlines() if line.startswith(" *"))


@pytest.mark.parametrize("drive", [OmniDrive(), HolonomicDrive()])
def test_a_design_that_the_layers_cannot_drive_is_refused(drive):
    design = replace(AGENT9, name="other", drive=drive)
    with pytest.raises(InvalidValueError, match="robots of the design other do not take the speeds of two wheels"):
        machine_source(StateMachine({"a": Halt()}), design, "robot")


@dataclass(frozen=True, kw_only=True, slots=True)
class Always(Condition):
    """A custom condition."""

    def chances(self, senses):
        return np.ones(len(senses.design))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: Cohere()", "layer .*Cohere.* cannot be exported; use Approach, Avoid, Explore, Follow, Halt, Retreat"),
        ("a: Approach(target='goal')", "Approach of 'goal' cannot be exported"),
        ("a: Avoid(fires='when hot')", "cannot be exported; use its other options"),
        ("a: Avoid(front='back up')", "cannot be exported; use its other options"),
        ("a: Halt()\na -> a: Always()", "condition .*Always.* cannot be exported"),
    ],
)
def test_what_has_no_c_is_refused_in_one_line(text, line):
    with pytest.raises(SwarmError, match=line) as caught:
        machine_source(StateMachine.read(text, parts=[Cohere, Always]), AGENT9, "robot")
    assert len(str(caught.value).splitlines()) == 1


def test_other_values_are_refused():
    machine = StateMachine({"a": (Avoid(), Explore())}, [Transition(source="a", target="a", condition=Always())])
    for given, line in (
        ((Halt(), AGENT9, "robot"), "expected a StateMachine"),
        ((machine, AGENT9, "R"), "the name is"),
    ):
        with pytest.raises(SwarmError, match=line):
            machine_source(*given)
    with pytest.raises(LearningError, match="no proximity sensors"):
        machine_source(machine, RobotDesign(name="blind", sensors=()), "robot")
