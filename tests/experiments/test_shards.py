"""Parts of a sweep, each with a ledger of its own, and the table of all of them."""

from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.cli import main
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.sweep import Shard, run_experiment, sweep
from mesa_swarm.experiments.worker_tasks import SchedulerLostError

GRID = {"n_robots": [2, 3]}
HOW = {"seeds": 3, "steps": 5, "jobs": 1}
EXPERIMENT = checked_experiment("fire_fighting", GRID, seeds=3, steps=5)
KEYS = ["0a" * 16, "0b" * 16, "0c" * 16]
GOOD, BAD = Outcome(steps=1, state_hash="", results={"x": 1.0}), Outcome(error="it broke")


def swept(folder, **how):
    return sweep("fire_fighting", GRID, out=folder, **{**HOW, **how})


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The table of a sweep without shards."""
    return swept(tmp_path_factory.mktemp("whole")).path.read_bytes()


@pytest.mark.slow
@given(points=st.integers(1, 5), seeds=st.integers(1, 5), shards=st.integers(1, 30))
def test_each_run_is_in_one_shard_and_shards_differ_by_one_run_at_most(points, seeds, shards):
    experiment = checked_experiment("fire_fighting", {"n_robots": range(1, 1 + points)}, seeds=seeds, steps=5)
    parts = [Shard(number, shards) for number in range(1, shards + 1)]
    keys = [[run.key for run in experiment.part(part.number, part.shards)] for part in parts]
    assert sorted(chain.from_iterable(keys)) == sorted(run.key for run in experiment.runs())
    assert [len(part) for part in keys] == [part.count(experiment) for part in parts]
    assert max(map(len, keys)) - min(map(len, keys)) <= 1


def test_the_table_of_all_shards_has_the_bytes_of_one_machine_and_no_run_is_repeated(tmp_path, table):
    parts = [swept(tmp_path, shard=(number, 4)) for number in (3, 1, 4, 2)]
    assert [part.runs for part in parts] == [1, 2, 1, 2]
    assert not (tmp_path / "runs.parquet").exists()
    made = swept(tmp_path)
    assert (made.runs, made.done_before) == (6, 6)
    assert made.path.read_bytes() == table


def test_what_a_shard_did_not_do_is_done_by_the_call_without_one(tmp_path, table):
    swept(tmp_path, shard=(2, 2))
    with (tmp_path / "ledger-2-of-2.jsonl").open("r+b") as file:
        file.truncate(file.seek(0, 2) - 5)  # it was killed as it wrote its last line
    made = swept(tmp_path)
    assert (made.done_before, made.path.read_bytes()) == (2, table)


def test_a_shard_works_while_others_and_the_whole_sweep_are_being_written(tmp_path):
    with Ledger(tmp_path / "ledger-1-of-2.jsonl"), Ledger(tmp_path / "ledger.jsonl"):
        assert swept(tmp_path, shard=(2, 2)).runs == 3
        with pytest.raises(SwarmError, match="is being written by another sweep"):
            swept(tmp_path, shard=(1, 2))


def test_runs_that_other_shards_or_the_whole_sweep_have_done_are_not_repeated(tmp_path):
    swept(tmp_path, shard=(1, 2))  # the runs 1, 3 and 5
    assert [swept(tmp_path, shard=(number, 3)).done_before for number in (1, 2, 3)] == [1, 1, 1]
    swept(tmp_path)
    assert [swept(tmp_path, shard=(number, 5)).done_before for number in (1, 5)] == [2, 1]


def test_recordings_of_all_shards_are_in_the_table(tmp_path):
    for number in (1, 2):
        swept(tmp_path, shard=(number, 2), record=True)
    made = swept(tmp_path, record=True)
    assert made.done_before == 6
    assert all((tmp_path / "recordings" / name).exists() for name in made.frame()["recording"])


def test_a_shard_has_no_table(tmp_path):
    with pytest.raises(InvalidValueError, match="without shard makes the table of all"):
        swept(tmp_path, shard=(1, 2)).frame()


@pytest.mark.parametrize("shard", [(0, 3), (4, 3), (1, 0), (1,), "3/10", 3, (1.5, 3)])
def test_an_impossible_shard_is_refused_before_any_run(tmp_path, shard):
    with pytest.raises(InvalidValueError, match="shard"):
        swept(tmp_path, shard=shard)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["3", "3/", "0/4", "5/4", "1.5/4", "3/10/2", "-1/4", "a/b", ""])
def test_an_impossible_shard_of_the_command_is_refused_in_one_line(tmp_path, text, capsys):
    with pytest.raises(SystemExit) as end:
        main(["sweep", str(tmp_path / "nothing.toml"), "--shard", text])
    lines = capsys.readouterr().err.splitlines()
    assert (end.value.code, len(lines)) == (2, 1)
    assert "shard" in lines[0]


def test_the_command_does_a_shard_and_counts_what_all_shards_have_done(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.toml").write_text('model = "fire_fighting"\nsteps = 5\nseeds = 3\ngrid = { n_robots = [2, 3] }\n')
    for words in ("--shard 1/3 --jobs 1", "--shard 3/3 --jobs 1", "--dry-run", "--shard 2/3 --dry-run"):
        with pytest.raises(SystemExit) as end:
            main(["sweep", "job.toml", "--quiet", *words.split()])
        assert end.value.code == 0
    first, second, whole, third = capsys.readouterr().out.splitlines()
    assert first.endswith("ledger-1-of-3.jsonl: 2 runs")
    assert second.endswith("ledger-3-of-3.jsonl: 2 runs")
    assert "6 runs" in whole
    assert whole.endswith("4 done, 2 to do")
    assert third.endswith("0 done, 2 to do")


@pytest.mark.parametrize(
    ("mine", "theirs", "retry", "left"),
    [
        (None, GOOD, False, GOOD),
        (None, BAD, False, BAD),
        (BAD, GOOD, False, GOOD),
        (GOOD, BAD, False, GOOD),
        (None, BAD, True, None),
        (BAD, BAD, True, None),
        (BAD, GOOD, True, GOOD),
    ],
)
def test_an_outcome_of_another_ledger_replaces_nothing_but_an_error(tmp_path, mine, theirs, retry, left):
    for name, outcome in (("mine", mine), ("theirs", theirs)):
        with Ledger(tmp_path / name) as ledger:
            if outcome is not None:
                ledger.append(KEYS[0], outcome)
    before = (tmp_path / "theirs").read_bytes()
    with Ledger(tmp_path / "mine", retry_failed=retry) as ledger:
        ledger.absorb(tmp_path / "theirs")
        assert ledger.outcome(KEYS[0]) == left
    assert (tmp_path / "theirs").read_bytes() == before


def test_a_ledger_takes_only_the_runs_that_are_wanted_and_yields_its_keys_once(tmp_path):
    with Ledger(tmp_path / "theirs") as ledger:
        for key in (*KEYS, KEYS[0]):
            ledger.append(key, GOOD)
        assert sorted(ledger) == sorted(KEYS)
    with Ledger(tmp_path / "mine") as ledger:
        ledger.absorb(tmp_path / "theirs", {KEYS[1]})
        assert list(ledger) == [KEYS[1]]


def test_a_file_that_is_no_ledger_but_named_as_one_is_refused_and_not_changed(tmp_path):
    (tmp_path / "ledger-1-of-2.jsonl").write_text("my notes\n")
    with pytest.raises(SwarmError, match="is not a ledger of runs"):
        run_experiment(EXPERIMENT, tmp_path)
    assert (tmp_path / "ledger-1-of-2.jsonl").read_text() == "my notes\n"


def test_a_lost_scheduler_is_reported_with_where_finished_runs_are(tmp_path, monkeypatch):
    def lost(*_):
        raise SchedulerLostError("the connection to the dask scheduler at tcp://there:1 is lost")
        yield

    monkeypatch.setattr("mesa_swarm.experiments.runs.on_all", lost)
    with pytest.raises(SchedulerLostError, match=r"ledger\.jsonl: start the scheduler .* call it again for the rest$"):
        run_experiment(EXPERIMENT, RunFiles(tmp_path), workers=2)
