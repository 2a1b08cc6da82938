"""The benchmark of learning: its tasks and measures, its continuation after an interruption, and its refusals."""

import ast
import json
import re
import shlex
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from mesa_swarm import AGENT9, Map, disc
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.cli import app
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.environments.scores import cells_in_reach
from mesa_swarm.experiments.fingerprints import ENGINE, PACKAGE
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.learning import ReflexPolicy, SensorLayout, save_policy
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.searches.drive_measures import drive_measured, driven_world
from mesa_swarm.searches.validation_gate import VALIDATION
from mesa_swarm_studies.benchmarks import learn_bench as bench
from mesa_swarm_studies.benchmarks.benchmark_tasks import APART, TEST, TRAIN, benchmark_tasks
from mesa_swarm_studies.benchmarks.contestants import BREEDING, CHOOSING
from mesa_swarm_studies.benchmarks.learn_bench import Benchmark, Training, learn_bench
from mesa_swarm_studies.benchmarks.learn_report import (
    command_of,
    lines_of,
    markdown,
    report_page,
    runs_csv,
    summary_json,
)
from mesa_swarm_studies.benchmarks.task_contestants import at_random, contestants_of, evolved_linear

BRIEF = {"seeds": 2, "steps": 40, "evaluation_steps": 10, "maps": 2}
TWO = ("random", "Q (b)")
OUTSIDE = """
import numpy as np

def ahead(observations):
    return np.ones((len(observations), 2))

class Turning:
    def act(self, observations):
        return np.tile([1.0, -1.0], (len(observations), 1))
"""

# Of what the benchmark imports: errors, what does runs and stores them, tables and pictures.
NOT_HASHED = {
    *("errors", "gallery", "model.gallery", "viewing.palette", "viewing.figures"),
    *(f"base.{name}" for name in ("errors", "extras", "files", "progress", "wording")),
    *(f"experiments.{name}" for name in ("compare", "experiment", "figures", "fingerprints", "ledger", "worker_pool")),
    *(f"experiments.{name}" for name in ("reality_gap", "run_tables", "runs", "statistics", "sweep", "tables")),
}
ROOMS = ("experiments", "searches")


def brief(only=TWO, **options):
    return Benchmark(**{**BRIEF, "tasks": ("avoid",), **options}, only=only)


def results_of(run):
    """Return the results apart from the times, which differ each time."""
    return {name: value for name, value in run.numbers.items() if "seconds" not in name}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return learn_bench(brief(), out=tmp_path_factory.mktemp("bench"))


@pytest.fixture
def outside(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "foreign_drivers.py").write_text(OUTSIDE)


def test_the_five_tasks_have_contestants_by_chance_and_by_a_rule():
    assert list(benchmark_tasks()) == ["avoid", "find_fires", "extinguish_fires", "foraging", "aggregation"]
    for name, task in benchmark_tasks().items():
        assert {"random", task.rule} < set(contestants_of(name))


def test_no_map_is_in_two_of_the_blocks_to_train_to_choose_to_validate_and_to_test():
    blocks = BREEDING, CHOOSING, TRAIN, VALIDATION, TEST
    assert len(set().union(*blocks)) == sum(map(len, blocks))
    assert len(TEST) == 50


@pytest.mark.slow
@pytest.mark.parametrize("name", benchmark_tasks())
def test_every_task_measures_a_rule_and_numbers_from_outside_in_the_same_world(name):
    setting = benchmark_tasks()[name]
    rule = contestants_of(name)[setting.rule](1, 0).frozen
    for controller in (rule, at_random(setting.task.numbers, 1)):
        found = setting.drive(controller, f"random {TEST[0]}", 1, 4)
        assert tuple(found) == setting.measures
        assert found == setting.drive(controller, f"random {TEST[0]}", 1, 4)


def test_a_drive_is_what_is_measured_step_by_step_without_the_environment():
    rule = Subsumption(Avoid(), Explore())
    found = benchmark_tasks()["avoid"].drive(rule, "random 60001", 3, 200)
    plain = drive_measured(driven_world(rule, AGENT9, 15, random_map(60_001), APART + 3), 200)
    assert found == pytest.approx(plain, abs=1e-12)


