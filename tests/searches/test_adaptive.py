"""Adaptive designs and calibration: proposals and results through one ledger, and targets that are found."""

import math
import re
from collections import Counter

import optuna
import pandas as pd
import pytest

from mesa_swarm import AdaptiveDesign, calibrate
from mesa_swarm.base import extras
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.base.extras import install_command
from mesa_swarm.experiments.sampling import Range
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.viewing.pictures import png
from support.known_functions import Bowl, Linear

SPACE = {"x1": (0.0, 1.0), "x2": (1e-4, 1.0, "log"), "kind": ["plain", "best", "other"], "whole": (1, 9)}


def design(home, **how):
    return AdaptiveDesign(Linear, **{"seeds": 2, "steps": 1, "out": home, "jobs": 1, **how})


def searched(home, **how):
    given = {"points": 6, "batch": 3, "seeds": 2, "fresh": 6, "steps": 1, "out": home, "jobs": 1, **how}
    return calibrate(Bowl, SPACE, {"y": (0.0, 1.0)}, settings={"noise": 0.1, **given.pop("settings", {})}, **given)


def test_tables_have_all_points_and_those_that_an_earlier_call_has_left_are_named_once(tmp_path, capsys):
    tried = design(tmp_path, tables=["csv"], retry_failed=True)
    for x in (0.0, 0.5):
        tried.propose([{"x1": x}])
        rows = tried.results()
    assert pd.read_csv(tmp_path / "runs.csv")["y"].tolist()[-2:] == rows["y"].tolist()
    assert len(pd.read_csv(tmp_path / "runs.csv")) == 4
    assert "earlier call" not in capsys.readouterr().err
    tried = design(tmp_path)
    for x in (0.0, 0.5):
        tried.propose([{"x1": x}])
        tried.results()
    assert capsys.readouterr().err.count("earlier call") == 1


def test_batches_make_the_table_of_one_sweep_of_all_points(tmp_path):
    points = [{"x1": x} for x in (0.0, 0.5, 1.0)]
    tried = design(tmp_path / "a")
    assert tried.propose(points[:2]) == range(2)
    first = tried.results()
    assert tried.propose(points[2:]) == range(2, 3)
    second = tried.results()
    whole = sweep(Linear, points, seeds=2, steps=1, out=tmp_path / "b", jobs=1)
    assert (tmp_path / "a" / "runs.parquet").read_bytes() == whole.path.read_bytes()
    assert pd.concat([first, second], ignore_index=True).equals(whole.frame())
    assert tried.table().equals(whole.frame())
    assert second["point"].tolist() == [2, 2]
    assert len(tried) == 3


def test_an_optimiser_that_is_started_again_finds_its_runs_in_the_ledger(tmp_path):
    diary = tmp_path / "diary"
    for _ in range(2):
        tried = design(tmp_path, settings={"diary": str(diary)})
        x = 1.0
        for _ in range(3):  # halves as long as the function falls
            tried.propose([{"x1": x}])
            x /= 1 + (tried.results()["y"].mean() > 0)
    assert len(diary.read_text().splitlines()) == 3 * 2


def test_failed_runs_of_a_design_are_rows_and_each_is_repeated_once_if_wanted(tmp_path):
    diary = tmp_path / "diary"
    settings = {"fails_above": 0.5, "diary": str(diary)}
    errors = []
    for retry in (False, True):
        tried = design(tmp_path, settings=settings, retry_failed=retry)
        for x in (0.0, 1.0, 0.2):
            tried.propose([{"x1": x}])
            errors.append(tried.results()["error"].notna().sum())
    assert errors == [0, 2, 0] * 2
    assert Counter(diary.read_text().splitlines()) == {"1": 4, "2": 4}  # of 3 points, one of them twice


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([], r"points is \[\]"),
        ({"x1": 1.0}, "expected a list of points"),
        ([{"x9": 1.0}], "unknown parameter of Linear 'x9'"),
        ([{"x1": "much"}], "x1 is 'much'"),
        ([{"x1": 1.0}, {"x2": 1.0}], "expected the same parameters in all"),
    ],
)
def test_wrong_points_are_refused_and_nothing_is_run(tmp_path, points, message):
    tried = design(tmp_path)
    with pytest.raises(SwarmError, match=message):
        tried.propose(points)
    with pytest.raises(SwarmError, match=r"call propose\(points\) first"):
        tried.results()
    assert list(tmp_path.iterdir()) == []


