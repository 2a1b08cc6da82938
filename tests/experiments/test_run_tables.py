"""Tables of runs as CSV, and in the form of NetLogo's BehaviorSpace."""

import csv
import re

import pandas as pd
import pytest

from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.experiments.compare import compare
from mesa_swarm.experiments.reality_gap import reality_gap
from mesa_swarm.experiments.sweep import sweep


class Plain(SwarmModel):
    """Robots, and parameters and results of all kinds."""

    compares = "word", ("a", 'two "b", c')

    def __init__(self, *, n_robots: int = 2, word: str = "a", flag: bool = False, rng=None):
        if n_robots == 7:
            raise ValueError("no seven")
        super().__init__(rng=rng, model_reporters={"now": lambda model: model.completed})
        self.add_robots(AGENT3, n_robots)

    def results(self):
        return {"robots": float(len(self.robots)), "share": 0.25, "nothing": None}


def behaviorspace(folder):
    """Return the lines about an experiment, and the rows below them by the names of their columns."""
    with open(folder / "behaviorspace.csv", encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))
    return lines[:6], [dict(zip(lines[6], line, strict=True)) for line in lines[7:]]


def test_the_csv_of_a_sweep_has_the_rows_of_its_table(tmp_path):
    made = sweep(Plain, {"word": list(Plain.compares[1])}, seeds=2, steps=3, out=tmp_path, jobs=1, tables=["csv"])
    assert made.tables == (tmp_path / "runs.csv",)
    read = pd.read_csv(tmp_path / "runs.csv")
    assert read.columns.tolist() == made.frame().columns.tolist()
    assert read["word"].tolist() == made.frame()["word"].tolist()
    assert read["share"].tolist() == [0.25] * 4


def test_the_table_of_behaviorspace_has_six_lines_about_the_experiment_and_a_row_a_run(tmp_path):
    points = [{"n_robots": 2, "word": 'two "b", c', "flag": True}, {"n_robots": 7, "word": "a", "flag": False}]
    points.append({**points[0], "n_robots": 3})
    made = sweep(Plain, points, seeds=[5], steps=3, out=tmp_path, jobs=1, tables="behaviorspace")
    assert made.failed == 1
    about, rows = behaviorspace(tmp_path)
    assert re.fullmatch(r"BehaviorSpace results \(mesa-swarm [0-9.]+.*\)", about[0][0])
    assert about[0][1] == "Table version 2.0"
    assert about[1][0].endswith("test_run_tables:Plain")
    assert re.fullmatch(r"\d\d/\d\d/\d{4} \d\d:\d\d:\d\d:\d{3} [+-]\d{4}", about[3][0])
    assert about[4:] == [["min-pxcor", "max-pxcor", "min-pycor", "max-pycor"], ["0", "800", "0", "600"]]
    names = ["[run number]", "n_robots", "word", "flag", "rng", "[step]", "robots", "share", "nothing"]
    values = [["1", "2", 'two "b", c', "true", "5", "3", "2", "0.25", ""]]
    values.append(["3", "3", 'two "b", c', "true", "5", "3", "3", "0.25", ""])  # the second run ended in an error
    assert rows == [dict(zip(names, row, strict=True)) for row in values]
    assert all(
        re.fullmatch('(".*")(,".*")*', line) for line in (tmp_path / "behaviorspace.csv").read_text().splitlines()
    )


def test_with_series_the_table_of_behaviorspace_has_a_row_a_step(tmp_path):
    how = {"seeds": 1, "steps": 3, "out": tmp_path, "jobs": 1, "tables": ["behaviorspace"]}
    sweep(Plain, {"n_robots": [2, 3]}, series="model", **how)
    _, rows = behaviorspace(tmp_path)
    assert [(row["[run number]"], row["n_robots"], row["[step]"], row["now"]) for row in rows] == [
        (run, robots, step, step) for run, robots in (("1", "2"), ("2", "3")) for step in ("1", "2", "3")
    ]
    sweep(Plain, {"n_robots": [2, 3]}, series="agents", **how)
    assert [row["robots"] for row in behaviorspace(tmp_path)[1]] == ["2", "3"]


@pytest.mark.slow
def test_compare_and_reality_gap_write_both_tables(tmp_path):
    tables = ["csv", "behaviorspace"]
    comparison = compare(Plain, seeds=2, steps=3, jobs=1, out=tmp_path, tables=tables)
    assert [row["word"] for row in behaviorspace(tmp_path)[1]] == ["a", 'two "b", c'] * 2
    text = (tmp_path / "runs.csv").read_text()
    comparison.save(tmp_path)
    assert (tmp_path / "runs.csv").read_text() == text
    gap = reality_gap("agglomeration", dial=(0, 1), seeds=2, steps=3, out=tmp_path / "gap", tables=tables)
    rows = pd.read_csv(tmp_path / "gap/runs.csv")
    assert rows["imperfections"].tolist() == [0, 0, 1, 1]
    assert rows[gap.measure].tolist() == gap.scores[0.0] + gap.scores[1.0]
    assert len(behaviorspace(tmp_path / "gap")[1]) == 4


def test_tables_of_a_shard_are_refused_since_they_are_of_all(tmp_path):
    with pytest.raises(InvalidValueError, match="tables are of all shards; leave them out here"):
        sweep(Plain, seeds=2, steps=3, out=tmp_path, shard=(1, 2), tables=["csv"])


def test_tables_and_series_of_an_earlier_call_that_are_left_are_named(tmp_path, capsys):
    settings = {"varied": {"n_robots": [2]}, "seeds": 2, "out": tmp_path, "jobs": 1}
    sweep(Plain, steps=3, tables=["csv"], series="model", **settings)
    assert "earlier call" not in capsys.readouterr().err
    sweep(Plain, steps=4, **settings)
    line = f"runs.csv, series/model in {tmp_path} are of an earlier call, and were not written anew"
    assert line in capsys.readouterr().err.replace("\n", " ")
    compare(Plain, "n_robots", [2, 3], seeds=2, steps=3, out=tmp_path, jobs=1, series="model")
    assert "earlier call" not in capsys.readouterr().err, "a comparison saves its runs.csv"
