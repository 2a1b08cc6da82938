"""run: one model, or the runs of a job."""

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from mesa_swarm.base import work_line as work_done
from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording import Recording, verify


def test_run_prints_the_model_s_results_and_state_hash(typed):
    status, out, err = typed("run fire_fighting --set strategy=A --set n_robots=4 --steps 50 --rng 3 --quiet")
    model = find_model("fire_fighting")(strategy="A", n_robots=4, rng=3).run(50)
    assert (status, err) == (0, "")
    assert out.splitlines()[-1].split() == ["state", "hash", model.state_hash()]
    assert ["fires", "out", "0"] in [line.split() for line in out.splitlines()]


@pytest.mark.slow
def test_a_run_is_not_delayed_by_garbage_collection_pictures_recordings_or_another_process():
    code = (
        "import gc, sys\nfrom mesa_swarm.cli import main\n"
        "try:\n    main(['run', 'boids', '--steps', '1', '--quiet'])\n"
        "finally:\n"
        "    slow = {'matplotlib', 'pyarrow.dataset', 'multiprocessing.resource_tracker', 'svgelements'}\n"
        "    print(sorted(slow & set(sys.modules)), gc.isenabled(), gc.get_freeze_count() > 100_000)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[] True True"


def test_within_another_program_garbage_collection_stays_as_it_is(typed):
    before = gc.get_freeze_count()
    assert typed("run boids --steps 1 --quiet")[0] == 0
    assert (gc.get_freeze_count(), gc.isenabled()) == (before, True)


def test_a_map_may_be_a_file(typed):
    assert typed("map import openspace_fire mine.toml")[0] == 0
    line = "run fire_fighting --steps 5 --quiet --set map="
    own, builtin = typed(f"{line}mine.toml"), typed(f"{line}openspace_fire")
    assert own == builtin
    assert own[0] == 0


def test_run_shows_a_progress_bar_on_stderr_with_the_finishing_time(typed, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    _, out, err = typed("run collision_avoidance --steps 40")
    assert "40/40 steps" in err
    assert "done at" in err
    assert "done at" not in out


MODEL = 'model = "fire_fighting"\n'


def test_run_does_every_run_of_a_job_with_the_results_of_the_model_alone(typed):
    Path("job.toml").write_text(MODEL + 'robots = 3\nsteps = 20\nseeds = [4, 9]\nmeasure = ["fires out"]')
    status, out, err = typed("run job.toml --quiet")
    hashes = [find_model("fire_fighting")(n_robots=3, rng=rng).run(20).state_hash() for rng in (4, 9)]
    assert (status, err) == (0, "")
    assert [line.split()[-1] for line in out.splitlines() if line.startswith("state")] == hashes
    assert out.splitlines()[:3] == ["run_1, rng 4", "steps       20", "fires out   0"]


@pytest.mark.parametrize("line", ["run fire_fighting --steps 5", "run job.toml"])
def test_a_recording_is_named_by_seed_and_name_and_other_fields_are_refused(typed, line):
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


def test_an_existing_recording_is_replaced_only_with_force(typed):
    Path("a.arrow").write_text("precious")
    status, _, err = typed("run boids --steps 2 --quiet --record a.arrow")
    assert (status, err) == (
        2,
        "mesa-swarm: a.arrow exists already; choose another name, or replace it with --force\n",
    )


def test_a_run_ends_at_a_condition_and_prints_what_ended_it(typed):
    lines = typed(["run", "fire_fighting", "--steps", "9", "--until", "steps >= 4", "--quiet"])[1].splitlines()
    assert [line.split()[-1] for line in lines[:2]] == ["4", "condition"]
    assert "ended by" not in typed("run fire_fighting --steps 2 --quiet")[1]
    assert "did you mean 'fires_burning'" in typed("run fire_fighting --until fires_burnin==0 --quiet")[2]


RECORDED = MODEL + 'robots = 2\nsteps = 20\nseeds = 2\nrecord = { file = "runs/{seed}.arrow", every = 5 }'


def test_run_records_a_job_in_its_folder_and_prints_the_files(typed, tmp_path):
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


def test_a_repeated_queue_replaces_recordings_only_with_force(typed):
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


def test_ctrl_c_in_a_queue_leaves_the_steps_so_far(typed, monkeypatch):
    step = find_model("fire_fighting").step

    def interrupted(self):
        step(self)
        if self.steps == 13:
            raise KeyboardInterrupt

    monkeypatch.setattr(find_model("fire_fighting"), "step", interrupted)
    Path("job.toml").write_text(RECORDED)
    status, out, err = typed("run job.toml --quiet")
    assert (status, err.count("\n")) == (130, 1)
    assert f"the steps so far are recorded in {Path('runs/1.arrow')}" in out
    assert Recording("runs/1.arrow").steps.tolist() == [5, 10]


@pytest.mark.slow
def test_a_shipped_job_is_recorded_only_on_request(typed, tmp_path):
    assert typed("run collision_avoidance.toml --quiet")[0] == 0
    assert list(tmp_path.iterdir()) == []
    assert typed(["run", "collision_avoidance.toml", "--quiet", "--record", "runs/{name}_{seed}.arrow"])[0] == 0
    assert [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.arrow")] == ["runs/run_1_1.arrow"]
    status, _, err = typed("run agglomeration.toml --quiet --record run.arrow")
    assert (status, err.count("\n")) == (2, 1)
    assert "two runs are recorded to" in err


def test_run_shows_for_each_run_how_long_it_takes_and_when_it_will_be_done(typed, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    Path("job.toml").write_text(MODEL + "robots = 2\nsteps = 30\nseeds = 2")
    _, out, err = typed("run job.toml")
    assert err.count("30/30 steps") == 2
    assert err.count("left, done at") >= 2
    assert "left" not in out


def test_run_refuses_options_that_the_job_sets_and_refers_to_sweep(typed):
    Path("job.toml").write_text(MODEL + "[grid]\nn_robots = [1, 2]")
    assert "--steps is given beside a job file" in typed("run job.toml --steps 3")[2]
    status, _, err = typed("run job.toml")
    assert (status, err) == (2, "mesa-swarm: run_1 has 2 points; run them with: mesa-swarm sweep job.toml\n")
