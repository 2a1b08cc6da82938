"""Measured results on models' pages: stored values are those of the models, and tables are computed from them."""

import math

import pytest
from measure_models import DEFAULTS, SEEDS, STEPS, measured, settings_of, stored
from model_pages import cell, model_page, results

from mesa_swarm.model.gallery import gallery_names

STORED = stored()
SETTINGS = [pytest.param(name, label, id=f"{name}: {label}") for name in gallery_names() for label in settings_of(name)]


def test_every_model_has_stored_results_of_its_defaults_and_of_each_preset_and_no_others():
    assert {name: list(found) for name, found in STORED.items()} == {
        name: list(settings_of(name)) for name in sorted(gallery_names())
    }
    assert set(STEPS) == set(gallery_names())


@pytest.mark.parametrize(("name", "label"), SETTINGS)
def test_a_setting_has_one_value_of_each_measure_for_each_seed(name, label):
    found = STORED[name][label]
    assert found.keys() == STORED[name][DEFAULTS].keys()
    assert {len(row) for row in found.values()} == {len(SEEDS)}


@pytest.mark.long
@pytest.mark.parametrize(("name", "label"), SETTINGS)
def test_a_run_measured_anew_has_the_stored_values(name, label):
    place = len(SEEDS) - 1
    fresh = measured(name, settings_of(name)[label], SEEDS[place])
    kept = {key: row[place] for key, row in STORED[name][label].items()}
    assert fresh == pytest.approx(kept, rel=0, abs=0, nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_a_page_has_its_results_before_its_parameters_and_its_description(name):
    page = model_page(name)
    assert page.index("\n## Results\n") < page.index("<summary>Parameters</summary>")
    assert page.index("<summary>Parameters</summary>") < page.index("## Description by the ODD protocol")
    assert f"Seeds {SEEDS[0]} to {SEEDS[-1]} for each setting, {STEPS[name]:,} steps" in page
    table = results(name).splitlines()[-len(STORED[name][DEFAULTS]) :]
    assert [row.split(" | ")[0].removeprefix("| ") for row in table] == list(STORED[name][DEFAULTS])


@pytest.mark.parametrize(
    ("key", "row", "shown"),
    [
        ("groups", [2.0] * 20, "2 [2, 2]"),
        ("groups", [1234.0] * 20, "1,234 [1,234, 1,234]"),
        ("agreed at", [100.0] * 10 + [math.nan] * 10, "10 of 20 runs [30 to 70 %]; 100 [100, 100]"),
        ("agreed at", [math.nan] * 20, "0 of 20 runs [0 to 16 %]"),
        ("agreed at", [7.0] + [math.nan] * 19, "1 of 20 runs [1 to 24 %]; 7"),
        ("share", [0.5] * 8 + [math.nan] * 12, "0.5 [0.5, 0.5] in 8 runs"),
        ("share", [math.nan] * 20, "undefined"),
    ],
)
def test_a_cell_has_the_mean_its_interval_and_the_number_of_runs(key, row, shown):
    assert cell(key, row) == shown
