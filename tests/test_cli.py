import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from mesa_swarm import cli
from mesa_swarm.analysis.pathology import KINDS
from mesa_swarm.cli import commands, picture_commands
from mesa_swarm.experiments import bench
from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.progress import finishing_time, progress_bar
from mesa_swarm.world.map import Map, builtin_maps


@pytest.fixture
def typed(capsys, monkeypatch, tmp_path):
    """Type a command in an empty folder; get its exit status, output and errors."""
    monkeypatch.chdir(tmp_path)

    def type_in(line):
        with pytest.raises(SystemExit) as left:
            cli.main(line.split() if isinstance(line, str) else line)
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in


def process(*words, **more):
    command = [sys.executable, "-m", "mesa_swarm.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, **more)


@pytest.mark.parametrize("line", ["", "--help", "-h", "map", "run --help", "compare -h", "map import --help"])
def test_help_is_given_when_asked_for_or_when_nothing_is_asked(typed, line):
    status, out, err = typed(line)
    assert (status, err) == (0, "")
    assert out.startswith("Usage: mesa-swarm")


def test_version_is_the_packages(typed):
    assert typed("--version")[:2] == (0, "mesa-swarm 0.1.0\n")


def test_list_names_every_model_with_its_parameters_and_defaults(typed):
    status, out, _ = typed("list")
    assert status == 0
    assert [line for line in out.splitlines() if not line.startswith(" ")] == model_names()
    assert "strategy=B" in out
    assert max(map(len, out.splitlines())) <= 100


def test_run_prints_what_the_model_says_and_its_state_hash(typed):
    status, out, err = typed("run fire_fighting --set strategy=A --set n_robots=4 --steps 50 --rng 3 --quiet")
    model = find_model("fire_fighting")(strategy="A", n_robots=4, rng=3).run(50)
    assert (status, err) == (0, "")
    assert out.splitlines()[-1].split() == ["state", "hash", model.state_hash()]
    assert ["fires", "out", "0"] in [line.split() for line in out.splitlines()]


def test_a_map_may_be_a_file(typed):
    assert typed("map import openspace_fire mine.toml")[0] == 0
    line = "run fire_fighting --steps 5 --quiet --set map="
    own, builtin = typed(f"{line}mine.toml"), typed(f"{line}openspace_fire")
    assert own == builtin
    assert own[0] == 0


def test_run_shows_a_progress_bar_on_stderr_with_the_finishing_time(typed):
    _, out, err = typed("run collision_avoidance --steps 40")
    assert "40/40 steps" in err
    assert "done at" in err
    assert "done at" not in out


def test_compare_prints_a_table_paths_and_a_finding_and_writes_the_files(typed, tmp_path):
    status, out, err = typed("compare fire_fighting --seeds 2 --steps 30 --jobs 1 --quiet")
    folder = Path("results", "compare_fire_fighting")
    assert (status, err) == (0, "")
    assert out.startswith("FireFighting: 2 paired seeds, at most 30 steps each")
    assert out.splitlines()[-1].startswith("With strategy ")
    written = {path.name for path in (tmp_path / folder).iterdir()}
    assert {str(folder / name) for name in written - {"runs.jsonl"}} <= set(out.splitlines())
    assert len(written) == 8
    again = typed("compare fire_fighting --seeds 2 --steps 30 --jobs 1 --quiet")[1]
    assert again == f"4 of 4 runs were done before, see {folder / 'runs.jsonl'}\n{out}"


def test_compare_takes_another_parameter_values_settings_and_folder(typed, tmp_path):
    line = "compare collision_avoidance --parameter n_robots --values 2,3 --set map=sparse --out here/there"
    status, out, err = typed(f"{line} --seeds 2 --steps 20 --jobs 1")
    assert status == 0
    assert "4/4 runs" in err
    assert "minus 2 [95 %]" in out
    assert (tmp_path / "here" / "there" / "over_time.png").exists()


@pytest.mark.parametrize("name", builtin_maps())
def test_map_import_writes_what_reads_back_as_the_same_map(typed, tmp_path, name):
    status, out, _ = typed(f"map import {name}")
    assert (status, out.splitlines()[-1]) == (0, f"{name}.toml")
    assert Map.load(tmp_path / f"{name}.toml") == Map.load(name)


def test_map_import_never_replaces_a_file_unless_forced(typed, tmp_path):
    (tmp_path / "mine.toml").write_text("precious")
    status, _, err = typed("map import original mine.toml")
    assert (status, err.count("\n")) == (2, 1)
    assert "mine.toml exists already" in err
    assert (tmp_path / "mine.toml").read_text() == "precious"
    assert typed("map import original mine.toml --force")[0] == 0
    assert Map.load(tmp_path / "mine.toml") == Map.load("original")


def test_map_show_counts_what_is_there(typed):
    status, out, _ = typed("map show original")
    assert status == 0
    assert "obstacles     11 (3 discs, 8 rectangles)" in out
    assert "fires         7 (areas" in typed("map show openspace_fire")[1]


def test_map_show_draws_a_picture(typed, tmp_path):
    status, out, _ = typed("map show sparse --out drawn/sparse.png")
    assert (status, out.splitlines()[-1]) == (0, "drawn/sparse.png")
    assert (tmp_path / "drawn" / "sparse.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(("kind", "steps"), [("stages", "0,20"), ("trace", "30"), ("ethogram", "30")])
def test_picture_draws_a_run_and_prints_where(typed, tmp_path, kind, steps):
    line = f"picture collision_avoidance --kind {kind} --steps {steps} --set n_robots=3 --quiet"
    path = Path("results", f"collision_avoidance_{kind}.png")
    assert typed(line) == (0, f"{path}\n", "")
    assert (tmp_path / path).read_bytes()[:4] == b"\x89PNG"
    assert [found.name for found in (tmp_path / "results").iterdir()] == [path.name]


def test_picture_takes_robots_a_seed_and_a_file_and_shows_progress(typed, tmp_path, monkeypatch):
    asked = []
    real = picture_commands.drawn
    monkeypatch.setattr(picture_commands, "drawn", lambda *words: (asked.append(words), real(*words))[1])
    line = "picture collision_avoidance --kind trace --steps 25 --robots 2 --rng 7 --out here/way.PNG"
    status, out, err = typed(line)
    assert (status, out) == (0, "here/way.PNG\n")
    assert "25/25 steps" in err
    assert (tmp_path / "here" / "way.PNG").exists()
    ((model, *rest),) = asked
    assert rest == ["trace", [25], 2, True]
    assert model.state_hash() == find_model("collision_avoidance")(rng=7).run(25).state_hash()


def test_picture_draws_stages_unless_asked_for_another_kind(typed, monkeypatch):
    monkeypatch.setattr(picture_commands, "STEPS", {"stages": "0,5"})
    assert typed("picture agglomeration --quiet") == (0, "results/agglomeration_stages.png\n", "")


def test_diagnose_finds_nothing_in_collision_avoidance_as_it_comes(typed):
    status, out, err = typed("diagnose collision_avoidance --quiet")
    lines = out.splitlines()
    assert (status, err) == (0, "")
    assert lines[0].split() == ["steps", "2000"]
    assert [line.split()[-1] for line in lines if line.split()[:-1] and line.startswith(KINDS)] == ["0"] * len(KINDS)
    assert lines[-1] == "No pathology was found."


def test_diagnose_finds_robots_that_turn_on_the_spot_in_a_corridor(typed):
    Map(name="corridor", bounds=(0, 0, 300, 22)).save("corridor.toml")
    line = "diagnose collision_avoidance --set map=corridor.toml --set design=AGENT3 --set n_robots=2 --steps 500"
    status, out, err = typed(f"{line} --set turn=stationary")
    ids = [robot.unique_id for robot in find_model("collision_avoidance")(n_robots=2, map="corridor.toml").robots]
    assert status == 0
    assert "500/500 steps" in err
    assert ["corridor", "flip", "2"] in [word.split() for word in out.splitlines()]
    told = out.splitlines()[-2:]
    assert sorted(int(sentence.split()[1]) for sentence in told) == ids
    assert all("turned away from what was near on its left and on its right by turns" in s for s in told)
    assert all(s.endswith("to 500 (layer 0).") for s in told)
    assert "layers                         0 Avoid, 1 Explore" in out
    assert typed(f"{line} --quiet")[1].endswith("No pathology was found.\n")


def test_bench_prints_its_report_and_the_paths(typed, tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "TARGETS", {50: 0.06, 200: 0.15, 10_000: 5.0})
    monkeypatch.setattr(bench, "step_seconds", lambda step, repetitions, budget: 1e-4)
    monkeypatch.setattr(bench, "peer_workload", lambda n: find_model("collision_avoidance")(n_robots=3, rng=1))
    monkeypatch.setattr(bench, "start_times", lambda: [0.1, 0.2, 0.3])
    status, out, _ = typed("bench --quick")
    assert status == 0
    assert "growth exponent from 200 to 10,000 robots: 0 (target" in out
    assert {path.name for path in (tmp_path / "results" / "bench").iterdir()} == {"step.csv", "complexity.png"}


def test_dashboard_is_launched_with_model_port_and_browser(typed, monkeypatch):
    calls = []
    page = SimpleNamespace(launch=lambda *details: calls.append(details))
    monkeypatch.setattr(commands, "import_module", lambda name: page)
    typed("dashboard")
    typed("dashboard collision_avoidance --port 9000 --no-browser")
    typed("dashboard boids --host 0.0.0.0 --recordings .")
    assert calls == [
        ("fire_fighting", 8765, True, "127.0.0.1", None),
        ("collision_avoidance", 9000, False, "127.0.0.1", None),
        ("boids", 8765, True, "0.0.0.0", Path()),
    ]


def test_dashboard_says_what_to_install_if_it_is_missing(typed, monkeypatch):
    def missing(name):
        raise ModuleNotFoundError("No module named 'solara'", name="solara")

    monkeypatch.setattr(commands, "import_module", missing)
    status, _, err = typed("dashboard")
    assert status == 2
    assert err == "mesa-swarm: the dashboard needs solara; install it with: pip install 'mesa-swarm[dashboard]'\n"


WRONG = {
    "lst": "Did you mean 'list'",
    "map shwo original": "Did you mean 'show'",
    "--nope": "No such option: --nope",
    "run": "Missing argument 'MODEL|JOB.toml'",
    "run fire_fighting extra": "unexpected extra argument",
    "run fire_figting": "did you mean 'fire_fighting'",
    "run fire_fighting --stps 3": "--steps",
    "run fire_fighting --set": "requires an argument",
    "run fire_fighting --set n_robots": "has no =",
    "run fire_fighting --set n_robts=3": "did you mean 'n_robots'",
    "run fire_fighting --set n_robots=many": "n_robots is 'many'; expected a whole number",
    "run fire_fighting --set n_robots=2.5": "expected a whole number",
    "run fire_fighting --set n_robots=1e9": "do not fit",
    "run fire_fighting --set map=original": "unknown map 'original'",
    "run fire_fighting --set map=nowhere.toml": "nowhere.toml: no such file",
    "run fire_fighting --set n_robots=-1": "n_robots is -1",
    "run fire_fighting --set k1=nan": "k1 is 'nan'",
    "run fire_fighting --set k1=-1": "k1 is -1",
    "run fire_fighting --set strategy=C": "unknown strategy 'C'; known: A, B",
    "run fire_fighting --set join=500": "expected join below leave",
    "run collision_avoidance --set map=orignal": "did you mean 'original'",
    "run fire_fighting --steps 0": "--steps",
    "run fire_fighting --steps 1e9": "--steps",
    "run fire_fighting --steps 999999999999": "--steps",
    "run fire_fighting --rng -1": "--rng",
    "run fire_fighting --rng x": "--rng",
    "compare fire_fighting --seeds 0": "--seeds",
    "compare fire_fighting --seeds nan": "--seeds",
    "compare fire_fighting --jobs 0": "expected a whole number at least 1 and at most 1024, or -1",
    "compare fire_fighting --jobs -5": "--jobs",
    "compare fire_fighting --values A": "1 values of strategy",
    "compare fire_fighting --values A,C": "unknown strategy 'C'",
    "compare fire_fighting --parameter n_robots": "0 values of n_robots",
    "compare fire_fighting --parameter n_robots --values 5,1e9": "do not fit",
    "compare fire_fighting --parameter nope --values 1,2": "unknown parameter of FireFighting 'nope'",
    "compare fire_fighting --set strategy=A": "set and compared at once",
    "compare fire_fighting --out /dev/null/x": "results cannot be written to '/dev/null/x'",
    "compare fire_fighting --out taken": "results cannot be written to 'taken'",
    "picture": "Missing argument 'MODEL'",
    "picture agglomeraton": "did you mean 'agglomeration'",
    "picture agglomeration --kind stage": "unknown kind 'stage'; did you mean 'stages'?",
    "picture agglomeration --kind etogram": "did you mean 'ethogram'",
    "picture agglomeration --steps x": "steps is 'x'; expected steps such as 0,1000,3000",
    "picture agglomeration --steps 5,": "steps is '5,'",
    "picture agglomeration --steps 20,10": "expected ascending steps",
    "picture agglomeration --steps 10000001": "at most 10,000,000",
    "picture agglomeration --kind trace --steps 5,10": "expected one number of steps",
    "picture agglomeration --kind trace --steps 0": "steps is 0; expected a whole number at least 1",
    "picture agglomeration --kind trace --robots 9": "robots is 9; expected a whole number at least 1 and at most 8",
    "picture agglomeration --kind ethogram --steps 0": "steps is 0; expected a whole number at least 1",
    "picture agglomeration --kind ethogram --robots 0": "--robots",
    "picture agglomeration --robots 3": "stages show all of them",
    "picture agglomeration --out a.jpg": "out is 'a.jpg'; expected the name of a .png file",
    "picture agglomeration --out /dev/null/a.png": "results cannot be written to '/dev/null'",
    "picture agglomeration --out taken/a.png": "results cannot be written to 'taken'",
    "picture agglomeration --set n_robts=3": "did you mean 'n_robots'",
    "picture agglomeration --rng -1": "--rng",
    "diagnose": "Missing argument 'MODEL'",
    "diagnose agglomeraton": "did you mean 'agglomeration'",
    "diagnose agglomeration --steps 0": "--steps",
    "diagnose agglomeration --steps 1000001": "--steps",
    "diagnose agglomeration --set n_robots=many": "expected a whole number",
    "diagnose collision_avoidance --set map=taken.toml": "taken.toml",
    "diagnose boids": "robots of the design boid have no wheels left and right",
    "map show": "Missing argument",
    "map show orignal": "did you mean 'original'",
    "map show .": "expected a file that ends in",
    "map show taken.toml": "taken.toml",
    "map show original --out picture.jpg": "out is 'picture.jpg'; expected the name of a .png file",
    "map show original --out /dev/null/a.png": "results cannot be written to",
    "map import original /dev/null/a.toml": "/dev/null/a.toml",
    "map import original a.bmp": "expected a file that ends in",
    "dashboard nope": "unknown model 'nope'",
    "dashboard --port 0": "--port",
    "dashboard --port 70000": "--port",
    "bench --out taken": "results cannot be written to 'taken'",
}


@pytest.mark.parametrize("line", WRONG)
def test_what_is_typed_wrongly_is_refused_in_one_line_before_anything_is_run(typed, tmp_path, line):
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "taken.toml").write_text("mine = [")
    status, out, err = typed(line)
    assert (status, out) == (2, "")
    assert err.startswith("mesa-swarm: ")
    assert err.count("\n") == 1
    assert WRONG[line] in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["taken", "taken.toml"]


def test_a_traceback_is_shown_with_debug_only_and_the_status_stays(typed):
    for line in ["--debug run fire_fighting --set n_robots=-1", "run fire_fighting --set n_robots=-1 --debug"]:
        status, _, err = typed(line)
        assert status == 2
        assert "Traceback" in err
        assert err.splitlines()[-1].startswith("mesa-swarm: n_robots is -1")


def test_an_unexpected_error_is_one_line_too(typed, monkeypatch):
    def break_down():
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr(commands, "list_models", break_down)
    status, _, err = typed("list")
    assert (status, err.count("\n")) == (2, 1)
    assert err.startswith("mesa-swarm: ZeroDivisionError: division by zero")


def test_an_error_of_the_system_names_the_file(typed, monkeypatch):
    def full():
        raise OSError(28, "No space left on device", "results/runs.csv")

    monkeypatch.setattr(commands, "list_models", full)
    assert typed("list")[::2] == (2, "mesa-swarm: results/runs.csv: No space left on device\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_output_that_is_printed_to_a_full_disk_is_named():
    command = [sys.executable, "-m", "mesa_swarm.cli", "list"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.stderr == "mesa-swarm: standard output or a temporary file: No space left on device\n"
    assert done.returncode == 2


def test_warnings_are_one_line(typed, monkeypatch):
    def warn():
        cli.warnings.simplefilter("always")
        cli.warnings.warn("this\nis odd", UserWarning, stacklevel=1)

    monkeypatch.setattr(commands, "list_models", warn)
    assert typed("list") == (0, "", "mesa-swarm: warning: this is odd\n")


def test_ctrl_c_is_one_line_and_status_130(typed, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "list_models", interrupt)
    assert typed("list") == (130, "", "mesa-swarm: interrupted; nothing more was written\n")


def test_ctrl_c_stops_a_comparison_on_all_cores_and_leaves_nothing_but_its_runs(tmp_path):
    command = [sys.executable, "-m", "mesa_swarm.cli", "compare", "fire_fighting", "--jobs", "2", "--out", "made"]
    running = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    seen = ""
    while "runs" not in seen:  # the bar is there: workers are being started
        seen += running.stderr.read(1)
    time.sleep(1)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to all processes
    out, err = running.communicate(timeout=120)
    ledger = Path("made", "runs.jsonl")
    assert running.returncode == 130
    assert out == f"the runs so far are stored in {ledger}; the same command goes on where this one stopped\n"
    assert "mesa-swarm: interrupted; nothing more was written" in err.splitlines()
    assert "Traceback" not in err
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [tmp_path / ledger]


def test_the_program_runs_as_a_process_and_imports_little_for_its_help():
    check = "import sys, mesa_swarm.cli; print(sorted({'mesa', 'numpy', 'matplotlib', 'solara'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert process("lst").returncode == 2
    assert process("--version").stdout.startswith("mesa-swarm ")


def test_a_reader_that_has_seen_enough_is_no_error():
    command = f"{sys.executable} -m mesa_swarm.cli list | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == (f"{model_names()[0]}\n", "")


def test_an_unknown_rate_gives_no_finishing_time():
    assert finishing_time(10, 0.0, None) == "measuring"
    with progress_bar(5, "runs", shown=False) as bar:
        bar.update(5)
