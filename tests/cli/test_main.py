"""The program as a whole: help, what is refused, and how every error ends."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import mesa_swarm
from mesa_swarm import cli
from mesa_swarm.base.progress import finishing_time, progress_bar
from mesa_swarm.cli import listing
from mesa_swarm.cli.options import print_pairs
from mesa_swarm.model.gallery import model_names

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
    "run fire_fighting --set map=original": "which this model does not offer; expected openspace_fire",
    "run collision_avoidance --set map=openspace_FIRE": "expected original, sparse, openspace or a file of your own",
    "run fire_fighting --set map=nowhere.toml": "nowhere.toml: no such file",
    "run fire_fighting --set map=fire.sim": "fire.sim: drawing commands of RAS2D",
    "run fire1.job": "fire1.job: a job of RAS2D",
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


def process(*words, **more):
    command = [sys.executable, "-m", "mesa_swarm", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, **more)


@pytest.mark.parametrize("line", ["", "--help", "-h", "map", "run --help", "compare -h", "map import --help"])
def test_help_is_printed_on_request_and_without_a_command(typed, line):
    status, out, err = typed(line)
    assert (status, err) == (0, "")
    assert out.startswith("Usage: mesa-swarm")


def test_version_is_the_packages(typed):
    assert typed("--version")[:2] == (0, f"mesa-swarm {mesa_swarm.__version__}\n")


@pytest.mark.slow
@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_command_is_refused_in_one_line_before_anything_is_run(typed, tmp_path, line):
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

    monkeypatch.setattr(listing, "model_names", break_down)
    status, _, err = typed("list")
    assert (status, err.count("\n")) == (2, 1)
    assert re.match(r"mesa-swarm: test_main.py, line \d+: ZeroDivisionError: division by zero", err)


def test_an_error_of_the_system_names_the_file(typed, monkeypatch):
    def full():
        raise OSError(28, "No space left on device", "results/runs.csv")

    monkeypatch.setattr(listing, "model_names", full)
    assert typed("list")[::2] == (2, "mesa-swarm: results/runs.csv: No space left on device\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_output_that_is_printed_to_a_full_disk_is_named():
    command = [sys.executable, "-m", "mesa_swarm", "list"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.stderr == "mesa-swarm: standard output or a temporary file: No space left on device\n"
    assert done.returncode == 2


def test_a_warning_is_one_line_once_in_a_command(typed, monkeypatch):
    def warn():
        cli.warnings.simplefilter("always")
        for _ in range(3):
            cli.warnings.warn("this\nis odd", UserWarning, stacklevel=1)
        return []

    monkeypatch.setattr(listing, "model_names", warn)
    assert typed("list") == (0, "", "mesa-swarm: warning: this is odd\n")


def test_ctrl_c_is_one_line_and_status_130(typed, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr(listing, "model_names", interrupt)
    assert typed("list") == (130, "", "mesa-swarm: interrupted; nothing more was written\n")


@pytest.mark.slow
def test_the_program_runs_as_a_process_and_imports_little_for_its_help():
    check = "import sys, mesa_swarm.cli; print(sorted({'mesa', 'numpy', 'matplotlib', 'solara'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert process("lst").returncode == 2
    assert process("--version").stdout.startswith("mesa-swarm ")


@pytest.mark.slow
def test_models_do_not_wait_for_statistics_or_pictures():
    check = "import sys; from mesa_swarm.model.gallery import loaded_models; loaded_models(); "
    check += "print(sorted({'scipy.stats', 'matplotlib', 'solara', 'pyarrow.dataset'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_reader_that_closes_the_output_is_not_an_error():
    command = f"{sys.executable} -m mesa_swarm list | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == (f"{model_names()[0]}\n", "")


def test_an_unknown_rate_gives_no_finishing_time():
    assert finishing_time(10, 0.0, None) == "measuring"
    with progress_bar(5, "runs", is_shown=False) as bar:
        bar.update(5)


def test_values_are_printed_in_two_columns_as_a_user_would_write_them(capsys):
    print_pairs({"steps": 10, "out at": None, "share": 0.1 + 0.2})
    assert capsys.readouterr().out == "steps   10\nout at  -\nshare   0.3\n"