@pytest.mark.parametrize(
    ("measured", "is_met"),
    [((0.5, 0.6, 0.8), True), ((0.51, 0.9, 0.9), False), ((0.0, 0.59, 0.9), False), ((0.0, 0.9, 0.79), False)],
)
def test_the_target_is_few_collisions_a_speed_and_the_coverage_of_the_rule(measured, is_met):
    found = dict(zip(("collisions", "speed ahead", "coverage"), measured, strict=True))
    assert all(benchmark_tasks()["avoid"].target.met(found, {"coverage": 0.8})) is is_met


@pytest.mark.slow
def test_a_linear_controller_is_evolved_to_the_same_weights_each_time():
    seen = np.random.default_rng(1).random((3, 36), np.float32)
    found = [evolved_linear("aggregation", 1, 0.02) for _ in range(2)]
    actions = [controller.actor("continuous")(seen) for controller, _ in found]
    assert (actions[0] == actions[1]).all()
    assert not (actions[0] == evolved_linear("aggregation", 2, 0.02)[0].actor("continuous")(seen)).all()
    assert found[0][1] == (16 + 10) * 20 * 15


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
    assert cells_in_reach(model, model.swarm.position)[:, 21:].sum() == 0
    model.add_robots(AGENT9, poses=[(300, 100, 0.0)])
    assert cells_in_reach(model, model.swarm.position)[:, 22:].all()


def test_within_reach_leaves_out_what_stands_there():
    pillar = Map(name="pillar", bounds=(0, 0, 400, 400), obstacles=[disc((200, 200), 60)])
    model = driven_world(Subsumption(Avoid(), Explore()), AGENT9, 3, pillar, 1)
    cells = cells_in_reach(model, model.swarm.position)
    assert not cells[19:21, 19:21].any()
    assert cells[2:8, 2:8].all()


@pytest.mark.slow
def test_learners_are_measured_frozen_and_still_learning_and_others_only_frozen(runs):
    assert [(run.name, run.seed) for run in runs] == [("random", 1), ("Q (b)", 1), ("random", 2), ("Q (b)", 2)]
    modes = {run.name: {mode for _, mode, _, _ in run.rows()} for run in runs}
    assert modes == {"random": {"frozen"}, "Q (b)": {"frozen", "learning"}}
    assert all(len(list(run.rows())) == 3 * 4 * len(modes[run.name]) for run in runs)
    assert len(runs[1].curve()) == 33
    assert runs[1].results["robot-steps"] == 40 * 15


@pytest.mark.slow
def test_an_interrupted_benchmark_goes_on_to_the_same_results(tmp_path, monkeypatch):
    calls = []
    usual = bench.measured

    def interrupted(*given, **more):
        calls.append(more)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return usual(*given, **more)

    whole = learn_bench(brief(maps=1), out=tmp_path / "whole")
    monkeypatch.setattr(bench, "measured", interrupted)
    with pytest.raises(KeyboardInterrupt):
        learn_bench(brief(maps=1), out=tmp_path)
    again = learn_bench(brief(maps=1), out=tmp_path)
    assert len(calls) == 3 + 2
    assert [list(run.rows()) for run in again] == [list(run.rows()) for run in whole]
    learn_bench(brief(maps=1), out=tmp_path)
    assert len(calls) == 5
    learn_bench(brief(only=("random",), maps=1), out=tmp_path, resume=False)
    assert len(calls) == 7


def training(seed, **more):
    kinds = {"collisions": 1.0, "worst robot": 2.0, "speed ahead": 0.5, "coverage": 0.25}
    results = {f"random {k}|frozen|{m}": v for k in (60_001, 60_002) for m, v in kinds.items()}
    figures = {"train wall seconds": 1.0, "train processor seconds": 1.0, "robot-steps": 15.0, "trainings": 1.0}
    numbers = {**figures, "passed": None, **results, **more}
    return Training(task="avoid", name="one", seed=seed, results=numbers)


def test_lines_are_means_over_seeds_of_means_over_maps_without_what_did_not_happen():
    trainings = [training(seed, **{"random 60001|frozen|collisions": 3.0 * seed}) for seed in range(1, 7)]
    trainings[0].results["random 60001|frozen|coverage"] = None
    (line,) = lines_of(trainings)
    assert (line.group, line.mode) == ("test", "frozen")
    assert line.values["collisions"].estimate == np.mean([(3.0 * seed + 1.0) / 2 for seed in range(1, 7)])
    assert line.values["collisions"].low < line.values["collisions"].estimate < line.values["collisions"].high
    assert line.values["coverage"].estimate == 0.25


