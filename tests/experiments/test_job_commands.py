"""What `mesa-swarm run` and `sweep` do with a job file."""

from pathlib import Path

import pytest

from mesa_swarm import cli
from mesa_swarm.gallery import find_model
from mesa_swarm.recording import Recording, verify

MODEL = 'model = "fire_fighting"\n'


@pytest.fixture
def typed(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def type_in(line):
        with pytest.raises(SystemExit) as left:
            cli.main(line.split() if isinstance(line, str) else line)
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in


def test_run_does_every_run_of_a_job_and_prints_what_the_model_alone_says(typed):
    Path("job.toml").write_text(MODEL + 'robots = 3\nsteps = 20\nseeds = [4, 9]\nmeasure = ["fires out"]')
    status, out, err = typed("run job.toml --quiet")
    hashes = [find_model("fire_fighting")(n_robots=3, rng=rng).run(20).state_hash() for rng in (4, 9)]
    assert (status, err) == (0, "")
    assert [line.split()[-1] for line in out.splitlines() if line.startswith("state")] == hashes
    assert out.splitlines()[:3] == ["run_1, rng 4", "steps       20", "fires out   0"]


@pytest.mark.parametrize("line", ["run fire_fighting --steps 5", "run job.toml"])
def test_a_recording_is_named_by_seed_and_name_and_other_places_are_refused(typed, line):
    Path("job.toml").write_text(MODEL + 'robots = 3\nsteps = 5\nname = "fire_fighting"')
    assert typed(f"{line} --quiet --record {{name}}_{{seed}}.arrow")[0] == 0
    assert Path("fire_fighting_1.arrow").exists()
    before = sorted(Path().iterdir())
    for name in ("a{seed}{nme}.arrow", "{nme}/a.arrow"):
        status, out, err = typed(f"{line} --quiet --record {name}")
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "place in the name of a recording 'nme'; did you mean 'name'? known: name, seed" in err
    assert sorted(Path().iterdir()) == before


def test_a_job_that_records_to_an_unknown_place_is_refused(typed):
    Path("job.toml").write_text(MODEL + 'record = "a{seed}{nme}.arrow"')
    status, out, err = typed("run job.toml --quiet")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "did you mean 'name'? known: name, seed" in err


def test_a_file_that_is_there_is_replaced_by_what_one_types(typed):
    Path("a.arrow").write_text("precious")
    status, _, err = typed("run boids --steps 2 --quiet --record a.arrow")
    assert (status, err) == (
        2,
        "mesa-swarm: a.arrow exists already; choose another name, or replace it with --force\n",
    )


RECORDED = MODEL + 'robots = 2\nsteps = 20\nseeds = 2\nrecord = { file = "runs/{seed}.arrow", every = 5 }'


def test_run_records_what_the_job_says_under_its_folder_and_says_where(typed, tmp_path):
    folder = tmp_path / "jobs"
    folder.mkdir()
    (folder / "job.toml").write_text(RECORDED)
    status, out, err = typed("run jobs/job.toml --quiet")
    assert (status, err) == (0, "")
    files = [Path("jobs", "runs", f"{seed}.arrow") for seed in (1, 2)]
    assert [line.split()[-1] for line in out.splitlines() if line.startswith("recording")] == list(map(str, files))
    for file in files:
        assert Recording(file).steps.tolist() == [5, 10, 15, 20]
        assert verify(Recording(file), find_model("fire_fighting")).same
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_file()) == ["1.arrow", "2.arrow", "job.toml"]


def test_running_a_queue_again_replaces_no_recording_but_does_the_rest_and_with_force_all(typed):
    Path("job.toml").write_text(RECORDED)
    Path("runs").mkdir()
    Path("runs/1.arrow").write_text("precious")
    status, _, err = typed("run job.toml --quiet")
    assert (status, err.count("\n")) == (1, 1)
    assert err.startswith("mesa-swarm: run_1, rng 1: RecordingError: runs/1.arrow exists already")
    assert Path("runs/1.arrow").read_text() == "precious"
    assert len(Recording("runs/2.arrow")) == 4
    assert typed("run job.toml --quiet --force")[0] == 0
    assert len(Recording("runs/1.arrow")) == 4


def test_a_run_that_fails_is_one_line_and_the_rest_of_the_queue_is_done(typed, monkeypatch):
    model, step = find_model("fire_fighting"), find_model("fire_fighting").step

    def failing(self):
        step(self)
        if len(self.robots) == 3:
            raise RuntimeError("it broke\nin two lines")

    monkeypatch.setattr(model, "step", failing)
    Path("job.toml").write_text("".join(f"[[run]]\n{MODEL}steps = 5\nrobots = {n}\n" for n in (2, 3, 4)))
    status, out, err = typed("run job.toml --quiet")
    assert (status, err) == (1, "mesa-swarm: run_2, rng 1: RuntimeError: it broke in two lines\n")
    assert [line for line in out.splitlines() if line.startswith(("run", "steps"))] == [
        "run_1, rng 1",
        "steps                    5",
        "run_2, rng 1",
        "run_3, rng 1",
        "steps                    5",
    ]