def test_a_later_batch_that_is_wrong_leaves_the_design_as_it_was(tmp_path):
    tried = design(tmp_path)
    tried.propose([{"x1": 0.0}])
    tried.results()
    with pytest.raises(SwarmError, match=r"a point sets \['x2'\]; expected \['x1'\]"):
        tried.propose([{"x1": 1.0}, {"x2": 0.0}])
    with pytest.raises(SwarmError, match="no points were proposed since the last results"):
        tried.results()
    assert len(tried) == 1


@pytest.mark.slow
def test_a_target_is_found_in_a_space_of_numbers_whole_numbers_ratios_and_names(tmp_path):
    found = searched(tmp_path, points=120, batch=8, seeds=1, fresh=20, settings={"noise": 0.01})
    assert (found.best["kind"], found.best["whole"]) == ("best", 5)
    assert found.best["x1"] == pytest.approx(0.3, abs=0.3)
    assert math.log10(found.best["x2"]) == pytest.approx(-2, abs=0.5)
    assert found.loss < 0.1


def test_the_best_is_judged_by_seeds_that_the_search_has_not_used(tmp_path):
    found = searched(tmp_path, seeds=[3, 9])
    assert list(found.seeds) == [10, 11, 12, 13, 14, 15]
    best = found.history.loc[found.history["loss"].idxmin()]
    assert (found.point, found.best["x1"]) == (best["point"], best["x1"])
    alone = [Bowl(**found.best, noise=0.1, rng=rng).results()["y"] for rng in found.seeds]
    assert found.measures["y"].mean.estimate == pytest.approx(sum(alone) / 6)
    assert found.loss == pytest.approx((sum(alone) / 6) ** 2)
    assert best["loss"] == pytest.approx(best["y"] ** 2)


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_search_that_was_killed_proposes_the_same_and_does_only_the_rest(tmp_path, jobs):
    one = searched(tmp_path / "1")
    lines = (tmp_path / "1" / "ledger.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "2").mkdir()
    (tmp_path / "2" / "ledger.jsonl").write_bytes(b"".join(lines[:7]))
    two = searched(tmp_path / "2", jobs=jobs)
    assert one.history.equals(two.history)
    assert one.csv() == two.csv()
    assert len((tmp_path / "2" / "ledger.jsonl").read_bytes().splitlines()) == len(lines)
    tables = [(tmp_path / folder / "runs.parquet").read_bytes() for folder in "12"]
    assert tables[0] == tables[1]


@pytest.mark.slow
def test_points_whose_runs_fail_have_no_loss_and_are_never_the_best(tmp_path):
    found = searched(tmp_path, settings={"fails_above": 0.5})
    lost = found.history["loss"].isna()
    assert lost.any()
    assert (found.history["failed"][lost] == 2).all()
    assert (found.history["x1"][lost] > 0.5).all()
    assert found.best["x1"] <= 0.5
    assert "had no loss" in found.table()
    assert png(found.figure())


def test_a_search_without_any_loss_is_refused_with_the_reason(tmp_path):
    with pytest.raises(SwarmError, match=r"none of 6 points has a loss: a run ended in 'ValueError: x1 is too large'"):
        searched(tmp_path, settings={"fails_above": -1.0})
    how = {"points": 2, "seeds": 1, "steps": 1, "out": tmp_path / "2", "jobs": 1}
    with pytest.raises(SwarmError, match="a measure did not happen, see missing"):
        calibrate(Bowl, {"x1": (0.0, 0.4)}, {"seldom": 1}, **how)
    found = calibrate(Bowl, {"x1": (0.0, 0.4)}, {"seldom": 1}, missing={"seldom": 3}, fresh=2, **how)
    assert found.loss == 4


def test_a_function_of_the_means_may_be_the_loss(tmp_path):
    seen = []

    def loss(means):
        seen.append(means)
        return None if means["seldom"] is None else abs(means["y"] - 3)

    how = {"points": 6, "batch": 6, "seeds": 1, "fresh": 2, "steps": 1, "out": tmp_path, "jobs": 1}
    found = calibrate(Linear, {"x1": (0.0, 1.0)}, loss, **how)
    assert seen[0].keys() == {"y", "seldom"}
    assert found.best["x1"] > 0.5
    assert found.history["loss"].isna().tolist() == (found.history["x1"] <= 0.5).tolist()
    assert "target of" not in found.finding()


def test_another_sampler_of_optuna_may_search(tmp_path):
    found = []
    how = {"points": 4, "batch": 4, "seeds": 1, "fresh": 2, "steps": 1, "jobs": 1}
    for k in range(2):
        sampler = optuna.samplers.RandomSampler(seed=3)
        found.append(calibrate(Bowl, {"x1": (0.0, 1.0)}, {"y": 0}, sampler=sampler, out=tmp_path / str(k), **how))
    assert found[0].history.equals(found[1].history)


def test_values_may_be_listed_in_place_of_the_ends_of_numbers(tmp_path):
    found = calibrate(
        Linear,
        {"whole": Range(values=(2, 8))},
        {"y": 8},
        points=4,
        seeds=1,
        fresh=2,
        steps=1,
        out=tmp_path,
        jobs=1,
    )
    assert found.best == {"whole": 8}
    assert set(found.history["whole"]) <= {2, 8}


@pytest.mark.slow
def test_all_of_a_calibration_is_written(tmp_path):
    found = searched(tmp_path)
    paths = found.save(tmp_path / "saved")
    assert [path.name for path in paths] == ["best.csv", "history.csv", "calibration.txt", "calibration.png"]
    assert pd.read_csv(paths[1])["loss"].tolist() == pytest.approx(found.history["loss"].tolist())
    assert repr(found) == paths[2].read_text().rstrip("\n")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"target": {}}, r"target is \{\}"),
        ({"target": 7}, "expected a value by measure"),
        ({"target": {"y": "much"}}, "target of y is 'much'"),
        ({"target": {"y": (1, 2, 3)}}, r"expected a number, or \(number, scale\)"),
        ({"target": {"y": (1, 0)}}, "scale of y is 0"),
        ({"target": {"z": 1}}, "unknown result of Bowl 'z'"),
        ({"ranges": {}}, "ranges is"),
        ({"points": 0}, "points is 0"),
        ({"batch": 0}, "batch is 0"),
        ({"measure": ["y"]}, "measure is given beside targets"),
        ({"missing": {"z": 1}}, "missing has 'z'"),
        ({"sampler": "tpe"}, "expected one of optuna.samplers"),
    ],
)
def test_a_wrong_calibration_is_refused_before_anything_is_run(tmp_path, wrong, message):
    given = {"ranges": SPACE, "target": {"y": 0}, "steps": 1, "out": tmp_path, "jobs": 1, **wrong}
    with pytest.raises(SwarmError, match=message):
        calibrate(Bowl, given.pop("ranges"), given.pop("target"), **given)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_optuna_gives_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(SwarmError, match=re.escape(f"needs Optuna; install it with: {install_command('calibration')}")):
        calibrate(Bowl, SPACE, {"y": 0})


def test_a_function_as_target_takes_results_that_did_not_happen(tmp_path):
    how = {"points": 2, "seeds": 1, "fresh": 1, "steps": 5, "out": tmp_path, "jobs": 1}
    found = calibrate(
        "fire_fighting", {"n_robots": (2, 5)}, lambda means: 1.0 + (means["fire 1 out at"] is None), **how
    )
    assert found.loss == 2.0
    assert "fire 1 out at" in found.table()
    assert "fire 1 out at" not in found.finding()
    assert "no intervals: they need at least 6" in found.table()
    assert ",," in found.csv()


def test_a_single_text_is_refused_as_the_measures_of_a_design(tmp_path):
    with pytest.raises(SwarmError, match=r"measure is 'y'; expected a list of names"):
        design(tmp_path, measure="y")


def test_a_design_states_how_far_it_is(tmp_path):
    tried = design(tmp_path)
    tried.propose([{"x1": 0.0}, {"x1": 1.0}])
    assert repr(tried) == "<AdaptiveDesign of Linear: 2 points proposed, none with results>"
