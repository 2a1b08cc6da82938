"""Runs are made once, in any order and number of processes, and what was made before an interruption stays."""

import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm_studies.commands import made_by
from mesa_swarm_studies.laboratory import Laboratory, key_of
from mesa_swarm_studies.registry import Item
from mesa_swarm_studies.thesis.networks import choice_run

calls = []


def noted(rng, *, offset=0):
    """Return a number, and note the call."""
    calls.append((rng, offset))
    return {"number": rng + offset, "list": [1.5, None]}


def interrupted_at_three(rng):
    """Be interrupted as by Ctrl-C."""
    calls.append(rng)
    if rng == 3 and calls.count(3) == 1:
        raise KeyboardInterrupt
    return {"number": rng}


@pytest.fixture(autouse=True)
def no_calls():
    calls.clear()


def test_a_run_is_made_once_and_then_looked_up_also_later(tmp_path):
    for _ in range(2):
        with Laboratory(tmp_path) as laboratory:
            rows = laboratory.runs(noted, range(1, 4))
            assert laboratory.runs(noted, [3, 1]) == [rows[2], rows[0]]
    assert calls == [(1, 0), (2, 0), (3, 0)]
    assert rows[0] == {"number": 1, "list": [1.5, None]}


def test_a_grid_has_a_row_a_point_and_shares_runs_with_others(tmp_path):
    with Laboratory(tmp_path) as laboratory:
        laboratory.runs(noted, [1], offset=10)
        rows = laboratory.grid(noted, [{"offset": 10}, {"offset": 20}], [1, 2])
        assert [[row["number"] for row in point] for point in rows] == [[11, 12], [21, 22]]
        assert laboratory.made == 4


def test_an_interrupted_reproduction_goes_on_where_it_stopped(tmp_path):
    with pytest.raises(KeyboardInterrupt), Laboratory(tmp_path) as laboratory:
        laboratory.runs(interrupted_at_three, range(1, 6))
    with Laboratory(tmp_path) as laboratory:
        rows = laboratory.runs(interrupted_at_three, range(1, 6))
        assert laboratory.made == 3
    assert calls == [1, 2, 3, 3, 4, 5]
    assert [row["number"] for row in rows] == [1, 2, 3, 4, 5]


@pytest.mark.long
def test_two_processes_find_what_one_finds(tmp_path):
    rows = []
    for jobs in (1, 2):
        with Laboratory(tmp_path / str(jobs), jobs=jobs) as laboratory:
            rows.append(laboratory.runs(choice_run, range(1, 5), draws=100))
    assert rows[0] == rows[1]


def test_a_key_distinguishes_runs_settings_and_seeds_and_not_the_order_of_settings():
    keys = {
        key_of(noted, {}, 1),
        key_of(noted, {}, 2),
        key_of(noted, {"offset": 1}, 1),
        key_of(interrupted_at_three, {}, 1),
    }
    assert len(keys) == 4
    assert key_of(noted, {"a": 1, "b": 2}, 1) == key_of(noted, {"b": 2, "a": 1}, 1)


def test_judged_seeds_are_neither_those_of_trials_nor_of_settings(tmp_path):
    with Laboratory(tmp_path) as full:
        assert list(full.fresh_seeds(2)) == [1001, 1002]
        assert not set(full.fresh_seeds(8_000)) & {*full.seeds(1_000), *range(10_000, 20_000)}


def test_quick_is_a_few_seeds(tmp_path):
    with Laboratory(tmp_path, quick=True) as quick:
        assert list(quick.seeds(40)) == [1, 2, 3]
        assert list(quick.seeds(40, quick=2)) == [1, 2]
        assert list(quick.fresh_seeds(40, quick=2)) == [1, 2]
        assert quick.pick("full", "quick") == "quick"


@pytest.mark.parametrize("wrong", [{}, {"number": None}, {"number": [1.0]}])
def test_a_figure_that_cannot_be_made_of_stored_runs_names_the_file_to_remove(tmp_path, monkeypatch, wrong):
    item = Item(figure="0", section="0", title="", make=lambda laboratory: laboratory.runs(noted, [1])[0]["number"] + 1)
    with Laboratory(tmp_path) as laboratory:
        assert [made.result for made in made_by(laboratory, [item])] == [2]
    with Ledger(tmp_path / "runs.jsonl") as ledger:
        ledger.append(key_of(noted, {}, 1), Outcome(results=wrong))
    with (
        Laboratory(tmp_path) as laboratory,
        pytest.raises(SwarmError, match=r"figure 0 cannot be made .*remove the file"),
    ):
        list(made_by(laboratory, [item]))


def test_an_error_in_runs_that_are_new_is_not_blamed_on_the_file(tmp_path):
    item = Item(figure="0", section="0", title="", make=lambda laboratory: laboratory.runs(noted, [1])[0]["missing"])
    with Laboratory(tmp_path) as laboratory, pytest.raises(KeyError):
        list(made_by(laboratory, [item]))
