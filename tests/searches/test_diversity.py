"""Quality-diversity search: the same by seed, stored, and each cell holds a controller that behaves as it states."""

import json
import re

import numpy as np
import pytest

from mesa_swarm.base import extras
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.base.extras import install_command
from mesa_swarm.base.streams import Streams
from mesa_swarm.experiments.fingerprints import PACKAGE
from mesa_swarm.maps.map import Map
from mesa_swarm.searches import diversity
from mesa_swarm.searches.diversity import BehaviourMap, behaviour_figure, behaviour_of, cell_middles, diversify
from mesa_swarm.searches.evolved_controllers import Trial

BRIEF = Trial(robots=4, steps=60, units=0, encoding="typed")
SMALL = {"cells": 8, "generations": 4, "emitters": 2, "batch": 6}


@pytest.mark.long
def test_an_archive_is_the_same_for_the_same_seed_and_any_number_of_processes():
    pytest.importorskip("ribs")
    one, two = (diversify(BRIEF, rng=3, jobs=jobs, **SMALL) for jobs in (1, 2))
    assert np.array_equal(one.fitness, two.fitness, equal_nan=True)
    assert np.array_equal(one.genomes, two.genomes, equal_nan=True)
    assert not np.array_equal(one.fitness, diversify(BRIEF, rng=4, **SMALL).fitness, equal_nan=True)
    assert one.tried == 48
    assert 1 / 64 < one.filled < 48 / 64


def test_a_search_that_was_interrupted_does_only_the_trials_that_are_missing(tmp_path, monkeypatch):
    pytest.importorskip("ribs")
    small = {"cells": 4, "generations": 2, "emitters": 1, "batch": 4, "rng": 3}
    whole = diversify(BRIEF, **small)
    tried = []

    def interrupted(*arguments, most=6):
        tried.append(arguments)
        if len(tried) > most:
            raise KeyboardInterrupt
        return behaviour_of(*arguments)

    monkeypatch.setattr(diversity, "behaviour_of", interrupted)
    with pytest.raises(KeyboardInterrupt):
        diversify(BRIEF, out=tmp_path, **small)
    tried.clear()
    again = diversify(BRIEF, out=tmp_path, **small)
    assert len(tried) == 2
    assert np.array_equal(again.fitness, whole.fitness, equal_nan=True)
    assert np.array_equal(again.genomes, whole.genomes, equal_nan=True)


@pytest.mark.long
def test_a_controller_of_a_cell_behaves_as_its_cell_states(tmp_path):
    pytest.importorskip("ribs")
    found = diversify(BRIEF, rng=3, **SMALL)
    seed = int(Streams(np.random.SeedSequence(3))["world"].integers(2**63))
    for row, column in np.argwhere(np.isfinite(found.fitness)).tolist():
        genome = found.genomes[row, column]
        worth, *measured = behaviour_of(BRIEF, ("coverage", "speed"), Map.load("openspace"), seed, genome)
        assert worth == found.fitness[row, column]
        for value, place, name in zip(measured, (row, column), found.measures, strict=True):
            assert abs(value - cell_middles(name, 8)[place]) <= 1 / 16 + 1e-6
        assert found.policy(row, column).wheel.size == BRIEF.genes
    found.save(tmp_path / "archive.json")
    stored = json.loads((tmp_path / "archive.json").read_text())
    assert len(stored["found"]) == np.isfinite(found.fitness).sum()


def archive():
    fitness = np.full((2, 4), np.nan)
    fitness[1, 2] = 3.5
    genomes = np.full((2, 4, BRIEF.genes), np.nan)
    genomes[1, 2] = 0.5
    return BehaviourMap(measures=("coverage", "speed"), fitness=fitness, genomes=genomes, trial=BRIEF, tried=7)


def test_a_map_of_behaviours_is_a_table_and_a_picture_of_its_filled_cells():
    found = archive()
    assert found.csv().splitlines() == ["coverage,speed,fitness", "0.75,0.625,3.5"]
    assert found.filled == 1 / 8
    axes = behaviour_figure(found).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed", "coverage")
    assert axes.images[0].get_array().compressed().tolist() == [3.5]
    assert (found.policy(1, 2).wheel == 0.5).all()
    with pytest.raises(InvalidValueError, match="no controller was found for row 0, column 0"):
        found.policy(0, 0)


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(SwarmError, match=re.escape(install_command("diversity"))):
        diversify(BRIEF)


def test_all_files_that_trials_depend_on_are_there():
    assert all((PACKAGE / name).exists() for name in diversity.SOURCES)


def test_measures_are_two_different_ones():
    for wrong in ("speed", ["speed"], ["speed", "speed"], ["speed", "size"]):
        with pytest.raises(SwarmError):
            diversity.check_two_measures(wrong)
