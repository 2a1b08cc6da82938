import csv
import io
import json
import math
from fractions import Fraction
from functools import partial
from importlib import import_module
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

import mesa_swarm
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.base.files import check_writable, write_whole
from mesa_swarm.experiments.compare import compare, run_plan
from mesa_swarm.experiments.figures import comparison_figure
from mesa_swarm.experiments.plan import checked_plan
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.runs import Run, attempt, numbers_of, simulate
from mesa_swarm.experiments.tables import WIDEST, finding, fitting, runs_csv, summary_csv, summary_rows
from mesa_swarm.model.gallery import class_name, description, find_model, model_names
from mesa_swarm.models.collision_avoidance import DESIGNS
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.pictures import png
from support.comparisons import comparison_of, plan_of

FIRE = find_model("fire_fighting")
AVOID = find_model("collision_avoidance")


@pytest.fixture(scope="module")
def comparison():
    return compare(FIRE, seeds=3, steps=400, jobs=1)


def made_up(columns, model_class=FIRE, parameter="strategy"):
    return comparison_of(columns, model_class, parameter)


def test_every_value_meets_the_same_seeds(comparison):
    assert [(run.value, run.rng) for run in comparison.runs] == [
        (value, rng) for rng in (1, 2, 3) for value in ("A", "B")
    ]


def test_each_run_is_what_the_model_does_alone(comparison):
    alone = FIRE(strategy="B", rng=2).run(400)
    run = comparison.runs[3]
    assert (run.state_hash, run.results, run.steps) == (alone.state_hash(), alone.results(), alone.steps)


@pytest.mark.slow
def test_a_comparison_that_was_interrupted_goes_on_in_its_folder_and_ends_in_the_same_files(comparison, tmp_path):
    outcomes = []
    with pytest.raises(KeyboardInterrupt):
        run_plan(
            comparison.plan,
            heard=lambda run: outcomes.append(run) or stop_after(4, outcomes),
            folder=RunFiles(tmp_path),
        )
    went_on = []
    again = run_plan(comparison.plan, heard=went_on.append, folder=tmp_path)
    assert (again.done_before, again.runs) == (4, comparison.runs)
    # The runs with the first seed are done again, for the pictures.
    assert [(run.rng, run.value) for run in went_on] == [(1, "A"), (1, "B"), (3, "A"), (3, "B")]
    whole = [path.read_bytes() for path in comparison.save(tmp_path / "whole")]
    assert [path.read_bytes() for path in again.save(tmp_path)] == whole


def stop_after(count, outcomes):
    if len(outcomes) == count:
        raise KeyboardInterrupt


@pytest.mark.slow
def test_runs_of_changed_code_settings_or_steps_are_other_runs(tmp_path, monkeypatch):
    def done_before(**how):
        return compare(FIRE, **{"seeds": 2, "steps": 5, "jobs": 1, "out": tmp_path, **how}).done_before

    assert [done_before(), done_before(), done_before(seeds=3)] == [0, 4, 4]
    assert [done_before(steps=6), done_before(settings={"n_robots": 3}), done_before(measures=["fires out"])] == [0] * 3
    monkeypatch.setattr(import_module("mesa_swarm.experiments.plan"), "source_hash", lambda model_class: "changed")
    assert done_before() == 0


@pytest.mark.slow
def test_the_outcome_does_not_depend_on_the_number_of_jobs(comparison):
    two = compare(FIRE, seeds=3, steps=400, jobs=2)
    assert two.runs == comparison.runs
    assert two.table() == comparison.table()
    assert runs_csv(two) == runs_csv(comparison)


def test_portraits_are_drawn_of_the_first_seed_only(comparison):
    assert [run.portrait is not None for run in comparison.runs] == [True, True, False, False, False, False]
    assert list(comparison.portraits) == ["A", "B"]


def test_steps_and_values_are_by_default_those_that_the_model_declares():
    plan = checked_plan(FIRE)
    assert (plan.parameter, plan.values, plan.steps, plan.seeds) == ("strategy", ("A", "B"), 15_000, range(1, 31))
    assert checked_plan(AVOID, seeds=1).steps == 3_000


