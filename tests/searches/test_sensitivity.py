"""Sensitivity: indices that are known in closed form are found through the public function; what is refused."""

import math
import re

import numpy as np
import pytest
from SALib.analyze import morris as salib_morris
from SALib.analyze import sobol as salib_sobol

from mesa_swarm import sensitivity
from mesa_swarm.base import extras
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.base.extras import install_command
from mesa_swarm.searches import sensitivity as module
from mesa_swarm.viewing.pictures import png
from support.known_functions import ISHIGAMI, WEIGHTS, Chance, GFunction, Ishigami, Linear, Step, g_indices

PI = (-math.pi, math.pi)
UNIT = (0.0, 1.0)
THREE = {"x1": (0.0, 2.0), "x2": UNIT, "x3": UNIT}


def studied(model, ranges, home, **how):
    return sensitivity(model, ranges, "y", steps=1, out=home, **{"jobs": 1, "seeds": 1, **how})


def assert_within(found, expected):
    for index, values in expected.items():
        for name, value in values.items():
            interval = found.indices[index][name]
            assert interval.low <= value <= interval.high, (index, name, value, interval)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "ranges", "expected"),
    [(Ishigami, dict.fromkeys(WEIGHTS, PI), ISHIGAMI), (GFunction, dict.fromkeys(WEIGHTS, UNIT), g_indices())],
)
def test_intervals_of_sobol_indices_hold_the_closed_forms(tmp_path, model, ranges, expected):
    found = studied(model, ranges, tmp_path, points=128)
    assert_within(found, expected)
    assert max(found.indices["ST"][name].high - found.indices["ST"][name].low for name in ranges) < 0.5


@pytest.mark.slow
def test_indices_of_a_linear_function_are_those_of_its_variances(tmp_path):
    # 3 x1 on (0, 2) has the variance 3, and 2 x2 on (0, 1) has 1/3.
    found = studied(Linear, THREE, tmp_path, points=16)
    expected = {"x1": 0.9, "x2": 0.1, "x3": 0.0}
    assert_within(found, {"ST": expected})
    assert found.indices["ST"]["x1"].estimate == pytest.approx(0.9, abs=0.1)
    assert found.ranked() == ["x1", "x2", "x3"]
    assert found.finding().startswith("y depends most on x1 (ST ")
    assert found.finding().endswith("no effect beyond chance is shown for x3.")


@pytest.mark.slow
def test_parameters_are_not_ranked_while_intervals_are_unknown(tmp_path):
    # Few points lie beyond the step: in some bootstrap samples none does.
    found = studied(Step, {"x1": UNIT, "x2": UNIT}, tmp_path, points=32)
    assert math.isnan(found.indices["ST"]["x1"].low)
    assert found.finding().startswith("y: no ranking, since intervals are unknown")
    assert any(note.startswith("Intervals are unknown") for note in found.notes())


def test_no_parameter_is_named_first_if_none_has_an_effect_beyond_chance(tmp_path):
    found = studied(Chance, {"x2": UNIT, "x3": UNIT}, tmp_path, method="morris", points=3, seeds=2)
    assert found.finding().startswith("No effect of any parameter on y beyond chance is shown")
    assert max(each.low for each in found.indices["mu*"].values()) <= found.floor


@pytest.mark.slow
def test_estimates_are_those_of_salib_for_the_means_over_the_seeds(tmp_path):
    found = studied(Linear, THREE, tmp_path / "a", points=4, seeds=2, settings={"noise": 0.5})
    means = found.numbers.mean(axis=1)
    theirs = salib_sobol.analyze(found.plan.problem(), means, calc_second_order=False, num_resamples=10, seed=1)
    for index in ("S1", "ST"):
        assert [i.estimate for i in found.indices[index].values()] == pytest.approx(theirs[index].tolist())
    found = studied(Linear, THREE, tmp_path / "b", method="morris", points=4, seeds=2, settings={"noise": 0.5})
    theirs = salib_morris.analyze(found.plan.problem(), found.shares, found.numbers.mean(axis=1), num_resamples=10)
    for index, key in {"mu*": "mu_star", "mu": "mu", "sigma": "sigma"}.items():
        assert [i.estimate for i in found.indices[index].values()] == pytest.approx(list(theirs[key]))


def test_effects_on_a_linear_function_are_its_slopes_times_the_ranges(tmp_path):
    found = studied(Linear, {**THREE, "whole": (1, 7)}, tmp_path, method="morris", points=4)
    mean = {name: interval.estimate for name, interval in found.indices["mu"].items()}
    assert mean == pytest.approx({"x1": 6.0, "x2": -2.0, "x3": 0.0, "whole": 6.0})
    assert all(interval.estimate == 0 for interval in found.indices["sigma"].values())
    assert found.indices["mu*"]["x2"].estimate == pytest.approx(2.0)


@pytest.mark.slow
def test_a_difference_is_taken_between_runs_of_the_same_seed(tmp_path):
    # The noise of a seed is the same with both values, so that the difference is -6 x1 without any.
    how = {"method": "morris", "points": 3, "seeds": 2, "settings": {"noise": 5.0}}
    found = studied(Linear, THREE, tmp_path, difference=("kind", "plain", "other"), **how)
    assert [i.estimate for i in found.indices["mu"].values()] == pytest.approx([-12.0, 0.0, 0.0], abs=1e-9)
    assert found.sweep.frame()["kind"].tolist()[:4] == ["plain", "plain", "other", "other"]
    assert found.chance == 0
    assert "The differences between points are the same with every seed." in found.table()
    assert "kind other minus plain" in found.table()


