"""evolve: the same whatever the number of processes, gone on with from its file, and right on a sphere."""

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, RobotDesign
from mesa_swarm.base.errors import LearningError, SwarmError
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.maps.map import Map
from mesa_swarm.searches.evolved_controllers import Trial, evolve, settings_of

SMALL = {"generations": 3, "population": 4, "finalists": 2, "final_trials": 1}
BRIEF = Trial(robots=3, steps=15)


@dataclass(frozen=True, kw_only=True)
class Sphere(Trial):
    """Weights are worth the more, the nearer they are to 0.25."""

    worth: float = 0.0

    def fitness_of(self, genome, world, rng):
        return self.worth - float(((genome - 0.25) ** 2).sum())


def weights(evolved):
    return np.concatenate([part.ravel() for part in evolved.policy.arrays().values()])


def test_finds_the_middle_of_a_sphere():
    sphere = Sphere(units=0, design=AGENT3, steps=10, robots=2)
    found = evolve(sphere, generations=150, population=12, finalists=1, final_trials=1)
    assert np.abs(weights(found) - 0.25).max() < 1e-4
    assert found.fitness.shape == (150, 12)
    assert found.policy.steps == 150 * 12 * 20 + 80


def test_a_mirrored_trial_finds_half_of_the_weights_and_all_its_middles_are_mirrored():
    sphere = Sphere(design=AGENT3, steps=10, robots=2, units=2, encoding="typed", mirrored=True)
    assert sphere.genes == 2 * (6 + 2 + 2)
    found = evolve(sphere, generations=3, population=6, finalists=1, final_trials=1).policy
    assert (found.encoding, found.wheel.shape, found.hidden.shape) == ("typed", (1, 10, 2), (1, 10, 2))
    left, right = found.wheel[0].T
    assert (right == left[[0, 2, 1, 3, 5, 4, 7, 6, 8, 9]] * [1, 1, 1, 1, 1, 1, 1, 1, -1, 1]).all()


def test_candidates_begin_around_the_constant_that_was_given():
    searched = {"generations": 1, "population": 4, "finalists": 1, "final_trials": 1, "sigma": 1e-6}
    policy = evolve(replace(BRIEF, mirrored=True), **searched, constant=1.5).policy
    assert np.abs(policy.wheel[0, -1] - 1.5).max() < 1e-4
    assert np.abs(policy.wheel[0, :-1]).max() < 1e-4


@dataclass(frozen=True, kw_only=True)
class Noted(Sphere):
    """Notes where it is tried, with how many robots and steps."""

    def fitness_of(self, genome, world, rng):
        PLACES.append((world.name, self.robots, self.steps))
        return super().fitness_of(genome, world, rng)


PLACES = []


def test_finalists_are_tried_on_maps_and_by_trials_of_their_own_and_their_robot_steps_count():
    PLACES.clear()
    trial, final = Noted(robots=3, steps=15), Noted(robots=5, steps=40)
    bred = evolve(trial, **SMALL, maps=["sparse"], final=final, final_maps=["openspace", "original"])
    assert PLACES[:12] == [("sparse", 3, 15)] * 12
    assert PLACES[12:] == [("openspace", 5, 40)] * 2
    assert bred.policy.steps == 12 * 45 + 2 * 200
    PLACES.clear()
    evolve(trial, **SMALL)
    assert PLACES[12:] == [("original", 3, 60)] * 2


@pytest.mark.slow
def test_the_seed_decides_and_nothing_else():
    one, two, other = evolve(BRIEF, **SMALL), evolve(BRIEF, **SMALL), evolve(BRIEF, **SMALL, rng=2)
    assert (weights(one) == weights(two)).all()
    assert (one.fitness == two.fitness).all()
    assert (one.fitness != other.fitness).any()


@pytest.mark.slow
def test_more_generations_and_an_interruption_go_on_to_the_same_bits(tmp_path, monkeypatch):
    whole = evolve(BRIEF, **SMALL)
    file = tmp_path / "mine.json"
    calls = []
    usual = Trial.fitness_of

    def interrupted(self, *given):
        calls.append(1)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return usual(self, *given)

    monkeypatch.setattr(Trial, "fitness_of", interrupted)
    with pytest.raises(KeyboardInterrupt):
        evolve(BRIEF, **SMALL, file=file)
    assert len(json.loads(file.read_text())["fitness"]) == 1
    monkeypatch.setattr(Trial, "fitness_of", usual)
    again = evolve(BRIEF, **SMALL, file=file)
    assert (again.fitness == whole.fitness).all()
    assert (weights(again) == weights(whole)).all()
    longer = evolve(BRIEF, **{**SMALL, "generations": 4}, file=file)
    assert (longer.fitness[:3] == whole.fitness).all()
    assert [path.name for path in tmp_path.iterdir()] == ["mine.json"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "other",
    [{"rng": 2}, {"sigma": 0.1}, {"maps": ["sparse"]}, {"trial": Trial(robots=4, steps=15)}],
)
def test_a_file_of_another_evolution_is_refused(tmp_path, other):
    file = tmp_path / "mine.json"
    evolve(BRIEF, **SMALL, file=file)
    before = file.read_text()
    with pytest.raises(LearningError, match="is of an evolution with other"):
        evolve(**{"trial": BRIEF, **SMALL, **other}, file=file)
    assert file.read_text() == before


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "format"),
        ('{"format": "mesa_swarm evolution 1"}', "no settings"),
    ],
)
def test_a_file_that_is_not_an_evolution_is_refused_in_one_line(tmp_path, text, reason):
    file = tmp_path / "mine.json"
    file.write_text(text)
    with pytest.raises(LearningError) as caught:
        evolve(BRIEF, **SMALL, file=file)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("fitness", [[["a"] * 4], [[1.0] * 3], [[math.nan] * 4], [5]])
