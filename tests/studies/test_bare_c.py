"""The bare C program beside which steps are timed: it reads what sensors read, and moves as robots do."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT3,
    AGENT9,
    DifferentialDrive,
    Map,
    ProximitySensor,
    RobotDesign,
    SwarmModel,
    disc,
    rectangle,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import InvalidValueError, PlacementError
from mesa_swarm_studies.benchmarks import bare_c, goals
from mesa_swarm_studies.benchmarks.bare_c import BareProgram, start_of
from mesa_swarm_studies.benchmarks.goals import NotMeasuredError
from mesa_swarm_studies.benchmarks.speed import (
    BESIDE_C,
    StepBesideC,
    bare_c_csv,
    bare_c_table,
    peer_workload,
    step_beside_c,
)
from support.c_code import STRICT, needs_cc

NOTHING, OBSTACLE, ROBOT = -1, 0, 1
BOUNDS = (-40.0, 10.0, 160.0, 130.0)
SENSORS = st.builds(
    ProximitySensor,
    bearing_degrees=st.floats(-180, 180),
    field_of_view_degrees=st.floats(1, 360),
    range=st.floats(1, 60),
)
DESIGNS = st.builds(
    RobotDesign,
    radius=st.floats(1, 8),
    max_speed=st.floats(0, 0.5),
    sensors=st.lists(SENSORS, max_size=12).map(tuple),
)


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The compiled program."""
    return BareProgram.compile_into(tmp_path_factory.mktemp("bare"))


def random_world(design: RobotDesign, robots: int, discs: int, seed: int) -> SwarmModel:
    """Return a crowded room, with fewer robots if there is no place for all of them."""
    rng = np.random.default_rng(seed)
    centres, radii = rng.uniform(BOUNDS[:2], BOUNDS[2:], (discs, 2)), rng.uniform(1, 15, discs)
    obstacles = tuple(disc(centre, radius) for centre, radius in zip(centres, radii, strict=True))
    model = SwarmModel(map=Map(name="random", bounds=BOUNDS, obstacles=obstacles), rng=seed)
    for _ in range(robots):
        try:
            model.add_robots(design, 1)
        except PlacementError:
            break
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def gaps_between(position: np.ndarray, radius: float) -> np.ndarray:
    """Return the gaps between any two robots, below 0 where they overlap."""
    apart = np.linalg.norm(position[:, None] - position, axis=-1) - 2 * radius
    return apart[np.triu_indices(len(position), 1)]


@needs_cc
@settings(max_examples=40, deadline=None)
@given(
    design=DESIGNS,
    robots=st.integers(1, 25),
    discs=st.integers(0, 6),
    steps=st.integers(0, 40),
    seed=st.integers(0, 99),
)
def test_the_program_reads_what_sensors_read_in_random_worlds(program, design, robots, discs, steps, seed):
    model = random_world(design, robots, discs, seed).run(steps)
    model.sense()
    np.testing.assert_allclose(program.end_of(model, 1).distance, model.swarm.distance, rtol=0, atol=1e-9)


@needs_cc
@pytest.mark.parametrize("n", [10, 50, 1000])
def test_the_program_sees_the_same_walls_discs_and_robots_as_the_workload_that_is_timed(program, n):
    model = peer_workload(n).run(50)
    model.sense()
    end = program.end_of(model, 1)
    np.testing.assert_allclose(end.distance, model.swarm.distance, rtol=0, atol=1e-9)
    assert end.kind.tolist() == model.swarm.kind.tolist()
    if n == 1000:
        assert set(end.kind.ravel()) == {NOTHING, OBSTACLE, ROBOT}


@needs_cc
def test_robots_of_the_program_that_touch_nothing_move_as_those_of_the_model(program):
    model = peer_workload(1000).run(50)
    end = program.end_of(model, 1)
    model.step()
    swarm = model.swarm
    free = ~swarm.collided
    assert 500 < free.sum() < 1000
    np.testing.assert_allclose(end.position[free], swarm.position[free], rtol=0, atol=1e-9)
    turned = np.remainder(end.heading - swarm.heading + math.pi, 2 * math.pi) - math.pi
    assert np.abs(turned[free]).max() < 1e-9