def test_values_of_a_choice_need_not_be_given():
    assert checked_plan(AVOID, parameter="design", seeds=1).values == tuple(DESIGNS)


def test_settings_reach_the_model():
    plan = checked_plan(FIRE, settings={"n_robots": 3}, seeds=1)
    assert len(plan.built(1, "A").robots) == 3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"seeds": 0}, "seeds is 0"),
        ({"seeds": float("nan")}, "seeds is nan"),
        ({"steps": 0}, "steps is 0"),
        ({"steps": 10**12}, "steps is 1000000000000"),
        ({"jobs": 0}, "jobs is 0"),
        ({"jobs": -2}, "jobs is -2"),
        ({"parameter": "stratgy"}, "did you mean 'strategy'"),
        ({"parameter": "n_robots"}, "0 values of n_robots"),
        ({"parameter": "n_robots", "values": [5, 10**9]}, "do not fit"),
        ({"parameter": "n_robots", "values": [5, -1]}, "n_robots is -1"),
        ({"values": ["A"]}, "1 values of strategy"),
        ({"values": ["A", "A"]}, "expected different ones"),
        ({"values": ["A", "C"]}, "unknown strategy 'C'"),
        ({"seeds": []}, "number of seeds is 0"),
        ({"seeds": [1, 1]}, "expected different ones"),
        ({"seeds": [1.5]}, "seeds is 1.5"),
        ({"seeds": "12"}, "seeds is '12'"),
        ({"measures": ["fires"]}, "did you mean 'fires out'"),
        ({"measures": "fires out"}, "expected a list of names"),
        ({"measures": ["fires out", "fires out"]}, "expected different ones"),
        ({"settings": {"strategy": "A"}}, "set and compared at once"),
        ({"settings": {"n_robotz": 3}}, "did you mean 'n_robots'"),
        ({"settings": {"k1": float("inf")}}, "k1 is inf"),
    ],
)
def test_a_wrong_comparison_is_refused_in_one_line_before_it_is_run(wrong, message):
    with pytest.raises(SwarmError, match=message) as caught:
        compare(FIRE, **wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("model", "message"), [("fire_figting", "did you mean 'fire_fighting'"), (7, "model is 7; expected a class")]
)
def test_what_is_not_a_model_is_refused_in_one_line(model, message):
    with pytest.raises(SwarmError, match=message):
        compare(model)


def test_a_comparison_can_be_asked_for_by_position_by_name_and_with_seeds_of_ones_own():
    by_class = compare(FIRE, "strategy", ("A", "B"), range(3), steps=20, measures=["fires out"], jobs=1)
    by_name = mesa_swarm.compare("fire_fighting", "strategy", ["A", "B"], [0, 1, 2], steps=20, jobs=1)
    assert [run.state_hash for run in by_class.runs] == [run.state_hash for run in by_name.runs]
    assert [run.rng for run in by_class.runs[::2]] == [0, 1, 2]
    assert by_class.measures == ["fires out"]
    assert list(by_class.portraits) == ["A", "B"]


def test_the_function_at_the_root_hides_no_module():
    assert import_module("mesa_swarm.experiments.sweep").sweep is mesa_swarm.sweep
    assert import_module("mesa_swarm.experiments.compare").compare is mesa_swarm.compare
    assert mesa_swarm.Recording is import_module("mesa_swarm.recording").Recording


def test_a_model_without_results_is_refused():
    class Mute(SwarmModel):
        def __init__(self, *, speed: float = 1.0, rng=None) -> None:
            super().__init__(rng=rng)

    with pytest.raises(SwarmError, match=r"Mute has no method results"):
        compare(Mute, parameter="speed", values=[1.0, 2.0])
    with pytest.raises(SwarmError, match="has no attribute compares"):
        compare(Mute)


