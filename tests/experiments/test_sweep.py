"""Sweeps: every run once, the same table whatever the processes, and what a run may get wrong."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pyarrow import parquet

from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments.compare import compare
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.experiments.fingerprints import source_hash
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.experiments.runs import error_in_words
from mesa_swarm.experiments.sampling import Sample
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.model.gallery import find_model
from mesa_swarm.swarm_model import SwarmModel
from support.failing_models import Counting, Raising, seeds_run
from support.machine import slowness
from support.pace import processor_seconds

FIRE = find_model("fire_fighting")
GRID = {"strategy": ["A", "B"], "n_robots": [2, 3]}


# ---- the table


def test_each_row_is_what_the_model_does_alone(tmp_path):
    table = sweep(FIRE, GRID, seeds=[5, 6], steps=30, out=tmp_path, jobs=1).frame()
    assert table[["strategy", "n_robots", "rng"]].iloc[3].tolist() == ["A", 3, 6]
    alone = [
        FIRE(strategy=strategy, n_robots=n, rng=rng).run(30).state_hash()
        for strategy in "AB"
        for n in (2, 3)
        for rng in (5, 6)
    ]
    assert table["state_hash"].tolist() == alone


def test_the_table_does_not_depend_on_the_number_of_processes(tmp_path):
    paths = [sweep(FIRE, GRID, seeds=4, steps=10, out=tmp_path / str(n), jobs=n).path for n in (1, 2)]
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_sweep_that_is_widened_does_only_what_is_new(tmp_path):
    diary = tmp_path / "diary"
    first, second = (
        sweep(Counting, seeds=n, steps=1, settings={"diary": str(diary)}, out=tmp_path, jobs=1) for n in (2, 4)
    )
    assert (first.done_before, second.done_before, second.runs) == (0, 2, 4)
    assert seeds_run(diary) == {1: 1, 2: 1, 3: 1, 4: 1}
    assert second.frame()["seed"].tolist() == [1, 2, 3, 4]


def test_other_steps_and_parameters_are_other_runs():
    keys = {
        run.key
        for steps in (5, 6)
        for n in (2, 3)
        for run in checked_experiment(FIRE, {"n_robots": [n]}, seeds=2, steps=steps).runs()
    }
    assert len(keys) == 8


def test_only_what_is_wanted_becomes_a_column(tmp_path):
    path = sweep(FIRE, seeds=1, steps=5, measure=["fires out"], out=tmp_path, jobs=1).path
    assert parquet.read_schema(path).names == ["point", "rng", "steps", "state_hash", "fires out", "error"]


@pytest.mark.slow
@pytest.mark.parametrize("varied", [GRID, Sample("sobol", {"n_robots": (2, 9)}, points=4), [{"n_robots": 2}] * 4, ()])
def test_the_table_of_every_design_numbers_its_points(tmp_path, varied):
    table = sweep(FIRE, varied, seeds=2, steps=3, out=tmp_path, jobs=1).frame()
    assert table["point"].tolist() == [i for i in range(len(table) // 2) for _ in range(2)]
    assert (table.drop(columns=["rng", "state_hash"]).groupby("point").nunique() <= 1).all(axis=None)


class Pointing(SwarmModel):
    """A model whose parameter is named as a column."""

    def __init__(self, *, point: int = 1, rng=None) -> None:
        super().__init__(rng=rng)

    def results(self):
        """Return a number."""
        return {"a": 1.0}


def test_a_parameter_that_is_named_as_a_column_is_refused(tmp_path):
    with pytest.raises(InvalidValueError, match="parameter point is named as a column of the table; rename it"):
        sweep(Pointing, {"point": [1, 2]}, seeds=1, steps=1, out=tmp_path, jobs=1)
    assert list(tmp_path.iterdir()) == []


def test_points_that_a_sample_has_twice_are_run_once(tmp_path):
    sample = Sample("latin_hypercube", {"n_robots": (2, 3)}, points=6)
    table = sweep(FIRE, sample, seeds=1, steps=5, out=tmp_path, jobs=1).frame()
    assert sorted(table["n_robots"]) == [2, 2, 2, 3, 3, 3]
    assert len((tmp_path / "ledger.jsonl").read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"varied": {"n_robotz": [1]}}, "did you mean 'n_robots'"),
        ({"varied": [{"n_robots": 1}, {"k1": 0.1}]}, "expected the same parameters"),
        ({"seeds": 0}, "seeds is 0"),
        ({"seeds": "12"}, "seeds is '12'"),
        ({"measure": ["fires"]}, "did you mean 'fires out'"),
        ({"jobs": 0}, "jobs is 0"),
        ({"varied": {"n_robots": [10**6]}}, "do not fit"),
    ],
)
def test_a_wrong_sweep_is_refused_before_anything_is_run(tmp_path, wrong, message):
    with pytest.raises(SwarmError, match=message):
        sweep(FIRE, **{"steps": 5, "out": tmp_path, **wrong})
    assert list(tmp_path.iterdir()) == []


# ---- other code


MODEL_FILE = """
from mesa_swarm.swarm_model import SwarmModel

