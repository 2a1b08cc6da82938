"""Ant trails: robots go to and fro by a bridge of two branches, and choose by the trail that they smell."""

import numpy as np
import pytest
import shapely

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.ant_trails import ANT, ENDS, FOOD, FORK, FORKS, HALF, LEVEL, NEAR, NEST, PATH, AntTrails, way
from mesa_swarm_studies.published.trails import trail_checks, trail_figure, trail_run

STORED = {"passages": 77.0, "share of the upper branch": 4 / 77}
STEMS = FORKS[0] - ENDS[0] + ENDS[1] - FORKS[1]
BOTH_ENDS = [0.02, 0.98] * 15


@pytest.mark.slow
def test_a_run_has_the_stored_numbers():
    assert AntTrails(rng=1).run(1500).results() == pytest.approx(STORED)


@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0])
def test_the_lower_branch_is_longer_by_the_ratio(ratio):
    assert way(-1.0, ratio).length - STEMS == pytest.approx(ratio * (way(1.0, 1.0).length - STEMS))


@pytest.mark.slow
def test_robots_stay_in_the_corridors_and_traffic_goes_on():
    model = AntTrails(rng=2)
    ways = shapely.union_all([way(1.0, 1.0), way(-1.0, 2.0)])
    passages = [0]
    for _ in range(4):
        model.run(500)
        passages.append(model.results()["passages"])
        assert shapely.distance(ways, shapely.points(model.swarm.position)).max() < HALF
    assert np.diff(passages)[1:].min() > 15


def test_a_robot_reads_the_place_and_the_bearings_of_four_lanes():
    model = AntTrails(n_robots=1, rng=1)
    (robot,) = model.robots
    places = {30.0: NEST, 100.0: PATH, 200.0: NEAR, 247.0: FORK, 593.0: FORK, 640.0: NEAR, 690.0: FOOD}
    for x, place in places.items():
        robot.position, robot.heading = (x, LEVEL), 0.0
        model.sense()
        assert robot.ground[0] == place
    robot.position = (100.0, LEVEL - 9.0)
    model.sense()
    assert robot.ground[[1, 3]] == pytest.approx(0.0)
    assert (np.abs(robot.ground[[2, 4]]) > 2.0).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_robots_choose_the_branch_in_which_there_is_much_more_trail(side):
    model = AntTrails(n_robots=3, rng=3, ratio=1.0, leaving=1.0, evaporation=0.0)
    model.fields["trail"].deposit((320.0, LEVEL + side * 50.0), 1e9)
    model.run(250)
    assert model.swarm.columns["0.follow.chosen"].all()
    assert (model.swarm.columns["0.follow.lower"] == (side < 0)).all()


@pytest.mark.parametrize(("x", "heading"), [(241.0, 0.0), (599.0, np.pi)])
def test_a_robot_at_a_fork_smells_the_middle_of_both_branches(x, heading):
    model = AntTrails(n_robots=1, rng=1)
    (robot,) = model.robots
    ahead = 1.0 if heading == 0.0 else -1.0
    robot.position, robot.heading = (x, LEVEL - ahead * 9.0), heading
    model.fields["trail"].values = np.random.default_rng(1).random(model.fields["trail"].values.shape)
    model.sense()
    places = [(x + 79.0 * ahead, LEVEL + ahead * side * 50.0) for side in (1.0, -1.0)]
    assert robot.trail == pytest.approx(model.fields["trail"].at(places))
    assert shapely.distance(way(1.0, 1.0), shapely.points(places)).min() < 1e-6
    assert shapely.distance(way(-1.0, 1.0), shapely.points(places)).min() < 1e-6


def test_a_robot_leaves_as_much_trail_as_it_goes_far():
    model = AntTrails(n_robots=1, rng=1, leaving=1.0, evaporation=0.0)
    model.run(50)
    went = 0.0
    for _ in range(400):
        before, there = model.fields["trail"].total, model.swarm.position.copy()
        model.step()
        went += np.hypot(*(model.swarm.position - there)[0])
        assert model.fields["trail"].total - before <= 1.0 + 1e-9
    assert model.fields["trail"].total - 50.0 == pytest.approx(went / 2.0, rel=0.05)


def test_a_large_k_makes_choices_random():
    model = AntTrails(rng=4, ratio=1.0, k=1e9, leaving=1.0).run(400)
    assert 5 <= model.swarm.columns["0.follow.lower"].sum() <= 25


def test_robots_that_have_not_left_stand_still():
    model = AntTrails(rng=5).run(5)
    out = model.swarm.columns["0.follow.out"].astype(bool)
    start = AntTrails(rng=5).swarm.position
    assert (~out).sum() > 0
    assert np.array_equal(model.swarm.position[~out], start[~out])


def test_without_passages_the_share_is_unknown():
    assert AntTrails(n_robots=0, rng=1).run(3).results() == {"passages": 0.0, "share of the upper branch": None}
    assert trail_run(1, steps=4, last=2, n_robots=2) == {"upper": None, "passages": 0.0}


@pytest.mark.parametrize(
    "wrong",
    [{"ratio": 0.5}, {"ratio": 3}, {"k": 0}, {"k": np.nan}, {"leaving": 0}, {"n_robots": 37}, {"evaporation": 2}],
)
def test_wrong_numbers_are_refused_in_one_line_that_names_them(wrong):
    with pytest.raises(SwarmError, match=next(iter(wrong))) as caught:
        AntTrails(rng=1, **wrong)
    assert "\n" not in str(caught.value)


def test_swarms_that_choose_as_in_the_paper_pass_all_checks():
    checks = trail_checks(BOTH_ENDS, [0.95, 0.97] * 15)
    assert {check.outcome for check in checks} == {"passed"}


def test_swarms_that_do_not_choose_or_choose_one_side_fail_them():
    undecided = trail_checks([0.5, 0.6] * 15, [0.5, 0.6] * 15)
    assert [check.outcome for check in undecided if "carries more than" in check.claim] == ["failed", "failed"]
    one_sided = trail_checks([0.95, 0.9] * 15, BOTH_ENDS)
    assert next(check for check in one_sided if "upper one carries more" in check.claim).outcome == "failed"


def test_the_figure_counts_each_run_once():
    (axes,) = trail_figure(BOTH_ENDS, [0.95] * 30).axes
    assert sum(bar.get_height() for bar in axes.patches) == 60


def test_the_robots_are_as_the_page_describes_them():
    assert [sensor.name for sensor in ANT.sensors[-3:]] == ["ground", "trail", "trail"]
    assert [actuator.name for actuator in ANT.actuators] == ["trail"]
