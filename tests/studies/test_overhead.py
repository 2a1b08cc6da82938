"""The overhead of a run: its definition, and that both places are measured."""

import pytest

from mesa_swarm_studies.benchmarks import overhead
from mesa_swarm_studies.benchmarks.overhead import overhead_per_run
from mesa_swarm_studies.benchmarks.speed import MEASUREMENTS


def test_the_overhead_is_the_time_of_all_workers_less_the_runs_own_over_the_runs(monkeypatch):
    series = []

    def measured(number, runs, workers):
        series.append((number, runs))
        return 3.0 + 0.5 * abs(number), 4.0  # s in all, and the sum of the runs' own

    monkeypatch.setattr(overhead, "_seconds_and_own", measured)
    assert overhead_per_run(1000, 2, repetitions=2) == (pytest.approx(2.0), 3.5)
    assert series == [(-1, overhead.FIRST_RUNS), (0, 1000), (1, 1000)], "no run twice: it would be found done"


def test_a_run_is_shorter_than_the_sweep_that_has_it():
    seconds, own = overhead._seconds_and_own(0, 3, 1)
    assert 0 < own < seconds


def test_the_bench_has_a_goal_for_each_of_the_two():
    goals = [goal for measurement in MEASUREMENTS for goal in measurement.goals if "overhead" in goal.what]
    assert [goal.limit for goal in goals] == [2.0, 10.0]
