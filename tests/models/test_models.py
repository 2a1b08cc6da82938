import inspect
import math
import tracemalloc

import mesa
import numpy as np
import pytest

from mesa_swarm import Choice, Slider, batch_run
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments.compare import compare
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.model.parameters import parameters_of

NAMES = model_names()
STEPS = 60


def test_collisions_are_counted_per_robot_that_there_was_in_each_step():
    model = find_model("collision_avoidance")(n_robots=40, rng=1).run(100)
    model.remove_robots(list(model.robots)[1:])
    model.run(50)
    rate = 1000 * model.total_collisions / (40 * 100 + 50)
    assert rate > 0
    assert model.results() == {"collisions per robot and 1,000 steps": pytest.approx(rate)}


@pytest.mark.parametrize("left", [0, 1])
def test_of_fewer_than_two_robots_there_is_no_distance_to_the_nearest(left):
    model = find_model("agglomeration")(n_robots=5, rng=1).run(2)
    model.remove_robots(list(model.robots)[left:])
    model.run(1)
    assert math.isnan(model.neighbour_distance)
    assert model.results()["mean distance to the nearest robot"] is None


def batch_of_two(model_class, **more):
    """Run mesa.batch_run with two seeds; Mesa 3.5 wants `rng`, earlier ones repeat by `iterations`, Mesa 4 has none."""
    run = getattr(mesa, "batch_run", batch_run)
    again = {"rng": [1, 2]} if "rng" in inspect.signature(run).parameters else {"iterations": 2}
    return run(model_class, {"n_robots": 4}, max_steps=20, number_processes=1, display_progress=False, **again, **more)


@pytest.mark.parametrize("name", NAMES)
class TestEveryModel:
    @pytest.mark.slow
    def test_runs_and_has_results_in_numbers(self, name):
        model = find_model(name)(rng=1).run(STEPS)
        assert model.steps == STEPS
        assert model.results()
        assert all(value is None or np.isfinite(value) for value in model.results().values())

    @pytest.mark.slow
    @pytest.mark.parametrize("n_robots", [1, 2])
    def test_has_results_in_numbers_for_few_robots_or_none_where_they_are_undefined(self, name, n_robots):
        lowest = parameters_of(find_model(name))["n_robots"].control.minimum
        results = find_model(name)(n_robots=max(n_robots, lowest), rng=3).run(3).results()
        assert results
        assert all(value is None or np.isfinite(value) for value in results.values())

    @pytest.mark.slow
    def test_same_seed_gives_the_same_state(self, name):
        first, second = (find_model(name)(rng=5).run(STEPS).state_hash() for _ in range(2))
        assert first == second

    @pytest.mark.slow
    def test_another_seed_gives_another_state(self, name):
        first, second = (find_model(name)(rng=rng).run(STEPS).state_hash() for rng in (5, 6))
        assert first != second

    @pytest.mark.slow
    def test_works_with_batch_run(self, name):
        rows = batch_of_two(find_model(name))
        runs = {row["RunId"] for row in rows}
        assert len(runs) == 2
        assert {row["Step"] for row in rows} == {20}
        assert all("total_collisions" in row for row in rows)

    def test_has_ranges_that_contain_the_defaults(self, name):
        for parameter in parameters_of(find_model(name)).values():
            control = parameter.control
            if isinstance(control, Slider):
                assert control.minimum <= parameter.default <= control.maximum, parameter.name
                assert control.step > 0
            else:
                assert isinstance(control, Choice), f"{parameter.name} has neither Slider nor Choice"
                assert parameter.default in control.options
            assert parameter.help, f"{parameter.name} has no help"

    @pytest.mark.slow
    def test_accepts_both_ends_of_every_range_or_names_what_they_contradict(self, name):
        model_class = find_model(name)
        for parameter in parameters_of(model_class).values():
            control = parameter.control
            ends = control.options if isinstance(control, Choice) else (control.minimum, control.maximum)
            for end in ends:
                error = refusal(model_class, parameter.name, end)
                assert error is None or parameter.name in error

    def test_reads_its_own_defaults_from_text(self, name):
        for parameter in parameters_of(find_model(name)).values():
            assert parameter.parse(str(parameter.default)) == parameter.default

    def test_compares_values_that_it_accepts(self, name):
        parameter, values = find_model(name).compares
        assert len(values) > 1
        for value in values:
            find_model(name)(**{parameter: value}, rng=1)

    @pytest.mark.parametrize("wrong", [{"n_robots": 10**9}, {"n_robots": -1}, {"n_robots": np.nan}, {"rng": -1}])
    def test_refuses_nonsense_in_one_line(self, name, wrong):
        with pytest.raises(SwarmError) as caught:
            find_model(name)(**wrong)
        assert "\n" not in str(caught.value)

    def test_refuses_too_many_robots_before_it_makes_arrays_of_that_size(self, name):
        tracemalloc.start()
        try:
            with pytest.raises(SwarmError):
                find_model(name)(n_robots=10**8)
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < 10**8  # bytes; one number for each robot would be eight times as much


def refusal(model_class, name, value):
    """Return the model's error about a value, or None; a single end of a range may contradict other defaults."""
    try:
        model_class(**{name: value}, rng=1)
    except SwarmError as error:
        return str(error)
    return None


def test_fire_fighting_stops_when_all_fires_are_out():
    model = find_model("fire_fighting")(initial_temperature=0.01, k2=0.05, rng=1).run(20_000)
    assert not model.running
    assert model.steps < 20_000
    assert model.results()["all fires out at"] == model.steps
    assert model.results()["fires out"] == 7


def test_communication_can_be_compared_in_fire_fighting():
    fire_fighting = find_model("fire_fighting")
    comparison = compare(fire_fighting, parameter="communication", seeds=1, steps=5, jobs=1)
    assert [run.value for run in comparison.runs] == ["none", "state", "goal"]
    layers = {value: len(fire_fighting(communication=value).control.layers) for value in comparison.plan.values}
    assert layers == {"none": 3, "state": 4, "goal": 4}


def test_fire_fighting_keeps_every_fire_once_it_is_out():
    history = find_model("fire_fighting")(rng=1).run(1500).fires.history.robots
    out = history == -1
    assert out.any(axis=0).sum() == 6
    assert (out == np.logical_or.accumulate(out)).all()


def test_collision_avoidance_counts_collisions_per_robot_and_thousand_steps():
    model = find_model("collision_avoidance")(n_robots=60, rng=1).run(50)
    assert model.total_collisions > 0
    (rate,) = model.results().values()
    assert rate == pytest.approx(1000 * model.total_collisions / (60 * 50))


def test_fire_fighting_on_a_map_without_fires_is_refused():
    with pytest.raises(SwarmError, match="map original has no fires"):
        find_model("fire_fighting")(map="original")


def test_fire_fighting_finds_the_largest_fire_if_there_is_one():
    model = find_model("fire_fighting")(rng=1)
    assert [name for name in model.results() if "largest" in name] == ["fire 2 (largest) out at"]
    model.add_fire((100, 300), area=model.fires.area.max())
    assert not [name for name in model.results() if "largest" in name]
