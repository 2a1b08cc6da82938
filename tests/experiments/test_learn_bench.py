"""The benchmark of learning: its measures, its continuation after an interruption, and its refusals."""

import ast
import json

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, disc
from mesa_swarm.cli.learn import learn_bench as command
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import SwarmError
from mesa_swarm.experiments import learn_bench as bench
from mesa_swarm.experiments.contestants import BREEDING, CHOOSING, contestants
from mesa_swarm.experiments.driving import drive_measured, driven_world, within_reach
from mesa_swarm.experiments.fingerprints import ENGINE, PACKAGE
from mesa_swarm.experiments.learn_bench import (
    EVERY,
    GENERATED,
    UNSEEN,
    Benchmark,
    Training,
    learn_bench,
    lines_of,
    markdown,
    runs_csv,
    seed_by_seed,
    summary_json,
)
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.world.random_map import random_map

BRIEF = {"seeds": 2, "steps": 40, "evaluation_steps": 10}
TWO = ("random", "Hebbian")


def brief(only=TWO, **options):
    return Benchmark(**{**BRIEF, **options}, only=only)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return learn_bench(brief(), out=tmp_path_factory.mktemp("bench"))


def test_all_that_the_table_must_list_take_part():
    wanted = {"random", "Avoid + Explore", "evolved reflex", "Q (a)", "Q (b)", "Q (c)", "Q (c), typed", "wire-fitted Q"}
    assert wanted | {"Hebbian"} <= set(contestants())


def test_ten_seeds_see_all_built_in_and_twenty_generated_maps():
    ten = Benchmark(seeds=10)
    seen = {place for seed in range(1, 11) for place in ten.maps(seed)}
    assert seen == {"original", "sparse", "openspace", "openspace_fire", *(f"random {k}" for k in GENERATED)}
    assert all(len(ten.maps(seed)) == 6 for seed in range(1, 11))
    assert ten.maps(11) == ten.maps(1)
    assert len(GENERATED) == len(UNSEEN) == 20


def test_no_map_is_in_two_of_the_blocks_to_breed_to_choose_to_compare_and_to_test():
    blocks = BREEDING, CHOOSING, GENERATED, UNSEEN
    assert len(set().union(*blocks)) == sum(map(len, blocks))


def test_the_rule_and_the_bred_are_measured_on_every_unseen_map_with_each_seed(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "UNSEEN", range(40_001, 40_004))
    alone = Benchmark(seeds=1, steps=40, evaluation_steps=10, only=("random", "Avoid + Explore", "evolved reflex"))
    runs = learn_bench(alone, out=tmp_path)
    rows = {run.name: {measure: value for place, _, measure, value in run.rows() if place == EVERY} for run in runs}
    assert (rows["random"], len(rows["evolved reflex"])) == ({}, 4)
    rule, apart = Subsumption(Avoid(), Explore()), bench.APART + 1
    each = [drive_measured(driven_world(rule, AGENT9, 15, random_map(k), apart), 10) for k in range(40_001, 40_004)]
    assert rows["Avoid + Explore"] == {measure: np.mean([row[measure] for row in each]) for measure in each[0]}
    assert "evolved reflex: each seed on all twenty unseen maps" in markdown(alone, runs)


def test_the_target_is_judged_seed_by_seed_and_in_the_mean():
    def training(seed, name, *values):
        measures = ("collisions", "speed ahead", "coverage")
        results = {f"{EVERY}|frozen|{m}": v for m, v in zip(measures, values, strict=True)}
        return Training(name=name, seed=seed, results=results)

    rule = [training(seed, "Avoid + Explore", 60.0, 0.9, 0.8) for seed in (1, 2)]
    bred = [training(1, "evolved reflex", 0.25, 0.875, 0.8125), training(2, "evolved reflex", 0.75, 0.875, 0.8125)]
    table = [
        [cell.strip() for cell in row.split("|")[1:-1]]
        for row in seed_by_seed(rule + bred, "evolved reflex").splitlines()[4:]
    ]
    assert table == [
        ["1", "0.25", "0.88", "0.812", "0.800", "yes"],
        ["2", "0.75", "0.88", "0.812", "0.800", "no"],
        ["mean", "0.50", "0.88", "0.812", "0.800", "yes"],
    ]
    alone = seed_by_seed(bred[:1], "evolved reflex").splitlines()[-1]
    assert [cell.strip() for cell in alone.split("|")[-3:-1]] == ["nan", "no"]


