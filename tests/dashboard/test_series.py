"""What is measured while a model is played: exact numbers in bounded memory."""

import numpy as np
import pytest
from mesa import DataCollector

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.dashboard.compare.comparing import Pair
from mesa_swarm.dashboard.page.series import MOST_NUMBERS, Series, charts_of, group_rows
from mesa_swarm.dashboard.page.session import MOST_WATCHED_STEPS, Session
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing.player import FRAME_BYTES, MOST_BYTES, MOST_COLLECTED

MODULE = "mesa_swarm.dashboard.page.series"


def played(what, steps):
    for _ in range(steps):
        what.step()


def followed(model, **limits) -> Series:
    series = Series(**limits)
    series.follow(model)
    return series


def test_numbers_are_those_of_the_model_in_every_step():
    model = FireFighting(rng=3)
    series, shares, fighting = followed(model), [], []
    for _ in range(40):
        model.step()
        shares.append([100 * np.mean(model.swarm.layer == k) for k in (0, 1, 2, -1)])
        fighting.append(model.fires.robots.copy())
    steps, rows = series.rows("layers")
    assert steps.tolist() == list(range(1, 41))
    assert rows == pytest.approx(np.array(shares))
    assert series.rows("at_fires")[1].tolist() == np.array(fighting).tolist()
    assert series.rows("total_collisions")[1][:, 0].tolist() == model.datacollector.model_vars["total_collisions"]


def test_measuring_does_not_change_a_run():
    model = FireFighting(rng=3)
    followed(model)
    assert model.run(50).state_hash() == FireFighting(rng=3).run(50).state_hash()


def test_long_runs_are_thinned_to_exact_numbers_of_every_so_many_steps():
    model = CollisionAvoidance(rng=1)
    series = followed(model, most_numbers=600)
    model.run(2_000)
    steps, rows = series.rows("total_collisions")
    assert 50 < len(steps) <= 100
    assert series.row_every == 2 ** round(np.log2(series.row_every)) > 8
    assert (steps % series.row_every == 0).all()
    assert np.diff(steps).tolist() == [series.row_every] * (len(steps) - 1)
    collected = np.array(model.datacollector.model_vars["total_collisions"])
    assert rows[:, 0].tolist() == collected[steps - 1].tolist()


def test_groups_have_mean_least_and_greatest_of_all_rows():
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(1000, 3))
    curves = group_rows(np.arange(1, 1001), rows, 8)
    assert curves.mean.shape == (3, 125)
    assert curves.mean[:, 7] == pytest.approx(rows[56:64].mean(axis=0))
    assert curves.low.min(axis=1) == pytest.approx(rows.min(axis=0))
    assert curves.high.max(axis=1) == pytest.approx(rows.max(axis=0))
    assert curves.steps[-1] == 1000
    few = group_rows(np.arange(1, 6), np.array([[1.0], [3.0], [5.0], [np.nan], [7.0]]), 2)
    assert few.steps.tolist() == [2, 4, 5]
    assert (few.mean.tolist(), few.high.tolist()) == ([[2.0, 5.0, 7.0]], [[3.0, 5.0, 7.0]])


def test_what_was_drawn_stays_as_it_is_while_rows_are_added():
    rows = np.random.default_rng(2).normal(size=(900, 1))
    before, after = (group_rows(np.arange(n), rows[:n], 4).mean[0] for n in (800, 900))
    assert after[:200].tolist() == before.tolist()


def test_a_fire_that_is_added_is_a_curve_of_which_nothing_is_known_before():
    model = FireFighting(rng=1)
    series = followed(model)
    model.run(5)
    model.add_fire((400, 60), radius=10)
    model.run(5)
    steps, rows = series.rows("at_fires")
    assert (len(steps), rows.shape) == (10, (10, 8))
    assert np.isnan(rows[:5, 7]).all()
    assert np.isfinite(rows[5:]).all()
    assert np.isfinite(rows[:5, :7]).all()


def test_layers_of_the_same_name_are_distinguished():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(Avoid(), Avoid(distance=30), Explore())
    assert charts_of(model)[-1].names == ("Avoid 1", "Avoid 2", "Explore", "no layer")


def test_what_is_no_number_is_not_known():
    model = SwarmModel(rng=1, model_reporters={"word": lambda _: "far", "yes": lambda _: True})
    series = followed(model)
    model.run(2)
    assert np.isnan(series.rows("word")[1]).all()
    assert series.rows("yes")[1].tolist() == [[1.0], [1.0]]


def test_an_unknown_chart_is_refused_in_one_line():
    with pytest.raises(UnknownNameError, match="did you mean 'collisions'"):
        followed(SwarmModel(rng=1)).rows("colisions")