def test_the_table_of_trainings_counts_single_trainings_that_missed():
    text = markdown(brief(), [training(1, trainings=3.0, passed=1.0), training(2, trainings=5.0, passed=0.0)])
    assert "| 7 of 8 " in text
    assert " of 2" not in markdown(brief(), [training(1), training(2)])


def test_tables_hold_all_contestants_and_are_read_back(runs):
    text = markdown(brief(), runs)
    assert all(name in text for name in TWO)
    assert "On the test maps, 2 of them, still learning" in text
    page = report_page(brief(), runs, Path("docs/page.md"))
    assert all(line in page for line in text.splitlines())
    assert "mesa-swarm learn-bench --task avoid --only 'random;Q (b)' --seeds 2 --steps 40" in page
    assert "--report docs/page.md\n" in page
    assert "--report page.md\n" in report_page(brief(), runs, Path("/somewhere/page.md"))
    rows = runs_csv(runs).splitlines()
    assert rows[0] == "task,contestant,seed,map,mode,measure,value"
    assert len(rows) == 1 + 2 * 3 * 4 * (1 + 2)
    summary = json.loads(summary_json(brief(), runs))
    assert (summary["seeds"], len(summary["lines"])) == (2, 2 * 3)


@pytest.mark.slow
def test_the_command_writes_tables_pictures_and_a_page(tmp_path):
    line = "learn-bench --task avoid --only random;Hebbian --seeds 1 --steps 5 --evaluation-steps 3 --maps 1 --jobs 1"
    done = CliRunner().invoke(app, [*line.split(), "--quiet", "--out", tmp_path, "--report", tmp_path / "page.md"])
    assert done.exit_code == 0, done.output
    names = {path.name for path in tmp_path.iterdir()}
    tables = {"learn_bench.md", "learn_bench.csv", "learn_bench.json"}
    assert names == tables | {"learn_bench_avoid.png", "learn_bench_curves.png", "ledger.jsonl", "page.md", "pictures"}
    page = (tmp_path / "page.md").read_text()
    shown = re.findall(r"\]\((pictures/.*?)\)", page)
    assert len(shown) == 2
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in shown)


@pytest.mark.parametrize("name", ["page.txt", "folder.md"])
def test_a_page_that_cannot_be_written_is_refused_before_the_first_training(tmp_path, monkeypatch, name):
    (tmp_path / "folder.md").mkdir()
    monkeypatch.setattr(bench, "learn_bench", None)
    line = "learn-bench --task avoid --only random --seeds 1 --quiet --out"
    done = CliRunner().invoke(app, [*line.split(), tmp_path / "out", "--report", tmp_path / name])
    assert "report is" in str(done.exception)
    assert not (tmp_path / "out").exists()


def test_the_command_on_a_page_makes_the_same_benchmark(monkeypatch, tmp_path):
    benchmark = brief((), seeds=30, tasks=("avoid", "foraging"), evaluation_steps=10)
    made = []
    monkeypatch.setattr(bench, "learn_bench", lambda benchmark, **more: made.append(benchmark) or [])
    CliRunner().invoke(app, [*shlex.split(command_of(benchmark))[1:], "--out", tmp_path, "--quiet"])
    assert made == [benchmark]


def test_controllers_from_outside_are_measured_beside_the_rule_and_chance(tmp_path, outside):
    eyes = SensorLayout.of(AGENT9)
    save_policy(ReflexPolicy.reflex(eyes, [*[[0, 0]] * 9, [1, 1]]), "ahead.npz")
    benchmark = brief(
        (), seeds=1, maps=1, policies=("./foreign_drivers.py:ahead", "./foreign_drivers.py:Turning", "ahead.npz")
    )
    found = {run.name: dict(run.numbers) for run in learn_bench(benchmark, out=tmp_path)}
    assert list(found) == ["random", "Avoid + Explore", *benchmark.policies]
    ahead, turning, saved = (found[name] for name in benchmark.policies)
    assert ahead["random 60001|frozen|speed ahead"] == saved["random 60001|frozen|speed ahead"] == 1.0
    assert turning["random 60001|frozen|speed ahead"] == 0.0


def test_a_controller_from_outside_is_measured_anew_when_its_file_changes(tmp_path, outside):
    benchmark = brief((), policies=("./foreign_drivers.py:ahead",))
    before = benchmark.key("avoid", "./foreign_drivers.py:ahead", 1)
    (tmp_path / "foreign_drivers.py").write_text(OUTSIDE + "# changed")
    assert benchmark.key("avoid", "./foreign_drivers.py:ahead", 1) != before


