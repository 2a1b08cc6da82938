"""Reports: the last row is the final value, missing rows are counted, and what is not a number is refused."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from mesa_swarm import calibrate, compare, sensitivity, sweep
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.experiments.reality_gap import reality_gap
from mesa_swarm.experiments.reports import REDUCTIONS, all_reports, check_report, reduced
from mesa_swarm.experiments.sweep import LEDGER
from mesa_swarm.experiments.tables import runs_csv
from mesa_swarm.swarm_model import SwarmModel
from support.reporting_models import Blowing, Gone, Infinite, InWords, Reporting

MISSING = (None, math.nan, np.nan, np.float32("nan"), pd.NA, np.ma.masked)
rows = st.lists(st.one_of(st.integers(-9, 9), st.floats(-1e6, 1e6), st.sampled_from([*MISSING, math.inf])), max_size=12)


def reported(values, **named):
    """Return a model that has collected these values, a row a step."""
    model = SwarmModel(rng=1, model_reporters={"x": lambda model: values[model.steps - 1]}, **named)
    return model.run(len(values))


def all_of(model, name="x"):
    """Return all reductions of a report, by reduction."""
    return {reduction: reduced(model, [f"{reduction} of {name}"])[f"{reduction} of {name}"] for reduction in REDUCTIONS}


def is_missing(value):
    """Return whether a row is one of those that are missing."""
    return value is None or value is pd.NA or value is np.ma.masked or math.isnan(value)


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(rows)
def test_the_final_value_is_that_of_the_last_row_and_missing_rows_are_counted(values):
    found, numbers = all_of(reported(values)), [float(value) for value in values if not is_missing(value)]
    assert found["rows left out"] == len(values) - len(numbers)
    assert found["final value"] == (None if not values or is_missing(values[-1]) else values[-1])
    if not numbers:
        assert [found[name] for name in ("mean", "minimum", "maximum", "sum")] == [None] * 4
        return
    assert (found["minimum"], found["maximum"]) == (min(numbers), max(numbers))
    assert found["sum"] == pytest.approx(math.fsum(numbers), abs=1e-6)
    assert found["mean"] == pytest.approx(math.fsum(numbers) / len(numbers), abs=1e-6)


def test_infinities_of_both_signs_have_no_mean():
    found = all_of(reported([math.inf, -math.inf, 1.0]))
    assert (found["minimum"], found["maximum"], found["mean"]) == (-math.inf, math.inf, None)


def test_the_mean_of_huge_numbers_is_among_them_and_a_sum_beyond_all_numbers_is_refused():
    model = reported([1e308, 1.5e308])
    assert reduced(model, ["mean of x"])["mean of x"] == pytest.approx(1.25e308)
    with pytest.raises(InvalidValueError, match=r"^sum of x is beyond the largest number"):
        reduced(model, ["sum of x"])


NOT_NUMBERS = ["few", b"3", "3.5", [1.0, 2.0], np.array([1.0]), {"a": 1}, 1j, np.complex128(1), 10**400, object, []]


@pytest.mark.slow
@pytest.mark.parametrize("value", NOT_NUMBERS, ids=repr)
@pytest.mark.parametrize("reduction", REDUCTIONS)
def test_a_report_that_is_not_a_number_is_refused_in_one_line_that_names_it(value, reduction):
    with pytest.raises(InvalidValueError) as caught:
        reduced(reported([1.0, value]), [f"{reduction} of x"])
    assert str(caught.value).startswith("reporter 'x' of SwarmModel returned ")
    assert "expected a number, or None" in str(caught.value)
    assert len(str(caught.value)) <= 300
    assert "\n" not in str(caught.value)


def test_a_report_in_words_is_refused_before_any_run_if_it_is_one_before_the_first_step(tmp_path):
    model = SwarmModel(rng=1, model_reporters={"map": lambda model: model.map.name})
    with pytest.raises(InvalidValueError, match=r"^reporter 'map' of SwarmModel returned 'openspace'; expected"):
        check_report("mean of map", model)


def test_a_report_in_words_later_on_is_the_error_of_its_run(tmp_path):
    made = sweep(InWords, seeds=2, steps=2, measure=["mean of value"], out=tmp_path, jobs=1)
    assert made.failed == 2
    assert made.errors[0].startswith("InvalidValueError: reporter 'value' of InWords returned 'few'; expected a number")


def test_a_reporter_that_works_after_the_first_step_only_is_no_reason_to_refuse_it():
    model = SwarmModel(rng=1, model_reporters={"share": lambda model: 1 / model.steps})
    check_report("mean of share", model)
    assert reduced(model.run(2), ["mean of share"]) == {"mean of share": 0.75}


# ---- rows of some steps only


def test_a_sum_over_some_of_the_steps_is_refused_before_any_run(tmp_path):
    with pytest.raises(InvalidValueError, match=r"^sum of own would be over one step in 4 \(collect_every\)"):
        sweep(Reporting, seeds=1, steps=8, settings={"every": 4}, measure=["sum of own"], out=tmp_path, jobs=1)
    assert not (tmp_path / LEDGER).exists()


def test_a_sum_over_some_of_the_steps_is_refused_after_a_run_that_changed_it():
    model = SwarmModel(rng=1, model_reporters={"now": "completed"}).run(3)
    model.collect_every = 2
    with pytest.raises(InvalidValueError, match=r"^sum of now would be over one step in 2"):
        reduced(model, ["sum of now"])


@pytest.mark.parametrize("steps", range(1, 10))
@pytest.mark.parametrize("every", [1, 2, 4])
def test_the_final_value_is_of_the_last_step_whichever_steps_were_collected(steps, every):
    model = SwarmModel(rng=1, collect_every=every, model_reporters={"now": "completed"}).run(steps)
    if steps < every:
        with pytest.raises(InvalidValueError, match=f"has no rows after {steps} steps, since collect_every is {every}"):
            reduced(model, ["final value of now"])
    else:
        assert reduced(model, ["final value of now"]) == {"final value of now": steps}
        assert len(model.datacollector.model_vars["now"]) == steps // every


def test_a_report_without_rows_is_refused_after_a_run():
    model = SwarmModel(rng=1, collect_every=0, model_reporters={"now": "completed"}).run(3)
    with pytest.raises(InvalidValueError, match=r"^report 'now' of SwarmModel has no rows after 3 steps, since coll"):
        reduced(model, ["mean of now"])
    assert reduced(SwarmModel(rng=1, model_reporters={"now": "completed"}), ["mean of now"]) == {"mean of now": None}


def test_a_report_that_a_model_has_not_is_refused():
    with pytest.raises(SwarmError, match="unknown report of SwarmModel 'then'; did you mean 'them'"):
        reduced(SwarmModel(rng=1, model_reporters={"them": "completed"}).run(1), ["mean of then"])


def test_reports_that_would_be_refused_are_not_offered():
    model = SwarmModel(rng=1, collect_every=2, model_reporters={"map": lambda model: model.map.name, "now": "steps"})
    known, usual = ["final value", "mean", "minimum", "maximum", "rows left out"], ("collisions", "total_collisions")
    offered = {
        names: [f"{reduction} of {name}" for name in (*usual, *names) for reduction in known]
        for names in (("now",), ("map", "now"))
    }
    assert all_reports(model) == offered["map", "now"]
    assert all_reports(model, call=True) == all_reports(model.run(2)) == offered["now",]


# ---- sweeps


def test_a_table_counts_the_rows_that_are_left_out(tmp_path):
    made = sweep(Reporting, seeds=2, steps=6, measure=["final value of value", "mean of value"], out=tmp_path, jobs=1)
    names = ["point", "rng", "steps", "state_hash", "final value of value", "mean of value"]
    assert parquet.read_schema(made.path).names == [*names, "rows left out of value", "error"]
    frame = made.frame()
    assert frame["final value of value"].isna().all()
    assert frame["mean of value"].tolist() == [8 / 3] * 2
    assert frame["rows left out of value"].tolist() == [3.0, 3.0]
    assert made.left_out == {"value": 6}


def test_a_table_without_missing_rows_has_no_further_column(tmp_path):
    made = sweep(Reporting, seeds=1, steps=1, measure=["mean of value"], out=tmp_path, jobs=1)
    assert parquet.read_schema(made.path).names[4:] == ["mean of value", "error"]
    assert made.left_out == {}


def test_infinite_reports_are_in_the_table_and_are_not_measured_again(tmp_path):
    measure = ["maximum of value", "minimum of value", "final value of value"]
    first, again = (sweep(Infinite, seeds=2, steps=4, measure=measure, out=tmp_path, jobs=1) for _ in range(2))
    assert first.frame()[measure].to_numpy().tolist() == [[math.inf, -3.0, -3.0]] * 2
    assert (first.failed, again.done_before) == (0, 2)


def test_a_stored_report_without_its_number_of_missing_rows_is_measured_again(tmp_path):
    measure = ["final value of value"]
    first = sweep(Gone, seeds=1, steps=4, measure=measure, out=tmp_path, jobs=1)
    with Ledger(tmp_path / LEDGER) as ledger:
        (key,) = ledger
        stale = Outcome(**{**ledger.outcome(key).stored(), "results": {"final value of value": 6.0}})
        ledger.clear()
        ledger.append(key, stale)
    again = sweep(Gone, seeds=1, steps=4, measure=measure, out=tmp_path, jobs=1)
    assert (first.done_before, again.done_before) == (0, 0)
    assert again.frame()["final value of value"].isna().all()


# ---- comparisons of models without results


@pytest.mark.slow
def test_a_comparison_takes_reports_of_a_model_without_results(tmp_path):
    found = compare(Reporting, seeds=6, steps=6, measures=["mean of own", "final value of value"], jobs=1, out=tmp_path)
    assert found.measures == ["mean of own", "final value of value"]
    assert found.column(2.0, "mean of own") == [2.0 * seed for seed in range(1, 7)]
    assert found.column(1.0, "final value of value") == [None] * 6
    assert "Rows left out, since they have no number: 36 of value." in found.table()
    assert found.finding().startswith("mean of own was 7.0 [")
    header, first, *_ = runs_csv(found).splitlines()
    assert header.endswith("mean of own,final value of value,rows left out of own,rows left out of value") or (
        header.endswith("mean of own,final value of value,rows left out of value")
    )
    assert first.endswith(",1.0,,3")
    again = compare(Reporting, seeds=6, steps=6, measures=["mean of own", "final value of value"], jobs=1, out=tmp_path)
    assert again.done_before == 12
    assert found.save(tmp_path)


@pytest.mark.slow
def test_a_comparison_of_infinite_reports_has_a_table_a_finding_and_pictures(tmp_path):
    found = compare(Infinite, seeds=6, steps=4, measures=["maximum of value"], jobs=1, out=tmp_path)
    assert [row.split()[-2:] for row in found.table().splitlines() if row.startswith("maximum")] == [["1.0", "inf"]]
    assert "no difference" in found.finding()
    assert found.save(tmp_path)
    assert compare(Infinite, seeds=6, steps=4, measures=["maximum of value"], jobs=1, out=tmp_path).done_before == 12


def test_a_model_without_results_and_without_reports_to_measure_is_refused_with_the_way_out():
    with pytest.raises(SwarmError, match=r"Reporting has no method results\(\).*as measures, such as 'mean of NAME'"):
        compare(Reporting, seeds=1, steps=2, jobs=1)
    with pytest.raises(SwarmError, match="unknown report of Reporting 'onw'; did you mean 'own'"):
        compare(Reporting, seeds=1, steps=2, measures=["mean of onw"], jobs=1)


def test_a_comparison_refuses_a_sum_over_some_of_the_steps():
    with pytest.raises(InvalidValueError, match=r"^sum of own would be over one step in 3"):
        compare(Reporting, seeds=1, steps=6, settings={"every": 3}, measures=["sum of own"], jobs=1)


def test_the_reality_gap_is_of_a_report_of_a_model_without_results():
    gap = reality_gap(f"{Reporting.__module__}:Reporting", dial=(0, 1), seeds=2, steps=6, measure="mean of value")
    assert gap.scores == {0.0: [8 / 3, 8 / 3], 1.0: [8 / 3, 8 / 3]}
    assert "Rows left out, since they have no number: 12 of value." in gap.table()


def test_the_reality_gap_of_an_infinite_report_has_a_table_and_a_picture(tmp_path):
    gap = reality_gap(f"{Infinite.__module__}:Infinite", dial=(0, 1), seeds=2, steps=4, measure="maximum of value")
    assert gap.scores == {0.0: [math.inf] * 2, 1.0: [math.inf] * 2}
    assert "inf" in gap.table()
    assert len(gap.save(tmp_path)) == 2


# ---- findings


def test_sensitivity_refuses_a_final_value_that_is_missing(tmp_path):
    how = {"method": "morris", "points": 2, "seeds": 1, "steps": 6, "jobs": 1, "out": tmp_path}
    ranges = {"gain": (1.0, 2.0), "seed": (1, 9)}
    with pytest.raises(InvalidValueError, match=r"^'final value of value' did not happen in 6 of 6 runs"):
        sensitivity(Gone, ranges, "final value of value", **how)
    found = sensitivity(Gone, ranges, "mean of own", **how)
    assert found.indices["mu*"]["seed"].estimate > 0


def test_sensitivity_names_the_rows_that_its_measure_leaves_out(tmp_path):
    how = {"method": "morris", "points": 2, "seeds": 1, "steps": 6, "jobs": 1, "out": tmp_path}
    found = sensitivity(Reporting, {"gain": (1.0, 2.0), "seed": (1, 9)}, "mean of value", **how)
    assert "Rows left out, since they have no number: 18 of value." in found.notes()


def test_sensitivity_refuses_an_infinite_measure(tmp_path):
    how = {"method": "morris", "points": 4, "seeds": 1, "steps": 2, "jobs": 1, "out": tmp_path}
    with pytest.raises(InvalidValueError, match=r"^'maximum of value' is infinite or beyond 1e.150 in .* of 12 runs"):
        sensitivity(Blowing, {"gain": (1.0, 2.0), "seed": (1, 9)}, "maximum of value", **how)


def test_calibration_has_no_loss_where_the_final_value_is_missing(tmp_path):
    how = {"points": 2, "batch": 2, "seeds": 1, "fresh": 1, "steps": 6, "jobs": 1, "out": tmp_path}
    with pytest.raises(InvalidValueError, match=r"^none of 2 points has a loss: a measure did not happen"):
        calibrate(Gone, {"gain": (1.0, 2.0)}, {"final value of value": 6.0}, **how)


def test_calibration_never_chooses_a_point_of_infinite_loss_and_names_rows_left_out(tmp_path):
    how = {"points": 8, "batch": 4, "seeds": 1, "fresh": 2, "steps": 2, "jobs": 1, "out": tmp_path}
    found = calibrate(Blowing, {"gain": (1.0, 2.0)}, {"maximum of value": 1.5}, **how)
    infinite = np.isinf(found.history["maximum of value"].to_numpy(float))
    assert infinite.any()
    assert found.history["loss"].isna().tolist() == infinite.tolist()
    assert found.best["gain"] <= 1.5
    rows_of = calibrate(Reporting, {"gain": (1.0, 2.0)}, {"mean of value": 2.0}, **{**how, "out": tmp_path / "rows"})
    assert rows_of.left_out == {"value": 10}
    assert "Rows left out, since they have no number: 10 of value." in rows_of.table()