def test_a_reset_clears_what_was_measured_and_leaves_the_old_model_alone():
    session = Session("collision_avoidance")
    session.step()
    old = session.model
    session.reset()
    assert len(session.series) == 0
    assert session.series not in old.observers
    session.step()
    assert session.series.rows("collisions")[0].tolist() == [1]
    session.close()
    assert session.series.model is None


def test_a_link_to_a_later_step_has_all_that_was_measured_until_then():
    session = Session("fire_fighting", steps=25)
    assert session.series.rows("at_fires")[0].tolist() == list(range(1, 26))


@pytest.mark.slow
def test_a_run_on_the_page_keeps_a_window_of_all_that_grows_with_the_steps(monkeypatch):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 50)
    session, alone = Session("fire_fighting", seed=3), FireFighting(rng=3)
    session.recent.most_bytes, session.series.most_numbers = 40_000, 1000
    for _ in range(330):
        session.step()
        alone.step()
    model = session.model
    assert {len(values) for values in model.datacollector.model_vars.values()} == {80}
    assert len(model.fires.history.steps) == len(model.fires.history.temperature) == 33  # of every tenth step
    assert len(session.past) < 40
    assert len(session.series) <= 1000 // session.series.rows("collisions")[1].shape[1]
    assert len(model.watched) <= MOST_WATCHED_STEPS
    assert model.state_hash() == alone.state_hash()
    session.close()


def test_a_data_collector_that_takes_the_place_of_another_has_its_own_charts_from_then_on():
    model = SwarmModel(rng=1, model_reporters={"first": lambda model: model.steps})
    series = followed(model)
    model.run(3)
    model.datacollector = DataCollector(model_reporters={"second": lambda model: 10 * model.steps})
    model.run(2)
    assert {chart.key for chart in series.charts()} & {"first", "second"} == {"second"}
    assert np.isnan(series.rows("second")[1][:3]).all()


def test_what_is_recorded_is_not_forgotten_meanwhile(monkeypatch, tmp_path):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 20)
    session = Session("fire_fighting", seed=3)
    model = session.model
    played(session, 15)
    with model.record(tmp_path / "run.arrow"):
        played(session, 55)
        assert len(model.datacollector.model_vars["collisions"]) == 70
    played(session, 10)
    assert len(model.datacollector.model_vars["collisions"]) == 20
    session.close()
    assert FireFighting.resume(tmp_path / "run.arrow").state_hash() == FireFighting(rng=3).run(70).state_hash()


def test_worlds_that_are_compared_keep_a_window_too(monkeypatch):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 20)
    pair = Pair()
    pair.place(CollisionAvoidance(n_robots=2, rng=1), CollisionAvoidance(n_robots=2, rng=2))
    played(pair, 50)
    for side in pair.sides:
        assert {len(values) for values in side.model.datacollector.model_vars.values()} == {30}


def test_steps_before_the_first_picture_and_on_the_way_to_a_branch_are_forgotten_alike(monkeypatch):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 20)
    session = Session("fire_fighting", seed=3, steps=65)
    for _ in range(2):
        assert len(session.model.datacollector.model_vars["collisions"]) == 20
        played(session, 14)
        assert len(session.model.datacollector.model_vars["collisions"]) == 34
        played(session, 1)
        assert len(session.model.datacollector.model_vars["collisions"]) == 20
        session.adopt(FireFighting(rng=5).run(65), "fire_fighting", {}, 5)
    session.close()


def test_a_model_that_was_built_elsewhere_is_measured_from_the_step_at_which_it_is_adopted():
    session = Session("fire_fighting", seed=3)
    session.adopt(FireFighting(rng=5).run(7), "fire_fighting", {}, 5)
    played(session, 3)
    assert session.series.rows("collisions")[0].tolist() == [8, 9, 10]
    session.close()


@pytest.mark.slow
def test_millions_of_robot_steps_on_the_page_leave_its_memory_flat(amount):
    session = Session("collision_avoidance", {"n_robots": 100}, seed=3)
    model, steps = session.model, amount(30_000, 100_000)
    for _ in range(steps):
        with session.lock:
            session._take_step(model)
    assert len(session.past) <= MOST_BYTES / FRAME_BYTES
    assert len(session.series) <= MOST_NUMBERS
    assert max(len(values) for values in model.datacollector.model_vars.values()) <= 2 * MOST_COLLECTED
    assert model.completed == steps
    session.close()


def test_events_are_counted_in_a_chart_from_the_first_of_each_name_on():
    model = FireFighting(rng=3)
    series = followed(model)
    for step, names in enumerate(("", "ab", "b", ""), start=1):
        model.step()
        for name in names:
            model.event(name)
        assert ("events" in {chart.key for chart in series.charts()}) == (step > 2)
    assert series.chart("events").names == ("a", "b")
    assert series.rows("events")[1][2:].tolist() == [[1.0, 1.0], [1.0, 2.0]]