def test_chance_is_the_share_of_the_variance_of_means_that_independent_noise_has():
    rng = np.random.default_rng(1)
    means, noise = rng.normal(0, 2, (2000, 1)), rng.normal(0, 1, (2000, 5))
    common = rng.normal(0, 9, 5)
    assert module._chance(means + noise + common) == pytest.approx((1 / 5) / (4 + 1 / 5), rel=0.1)


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_study_that_was_killed_continues_to_the_same_bits_on_any_number_of_processes(tmp_path, jobs):
    how = {"method": "morris", "points": 2, "seeds": 2, "settings": {"noise": 0.5}}
    one = studied(Linear, THREE, tmp_path / "1", **how)
    lines = (tmp_path / "1" / "ledger.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "2").mkdir()
    (tmp_path / "2" / "ledger.jsonl").write_bytes(b"".join(lines[:5]) + lines[5][:40])  # torn within the sixth
    two = studied(Linear, THREE, tmp_path / "2", **how, jobs=jobs)
    assert (one.sweep.done_before, two.sweep.done_before) == (0, 5)
    assert one.sweep.path.read_bytes() == two.sweep.path.read_bytes()
    assert one.csv() == two.csv()


@pytest.mark.slow
def test_a_parameter_of_names_has_indices_too_and_all_is_written(tmp_path):
    found = studied(Linear, {"kind": ["plain", "other"], "x1": UNIT}, tmp_path, points=8, seeds=2)
    paths = found.save(tmp_path / "saved")
    assert [path.name for path in paths] == ["sensitivity.csv", "sensitivity.txt", "sensitivity.png"]
    assert paths[2].read_bytes() == png(found.figure())
    assert found.frame().loc["kind", "ST"] > found.frame().loc["kind", "S1"]
    assert "plain, other" in found.table(60)
    assert len(found.csv().splitlines()) == 1 + 2 * 2


def test_a_measure_that_does_not_vary_has_no_indices_and_a_finding_that_states_it(tmp_path):
    found = studied(Linear, {"x3": UNIT, "fails_above": (5.0, 6.0)}, tmp_path, points=2)
    assert found.finding() == "y was 1 at every point: it does not depend on these parameters."
    assert math.isnan(found.indices["ST"]["x3"].estimate)
    assert "nan" not in found.table()
    assert png(found.figure())


def test_failed_runs_are_refused_after_all_others_are_done(tmp_path):
    with pytest.raises(SwarmError, match=r"of 8 runs ended in an error, such as 'ValueError: x1 is too large'; narrow"):
        studied(Linear, {"x1": UNIT, "x2": UNIT}, tmp_path, points=2, settings={"fails_above": 0.4})
    assert len((tmp_path / "ledger.jsonl").read_text().splitlines()) == 8


def test_a_measure_that_did_not_happen_needs_a_number_in_its_place(tmp_path):
    wanted = {"method": "morris", "points": 2, "seeds": 1, "steps": 1, "out": tmp_path, "jobs": 1}
    ranges = {"x1": UNIT, "x2": UNIT}
    with pytest.raises(SwarmError, match=r"'seldom' did not happen in \d of 6 runs; give the number"):
        sensitivity(Linear, ranges, "seldom", **wanted)
    found = sensitivity(Linear, ranges, "seldom", missing=0.0, **wanted)
    assert (found.sweep.done_before, set(found.numbers.ravel())) == (6, {0.0, 1.0})


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"ranges": {"x1": UNIT}}, "1 range is given; expected at least two"),
        ({"ranges": {"x1": UNIT, "y2": UNIT}}, "did you mean"),
        ({"ranges": {"x1": UNIT, "x2": (1.0, 1.0)}}, "range of x2 is 1 to 1; expected the lower end first"),
        ({"ranges": {"x1": UNIT, "x2": (0.0, 1.0, "log")}}, "lower end of the logarithmic range of x2 is 0"),
        ({"ranges": {"x1": UNIT, "x2": (0.0, 1.0, "lin")}}, r'expected \[low, high\], \[low, high, "log"\] or Range'),
        ({"ranges": [("x1", 1)]}, "ranges is"),
        ({"measure": "z"}, "unknown result of Linear 'z'"),
        ({"measure": ["y"]}, "expected the name of a result"),
        ({"method": "fast"}, "unknown method 'fast'"),
        ({"points": 12}, "expected a power of two for sobol, such as 16"),
        ({"difference": ("kind", "plain")}, "difference is"),
        ({"difference": ("x1", 0.0, 1.0)}, "a parameter without a range"),
        ({"settings": {"x1": 0.5}}, "x1 is set and varied at once"),
    ],
)
def test_a_wrong_study_is_refused_before_anything_is_run(tmp_path, wrong, message):
    given = {"ranges": THREE, "measure": "y", "steps": 1, "out": tmp_path, "jobs": 1, **wrong}
    with pytest.raises(SwarmError, match=message):
        sensitivity(Linear, given.pop("ranges"), given.pop("measure"), **given)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_salib_gives_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(SwarmError, match=re.escape(f"needs SALib; install it with: {install_command('sensitivity')}")):
        sensitivity(Linear, THREE, "y")