@pytest.mark.parametrize("wrong", [{"n_robots": (2, 3)}, "n_robots", ("n_robots", 2), 3, ("n_robots",)])
def test_an_attribute_compares_that_is_not_a_parameter_and_values_is_refused_in_one_line(wrong):
    class Odd(find_model("boids")):
        compares = wrong

    with pytest.raises(SwarmError, match=r'^compares of Odd is .*; expected .* compares = "strategy", \("A", "B"\)$'):
        compare(Odd, seeds=2, steps=5)


def test_results_that_are_not_numbers_are_refused():
    class Odd(SwarmModel):
        compares = "speed", (1.0, 2.0)

        def __init__(self, *, speed: float = 1.0, rng=None) -> None:
            super().__init__(rng=rng)

        def results(self):
            return {"speed": float("nan")}

    with pytest.raises(SwarmError, match="result 'speed' is nan"):
        compare(Odd)


@pytest.mark.slow
def test_an_error_within_a_run_reaches_the_caller_from_other_processes():
    plan = plan_of(FIRE, "n_robots", (5, 10**9), (1, 2), 5)
    with pytest.raises(SwarmError, match="do not fit"):
        run_plan(plan, 2)


def test_the_table_fits_a_terminal_and_shows_shares_and_intervals(comparison):
    lines = comparison.table().splitlines()
    assert max(map(len, lines)) <= WIDEST
    assert lines[0] == "FireFighting: 3 paired seeds, at most 400 steps each"
    row = next(line for line in lines if line.startswith("fire 2 (largest) out at"))
    assert row.split()[5:] == ["A", "0/3", "[0-56", "%]", "-"]


def test_a_table_that_is_too_wide_puts_names_on_their_own_lines():
    columns = {value: {"a measure with a long name " * 3: [1e9, 2e9, 4e9]} for value in ("one value", "another")}
    text = made_up(columns, AVOID, "turn").table()
    assert max(map(len, text.splitlines())) <= WIDEST
    assert "a measure with a long name" in text


def test_fitting_tables_stay_as_they_are():
    assert fitting([["", "x"], ["name", "1"]])[-1] == "name  1"


def test_the_csv_of_runs_has_every_number(comparison):
    rows = list(csv.DictReader(io.StringIO(runs_csv(comparison))))
    assert [(row["strategy"], int(row["rng"])) for row in rows] == [(r.value, r.rng) for r in comparison.runs]
    for row, run in zip(rows, comparison.runs, strict=True):
        assert row["state_hash"] == run.state_hash
        numbers = {name: float(row[name]) if row[name] else None for name in run.results}
        assert numbers == run.results


def test_the_csv_of_the_summary_has_every_limit_and_no_nan(comparison):
    text = summary_csv(summary_rows(comparison))
    rows = list(csv.DictReader(io.StringIO(text)))
    assert "nan" not in text
    assert len(rows) == 2 * len(comparison.measures)
    assert {row["difference"] for row in rows[::2]} == {""}


def test_the_difference_in_the_csv_of_the_summary_is_that_of_the_means():
    few = made_up({"a": {"hits": [1, 2, 3]}, "b": {"hits": [5, 6, 10]}}, AVOID, "turn")
    first, second = csv.DictReader(io.StringIO(summary_csv(summary_rows(few))))
    assert (float(first["mean"]), float(second["mean"])) == (2.0, 7.0)
    assert float(second["difference"]) == 5.0


def test_the_finding_about_fires_counts_runs_and_calls_a_clear_difference_clear():
    out = {"fires out": [7] * 30, "fire 2 (largest) out at": [100] * 30, "all fires out at": [200] * 30}
    left = {"fires out": [6] * 30, "fire 2 (largest) out at": [None] * 30, "all fires out at": [None] * 25 + [300] * 5}
    text = finding(made_up({"A": left, "B": out}))
    assert text.startswith(
        "With strategy B the swarm put out all fires in 30 of 30 runs (95 % interval 89-100 %), with A in 5 of 30"
    )
    assert "a clear difference; most different is 'fire 2 (largest) out': in 30 runs with B, in 0 with A." in text
    assert "\n" not in text


