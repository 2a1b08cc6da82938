"""Automatic design: every genome is a machine, a search finds what is best, and nothing depends on processes."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.control import Chance, Halt, StateMachine, Subsumption, Transition
from mesa_swarm.control.conditions import RobotsSeen
from mesa_swarm.learning.evolution import MixedEvolution
from mesa_swarm.learning.policy import PolicyLayer
from mesa_swarm.maps.map import Map
from mesa_swarm.searches.automatic_design import (
    MachineSpace,
    Mission,
    MissionTrial,
    design_machine,
    evolve_network,
)
from mesa_swarm.searches.design_gap import Budget, DesignGap, design_gap, design_gap_figure
from mesa_swarm.viewing.machine_drawing import machine_figure, state_places

BRIEF = Mission(robots=3, steps=20)
SMALL = {"population": 4, "finalists": 2, "final_trials": 2}


@st.composite
def genomes(draw):
    space = MachineSpace(states=draw(st.integers(2, 4)), transitions=draw(st.integers(1, 4)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    categories = np.array([rng.integers(count) for count in space.categories])
    return space, rng.normal(0.5, 2.0, space.numbers), categories


@given(genomes())
@settings(max_examples=40, deadline=None)
def test_every_genome_is_a_machine_within_the_space_whose_states_are_all_in_reach(genome):
    space, numbers, categories = genome
    machine = space.machine(numbers, categories)
    assert len(machine.state_names) <= space.states
    leaving = [one.source for one in machine.transitions]
    assert all(leaving.count(name) <= space.transitions for name in machine.state_names)
    reached = {machine.state_names[0]}
    for _ in machine.state_names:
        reached |= {one.target for one in machine.transitions if one.source in reached}
    assert reached == set(machine.state_names)
    assert StateMachine.read(machine.text()) == machine
    assert space.machine(numbers + 2.0, categories).names == machine.names


def test_every_behaviour_and_condition_can_be_chosen_and_drives_robots():
    space, world = MachineSpace(states=3, transitions=4), Map.load("openspace")
    rng, seen = np.random.default_rng(3), set()
    for seed in range(12):
        categories = np.array([rng.integers(count) for count in space.categories])
        machine = space.machine(rng.random(space.numbers), categories)
        assert 0.0 <= BRIEF.score(machine, world, seed) <= 1.0
        seen |= {name.partition(" ")[0] for name in machine.state_names}
        seen |= {(type(one.condition), getattr(one.condition, "fewer", False)) for one in machine.transitions}
    assert {"explore", "wander", "halt", "approach", "retreat", "follow"} < seen
    assert {(Chance, False), (RobotsSeen, False), (RobotsSeen, True)} < seen


@dataclass(frozen=True, kw_only=True, slots=True)
class MostHalts(Mission):
    """Machines are worth the more, the more of their states stand."""

    def score(self, control, world, rng, imperfections=None):
        return sum(name.startswith("halt") for name in control.state_names)


def test_a_search_finds_the_machine_that_is_worth_most():
    found = design_machine(
        MostHalts(), space=MachineSpace(states=2, transitions=2), generations=40, population=12, finalists=4
    )
    assert found.machine.state_names == ("halt", "halt 2")
    assert found.worth == 2
    assert found.scores.shape == (40, 12)


def test_a_table_of_another_program_beside_the_file_of_a_design_without_tables_is_none_of_its_business(tmp_path, capfd):
    (tmp_path / "runs.csv").write_text("another program's")
    design_machine(MostHalts(), generations=1, population=4, finalists=1, final_trials=1, file=tmp_path / "search.json")
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_design_is_the_same_when_it_was_interrupted_and_with_other_settings_is_refused(tmp_path):
    file = tmp_path / "search.json"
    whole = design_machine(BRIEF, generations=3, rng=5, **SMALL)
    design_machine(BRIEF, generations=2, rng=5, file=file, **SMALL)
    again = design_machine(BRIEF, generations=3, rng=5, file=file, **SMALL)
    assert again.machine == whole.machine
    assert (again.scores == whole.scores).all()
    with pytest.raises(LearningError, match="with other rng, steps"):
        design_machine(replace(BRIEF, steps=21), generations=3, rng=6, file=file, **SMALL)


@pytest.mark.long
def test_a_design_does_not_depend_on_the_number_of_processes():
    one, two = (design_machine(BRIEF, generations=3, rng=5, jobs=jobs, **SMALL) for jobs in (1, 2))
    assert one.machine == two.machine
    assert (one.scores == two.scores).all()


def test_a_mixed_search_finds_numbers_and_categories_and_repeats_itself_from_its_fitness():
    first, second = (MixedEvolution(3, [3, 4], sigma=0.3, population=10, seed=2) for _ in range(2))
    for _ in range(50):
        asked = first.ask()
        fitness = [float((c == [2, 1]).sum() - ((x - 0.2) ** 2).sum()) for x, c in asked]
        first.tell(fitness)
        second.tell(fitness)
    x, c = first.best[-1]
    assert c.tolist() == [2, 1]
    assert np.abs(x - 0.2).max() < 0.1
    for (x, c), (y, d) in zip(first.ask(), second.ask(), strict=True):
        assert (x == y).all()
        assert (c == d).all()


def test_wrong_fitness_of_a_mixed_search_is_refused_and_changes_nothing():
    search = MixedEvolution(2, [2], sigma=0.3, population=4, seed=1)
    before = search.ask()
    for fitness in ([1.0], [1.0, 2.0, float("nan"), 0.0]):
        with pytest.raises(LearningError):
            search.tell(fitness)
    assert search.generations == 0
    assert all((x == y).all() for (x, _), (y, _) in zip(before, search.ask(), strict=True))
    for wrong in ({"categories": []}, {"categories": [1]}, {"numbers": 1}, {"population": 3}, {"sigma": 0}):
        with pytest.raises(InvalidValueError):
            MixedEvolution(**{"numbers": 2, "categories": [2], "sigma": 0.3, "population": 4, "seed": 1, **wrong})


def test_a_network_is_tried_by_the_score_of_its_mission():
    evolved = evolve_network(BRIEF, generations=1, rng=2, **SMALL)
    world, control = Map.load("openspace"), Subsumption(PolicyLayer(policy=evolved.policy))
    genome = evolved.policy.wheel.ravel()
    assert MissionTrial.of(BRIEF).fitness_of(genome, world, 9) == BRIEF.score(control, world, 9)


def test_robots_that_stand_apart_score_nothing_and_imperfect_ones_are_the_same_for_the_same_seed():
    world = Map.load("openspace")
    assert BRIEF.score(StateMachine({"stay": Halt()}), world, 1) == 0.0
    careful = Mission(name="avoidance", robots=3, steps=20)
    assert careful.score(StateMachine({"stay": Halt()}), world, 1) == pytest.approx(15 * 3 / 300)


def test_wrong_values_are_refused():
    for make in (
        lambda: Mission(name="dancing"),
        lambda: Mission(robots=0),
        lambda: Mission(fitness=3),
        lambda: MachineSpace(states=1),
        lambda: MachineSpace(transitions=5),
        lambda: Budget(population=3),
        lambda: design_machine(3),
        lambda: design_machine(BRIEF, maps=[]),
        lambda: design_gap(BRIEF, designs=1),
        lambda: design_gap(BRIEF, preset="none"),
    ):
        with pytest.raises(SwarmError):
            make()


GAP = DesignGap(
    mission="aggregation",
    preset="measured",
    dial=(0.0, 1.0),
    seeds=30,
    scores={
        "state machine": [[0.5, 0.5], [0.6, 0.5], [0.4, 0.4]],
        "evolved network": [[0.5, 0.2], [0.7, 0.3], [0.6, 0.2]],
    },
)


def test_losses_are_differences_from_the_ideal_robots_and_paired_by_design():
    assert GAP.lost("state machine", 1).estimate == pytest.approx(0.1 / 3)
    assert GAP.lost("evolved network", 1).estimate == pytest.approx(1.1 / 3)
    assert GAP.more_lost(1).estimate == pytest.approx(1.0 / 3)
    assert GAP.advantage(1).estimate == pytest.approx((0.3 + 0.2 + 0.2) / 3)
    assert "3 designs of each kind, 30 seeds each" in GAP.table()
    assert GAP.csv().splitlines()[1] == "state machine,1,0.0,0.5"
    left, right = design_gap_figure(GAP).axes
    assert right.lines[0].get_ydata().tolist() == [0.0, 0.0]
    assert left.lines[0].get_ydata().tolist() == [0.5, 0.5]


@pytest.mark.slow
def test_an_interrupted_gap_goes_on_from_the_controllers_that_are_stored(tmp_path):
    given = {"budget": Budget(generations=1, **SMALL), "designs": 2, "seeds": 2, "dial": (0, 1), "out": tmp_path}
    whole = design_gap(BRIEF, **given)
    stored = tmp_path / "state_machine_2.json"
    changed = json.loads(stored.read_text())
    stored.write_text(json.dumps({**changed, "scores": [0.25, 0.75]}))
    (tmp_path / "evolved_network_1.json").write_text("{}")
    again = design_gap(BRIEF, **given)
    assert again.scores["state machine"] == [whole.scores["state machine"][0], [0.25, 0.75]]
    assert again.scores["evolved network"] == whole.scores["evolved network"]


@pytest.mark.slow
def test_a_gap_with_other_settings_is_refused_and_keeps_what_is_stored(tmp_path):
    given = {"budget": Budget(generations=1, **SMALL), "designs": 2, "seeds": 1, "dial": (0, 1), "out": tmp_path}
    design_gap(BRIEF, **given)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(LearningError, match=r"with other seeds, steps; use its settings or another folder"):
        design_gap(replace(BRIEF, steps=21), **{**given, "seeds": 2})
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@dataclass(frozen=True, kw_only=True, slots=True)
class Weighed(Mission):
    """A mission of a user's, with a parameter of its own."""

    weight: float = 1.0

    def score(self, control, world, rng, imperfections=None):
        return self.weight