@needs_cc
@pytest.mark.parametrize(
    ("make", "slack"),
    [
        (lambda: peer_workload(300), 1e-5),
        # Robots that do not see what they meet jam, where the program does not push until all are free.
        (lambda: random_world(AGENT9.with_proximity(range=1), 25, 3, seed=1), 0.2),
        (lambda: random_world(RobotDesign(radius=3, max_speed=1.5), 25, 3, seed=1), 0.2),
    ],
    ids=["the workload", "short-sighted", "blind"],
)
def test_robots_of_the_program_stay_apart_within_the_border_and_out_of_discs(program, make, slack):
    model = make()
    end = program.end_of(model, 500)
    assert end.contacts > 0
    radius = model.swarm.table.designs[0].radius
    left, below, right, above = model.map.bounds
    assert gaps_between(end.position, radius).min() > -slack
    assert (end.position >= np.array([left, below]) + radius - slack).all()
    assert (end.position <= np.array([right, above]) - radius + slack).all()
    for obstacle in model.obstacles:
        apart = np.linalg.norm(end.position - obstacle.position, axis=1)
        assert apart.min() > radius + obstacle.shape.radius - slack


@needs_cc
def test_about_as_many_robots_of_the_program_are_in_contact_as_of_the_model(program):
    model = peer_workload(1000).run(100)
    contacts = program.end_of(model, 200).contacts
    before = model.total_collisions
    assert 0.5 < contacts / ((model.run(200).total_collisions - before) / 200) < 2


@needs_cc
def test_the_program_does_not_change_the_model(program):
    model = peer_workload(20).run(5)
    before = model.state_hash()
    program.time_steps(model, 10, untimed=5)
    assert model.state_hash() == before


@needs_cc
def test_the_program_compiles_without_warnings(tmp_path):
    source = bare_c.resources.files(bare_c.__package__) / bare_c.SOURCE
    command = ["cc", *STRICT, "-O1", str(source), "-o", str(tmp_path / "strict"), "-lm"]
    assert subprocess.run(command, capture_output=True, text=True, check=False).stderr == ""


@needs_cc
def test_a_step_beside_the_program_has_three_times_and_two_ratios(program):
    step = step_beside_c(program, 10, goals.Effort(repetitions=1, budget=0.0))
    assert step.bare > 0
    assert (step.plain_ratio, step.collected_ratio) == (step.plain / step.bare, step.collected / step.bare)


@pytest.fixture
def standing(monkeypatch, tmp_path):
    """Return a function that lets a line of Python stand for the compiler."""

    def stands(line: str) -> None:
        monkeypatch.setattr(bare_c, "COMPILER", sys.executable)
        monkeypatch.setattr(bare_c, "OPTIONS", ("-c", line))

    return stands


def test_without_a_c_compiler_one_line_states_so(monkeypatch, tmp_path):
    monkeypatch.setattr(bare_c, "COMPILER", "no-such-compiler")
    with pytest.raises(NotMeasuredError, match=r"^there is no C compiler here: no program is named no-such-compiler$"):
        BareProgram.compile_into(tmp_path)


def test_a_compiler_that_fails_is_reported_by_its_first_error(standing, tmp_path):
    standing("raise SystemExit('in main:\\nmain.c:3: error: first\\n  3 |\\nmain.c:4: error: second')")
    with pytest.raises(NotMeasuredError, match=r"^the C compiler .* ended with status 1: main\.c:3: error: first$"):
        BareProgram.compile_into(tmp_path)


def test_a_program_that_crashes_is_reported_by_its_signal(tmp_path):
    crashing = tmp_path / "crashing"
    crashing.write_text("#!/bin/sh\nkill -SEGV $$\n")
    crashing.chmod(0o755)
    with pytest.raises(NotMeasuredError, match=r"^the bare C program was ended by signal 11: no message$"):
        BareProgram(crashing).time_steps(peer_workload(5), 1)


