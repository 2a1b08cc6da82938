"""--table of the commands that search, design and train: a row a run, in both forms, by the code of sweeps."""

import csv
import shlex
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest

BRIEF = "--robots 3 --steps 20 --generations 1"
STUDY = "fire_fighting --range n_robots=2:4 --seeds 1 --steps 5 --jobs 1"
# Of each command the rows of its table, columns of what was tried, and columns of results.
COMMANDS = {
    f"tune {BRIEF} --population 4 --seeds 2 --judged 2": (8, {"beta", "gamma"}, {"collisions", "speed"}),
    "reward-lab --rewards a,b --steps 30": (2, {"reward", "critical"}, {"beside a wall: back and forth"}),
    f"design {BRIEF} --population 4": (4, {"generation", "candidate", "map"}, {"fitness"}),
    f"design-gap {BRIEF} --population 4 --designs 2 --seeds 1": (20, {"controller", "dial"}, {"score"}),
    f"diversity {BRIEF}": (36, {"genome"}, {"fitness", "coverage", "largest group"}),
    "learn-bench --task avoid --only random --seeds 1 --steps 20 --evaluation-steps 20 --maps 1 --jobs 1": (
        *(1, {"task", "name"}, {"robot-steps", "original|frozen|collisions"}),
    ),
    f"sensitivity {STUDY} --range k1=0.001:0.01 --measure 'mean of fires_burning' --method morris --points 2": (
        *(6, {"n_robots", "k1"}, {"mean of fires_burning"}),
    ),
    f"calibrate {STUDY} --target 'fires out=0' --points 2 --fresh 2": (2, {"n_robots"}, {"fires out"}),
}
NEEDED = {"diversity": "ribs", "sensitivity": "SALib", "calibrate": "optuna"}


@pytest.mark.parametrize("line", COMMANDS, ids=lambda line: line.partition(" ")[0])
def test_a_command_writes_a_row_for_each_run_as_csv_and_for_behaviorspace(typed, line):
    command = line.partition(" ")[0]
    if command in NEEDED and find_spec(NEEDED[command]) is None:
        pytest.skip(f"needs {NEEDED[command]}")
    status, out, err = typed(shlex.split(f"{line} --quiet --out made --table csv --table behaviorspace"))
    assert (status, err) == (0, "")
    count, tried, measured = COMMANDS[line]
    rows = pd.read_csv("made/runs.csv")
    assert len(rows) == count
    assert {*tried, *measured, "rng", "steps"} <= set(rows)
    with Path("made/behaviorspace.csv").open(newline="") as file:
        lines = list(csv.reader(file))
    assert lines[6][0] == "[run number]"
    assert {*tried, *measured, "rng", "[step]"} <= set(lines[6])
    assert len(lines) == 7 + count
    assert {str(Path("made", name)) for name in ("runs.csv", "behaviorspace.csv")} <= set(out.splitlines())


def test_an_unknown_form_of_a_table_is_one_line_before_any_run(typed):
    for command in ("tune", "reward-lab", "design", "design-gap", "learn-bench"):
        status, out, err = typed(f"{command} --table xls --out made")
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "unknown form of a table 'xls'; known: csv, behaviorspace" in err
        assert not Path("made").exists()
