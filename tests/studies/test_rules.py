"""What reproductions compute beside runs: closed forms, and cells of the map of strategies."""

import math

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import paired_difference
from mesa_swarm.maps.map import Map
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm_studies.thesis import fire_fighting, fire_growth
from mesa_swarm_studies.thesis.complexity import exponents
from mesa_swarm_studies.thesis.fire_fighting import fire_model, grown_map, rhythm
from mesa_swarm_studies.thesis.maps import boxes, listed_boxes
from mesa_swarm_studies.thesis.networks import regression_run


def runs(out, times=None):
    return [{"out": n, "all out at": t} for n, t in zip(out, times or [None] * len(out), strict=True)]


PLACE = {"robots": 5, "size": 1.0, "rest": 60.0}


class TestCells:
    def test_more_fires_out_win(self):
        cell = fire_fighting.cell_of(PLACE, runs([6, 6, 6]), runs([7, 7, 7]))
        assert (cell.winner, cell.out) == ("B", (6.0, 7.0))
        assert fire_fighting.cell_of(PLACE, runs([7] * 12), runs([6, 6, 5, 6, 6, 5] * 2)).winner == "A"

    def test_many_comparisons_ask_for_a_wider_interval(self):
        few, many = runs([7] * 6), runs([6, 6, 5, 6, 6, 5])
        cell = fire_fighting.cell_of(PLACE, few, many)
        assert not cell.more.excludes_zero
        assert paired_difference([7] * 6, [6, 6, 5, 6, 6, 5])[0].excludes_zero

    def test_where_as_many_are_out_the_sooner_wins(self):
        first, second = runs([7] * 12, [500, 600, 700, 800] * 3), runs([7] * 12, [400, 510, 590, 700] * 3)
        assert fire_fighting.cell_of(PLACE, first, second).winner == "B"
        assert fire_fighting.cell_of(PLACE, second, first).winner == "A"

    def test_where_chance_is_larger_neither_wins(self):
        assert fire_fighting.cell_of(PLACE, runs([7, 6, 7]), runs([6, 7, 7])).winner == ""

    def test_words_name_where_a_wins(self):
        cells = [fire_fighting.cell_of(PLACE, runs([7, 7, 7]), runs([6, 6, 6]))]
        remarks = " ".join(fire_fighting.winners_in_words(cells))
        assert "A in 1" in remarks
        assert "with 5 robots, fires 1 times as large and a rest of 60" in remarks


class TestFires:
    @pytest.mark.parametrize("size", [0.5, 2.0])
    def test_a_grown_map_has_fires_of_so_many_times_the_area_at_the_same_places(self, size):
        plain, grown = Map.load("openspace_fire"), grown_map(size)
        assert [fire.position for fire in grown.fires] == [fire.position for fire in plain.fires]
        areas = [b.area / a.area for a, b in zip(plain.fires, grown.fires, strict=True)]
        assert np.allclose(areas, size)

    def test_a_size_and_a_rest_of_the_map_as_it_is_are_the_models_defaults(self):
        model = fire_model(3, "B").run(30)
        assert model.state_hash() == FireFighting(strategy="B", rng=3).run(30).state_hash()

    @pytest.mark.parametrize("rest", fire_fighting.RESTS)
    def test_a_robot_works_in_proportion_to_its_rest(self, rest):
        wanted = rhythm(rest)
        assert wanted["leave"] / rest == pytest.approx(100 / 60)
        assert (wanted["leave"] - wanted["join"]) / 1.5 == pytest.approx(rest)

    def test_the_solution_solves_its_equation(self):
        chosen = fire_growth.example()
        times = np.linspace(0, 150, 7)
        h = 1e-3
        slope = (fire_growth.solution(chosen, times + h) - fire_growth.solution(chosen, times - h)) / (2 * h)
        held = chosen.k2 * fire_growth.ROBOTS / fire_growth.AREA
        assert np.allclose(slope, chosen.k1 * (fire_growth.solution(chosen, times) + 1) - held)
        assert fire_growth.solution(chosen, np.array([0.0]))[0] == pytest.approx(1.0)

    def test_the_printed_constant_is_right_only_where_its_units_are_lost(self):
        k1 = math.log(2) / fire_growth.GROWTH
        assert fire_growth.printed_k2(k1) == pytest.approx(1.0018, abs=1e-4)


def test_exponents_are_those_of_power_laws():
    robots = np.array([6.0, 12, 24, 48])
    assert np.allclose(exponents(np.column_stack([robots**2, 3 * robots**0.5]), robots), [2.0, 0.5])


def test_the_listing_is_the_map_original_and_no_other():
    assert listed_boxes() == boxes(Map.load("original").obstacles)
    assert listed_boxes() != boxes(Map.load("sparse").obstacles)


def test_a_regression_is_the_same_for_the_same_seed():
    assert regression_run(2, networks=3, curve="drawn") == regression_run(2, networks=3, curve="drawn")