def test_a_file_with_other_things_than_fitnesses_is_refused(tmp_path, fitness):
    file = tmp_path / "mine.json"
    evolve(BRIEF, **SMALL, file=file)
    stored = json.loads(file.read_text())
    file.write_text(json.dumps({**stored, "fitness": fitness}))
    with pytest.raises(LearningError, match="is not an evolution that can be continued"):
        evolve(BRIEF, **SMALL, file=file)


def test_a_fitness_that_is_not_a_number_ends_it_with_candidate_and_generation(tmp_path):
    sick = Sphere(worth=math.nan, units=0, steps=5, robots=2)
    with pytest.raises(LearningError, match="the fitness of candidate 0 in generation 0 is nan"):
        evolve(sick, **SMALL)


@pytest.mark.parametrize(
    "wrong",
    [
        {"trial": "long"},
        {"maps": []},
        {"maps": ["nowhere"]},
        {"generations": 0},
        {"population": 2},
        {"sigma": math.nan},
        {"finalists": 0},
        {"final_trials": 0},
        {"final": "longer"},
        {"final": Trial(units=0)},
        {"final": Trial(encoding="typed")},
        {"final_maps": []},
        {"maps": 5},
        {"maps": None},
        {"maps": [5]},
        {"constant": math.inf},
        {"rng": -1},
        {"jobs": 0},
        {"file": "mine.txt"},
    ],
)
def test_what_is_no_evolution_is_refused_in_one_line_before_anything_is_tried(wrong):
    with pytest.raises(SwarmError) as caught:
        evolve(**{"trial": BRIEF, **SMALL, **wrong})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"robots": 0},
        {"steps": 0},
        {"units": -1},
        {"squash": "no"},
        {"encoding": "no"},
        {"mirrored": True, "units": 1},
        {"units": 2.5},
        {"fitness": "floreano"},
        {"fitness": None},
        {"design": "AGENT9"},
    ],
)
def test_what_is_no_trial_is_refused(wrong):
    with pytest.raises(SwarmError):
        Trial(**wrong)


def test_whole_numbers_may_be_written_as_floats():
    assert Trial(robots=3.0, steps=15.0, units=2.0) == BRIEF
    assert Trial(robots=3.0, steps=15.0, units=2.0).genes == 52


@pytest.mark.slow
def test_a_single_map_is_one_map():
    wanted = evolve(BRIEF, **SMALL, maps=["sparse"], final_maps=[Map.load("openspace")])
    for maps in ("sparse", Map.load("sparse")):
        bred = evolve(BRIEF, **SMALL, maps=maps, final_maps="openspace")
        assert (bred.fitness == wanted.fitness).all()
        assert (weights(bred) == weights(wanted)).all()


def test_blind_robots_can_be_bred_though_they_learn_only_to_drive():
    blind = Trial(design=RobotDesign(name="blind"), robots=2, steps=10, units=0, fitness=Fitness(kind="floreano"))
    assert evolve(blind, **SMALL).policy.wheel.shape == (1, 2, 2)


@pytest.mark.long
def test_the_number_of_processes_changes_no_bit():
    one, two = (evolve(BRIEF, **SMALL, jobs=jobs) for jobs in (1, 2))
    assert (one.fitness == two.fitness).all()
    assert (weights(one) == weights(two)).all()


class Slotted:
    """A drive that needs no more than the protocol asks for."""

    __slots__ = ("gain",)
    turns = True

    def __init__(self, gain):
        self.gain = gain

    def motion(self, commands, robots, moves):
        moves[:] = 0

    def wheels(self, moves, robots, wheels):
        wheels[:] = 0


class Dictated(Slotted):
    """One whose values are in a __dict__, as those of most objects."""


def described_design(drive):
    return settings_of(Trial(design=replace(AGENT3, drive=drive)), [])["design"]


@pytest.mark.parametrize("kind", [Slotted, Dictated])
def test_the_values_of_a_custom_drive_count_in_slots_and_in_a_dict(kind):
    assert described_design(kind(1.0)) == described_design(kind(1.0)) != described_design(kind(2.0))


def test_an_evolution_goes_on_from_a_file_that_names_the_place_of_its_drive_in_memory(tmp_path):
    file = tmp_path / "mine.json"
    whole = evolve(BRIEF, **SMALL, file=file)
    stored = json.loads(file.read_text())
    # As in versions that did not describe the values of a drive, and had neither actuators nor limited acceleration.
    drive = "drive=<mesa_swarm.robots.drive.DifferentialDrive object"
    assert drive in stored["settings"]["design"]
    stored["settings"]["design"] = stored["settings"]["design"].replace(drive, f"{drive} at 0x7f0123456789")
    assert "actuators" not in stored["settings"]["design"]
    stored["fitness"] = stored["fitness"][:2]
    file.write_text(json.dumps(stored))
    assert (evolve(BRIEF, **SMALL, file=file).fitness == whole.fitness).all()


def test_the_settings_of_a_fitness_are_the_same_in_each_process():
    described = str(settings_of(Trial(), []))
    assert "Differential" in described
    assert " at 0x" not in described