def test_a_design_is_not_continued_for_a_mission_with_another_score(tmp_path):
    brief = {"generations": 1, "file": tmp_path / "search.json", **SMALL}
    design_machine(Weighed(robots=3, steps=20), **brief)
    for other in (BRIEF, Weighed(robots=3, steps=20, weight=2.0)):
        with pytest.raises(LearningError, match="with other mission"):
            design_machine(other, **brief)


def test_a_drawing_has_a_disc_for_each_state_and_the_conditions_of_each_pair_on_one_arrow():
    machine = StateMachine(
        {"a": Halt(), "b": Halt(), "c": Halt()},
        [
            Transition(source="a", target="b", condition=Chance(probability=0.5)),
            Transition(source="a", target="b", condition=RobotsSeen(number=2)),
            Transition(source="c", target="c", condition=Chance(probability=0.25)),
        ],
    )
    axes = machine_figure(machine).axes[0]
    texts = [text.get_text() for text in axes.texts]
    assert texts[:6] == ["a", "Halt", "b", "Halt", "c", "Halt"]
    assert texts[6:] == ["p = 0.5\nrobots >= 2", "p = 0.25"]
    discs = [patch for patch in axes.patches if hasattr(patch, "radius")]
    assert len(discs) == 4
    x_limits, y_limits = axes.get_xlim(), axes.get_ylim()
    for disc in discs:
        x, y = disc.center
        assert x_limits[0] < x - disc.radius < x + disc.radius < x_limits[1]
        assert y_limits[0] < y - disc.radius < y + disc.radius < y_limits[1]


