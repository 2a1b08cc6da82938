"""What the page on readings compares: every combination, with the claims of the figures."""

from itertools import product

import numpy as np
import pytest

from mesa_swarm import AGENT9
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm_studies.judging import FAILED, PASSED, judged_fact
from mesa_swarm_studies.registry import Made, find_item, items, report
from mesa_swarm_studies.thesis.learning import READING
from mesa_swarm_studies.thesis.readings import (
    ACTIONS,
    CLAIMS,
    CRITICAL,
    DEFAULT,
    ITEMS,
    MEASURES,
    REWARDED,
    compared,
    holding,
    readings_figure,
    remark,
    settings_of,
    table,
)

ALL = list(product(CRITICAL, ACTIONS, REWARDED))


def rows_of(changed=None, measure="total", by=0.0):
    """Made-up runs of all readings; in one of them a measure is larger by a number."""
    chance = np.random.default_rng(1)
    base = [dict.fromkeys(MEASURES, float(value)) for value in chance.uniform(10, 11, 5)]
    rows = {reading: [dict(row) for row in base] for reading in ALL}
    for place, row in enumerate(rows.get(changed, ())):
        row[measure] += by * (1 + 0.01 * place)
    return rows


def test_the_default_reading_is_that_of_the_figures_and_of_the_model():
    model = QLearning(n_robots=1, rng=1).learner
    assert settings_of(*DEFAULT) == READING
    assert {name: getattr(model, name) for name in READING} == READING


def test_the_three_units_of_d_crit_are_20_units_4_units_and_0_4_units():
    reach = AGENT9.proximity[0].range
    units = [0.4 * reach, 0.4 * 2 * AGENT9.radius, 0.4]
    assert [share * reach for share in CRITICAL.values()] == pytest.approx(units)


@pytest.mark.parametrize(("reading", "measure", "claim", "more"), CLAIMS)
@pytest.mark.parametrize("by", [-5.0, 5.0])
def test_a_claim_passes_where_the_reading_changes_the_measure_as_claimed_and_fails_if_oppositely(
    reading, measure, claim, more, by
):
    outcomes = {check.claim: check.outcome for check in compared(rows_of(reading, measure, by))}
    assert outcomes.pop(claim) == (PASSED if (by > 0) == more else FAILED)
    assert PASSED not in outcomes.values()


def test_a_reading_has_a_line_with_its_measures_and_the_claims_that_do_not_hold():
    held, not_held = (judged_fact(f"claim {word}: number", "", word == "a", measured="") for word in "ab")
    side = judged_fact("side", "", False, measured="", main=False)
    assert holding((held, side)) == "1 of 1"
    assert holding((held, not_held, side)) == "1 of 2 (claim b: failed)"
    lines = table(rows_of(), {"8.3": dict.fromkeys(ALL, (held, not_held))}).splitlines()
    assert len([line for line in lines if line.endswith("| 1 of 2 (claim b: failed) |")]) == len(ALL) == 12
    assert next(line for line in lines if line.startswith("| **")).startswith(
        "| **0.4 of a diameter, 8 actions, r(s, a)** | 10."
    )


def test_a_remark_lists_the_readings_with_which_all_main_claims_hold():
    held, not_held = (judged_fact("claim", "", word == "a", measured="") for word in "ab")
    claims = dict.fromkeys(ALL, (held, not_held))
    assert remark("8.3", claims) == "All main claims of figure 8.3 hold with 0 of 12 readings."
    claims[DEFAULT] = (held,)
    assert remark("8.3", claims).endswith("hold with 1 of 12 readings: 0.4 of a diameter, 8 actions, r(s, a).")


def test_a_figure_has_a_line_for_every_reading():
    rates = readings_figure(rows_of()).axes[0]
    assert rates.get_yticklabels()[0].get_text() == "0.4 of the range, 8 actions, r(s, a)"
    assert len(rates.get_yticks()) == 12


def test_readings_are_neither_of_the_thesis_nor_of_papers_and_their_page_has_its_own_introduction(monkeypatch):
    assert {item.source for item in ITEMS} == {"reading"}
    assert all(find_item(item.figure) is item for item in ITEMS)
    assert [item for item in items().values() if item.source == "reading"] == list(ITEMS)
    monkeypatch.setattr("mesa_swarm_studies.thesis.readings.runs_by_reading", lambda *_: rows_of())
    for name in ("judged_frequency", "judged_totals"):
        monkeypatch.setattr(f"mesa_swarm_studies.thesis.readings.{name}", lambda *_: ())
    made = [Made(item=item, result=item.make(None), seconds=1.0) for item in ITEMS]
    page = report(made)
    assert page.startswith("# How much the verdicts depend on how one reads")
    assert "![the same, one robot](pictures/readings-8.2.png)" in page
    assert page.count("| **0.4 of a diameter, 8 actions, r(s, a)** |") == len(ITEMS) == 3