def test_the_finding_claims_only_what_the_intervals_support():
    first = {"all fires out at": [1, 2, None, None] * 2}
    second = {"all fires out at": [1, 2, 3, None] * 2}
    assert "inconclusive with these seeds" in finding(made_up({"A": first, "B": second}))


def test_few_seeds_are_inconclusive():
    few = made_up({"a": {"hits": [1, 2, 3]}, "b": {"hits": [5, 6, 7]}}, AVOID, "turn")
    assert "inconclusive with 3 seeds, 6 are required" in finding(few)
    assert "Means and differences of fewer than 6 have no interval." in few.table()


def test_a_parameter_keeps_its_name_at_the_head_of_the_finding():
    columns = {4: {"all fires out at": [None] * 6}, 9: {"all fires out at": [50] * 6}}
    assert finding(made_up(columns, FIRE, "n_robots")).startswith("With n_robots 9 the swarm put out all fires in 6 of")


def test_a_time_that_never_came_is_later_than_any_and_counts_in_no_difference():
    columns = {"A": {"task done at": [None, 10, 10, None]}, "B": {"task done at": [5, 10, None, None]}}
    row = summary_rows(made_up(columns))[1]
    assert (row.pairs, row.difference.estimate) == (1, 0.0)
    assert (row.ranked, row.larger.estimate) == (4, (0 + 0.5 + 1 + 0.5) / 4)


def test_another_number_that_is_missing_is_left_out_and_the_pairs_are_counted():
    columns = {"A": {"spread": [None, 1.0, 2.0]}, "B": {"spread": [5.0, 3.0, 3.0]}}
    comparison = made_up(columns)
    row = summary_rows(comparison)[1]
    assert (row.pairs, row.ranked, row.larger.estimate) == (2, 2, 1.0)
    assert "(2 pairs)" in comparison.table()
    assert "(1 pair)" in made_up({"A": {"spread": [None, 1.0]}, "B": {"spread": [5.0, 3.0]}}).table()


def test_each_value_is_compared_with_the_first():
    columns = {n: {"hits": [n + k for k in range(8)]} for n in (4, 8, 16)}
    rows = summary_rows(made_up(columns, FIRE, "n_robots"))
    assert [row.difference and row.difference.estimate for row in rows] == [None, 4.0, 12.0]


def test_the_intervals_of_times_do_not_reach_below_zero():
    times = {"A": {"out at": [1, 1, 2, 1, 3, 400]}, "B": {"out at": [2, 1, 1, 2, 1, 3]}}
    assert all(row.summary.mean.low >= 1 for row in summary_rows(made_up(times)))


@pytest.mark.slow
def test_the_same_runs_give_the_same_table_and_pictures_byte_for_byte():
    numbers = np.random.default_rng(3).exponential(100, (2, 30)).tolist()
    first, second = (made_up({"A": {"a at": numbers[0]}, "B": {"a at": numbers[1]}}) for _ in range(2))
    assert first.table() == second.table()
    assert summary_csv(summary_rows(first)) == summary_csv(summary_rows(second))
    assert png(comparison_figure(first, ["a at"])) == png(comparison_figure(second, ["a at"]))


def test_the_finding_states_no_difference():
    same = {"all fires out at": [1, 2, 3]}
    assert ": no difference" in finding(made_up({"A": same, "B": same}))
    same = {"collisions": [1, 2, 3]}
    assert ": no difference" in finding(made_up({"a": same, "b": same}, AVOID, "turn"))


def test_the_finding_about_one_seed_claims_nothing():
    one = made_up({"a": {"collisions": [1]}, "b": {"collisions": [5]}}, AVOID, "turn")
    assert "inconclusive with one seed" in finding(one)


def test_the_finding_about_numbers_uses_the_paired_difference():
    base = [10.0 * k for k in range(10)]
    higher = [x + 1 + 0.01 * k for k, x in enumerate(base)]
    text = finding(made_up({"a": {"hits": base}, "b": {"hits": higher}}, AVOID, "turn"))
    assert "over 10 paired seeds, larger with b on 100 % of 10 seeds (72-100 %): a clear difference." in text
    assert "with turn b" in text


