"""Claims of notebook 15 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import mean_interval, paired_difference
from support.exercises import names_of

SEEDS = range(1001, 1021)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def column(tmp_path_factory):
    """Return the notebook's function that returns a result of all runs of a case, of runs with fresh seeds."""
    return names_of(15, "setup", "four", folder=tmp_path_factory.mktemp("claims"), SEEDS=SEEDS)["column"]


def test_if_only_visitors_stand_arrivals_and_driving_hardly_change(column):
    arrivals, _ = paired_difference(column("neither stands", "arrivals"), column("visitors stand", "arrivals"))
    speed, _ = paired_difference(
        column("neither stands", "speed of robots"), column("visitors stand", "speed of robots")
    )
    assert arrivals.low > -0.3
    assert arrivals.high < 0.3
    assert speed.low > -0.02


def test_if_only_robots_stand_visitors_arrive_as_often_and_robots_drive_less(column):
    arrivals, _ = paired_difference(column("neither stands", "arrivals"), column("robots stand", "arrivals"))
    speed, _ = paired_difference(column("neither stands", "speed of robots"), column("robots stand", "speed of robots"))
    assert arrivals.low > -0.3
    assert arrivals.high < 0.3
    assert -0.2 < speed.low < speed.high < 0


def test_if_both_stand_visitors_arrive_less_often_than_if_only_they_do_and_robots_drive_less(column):
    arrivals, _ = paired_difference(column("visitors stand", "arrivals"), column("both stand", "arrivals"))
    speed, _ = paired_difference(column("robots stand", "speed of robots"), column("both stand", "speed of robots"))
    assert arrivals.high < -0.3
    assert speed.high < -0.1


def test_if_both_stand_there_are_hardly_any_contacts(column):
    contacts = column("both stand", "contacts")
    assert np.mean(np.array(contacts) == 0) >= 0.9
    assert mean_interval(contacts).high < 1.0