FACTOR = 1

class Edited(SwarmModel):
    def __init__(self, *, odd: float = 0.0, rng=None):
        super().__init__(rng=rng)

    def results(self):
        return {"number": 1.0 * FACTOR}
"""


def loaded(path, text):
    """Write a module and import it, as a new process would."""
    path.write_text(text)
    spec = importlib.util.spec_from_file_location("edited_model", path)
    module = sys.modules["edited_model"] = importlib.util.module_from_spec(spec)
    exec(compile(text, path, "exec"), vars(module))
    return module.Edited


@pytest.mark.parametrize(("old", "new"), [("1.0 *", "2.0 *"), ("FACTOR = 1", "FACTOR = 2")])
def test_a_model_that_was_edited_is_run_again_and_one_that_was_not_is_not(tmp_path, old, new):
    numbers = []
    for text in (MODEL_FILE, MODEL_FILE, MODEL_FILE.replace(old, new)):
        made = sweep(loaded(tmp_path / "edited_model.py", text), seeds=2, steps=1, out=tmp_path / "out", jobs=1)
        numbers.append((made.done_before, made.frame()["number"].tolist()))
    assert numbers == [(0, [1.0, 1.0]), (2, [1.0, 1.0]), (0, [2.0, 2.0])]


def test_a_class_without_a_file_is_known_by_the_code_of_its_methods():
    hashes = []
    for text in (MODEL_FILE, MODEL_FILE, MODEL_FILE.replace("1.0 *", "2.0 *")):
        space = {"__name__": "a_notebook"}
        exec(compile(text, "<cell>", "exec"), space)
        hashes.append(source_hash(space["Edited"]))
    assert hashes[0] == hashes[1] != hashes[2]


@pytest.mark.slow
def test_the_fingerprint_of_a_source_is_the_same_in_every_process():
    code = (
        "from mesa_swarm.experiments.fingerprints import source_hash; from mesa_swarm.model.gallery import find_model\n"
    )
    code += "print(hash('a'), source_hash(find_model('fire_fighting')))"
    # This process's own seed may be any number, so that it is not this one.
    surroundings = {**os.environ, "PYTHONHASHSEED": "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"}
    place = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", code], env=surroundings, capture_output=True, text=True, check=True, cwd=place
    )
    hashed, fingerprint = done.stdout.split()
    assert int(hashed) != hash("a")
    assert fingerprint == source_hash(FIRE)


# ---- what goes wrong


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_run_that_raises_is_recorded_in_one_line_and_the_rest_goes_on(tmp_path, jobs):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(Raising, seeds=4, steps=1, settings=settings, out=tmp_path, jobs=jobs)
    table = made.frame()
    assert (made.runs, made.failed) == (4, 1)
    assert table["error"].dropna().to_dict() == {1: "RuntimeError: it broke in <object object>"}
    assert table["seed"].dropna().tolist() == [1, 3, 4]


def test_an_error_is_kept_until_it_is_to_be_tried_again(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    wanted = {"seeds": 3, "steps": 1, "settings": settings, "out": tmp_path, "jobs": 1}
    made = [sweep(Raising, **wanted, retry_failed=retry) for retry in (False, False, True)]
    assert [(one.failed, one.done_before) for one in made] == [(1, 0), (1, 3), (1, 2)]
    assert seeds_run(tmp_path / "diary") == {1: 1, 2: 2, 3: 1}


@pytest.mark.long
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_sweep_adds_less_than_20_ms_of_processor_time_to_a_run(tmp_path, jobs):
    sweep(FIRE, seeds=4, steps=30, out=tmp_path / "warm", jobs=jobs)  # starts workers, loads kernels
    runs, rounds = 100, []
    for i in range(3):  # caches may be shared with others: of three rounds the best counts
        swept = processor_seconds(lambda i=i: sweep(FIRE, seeds=runs, steps=30, out=tmp_path / str(i), jobs=jobs))
        # The time of runs in workers does not count.
        bare = processor_seconds(lambda: [FIRE(rng=rng).run(30).results() for rng in range(1, runs + 1)])
        rounds.append((swept - (bare if jobs == 1 else 0.0)) / runs)
    print(f"{jobs} jobs: {[f'{1000 * extra:.2f}' for extra in rounds]} ms a run")
    assert min(rounds) < 0.020 * slowness()


def test_record_may_be_true_or_false(tmp_path):
    recorded = sweep(FIRE, seeds=1, steps=3, out=tmp_path / "a", jobs=1, record=True).frame()
    assert (tmp_path / "a" / "recordings" / recorded["recording"][0]).exists()
    assert "recording" not in sweep(FIRE, seeds=1, steps=3, out=tmp_path / "b", jobs=1, record=False).frame()


@pytest.mark.parametrize("wrong", [1, "run.arrow", ["every"]])
def test_record_is_refused_if_it_is_neither_a_flag_nor_options(tmp_path, wrong):
    with pytest.raises(InvalidValueError, match=r"record is .*; expected True, False or a mapping of options"):
        sweep(FIRE, seeds=1, steps=3, out=tmp_path, jobs=1, record=wrong)


@pytest.mark.parametrize("study", [sweep, compare])
def test_a_model_in_place_of_its_class_is_refused(study):
    with pytest.raises(InvalidValueError, match=r"model is .*; expected a class, or the name or address of a model"):
        study(FIRE(n_robots=1, rng=1), seeds=1, steps=1)


def test_an_experiment_of_a_model_in_place_of_its_class_is_refused():
    with pytest.raises(InvalidValueError, match=r"model is .*; expected a class, or the name or address of a model"):
        checked_experiment(FIRE(n_robots=1, rng=1), seeds=1, steps=1)


def test_a_stored_outcome_that_cannot_be_a_row_of_the_table_is_done_again(tmp_path):
    run = next(checked_experiment(FIRE, seeds=1, steps=5).runs())
    good = sweep(FIRE, seeds=1, steps=5, out=tmp_path, jobs=1)
    table = good.path.read_bytes()
    for wrong in ({"rng": 1.0}, {"error": 1.0}, {"a": [1.0, 2.0]}):
        with Ledger(tmp_path / "ledger.jsonl") as ledger:
            ledger.append(run.key, Outcome(steps=5, results=wrong))
        assert sweep(FIRE, seeds=1, steps=5, out=tmp_path, jobs=1).path.read_bytes() == table


def test_an_error_with_half_a_surrogate_is_an_outcome_that_can_be_written():
    assert error_in_words(ValueError("name \udcff")) == r"ValueError: name \udcff"


class Named(SwarmModel):
    """Its results have any names; some only in the end."""

    def __init__(self, *, names: str = "", late: str = "", rng=None) -> None:
        super().__init__(rng=rng)
        self.names, self.late = names, late

    def results(self):
        """Return a number by each name."""
        return dict.fromkeys([*self.names.split(","), *(self.late.split(",") if self.late and self.steps else ())], 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("names", ["recording", ",".join(f"r{k}" for k in range(5_001))])
def test_runs_are_remembered_whatever_their_results_are_called_and_however_many_there_are(tmp_path, names):
    made, again = (sweep(Named, seeds=2, steps=1, settings={"names": names}, out=tmp_path, jobs=1) for _ in range(2))
    assert (made.done_before, again.done_before) == (0, 2)
    assert len((tmp_path / "ledger.jsonl").read_text().splitlines()) == 2
    assert set(names.split(",")) <= set(again.frame().columns)


def test_a_result_that_is_called_recording_is_refused_where_runs_are_recorded(tmp_path):
    with pytest.raises(InvalidValueError, match="result 'recording' is named as another column; rename it"):
        sweep(Named, seeds=2, steps=1, settings={"names": "recording"}, out=tmp_path, jobs=1, record=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("late", "record"), [("rng", False), ("names", False), ("recording", True)])
def test_a_run_that_ends_with_a_result_named_as_another_column_is_an_error_that_is_remembered(tmp_path, late, record):
    settings = {"names": "a", "late": late}
    made, again = (
        sweep(Named, seeds=2, steps=1, settings=settings, out=tmp_path, jobs=1, record=record) for _ in range(2)
    )
    message = f"InvalidValueError: result '{late}' is named as another column; rename it in results()"
    assert (made.failed, again.done_before, again.errors) == (2, 2, (message,))


class Ambiguous(SwarmModel):
    """A model with parameters of names that calls of the package have as well."""

    def __init__(self, *, recording: int = 1, model: int = 2, provenance: int = 3, base: int = 4, rng=None):
        super().__init__(rng=rng)
        self.values = (recording, model, provenance, base)

    def results(self):
        return {"x": float(sum(self.values))}


def test_a_parameter_named_recording_is_swept_and_refused_only_beside_recordings(tmp_path):
    frame = sweep(Ambiguous, {"recording": [1, 2]}, seeds=1, steps=1, jobs=1, out=tmp_path / "plain").frame()
    assert frame["recording"].tolist() == [1, 2]
    with pytest.raises(InvalidValueError, match="parameter recording is named as a column of the table"):
        sweep(Ambiguous, {"recording": [1, 2]}, seeds=1, steps=1, jobs=1, out=tmp_path / "recorded", record=True)


def test_parameters_with_names_of_the_packages_own_arguments_are_set_when_a_run_goes_on(tmp_path):
    changes = {"model": 20, "provenance": 30, "base": 40, "recording": 10}
    assert Ambiguous(rng=1).run(2).continued(**changes).values == (10, 20, 30, 40)
    with (model := Ambiguous(rng=1)).record(tmp_path / "run.arrow"):
        model.run(2)
    assert Ambiguous.resume(tmp_path / "run.arrow", **changes).values == (10, 20, 30, 40)
