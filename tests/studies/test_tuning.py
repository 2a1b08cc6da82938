"""Tuned robots beside the thesis's: what is required, and that every contestant runs."""

import pytest

from mesa_swarm_studies.judging import FAILED, PASSED
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import find_item
from mesa_swarm_studies.thesis import tuning


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    with Laboratory(tmp_path_factory.mktemp("laboratory"), quick=True) as laboratory:
        return find_item("tuning").make(laboratory)


def rows(collisions, speed):
    """Runs of the contestant that was tuned off-line, beside those of the thesis with 40 collisions."""
    thesis = [{"collisions": 40.0 + i % 2, "speed": 0.28} for i in range(20)]
    tuned = [{"collisions": collisions + i % 3, "speed": speed} for i in range(20)]
    return {tuning.SLOW: thesis, tuning.FAST: thesis, tuning.OFFLINE: tuned}


def outcomes(collisions, speed):
    checks = tuning.tuned_checks(tuning.OFFLINE, rows(collisions, speed), main=True)
    return [check.outcome for check in checks], [check.main for check in checks]


def test_robots_that_stand_still_fail_though_they_collide_less():
    assert outcomes(0.0, 0.0) == ([PASSED, PASSED, FAILED], [True, False, True])


def test_robots_that_collide_less_at_the_goal_s_speed_pass():
    assert outcomes(20.0, 0.28)[0] == [PASSED] * 3


def test_robots_that_are_fast_and_collide_more_fail():
    assert outcomes(60.0, 0.5)[0] == [FAILED, FAILED, PASSED]


def test_both_ways_of_tuning_are_judged_and_only_the_one_off_line_decides(result):
    assert [check.main for check in result.checks] == [True, False, True, False, False, False]
    assert [check.claim.partition(":")[0] for check in result.checks] == [tuning.OFFLINE] * 3 + [tuning.ONLINE] * 3
    assert len(result.pictures[""].axes[0].get_legend().get_texts()) == len(tuning.CONTESTANTS)


def test_settings_and_trade_off_are_in_words(result):
    assert all(name in result.settings and name in result.remarks[0] for name in tuning.CONTESTANTS)