@pytest.mark.parametrize(
    "wrong",
    [
        *({"seeds": 0}, {"steps": 0}, {"evaluation_steps": 0}, {"only": ("Q (z)",)}, {"seeds": np.nan}, {"maps": 51}),
        *({"tasks": "avoid"}, {"policies": -1}, {"only": [1]}),
        *({"tasks": ("flying",)}, {"policies": ("nothing.npz",)}, {"policies": ("mine",)}),
    ],
)
def test_what_cannot_be_a_benchmark_is_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as caught:
        Benchmark(**{**BRIEF, **wrong})
    assert "\n" not in str(caught.value)


def test_the_order_in_which_contestants_are_named_does_not_matter():
    assert brief(only=("Q (b)", "random")).names("avoid") == ["random", "Q (b)"]
    assert brief().key("avoid", "random", 1) == brief(only=()).key("avoid", "random", 1)
    assert brief().key("avoid", "random", 1) != brief().key("avoid", "random", 2)


def test_contestants_that_are_named_twice_take_part_once(outside):
    twice = brief(("random", "random"), policies=("./foreign_drivers.py:ahead",) * 2)
    assert twice.names("avoid") == ["random", "./foreign_drivers.py:ahead"]


def test_contestants_of_the_experiment_about_own_networks_take_part_when_they_are_named():
    everyone = Benchmark(tasks=("avoid",)).names("avoid")
    assert not set(bench.NAMED_ONLY) & set(everyone)
    assert set(bench.NAMED_ONLY) < set(contestants_of("avoid"))
    assert Benchmark(tasks=("avoid",), only=bench.NAMED_ONLY).names("avoid") == list(bench.NAMED_ONLY)


def homes_of(file):
    """Yield the modules in which lies what a file imports of the package."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module.partition(".")[0] == "mesa_swarm":
            values = [getattr(import_module(node.module), alias.name) for alias in node.names]
            yield from (getattr(value, "__module__", node.module) for value in values)


def test_trainings_are_done_again_when_code_changes_that_trains_drives_or_measures():
    hashed = [PACKAGE / name for name in (*ENGINE, *bench.SOURCES)]
    assert all(path.exists() for path in hashed)
    assert Path(bench.__file__).parent in hashed
    files = [*Path(bench.__file__).parent.glob("*.py"), *(path for path in hashed if path.parent.name in ROOMS)]
    modules = {home for file in files for home in homes_of(file) if home.startswith("mesa_swarm.")}
    paths = {home: PACKAGE / home.partition(".")[2].replace(".", "/") for home in modules}
    left = [home for home, path in paths.items() if not {path.with_suffix(".py"), path, path.parent} & set(hashed)]
    assert {"mesa_swarm.analysis.coverage", "mesa_swarm.environments.tasks"} <= modules
    assert {home.partition(".")[2] for home in left} <= NOT_HASHED


def test_a_stored_training_with_other_numbers_than_those_of_a_training_counts_as_never_done(tmp_path):
    once = brief(("random",), seeds=1, maps=1)
    real = learn_bench(once, out=tmp_path)[0].results
    for wrong in ({}, {"a": 1.0}, {**real, "a|b|c": 1.0}, {**real, "robot-steps": None}, {**real, "training|00": 1.0}):
        with Ledger(tmp_path / "ledger.jsonl") as ledger:
            ledger.append(once.key("avoid", "random", 1), Outcome(steps=40, results=wrong))
        (again,) = learn_bench(once, out=tmp_path)
        assert results_of(again) == {name: value for name, value in real.items() if "seconds" not in name}


@pytest.mark.long
def test_a_benchmark_of_two_processes_has_the_results_of_one(tmp_path):
    alone, both = (learn_bench(brief(maps=1), out=tmp_path / str(jobs), jobs=jobs) for jobs in (1, 2))
    assert [results_of(run) for run in alone] == [results_of(run) for run in both]


def test_to_begin_anew_leaves_a_file_alone_that_is_not_a_ledger(tmp_path):
    (tmp_path / "ledger.jsonl").write_bytes(b"my own notes\n")
    with pytest.raises(SwarmError, match="is not a ledger"):
        learn_bench(brief(), out=tmp_path, resume=False)
    assert (tmp_path / "ledger.jsonl").read_bytes() == b"my own notes\n"