def test_a_program_that_is_not_there_is_reported_in_one_line(tmp_path):
    with pytest.raises(NotMeasuredError, match=r"^the bare C program does not start: No such file or directory$"):
        BareProgram(tmp_path / "nothing").time_steps(peer_workload(5), 1)


@needs_cc
def test_a_start_that_is_cut_off_is_refused_in_one_line(program, tmp_path):
    start = tmp_path / "start"
    start.write_bytes(start_of(peer_workload(5))[:-8])
    done = subprocess.run([program.path, start, "0", "1"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "bare_swarm: the start ends too early\n")


def with_control(*layers) -> SwarmModel:
    model = peer_workload(5)
    model.control = Subsumption(*layers)
    return model


def with_robots(design: RobotDesign) -> SwarmModel:
    model = SwarmModel(map=Map(bounds=(0, 0, 200, 200)), rng=1)
    model.add_robots(design, 2)
    model.control = Subsumption(Avoid(), Explore())
    return model


def with_two_designs() -> SwarmModel:
    model = with_robots(AGENT9)
    model.add_robots(AGENT3, 1)
    return model


def with_a_rectangle() -> SwarmModel:
    model = peer_workload(5)
    model.add_obstacle(rectangle((1, 1), (5, 5)))
    return model


def with_a_moving_disc() -> SwarmModel:
    model = with_robots(AGENT9)
    model.add_body(disc((100, 100), 5), mode="driven")
    return model


@pytest.mark.parametrize(
    ("make", "missing"),
    [
        (with_two_designs, "robots of one design"),
        (lambda: with_robots(RobotDesign(drive=DifferentialDrive(acceleration=0.1))), r"DifferentialDrive\(\)"),
        (lambda: with_robots(RobotDesign(radius=1, max_speed=0.6)), "at most half a radius a step"),
        (lambda: with_robots(AGENT9.with_slip(probability=0.1, magnitude=0.5)), "wheels that do not slip"),
        (lambda: with_robots(AGENT9.with_proximity(rays=3)), "sensors that read exactly, in every step"),
        (lambda: with_robots(AGENT9.with_proximity(period=2)), "sensors that read exactly, in every step"),
        (with_a_rectangle, "discs that stand"),
        (with_a_moving_disc, "discs that stand"),
        (lambda: with_control(Avoid(distance=15), Explore(speed=0.5)), r"Subsumption\(Avoid"),
        (lambda: with_control(Explore()), r"Subsumption\(Avoid"),
    ],
)
def test_a_model_of_other_work_is_refused_with_what_is_missing(make, missing):
    with pytest.raises(InvalidValueError, match=f"other work than this model; expected {missing}"):
        start_of(make())


STEPS = {
    10: StepBesideC(bare=1e-6, plain=5e-6, collected=8e-6, plain_ratio=5.0, collected_ratio=8.0),
    1000: StepBesideC(bare=1e-3, plain=2e-3, collected=2.1e-3, plain_ratio=2.0, collected_ratio=2.1),
}


def test_the_table_beside_c_has_a_row_for_each_number_of_robots():
    header, _, *rows = bare_c_table(STEPS)
    assert header.split() == [
        "robots",
        "C",
        "not",
        "collected",
        "times",
        "C",
        "collected",
        "times",
        "C",
        "required",
        "passed",
    ]
    assert [row.split() for row in rows] == [
        ["10", "1", "5", "5", "8", "8", "8", "yes"],
        ["1,000", "1,000", "2,000", "2", "2,100", "2.1", "2", "no"],
    ]


def test_the_file_beside_c_has_the_same_numbers_and_none_where_nothing_was_measured():
    nothing = StepBesideC(*[math.nan] * 5)
    lines = bare_c_csv({**STEPS, 50: nothing}).splitlines()
    assert lines[0] == "robots,bare_us,plain_us,collected_us,plain_ratio,collected_ratio,required"
    assert lines[1] == "10,1.0,5.0,8.0,5.0,8.0,8.0"
    assert lines[3] == "50,,,,,,4.0"
    assert set(BESIDE_C) == {10, 50, 1000, 10_000, 100_000}