def test_the_finding_about_what_never_happened_compares_nothing():
    never = {"hits": [None, None]}
    assert "nothing to compare" in finding(made_up({"a": never, "b": never}, AVOID, "turn"))


@pytest.mark.slow
def test_saving_writes_tables_and_pictures_whole(comparison, tmp_path):
    paths = comparison.save(tmp_path / "new" / "folder")
    names = {"runs.csv", "summary.csv", "finding.txt", "final_state.png", "robots_at_fires.png"}
    names |= {"comparison.png", "comparison_all.png"}
    assert {path.name for path in paths} == names
    assert set(Path(tmp_path / "new" / "folder").iterdir()) == set(paths)
    assert (tmp_path / "new" / "folder" / "finding.txt").read_text() == f"{comparison.finding()}\n"
    assert all(path.read_bytes()[:4] == b"\x89PNG" for path in paths if path.suffix == ".png")


def test_saving_where_a_file_is_in_the_way_is_refused(comparison, tmp_path):
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(SwarmError, match="results cannot be written to"):
        comparison.save(tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.parametrize("name", ["/proc/none/here", "/dev/null", "a\0b"])
def test_folders_that_cannot_be_written_to_are_refused(name):
    with pytest.raises(SwarmError, match="results cannot be written to"):
        check_writable(name)


def test_trying_a_folder_leaves_nothing_behind(tmp_path):
    check_writable(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file_and_no_draft(tmp_path):
    (tmp_path / "folder.txt").mkdir()
    with pytest.raises(SwarmError, match=r"folder\.txt cannot be written: it is a folder"):
        write_whole(tmp_path / "folder.txt", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["folder.txt"]


def test_every_model_is_found_under_the_words_of_its_class():
    for name in model_names():
        assert find_model(name).__name__ == class_name(name)
        assert description(find_model(name)).endswith(".")


def test_a_misspelt_model_is_refused_with_the_nearest_name():
    with pytest.raises(SwarmError, match="did you mean 'fire_fighting'"):
        find_model("fire_figting")


def test_a_comparison_shows_its_table_and_finding(comparison):
    assert repr(comparison) == f"{comparison.table()}\n\n{comparison.finding()}"


def forge(path, change):
    """Change what each line of a ledger holds, with the right checksum."""
    lines = [json.loads(line[9:]) for line in path.read_bytes().splitlines()]
    for line in lines:
        change(line)
    texts = [json.dumps(line).encode() for line in lines]
    path.write_bytes(b"".join(b"%08x %s\n" % (crc32(text), text) for text in texts))


FORGERIES = {
    "names": lambda line: line.update(results={"foo": 1.0}),
    "order": lambda line: line.update(results=dict(reversed(line["results"].items()))),
    "error": lambda line: line.update(results=None, error="ValueError: x"),
    "empty": lambda line: line.update(results={}),
    "lists": lambda line: line.update(results={name: [1.0, [2.0]] for name in line["results"]}),
    "infinite": lambda line: line.update(results=dict.fromkeys(line["results"], math.inf)),
    "huge": lambda line: line.update(results=dict.fromkeys(line["results"], 10**300)),
}


@pytest.mark.slow
@pytest.mark.parametrize("forgery", FORGERIES)
@pytest.mark.parametrize("measures", [(), ("fires out", "fire 1 out at")])
def test_stored_runs_that_cannot_be_of_this_comparison_are_done_again_and_then_remembered(tmp_path, forgery, measures):
    how = {"seeds": 3, "steps": 3, "jobs": 1, "out": tmp_path, "measures": measures}
    made = compare(FIRE, **how)
    forge(tmp_path / "runs.jsonl", FORGERIES[forgery])
    again, third = compare(FIRE, **how), compare(FIRE, **how)
    assert (again.runs, again.done_before, third.runs, third.done_before) == (made.runs, 0, made.runs, 6)
    assert len((tmp_path / "runs.jsonl").read_bytes().splitlines()) == 12


class Ending(SwarmModel):
    """Its result is what is wanted, from the first step on."""

    wanted: object = 1.0

    def __init__(self, *, kind: str = "a", rng=None) -> None:
        super().__init__(rng=rng, model_reporters={"a $x_{$": lambda model: 1.0})

    def results(self):
        """Return it."""
        return {"a $x_{$": self.wanted if self.steps else 0.0, "b": 1.0}


ODD = [(Fraction(1, 2), 0.5), (np.array(1.5), 1.5), (np.longdouble(2), 2.0), (10**20, 1e20)]
ODD += [(np.float32(0.5), 0.5), (True, True), (7, 7), (None, None)]


@pytest.mark.slow
@pytest.mark.parametrize(("odd", "number"), ODD)
def test_results_of_any_type_of_number_are_compared_and_stored(tmp_path, monkeypatch, odd, number):
    monkeypatch.setattr(Ending, "wanted", odd)
    how = {"seeds": 2, "steps": 1, "jobs": 1}
    without = compare(Ending, "kind", ["a", "b"], **how)
    stored, again = (compare(Ending, "kind", ["a", "b"], **how, out=tmp_path) for _ in range(2))
    assert without.column("a", "a $x_{$") == [number, number]
    assert type(without.column("a", "a $x_{$")[0]) is type(number)
    assert without.runs == stored.runs == again.runs
    assert (stored.done_before, again.done_before) == (0, 4)


@pytest.mark.parametrize("odd", ["text", [1.0], 1j, math.inf, 10**400, np.array([1.0, 2.0]), np.array([1.5])])
def test_a_run_that_ends_without_a_number_is_refused_in_one_line(tmp_path, monkeypatch, odd):
    monkeypatch.setattr(Ending, "wanted", odd)
    with pytest.raises(SwarmError, match=r"result 'a \$x_\{\$' is .*; expected a finite number or None") as refusal:
        compare(Ending, "kind", ["a", "b"], seeds=2, steps=1, jobs=1, out=tmp_path)
    assert len(str(refusal.value)) <= 300
    assert len(str(refusal.value).splitlines()) == 1


def test_runs_that_end_in_what_is_no_number_are_remembered_too(tmp_path, monkeypatch):
    monkeypatch.setattr(Ending, "wanted", math.nan)
    made = [compare(Ending, "kind", ["a", "b"], seeds=2, steps=1, jobs=1, out=tmp_path) for _ in range(2)]
    assert [comparison.done_before for comparison in made] == [0, 4]


@pytest.mark.parametrize("undefined", [math.nan, np.float64("nan"), np.float32("nan")])
def test_a_result_that_is_nan_counts_as_not_measured_like_none(undefined):
    assert numbers_of({"mean": undefined, "steps": 3}) == {"mean": None, "steps": 3}


def test_a_sweep_and_a_comparison_read_the_same_numbers_from_a_model(monkeypatch):
    monkeypatch.setattr(Ending, "wanted", math.nan)
    run = Run(partial(Ending, kind="a"), {}, rng=1, steps=1, key="one")
    assert attempt(run).results == simulate(run).results == {"a $x_{$": None, "b": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("values", [["a$x_{$", "b"], ["{n$^$}", "c"]])
def test_dollars_in_names_and_values_do_no_harm_to_pictures(tmp_path, values):
    comparison = compare(Ending, "kind", values, seeds=2, steps=3, jobs=1)
    assert "over_time.png" in {path.name for path in comparison.save(tmp_path)}


def test_a_picture_that_fails_costs_no_table(comparison, tmp_path, monkeypatch):
    def fail(*parts):
        raise RuntimeError("no picture")

    monkeypatch.setattr("mesa_swarm.experiments.figures.comparison_pictures", fail)
    with pytest.raises(RuntimeError, match="no picture"):
        comparison.save(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"runs.csv", "summary.csv", "finding.txt"}
    assert (tmp_path / "runs.csv").read_text() == runs_csv(comparison)