def test_ctrl_c_in_a_queue_keeps_what_was_recorded(typed, monkeypatch):
    step = find_model("fire_fighting").step

    def interrupted(self):
        step(self)
        if self.steps == 13:
            raise KeyboardInterrupt

    monkeypatch.setattr(find_model("fire_fighting"), "step", interrupted)
    Path("job.toml").write_text(RECORDED)
    status, out, err = typed("run job.toml --quiet")
    assert (status, err.count("\n")) == (130, 1)
    assert f"what was recorded so far is kept in {Path('runs/1.arrow')}" in out
    assert Recording("runs/1.arrow").steps.tolist() == [5, 10]


def test_a_sample_is_recorded_only_where_one_asks_for_it(typed, tmp_path):
    assert typed("run collision_avoidance.toml --quiet")[0] == 0
    assert list(tmp_path.iterdir()) == []
    assert typed(["run", "collision_avoidance.toml", "--quiet", "--record", "runs/{name}_{seed}.arrow"])[0] == 0
    assert [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.arrow")] == ["runs/run_1_1.arrow"]
    status, _, err = typed("run agglomeration.toml --quiet --record run.arrow")
    assert (status, err.count("\n")) == (2, 1)
    assert "two runs are recorded to" in err


def test_run_shows_for_each_run_how_long_it_takes_and_when_it_will_be_done(typed):
    Path("job.toml").write_text(MODEL + "robots = 2\nsteps = 30\nseeds = 2")
    _, out, err = typed("run job.toml")
    assert err.count("30/30 steps") == 2
    assert err.count("left, done at") >= 2
    assert "left" not in out


def test_run_refuses_what_the_job_says_itself_and_points_to_sweep(typed):
    Path("job.toml").write_text(MODEL + "[grid]\nn_robots = [1, 2]")
    assert "--steps is given beside a job file" in typed("run job.toml --steps 3")[2]
    status, _, err = typed("run job.toml")
    assert (status, err) == (2, "mesa-swarm: run_1 has 2 points; do them with: mesa-swarm sweep job.toml\n")


def test_sweep_writes_a_table_for_each_run_of_the_queue_and_does_nothing_twice(typed, tmp_path):
    Path("job.toml").write_text(f"[[run]]\n{MODEL}steps = 5\nseeds = 2\n" * 2)
    first, again = (typed("sweep job.toml --jobs 1 --quiet") for _ in range(2))
    paths = [Path("results", "job", name, "runs.parquet") for name in ("run_1", "run_2")]
    assert first == (0, "".join(f"{path}: 2 runs\n" for path in paths), "")
    assert again == (0, "".join(f"{path}: 2 runs, 2 of them before\n" for path in paths), "")
    assert all(path.exists() for path in paths)


def test_a_dry_run_says_how_much_is_to_do_and_writes_nothing(typed, tmp_path):
    Path("job.toml").write_text(f"{MODEL}steps = 5\nseeds = 2\n[grid]\nn_robots = [2, 3, 4]")
    planned = "results/job: 6 runs (3 points x 2 seeds, 5 steps each)"
    assert typed("sweep job.toml --dry-run") == (0, f"{planned}, 0 done, 6 to do\n", "")
    assert not Path("results").exists()
    assert typed("sweep job.toml --jobs 1 --quiet")[0] == 0
    Path("job.toml").write_text(f"{MODEL}steps = 5\nseeds = 3\n[grid]\nn_robots = [2, 3, 4]")
    with Path("results/job/ledger.jsonl").open("ab") as ledger:
        ledger.write(b"torn")
    before = {path: path.read_bytes() for path in Path("results").rglob("*") if path.is_file()}
    assert typed("sweep job.toml --dry-run")[1].endswith("9 runs (3 points x 3 seeds, 5 steps each), 6 done, 3 to do\n")
    assert typed("sweep job.toml --dry-run --record")[1].endswith("0 done, 9 to do\n")
    assert before == {path: path.read_bytes() for path in Path("results").rglob("*") if path.is_file()}


def test_sweep_records_every_run_if_asked_as_the_job_says(typed):
    Path("job.toml").write_text(RECORDED)
    assert typed("sweep job.toml --jobs 1 --quiet")[0] == 0
    assert not Path("results/job/recordings").exists()
    assert typed("sweep job.toml --jobs 1 --quiet --record") == (0, f"{Path('results/job/runs.parquet')}: 2 runs\n", "")
    assert [Recording(file).steps.tolist() for file in Path("results/job/recordings").iterdir()] == [
        [5, 10, 15, 20]
    ] * 2


def test_a_sweep_with_failed_runs_says_why_and_how_to_do_them_again_and_exits_with_1(typed):
    Path("job.toml").write_text(MODEL + "steps = 3\nseeds = 2\n[grid]\nn_robots = [3, 20000, 30000]")
    for done in ("", ", 6 of them before"):
        status, out, err = typed("sweep job.toml --quiet --jobs 1")
        assert (status, out) == (1, f"results/job/runs.parquet: 6 runs{done}, 4 ended in an error\n")
        first, second, last = err.splitlines()
        assert first.startswith("mesa-swarm: results/job/runs.parquet: PlacementError: ")
        assert second.startswith("mesa-swarm: results/job/runs.parquet: PlacementError: ")
        assert first != second
        assert last == "mesa-swarm: what failed is done again with --retry-failed"