def drawn_boxes(machine):
    """Return the figure's discs and the boxes of its texts, in pixels."""
    figure = machine_figure(machine)
    figure.canvas.draw()
    axes = figure.axes[0]
    discs = [patch.get_window_extent() for patch in axes.patches if hasattr(patch, "radius")]
    return figure, discs, {text: text.get_window_extent() for text in axes.texts}


def crowded(count):
    names = [f"behaviour {k}" for k in range(count)]
    ways = [(a, names[(k + step) % count]) for k, a in enumerate(names) for step in (1, 3)]
    condition = RobotsSeen(number=2.5, probability=0.123)
    return StateMachine(
        dict.fromkeys(names, Halt()), [Transition(source=a, target=b, condition=condition) for a, b in ways]
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 5, 6, 8])
def test_labels_of_arrows_overlap_neither_discs_nor_each_other(count):
    _, discs, texts = drawn_boxes(crowded(count))
    labels = [box for text, box in texts.items() if text.get_text().startswith("robots")]
    assert len(labels) == 2 * count
    for k, label in enumerate(labels):
        assert not any(label.overlaps(other) for other in labels[k + 1 :])
        for disc in discs:
            middle, reach = np.array([disc.x0 + disc.x1, disc.y0 + disc.y1]) / 2, disc.width / 2
            nearest = np.clip(middle, [label.x0, label.y0], [label.x1, label.y1])
            assert np.hypot(*(nearest - middle)) > reach


def test_long_names_and_many_layers_stay_within_their_disc():
    machine = StateMachine({"W" * 60: (Halt(name="W" * 90),) * 12})
    _, discs, texts = drawn_boxes(machine)
    assert "9 more" in [text.get_text() for text in texts]
    for box in texts.values():
        assert discs[0].x0 <= box.x0
        assert box.x1 <= discs[0].x1
        assert discs[0].y0 <= box.y0
        assert box.y1 <= discs[0].y1


@pytest.mark.parametrize("count", range(1, 12))
def test_discs_do_not_touch(count):
    places = state_places(count)
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    assert (apart[~np.eye(count, dtype=bool)] > 2.5).all()
