"""sensitivity and calibrate: what a user types, rightly and wrongly."""

from pathlib import Path

import pytest

from mesa_swarm.base import extras
from mesa_swarm.base.extras import install_command
from mesa_swarm.cli.parameter_searches import parsed_ranges
from mesa_swarm.experiments.sampling import Range
from mesa_swarm.model.gallery import find_model

STUDY = ["sensitivity", "fire_fighting", "--measure", "mean of robots_at_fires", "--steps", "20", "--jobs", "1"]
SEARCH = ["calibrate", "fire_fighting", "--steps", "20", "--jobs", "1", "--points", "2", "--seeds", "1"]
RANGES = ["--range", "k1=0.0002:0.0008:log", "--range", "n_robots=2:4"]


@pytest.mark.slow
def test_sensitivity_prints_indices_paths_and_a_finding_and_continues(typed):
    words = [*STUDY, *RANGES, "--method", "morris", "--points", "2", "--seeds", "2", "--quiet", "--until", "steps == 9"]
    status, out, err = typed([*words, "--difference", "strategy=A,B"])
    folder = Path("results", "sensitivity_fire_fighting_morris")
    assert (status, err) == (0, "")
    assert out.startswith("FireFighting: sensitivity of mean of robots_at_fires, strategy B minus A; 2 trajectories")
    assert "0.0002 to 0.0008, log" in out
    for name in ("runs.parquet", "sensitivity.csv", "sensitivity.txt", "sensitivity.png"):
        assert str(folder / name) in out.splitlines()
        assert (folder / name).exists()
    runs = (folder / "ledger.jsonl").read_bytes()
    assert typed([*words, "--difference", "strategy=A,B"]) == (0, out, "")
    assert (folder / "ledger.jsonl").read_bytes() == runs


@pytest.mark.slow
def test_calibrate_prints_the_best_and_its_measures_over_fresh_seeds(typed):
    status, out, err = typed(
        [*SEARCH, *RANGES, "--target", "fires out=0:1", "--fresh", "6", "--out", "here", "--quiet", "--table", "csv"]
    )
    assert (status, err) == (0, "")
    assert out.startswith("FireFighting: best of 2 points, 1 seed at each, then 6 fresh seeds")
    assert out.splitlines()[-1].endswith("fires out was 0 [0, 0] for a target of 0, which is within the interval.")
    assert {str(Path("here", "runs.csv")), str(Path("here", "fresh", "runs.csv"))} <= set(out.splitlines())
    assert {path.name for path in Path("here").iterdir()} >= {"best.csv", "history.csv", "calibration.png", "fresh"}


def test_ranges_are_read_as_the_types_of_the_parameters():
    texts = ["n_robots=5:20", "k1=0.001:0.01:log", "strategy=A,B", "leave=50,100,200"]
    assert parsed_ranges(find_model("fire_fighting"), texts) == {
        "n_robots": Range(low=5, high=20),
        "k1": Range(low=0.001, high=0.01, log=True),
        "strategy": Range(values=("A", "B")),
        "leave": Range(values=(50.0, 100.0, 200.0)),
    }


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (STUDY, "no range is given; give one for each parameter, such as --range n_robots=5:20"),
        ([*STUDY, "--range", "k1"], "range 'k1' is unclear; expected NAME=LOW:HIGH"),
        ([*STUDY, "--range", "k1=0.1:0.2:lin"], "range 'k1=0.1:0.2:lin' is unclear"),
        ([*STUDY, "--range", "k1=a:b"], "k1 is 'a'; expected a finite number"),
        ([*STUDY, "--range", "kay=1:2"], "unknown parameter of FireFighting 'kay'"),
        ([*STUDY, "--range", "k1=1:2", "--range", "k1=1:3"], "range of 'k1' is given twice"),
        ([*STUDY, *RANGES, "--difference", "strategy"], "difference 'strategy' is unclear; expected NAME=A,B"),
        ([*STUDY, *RANGES, "--points", "3"], "expected a power of two for sobol, such as 4"),
        ([*STUDY, *RANGES, "--method", "fast"], "unknown method 'fast'"),
        (["sensitivity", "fire_fighting", *RANGES], "Missing option '--measure'"),
        ([*SEARCH, *RANGES], "no target is given; give at least one, such as --target 'fires out=7'"),
        ([*SEARCH, *RANGES, "--target", "fires out"], "target 'fires out' is unclear; expected MEASURE=VALUE"),
        ([*SEARCH, *RANGES, "--target", "fires out=1:2:3"], "MEASURE=VALUE:SCALE"),
        ([*SEARCH, *RANGES, "--target", "fires=1"], "did you mean 'fires out'"),
        ([*SEARCH, *RANGES, "--target", "fires out=1", "--missing", "fires out=x"], "missing 'fires out=x' is unclear"),
        ([*SEARCH, *RANGES, *["--target", "fires out=1"] * 2], "target of 'fires out' is given twice"),
    ],
)
def test_wrong_words_end_with_one_line_and_leave_nothing(typed, tmp_path, words, message):
    status, out, err = typed(words)
    assert (status, out) == (2, "")
    assert message in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("command", "extra"), [(STUDY, "sensitivity"), (SEARCH, "calibration")])
def test_a_missing_package_is_reported_with_the_command_that_installs_it(typed, monkeypatch, command, extra):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    assert install_command(extra) in typed([*command, *RANGES])[2]