def test_a_robot_that_drives_straight_is_fast_and_sees_what_it_passes():
    hall = Map(name="hall", bounds=(0, 0, 400, 400))
    model = driven_world(Subsumption(Explore()), AGENT9, 0, hall, 1)
    model.add_robots(AGENT9, poses=[(105, 105, 0.0)])
    measured = drive_measured(model, 100)
    assert (measured["collisions"], measured["worst robot"], measured["speed ahead"]) == (0.0, 0.0, 1.0)
    assert measured["coverage"] == 11 / 1600  # x from 106 to 205, in cells of 10


def test_collisions_are_counted_per_robot_and_thousand_steps_and_the_worst_is_reported():
    hall = Map(name="hall", bounds=(0, 0, 400, 400))
    model = driven_world(Subsumption(Explore()), AGENT9, 0, hall, 1)
    model.add_robots(AGENT9, poses=[(395, 200, 0.0), (100, 100, 0.0)])
    measured = drive_measured(model, 50)
    assert (measured["collisions"], measured["worst robot"]) == (500.0, 1000.0)


def test_what_robots_can_reach_is_what_any_of_them_can():
    walls = Map.from_toml(
        'name = "two"\nwidth = 400\nheight = 400\n[[obstacle]]\nshape = "rectangle"\ncorners = [[190, 0], [210, 400]]\n'
    )
    model = driven_world(Subsumption(Explore()), AGENT9, 0, walls, 1)
    model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    assert within_reach(model)[:, 21:].sum() == 0
    model.add_robots(AGENT9, poses=[(300, 100, 0.0)])
    assert within_reach(model)[:, 22:].all()


def test_within_reach_leaves_out_what_stands_there():
    pillar = Map(name="pillar", bounds=(0, 0, 400, 400), obstacles=[disc((200, 200), 60)])
    model = driven_world(Subsumption(Avoid(), Explore()), AGENT9, 3, pillar, 1)
    cells = within_reach(model)
    assert not cells[19:21, 19:21].any()
    assert cells[2:8, 2:8].all()


def test_learners_are_measured_frozen_and_still_learning_and_others_only_frozen(runs):
    assert [(run.name, run.seed) for run in runs] == [("random", 1), ("Hebbian", 1), ("random", 2), ("Hebbian", 2)]
    modes = {run.name: {mode for _, mode, _, _ in run.rows()} for run in runs}
    assert modes == {"random": {"frozen"}, "Hebbian": {"frozen", "learning"}}
    assert all(len(list(run.rows())) == 6 * 4 * len(modes[run.name]) for run in runs)
    assert len(runs[1].curve()) == 33
    assert runs[1].results["robot-steps"] == 40 * 15


def test_an_interrupted_benchmark_goes_on_to_the_same_results(tmp_path, monkeypatch):
    calls = []
    usual = bench.measured

    def interrupted(*given, **more):
        calls.append(more)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return usual(*given, **more)

    monkeypatch.setattr(Benchmark, "maps", lambda self, seed: ("openspace",))
    whole = learn_bench(brief(), out=tmp_path / "whole")
    monkeypatch.setattr(bench, "measured", interrupted)
    with pytest.raises(KeyboardInterrupt):
        learn_bench(brief(), out=tmp_path)
    again = learn_bench(brief(), out=tmp_path)
    assert len(calls) == 3 + 2
    assert [list(run.rows()) for run in again] == [list(run.rows()) for run in whole]
    learn_bench(brief(), out=tmp_path)
    assert len(calls) == 5
    learn_bench(brief(only=("random",)), out=tmp_path, resume=False)
    assert len(calls) == 7


