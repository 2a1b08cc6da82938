"""Figure 8.7: what is exact is computed, not measured, and what robots have learned is asked at the same places."""

import math

import numpy as np
import pytest

from mesa_swarm.learning import ApproachValues, approach_values
from mesa_swarm_studies.judging import FAILED, PASSED, REFUTED
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import find_item
from mesa_swarm_studies.thesis import foresight


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The figure, from few and short runs and from exact values of distances alone."""
    with Laboratory(tmp_path_factory.mktemp("laboratory"), quick=True) as laboratory:
        return find_item("8.7").make(laboratory)


def outcomes(result, begins):
    return [check.outcome for check in result.checks if check.claim.startswith(begins)]


@pytest.mark.slow
def test_that_the_switching_distance_grows_with_gamma_is_refuted_by_exact_values_with_a_reason(result):
    assert result.verdict == REFUTED
    assert outcomes(result, "gamma 0, exact") == [PASSED]
    assert outcomes(result, "gamma above 0, exact") == outcomes(result, "gamma towards 1, exact") == [FAILED]


def test_the_refutation_is_limited_to_readings_of_a_critical_distance_of_several_steps(result):
    assert outcomes(result, "d_crit read as 0.4 of the range") == [FAILED]
    assert outcomes(result, "d_crit read as 0.4 map units") == [PASSED]
    assert result.reason.startswith("With d_crit of 4 units")
    assert "The refutation holds for a d_crit of several steps" in result.remarks[0]


def test_the_reason_is_so_forward_exceeds_turning_by_the_stated_margin_for_every_gamma(result):
    inside = (math.log((math.e - 1) / 4 * 3 + 1)) - 1
    for gamma in (0.0, 0.3, 0.7, 0.95):
        values = approach_values(gamma, turning="leave")
        at = np.flatnonzero(np.isclose(values.distance, foresight.D_CRIT))[0]
        margin = values.values[at, foresight.FORWARD] - values.values[at, 1]
        assert margin == pytest.approx(2 - gamma * (1 - inside), abs=1e-7)
        assert margin > 0
    assert "2 - gamma (1 - r)" in result.reason


def test_the_pictures_show_reward_and_utility_and_what_gamma_changes(result):
    assert list(result.pictures) == ["", "gamma"]
    assert [axes.get_title() for axes in result.pictures[""].axes] == ["exact", "learned, mean of runs"]
    assert all(len(axes.lines) == 3 + len(foresight.DRAWN_GAMMAS) for axes in result.pictures[""].axes)


def test_the_remarks_state_where_boltzmann_s_choice_hesitates_with_every_reward(result):
    assert "forward half of the time" in result.remarks[1]
    assert [remark[:15] for remark in result.remarks[2:4]] == ["With reward (a)", "With reward (c)"]


def test_a_robot_is_asked_at_every_place_and_counts_its_collisions():
    run = foresight.foresight_run(10_001, steps=50, gamma=0.7)
    assert len(run["utility"]) == len(foresight.PLACES)
    assert run["collisions"] >= 0
    assert run["distance"] is None or foresight.PLACES[0] <= run["distance"] <= 50


def test_the_distance_from_which_utility_falls_is_found_and_a_flat_curve_has_the_last_place_before_it():
    utility = np.array([0.0, 0.5, 0.98, 0.995, 1.0])
    values = np.zeros((5, 8))
    values[:, foresight.FORWARD] = utility
    assert foresight.falling_distance(ApproachValues(0.0, np.arange(5.0), values, values)) == 3.0
    assert foresight.finite(math.inf) is None
    assert foresight.finite(2.0) == 2.0
