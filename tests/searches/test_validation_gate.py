"""Training that is repeated until its outcome passes on validation maps."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, AGENT_FIRE, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.control import Avoid, Explore, Subsumption, behaviour
from mesa_swarm.environments import CollisionAvoidance, ExtinguishFires, Variation
from mesa_swarm.experiments.controllers import Controller
from mesa_swarm.learning import LearnFires, LearnFireWheels, QLearning
from mesa_swarm.searches.drive_measures import drive_measured, driven_world
from mesa_swarm.searches.validation_gate import VALIDATION, Criteria, ValidationGate, gated
from mesa_swarm_studies.benchmarks import contestants as all_contestants
from mesa_swarm_studies.benchmarks.benchmark_tasks import TEST, TRAIN
from mesa_swarm_studies.benchmarks.contestants import BREEDING, CHOOSING, Trained, contestants
from support.q_learners import learned, trained

MAPS = ["openspace", "sparse"]


def gate_of(most_collisions=1000, least_ahead=-1, least_coverage=0, *, steps=40, **more):
    """Return a gate of three robots on two maps, by default one that all pass."""
    criteria = Criteria(
        most={"collisions": most_collisions}, least={"speed ahead": least_ahead}, of_rule={"coverage": least_coverage}
    )
    task = CollisionAvoidance(n_robots=3, max_steps=steps)
    return ValidationGate(**{"task": task, "maps": MAPS, "criteria": criteria, **more})


@behaviour
def back(me):
    return -me.max_speed, -me.max_speed


@behaviour
def rest(me):
    return 0.0, 0.0


RULE, AHEAD, BACK, REST = (Subsumption(*layers) for layers in ((Avoid(), Explore()), (Explore(),), (back,), (rest,)))


def test_validation_is_the_mean_of_drives_on_all_maps():
    found = gate_of(rng=5).validate(AHEAD)
    rows = [drive_measured(driven_world(AHEAD, AGENT9, 3, name, 5), 40) for name in MAPS]
    assert set(found.measures) == {"collisions", "speed ahead", "coverage"}
    for measure, value in found.measures.items():
        assert value == pytest.approx(sum(row[measure] for row in rows) / 2)
    assert gate_of(rng=5).validate(RULE).measures == found.rule
    assert found.robot_steps == 2 * 3 * 40


@pytest.mark.long
def test_validation_does_not_depend_on_the_number_of_processes():
    assert gate_of().validate(AHEAD, jobs=2) == gate_of().validate(AHEAD)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("control", "criterion", "passed"),
    [
        (BACK, {"least_ahead": 0.6}, False),
        (AHEAD, {"least_ahead": 0.6}, True),
        (REST, {"least_coverage": 0.5}, False),
        (AHEAD, {"least_coverage": 0.5}, True),
        (AHEAD, {"most_collisions": 0}, False),
        (REST, {"most_collisions": 0}, True),
    ],
)
def test_each_criterion_alone_decides(control, criterion, passed):
    gate = gate_of(steps=500, **criterion)
    found = gate.validate(control)
    assert found.passed == passed
    collisions, ahead, coverage = found.measures.values()
    assert gate.rank(found) == (-2 - passed, collisions, -ahead, -coverage)


def test_the_rule_itself_passes_the_criterion_of_coverage():
    assert gate_of(least_coverage=1.0).validate(RULE).passed
    assert not gate_of(least_coverage=1.001).validate(RULE).passed


def test_training_is_repeated_with_derived_seeds_until_one_passes():
    seeds = []

    def train(seed):
        seeds.append(seed)
        return AHEAD if len(seeds) == 3 else BACK

    found = gated(train, gate_of(least_ahead=0.6), rng=9)
    assert (found.passed, found.trainings, found.chosen, found.result) == (True, 3, 2, AHEAD)
    assert found.seeds == tuple(seeds)
    assert seeds[0] == 9
    assert len(set(seeds)) == 3
    assert [each.passed for each in found.validations] == [False, False, True]
    again = gated(lambda seed: AHEAD if seed == seeds[1] else BACK, gate_of(least_ahead=0.6), rng=9, most=2)
    assert again.seeds == tuple(seeds[:2])


@pytest.mark.slow
@pytest.mark.parametrize("least_ahead", [0.98, 0.6, -1.0])
def test_where_none_passes_the_one_is_chosen_that_meets_most_criteria_and_then_collides_least(least_ahead):
    gate = gate_of(1, least_ahead, 1.5, steps=300)
    controls = [BACK, AHEAD, RULE, REST]
    remaining = iter(controls)
    found = gated(lambda seed: next(remaining), gate, most=4)
    assert (found.passed, found.trainings) == (False, 4)
    measured = [each.measures for each in found.validations]
    met = [(each["collisions"] <= 1) + (each["speed ahead"] >= least_ahead) for each in measured]
    best = [k for k in range(4) if met[k] == max(met)]
    fewest = min(measured[k]["collisions"] for k in best)
    assert found.chosen in best
    assert measured[found.chosen]["collisions"] == fewest
    assert found.result is controls[found.chosen]


def test_a_policy_is_validated_as_it_drives_alone():
    policy = learned(trained())
    found = gated(lambda seed: policy, gate_of())
    assert found.result is policy
    assert found.passed


@pytest.mark.parametrize("learner", [LearnFires, LearnFireWheels])
def test_policies_of_fires_are_validated_by_their_own_layer(learner):
    def train(seed):
        model = SwarmModel(map="openspace_fire", rng=seed)
        model.add_robots(AGENT_FIRE, 3)
        model.control = Subsumption(learner())
        return model.run(30).control.layers[0].policy()

    task = ExtinguishFires(n_robots=3, max_steps=20)
    gate = ValidationGate(task=task, maps="openspace_fire", criteria=Criteria(least={"fires out": 0.0}))
    assert gated(train, gate, most=1).passed


def test_a_controller_that_training_returns_is_validated_as_it_is():
    ahead = Controller(name="ahead", make=lambda: lambda seen: np.ones((len(seen), 2)))
    found = gated(lambda seed: ahead, gate_of(least_ahead=0.6), most=1)
    assert found.passed
    assert found.validations[0] == gate_of(least_ahead=0.6).validate(ahead)


@pytest.mark.parametrize("wrong", [3, None, QLearning(), lambda seen: seen], ids=lambda wrong: type(wrong).__name__)
def test_what_does_not_drive_is_not_validated(wrong):
    with pytest.raises(InvalidValueError, match=r"^control is .*; expected a control such as Subsumption\("):
        gate_of().validate(wrong)


def test_a_measure_that_is_not_known_ranks_behind_all_numbers():
    criteria = Criteria(most={"steps": 5}, least={"coverage": 0.5})
    assert criteria.better({"steps": math.nan, "coverage": 0.4}) == (math.inf, -0.4)
    assert criteria.better({"steps": 6.0, "coverage": math.nan}) == (6.0, math.inf)


def test_a_gated_contestant_counts_all_trainings_and_their_steps(monkeypatch):
    monkeypatch.setattr(all_contestants, "gate_of", lambda task, steps: gate_of(least_ahead=0.6))
    controls = iter([BACK, AHEAD])

    def train(seed, steps):
        return Trained(frozen=next(controls), robot_steps=steps * 15)

    found = all_contestants.gated_in("avoid", train, 1, 100)
    assert (found.frozen, found.trainings, found.passed) == (AHEAD, 2, True)
    assert found.robot_steps == 2 * 1500 + 2 * 2 * 3 * 40


def test_a_contestant_that_passes_at_once_is_the_one_without_a_gate(monkeypatch):
    monkeypatch.setattr(all_contestants, "gate_of", lambda task, steps: gate_of())
    alone, passed = (contestants()[name](3, 20) for name in ("shared Q (b), cooled", "shared Q (b), cooled, gated"))
    assert (alone.trainings, alone.passed, passed.trainings, passed.passed) == (1, None, 1, True)
    one, other = (each.frozen.layers[0].policy.networks for each in (alone, passed))
    assert all((a == b).all() for a, b in zip(one.weights, other.weights, strict=True))


def test_validation_maps_are_none_of_those_to_breed_to_choose_to_compare_and_to_test():
    assert not set(VALIDATION) & {
        *BREEDING,
        *CHOOSING,
        *TRAIN,
        *TEST,
        *range(50_001, 50_021),
        *range(60_001, 60_051),
    }


def test_cooled_contestants_end_cold_and_with_the_last_rate():
    found = contestants()["own Q (b), cooled, with replay"](1, 50)
    policy = found.frozen.layers[0].policy
    assert policy.temperature == pytest.approx(0.1 + 0.9 * 0.96**100)
    assert (policy.training["last_eta"], policy.training["replays"], policy.copies) == (0.02, 14, 15)
    assert found.robot_steps == 100 * 15
    short = contestants()["own Q (b), cooled, short replay"](1, 50).frozen.layers[0].policy.training
    assert (short["replay"], short["replays"], policy.training["replay"]) == (15, 14, 1000)
    brief = contestants()["shared Q (b), cooled, 1/15"](1, 75)
    assert (brief.robot_steps, brief.frozen.layers[0].policy.copies) == (10 * 15, 1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"maps": []},
        {"maps": 3},
        {"task": "avoid"},
        {"task": CollisionAvoidance(variation=Variation(speed=(0.5, 1.0)))},
        {"criteria": {"collisions": 0.5}},
        {"criteria": Criteria(most={"fires out": 0.5})},
        {"rng": -1},
    ],
)
def test_what_is_no_gate_is_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as caught:
        gate_of(**wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [{}, {"most": 0.5}, {"most": {"collisions": "few"}}, {"least": {"coverage": float("nan")}}, {"of_rule": {"x": -1}}],
    ids=str,
)
def test_what_are_no_criteria_is_refused(wrong):
    with pytest.raises(SwarmError):
        Criteria(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [{"train": 3}, {"control": 3}, {"gate": "gate"}, {"rng": -1}, {"most": 0}, {"jobs": 0}],
    ids=lambda wrong: next(iter(wrong)),
)
def test_what_is_no_gated_training_is_refused_before_the_first_training(wrong):
    def train(seed):
        raise AssertionError

    with pytest.raises(SwarmError):
        gated(**{"train": train, "gate": gate_of(), **wrong})