def test_lines_are_interquartile_means_over_seeds_and_maps():
    results = {
        f"random {k}|frozen|{m}": v for k, v in enumerate([1.0, 2.0, 3.0, 90.0]) for m in ("collisions", "coverage")
    }
    results |= {f"random {k}|frozen|{m}": 0.5 for k in range(4) for m in ("worst robot", "speed ahead")}
    (line,) = lines_of([Training(name="one", seed=1, results=results)])
    assert (line.group, line.mode, line.collisions.estimate, line.worst, line.ahead) == (
        "generated",
        "frozen",
        2.5,
        0.5,
        0.5,
    )


def test_tables_hold_all_contestants_and_are_read_back(runs):
    text = markdown(brief(), runs)
    assert all(name in text for name in TWO)
    assert "On generated maps that were not used for training, still learning" in text
    rows = runs_csv(runs).splitlines()
    assert rows[0] == "contestant,seed,map,group,mode,collisions,worst robot,speed ahead,coverage"
    assert len(rows) == 1 + 2 * 6 * 1 + 2 * 6 * 2
    summary = json.loads(summary_json(brief(), runs))
    assert (summary["seeds"], len(summary["lines"])) == (2, 3 * 3)


def test_the_command_writes_tables_and_pictures(tmp_path, capsys):
    command(seeds=1, steps=5, evaluation_steps=3, only="Hebbian", jobs=1, out=tmp_path / "b", resume=True, quiet=True)
    names = {path.name for path in (tmp_path / "b").iterdir()}
    assert {"learn_bench.md", "learn_bench.csv", "learn_bench.json", "learn_bench.png", "learn_curves.png"} <= names
    assert "learn_bench.png" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong",
    [{"seeds": 0}, {"steps": 0}, {"evaluation_steps": 0}, {"only": ("Q (z)",)}, {"seeds": np.nan}],
)
def test_what_is_no_benchmark_is_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as caught:
        Benchmark(**{**BRIEF, **wrong})
    assert "\n" not in str(caught.value)


def test_who_takes_part_does_not_depend_on_the_order_in_which_they_are_named():
    assert brief(only=("Hebbian", "random")).names == ["random", "Hebbian"]
    assert brief().key("random", 1) == Benchmark(**BRIEF).key("random", 1) != brief().key("random", 2)


def test_trainings_are_done_again_when_code_changes_that_trains_drives_or_measures():
    hashed = {name.split("/")[0] for name in (*ENGINE, *bench.SOURCES)}
    files = [PACKAGE / name for name in bench.SOURCES]
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    used = {
        node.module.split(".")[1] for node in nodes if isinstance(node, ast.ImportFrom) and "mesa_swarm" in node.module
    }
    parts = {part if (PACKAGE / part).is_dir() else f"{part}.py" for part in used}
    assert "analysis" in parts
    assert parts - hashed == {"errors.py", "files.py", "progress.py"}
    assert all((PACKAGE / name).exists() for name in (*ENGINE, *bench.SOURCES))


def test_a_stored_training_with_other_numbers_than_those_of_a_training_counts_as_never_done(tmp_path):
    once = Benchmark(seeds=1, steps=40, evaluation_steps=10, only=("random",))
    real = learn_bench(once, out=tmp_path)[0].results
    for wrong in ({}, {"a": 1.0}, {**real, "a|b|c": 1.0}, {**real, "robot-steps": None}, {**real, "training|00": 1.0}):
        with Ledger(tmp_path / "ledger.jsonl") as ledger:
            ledger.append(once.key("random", 1), Outcome(steps=40, results=wrong))
        again = learn_bench(once, out=tmp_path)[0].results
        assert {name: value for name, value in again.items() if "seconds" not in name} == {
            name: value for name, value in real.items() if "seconds" not in name
        }


def test_to_begin_anew_leaves_a_file_alone_that_is_not_a_ledger(tmp_path):
    (tmp_path / "ledger.jsonl").write_bytes(b"my own notes\n")
    with pytest.raises(SwarmError, match="is not a ledger"):
        learn_bench(brief(), out=tmp_path, resume=False)
    assert (tmp_path / "ledger.jsonl").read_bytes() == b"my own notes\n"
