"""The reward laboratory's runs: what they measure, and that a killed study continues with what is done."""

import os

import numpy as np
import pandas as pd
import pytest

from mesa_swarm import AGENT9
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments import reward_study as studies
from mesa_swarm.experiments.diagnosis import MEASURES, SCENES, oscillation, trained
from mesa_swarm.experiments.reward_study import reward_study
from mesa_swarm.learning.reward_lab import learned_profile
from support.killing import kill_at_call, lines_in

BRIEF = {"actions": 4, "steps": 30, "robots": 2, "seeds": 2, "rng": 3}


def test_a_run_is_measured_as_its_policy_is_alone_and_the_first_seed_is_drawn():
    study = reward_study(["a", "b"], **BRIEF)
    assert [(run.settings["reward"], run.rng) for run, _ in study.done] == [("a", 3), ("a", 4), ("b", 3), ("b", 4)]
    policy = trained("b", 4, 3, steps=30, n_robots=2)
    measures = study.done[2][1].numbers
    for scene in SCENES:
        alone = oscillation(policy, scene=scene, rng=3)
        assert {measure: measures[f"{scene}: {measure}"] for measure in MEASURES} == alone
    learned, alone = study.profiles["b"][1], learned_profile(policy, AGENT9)
    assert np.array_equal(learned.values, alone.values)
    assert learned.marks == alone.marks


STUDY = 'module.reward_study(["a", "b"], actions=4, steps=30, robots=2, seeds=2, rng=3, out=home)'


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_study_whose_process_is_killed_continues_with_what_is_done_and_ends_in_the_same_files(tmp_path, monkeypatch):
    home = tmp_path / "killed"
    kill_at_call(studies.__name__, "oscillation", 6, STUDY, home, tmp_path / "errors")
    assert lines_in(home / "runs.jsonl") == 2
    done = []
    monkeypatch.setattr(studies, "oscillation", lambda policy, **how: done.append(how) or oscillation(policy, **how))
    again = reward_study(["a", "b"], out=home, **BRIEF)
    assert len(done) == 2 * len(SCENES)
    whole = reward_study(["a", "b"], **BRIEF)
    assert again.table() == whole.table()
    names = [path.name for path in whole.save(tmp_path / "whole")]
    again.save(home)
    assert all((home / name).read_bytes() == (tmp_path / "whole" / name).read_bytes() for name in names)


def test_runs_end_at_a_condition_and_their_series_and_tables_are_written(tmp_path):
    study = reward_study(["b"], out=tmp_path, until="steps == 7", series="model", tables=["csv"], **BRIEF)
    rows = pd.read_csv(tmp_path / "runs.csv")
    assert rows["steps"].tolist() == [7, 7]
    assert rows["ended_by"].tolist() == ["condition"] * 2
    assert set(studies.IN_SCENES) < set(rows)
    assert not set(studies.CURVES) & set(rows)
    steps = pd.read_parquet(tmp_path / "series" / "model")
    assert len(steps) == 14
    assert set(steps["run"]) == set(rows["run"])
    assert study.files.stored == [tmp_path / name for name in ("runs.jsonl", "runs.csv", "series/model")]


def test_series_without_a_folder_are_refused():
    with pytest.raises(SwarmError, match=r"^series are wanted and no folder is named; add out="):
        reward_study(["b"], series=True)
