"""Task allocation: the share of robots at work is what the demand needs, whatever their thresholds."""

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.task_allocation import PACE, TaskAllocation
from mesa_swarm_studies.published.decisions import allocation_run, at_work, equilibrium

STORED = {"share at work": 0.3, "majors at work": 0.0, "stimulus": 0.787}


def test_a_run_has_the_stored_numbers():
    results = TaskAllocation(rng=1).run(500).results()
    assert results == pytest.approx(STORED)


def test_the_stimulus_grows_by_demand_and_falls_by_the_share_at_work():
    model = TaskAllocation(rng=2, demand=1.5)
    for _ in range(100):
        before = model.stimulus
        model.step()
        assert model.stimulus == pytest.approx(max(before + PACE * (1.5 - 3.0 * model.active), 0.0))


def test_robots_at_rest_stand_still_and_robots_at_work_do_not():
    model = TaskAllocation(rng=3).run(200)
    before = model.swarm.position.copy()
    model.step()
    moved = np.hypot(*(model.swarm.position - before).T) > 0
    at_rest = model.swarm.columns["act.work"] == 0
    touched = model.swarm.collided | (before != model.swarm.position).all(axis=1)
    assert 0 < at_rest.sum() < len(at_rest)
    assert not (moved & at_rest & ~touched).any()


def test_without_robots_of_a_caste_its_share_at_work_is_unknown():
    assert TaskAllocation(rng=1, n_robots=4, major_share=0).run(5).active_majors is None
    assert TaskAllocation(rng=1, n_robots=4, major_share=1).run(5).active_minors is None
    assert TaskAllocation(rng=1, n_robots=0).run(5).active == 0.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"demand": -1},
        {"demand": np.nan},
        {"efficiency": 0},
        {"minor_threshold": 0},
        {"major_share": 2},
        {"quitting": "x"},
    ],
)
def test_wrong_numbers_are_refused_in_one_line_that_names_them(wrong):
    with pytest.raises(SwarmError, match=next(iter(wrong))) as caught:
        TaskAllocation(rng=1, **wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("demand", [0.5, 1.0, 2.0])
def test_in_equilibrium_as_many_work_as_the_demand_needs(share, demand):
    shares = equilibrium(demand, share)
    assert share * shares["majors"] + (1 - share) * shares["minors"] == pytest.approx(demand / 3.0)
    assert shares["majors"] < shares["minors"]


def test_half_of_the_robots_work_where_the_response_is_as_likely_as_quitting():
    stimulus = 0.5  # s^2 / (s^2 + 1) = 0.2
    assert at_work(stimulus, 1.0) == pytest.approx(0.5)


def test_a_run_has_means_of_both_halves_and_follows_a_changed_demand():
    numbers = allocation_run(1, half=600, demand=0.3, later=2.4, n_robots=20)
    assert numbers.keys() == {f"{name}{when}" for name in ("", "_minors", "_majors") for when in ("before", "after")}
    assert numbers["before"] < 0.2
    assert numbers["after"] > 0.6
