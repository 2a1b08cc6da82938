"""Imperfect robots: what they read and do, and that ideal ones are as ever."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, AGENT_FIRE, LineSensor, RobotDesign, SwarmModel, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.physics.disturbances import draw_normal, draw_uniform
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.robots.imperfections import (
    MEASURED,
    ROBOTARIUM,
    ROBOTARIUM_ROBOT,
    Imperfection,
    Imperfections,
    is_ideal,
)

KEY = np.uint64(7)


def sensing(**values):
    return Imperfections(sensing=Imperfection(**values))


def driving(**values):
    return Imperfections(driving=Imperfection(**values))


def crowd(imperfections=None, design=AGENT9, robots=40, rng=1, engine="compiled"):
    model = SwarmModel(map="original", rng=rng, engine=engine)
    model.add_robots(design, robots)
    model.control = Subsumption(Avoid(distance=15), Explore())
    if imperfections is not None:
        model.imperfections = imperfections
    return model


def alone(imperfections, speed=1.0):
    """Return a model of one robot in the open that drives straight ahead."""
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT3, poses=[(100, 300, 0.0)])
    model.control = Subsumption(Explore(speed=speed))
    model.imperfections = imperfections
    return model


class TestDial:
    def test_at_0_there_is_nothing_and_at_1_all(self):
        assert MEASURED.at(0) is None
        assert MEASURED.at(1) == MEASURED
        assert ROBOTARIUM.at(0.5).sensing == Imperfection(error=0.015, dropout=0.0175, outliers=0.007)

    def test_an_imperfection_that_only_holds_chance_is_ideal_and_one_with_a_period_is_not(self):
        assert is_ideal(Imperfection(hold=3))
        assert not is_ideal(Imperfection(period=3))

    def test_whole_steps_are_rounded_and_a_charge_lasts_longer(self):
        half = replace(MEASURED, sensing=Imperfection(hold=5, period=9)).at(0.5)
        assert (half.sensing.hold, half.sensing.period, half.battery) == (3, 5, 40_000.0)

    @pytest.mark.parametrize("dial", [-0.1, 1.1, float("nan"), "half"])
    def test_a_place_that_is_none_is_refused(self, dial):
        with pytest.raises(InvalidValueError, match="dial is"):
            MEASURED.at(dial)

    @pytest.mark.parametrize(
        "values", [{"error": -1}, {"dropout": 2}, {"dropout": 0.6, "outliers": 0.6}, {"hold": 0}, {"lag": -1}]
    )
    def test_what_cannot_be_is_refused(self, values):
        with pytest.raises(InvalidValueError, match="expected"):
            Imperfection(**values)

    def test_readings_that_lag_are_refused(self):
        with pytest.raises(InvalidValueError, match="lag of sensing is 2; expected 0: late readings have a period"):
            sensing(lag=2)

    def test_a_model_takes_imperfections_only(self):
        with pytest.raises(InvalidValueError, match=r"expected Imperfections\(...\) or None"):
            crowd().imperfections = 0.5

    @pytest.mark.parametrize("name", ["agglomeration", "fire_fighting", "q_learning"])
    def test_ideal_robots_are_bitwise_what_they_are_without_a_dial(self, name):
        plain, dialled = (find_model(name)(n_robots=6, rng=3) for _ in range(2))
        dialled.imperfections = MEASURED
        dialled.imperfections = MEASURED.at(0)
        assert dialled.run(60).state_hash() == plain.run(60).state_hash()


class TestSameBits:
    def test_the_same_seed_gives_the_same_bits_and_another_seed_others(self):
        hashes = [crowd(MEASURED, rng=rng).run(50).state_hash() for rng in (1, 1, 2)]
        assert hashes[0] == hashes[1] != hashes[2]

    def test_to_look_changes_nothing(self):
        seen, unseen = crowd(MEASURED), crowd(MEASURED)
        for _ in range(20):
            seen.sense()
            seen.step()
            seen.sense()
            unseen.step()
        assert seen.state_hash() == unseen.state_hash()

    def test_chance_of_a_robot_does_not_depend_on_the_others(self):
        together = crowd(sensing(outliers=1.0), robots=10)
        together.sense()
        before = together.swarm.distance[1:].copy()
        together.robots[0].remove()
        together.sense()
        assert np.array_equal(together.swarm.distance, before)

    def test_a_model_goes_on_from_a_checkpoint_as_if_nothing_had_been(self):
        model = find_model("agglomeration")(n_robots=8, rng=1)
        model.imperfections = replace(MEASURED, battery=30.0)
        model.run(25)
        again = restore(find_model("agglomeration")(n_robots=8, rng=2), checkpoint_of(model))
        assert again.imperfections == model.imperfections
        assert again.run(25).state_hash() == model.run(25).state_hash()

    def test_another_control_does_not_charge_batteries(self):
        model = alone(Imperfections(battery=10.0)).run(20)
        model.control = Subsumption(Explore())
        before = model.swarm.position.copy()
        assert np.array_equal(model.run(5).swarm.position, before)

    def test_both_engines_agree(self):
        fast, slow = (crowd(MEASURED, robots=6, engine=engine).run(15) for engine in ("compiled", "shapely"))
        assert np.allclose(fast.swarm.position, slow.swarm.position, atol=1e-6)


class TestChance:
    def test_it_is_even_and_its_normal_is_normal(self):
        even = np.array([draw_uniform(KEY, i, 3, 5, 0) for i in range(20_000)])
        bell = np.array([draw_normal(KEY, i, 3, 5) for i in range(20_000)])
        assert np.histogram(even, 10, (0, 1))[0] == pytest.approx(2_000, abs=200)
        assert (bell.mean(), bell.std()) == (pytest.approx(0, abs=0.03), pytest.approx(1, abs=0.03))

    def test_robots_channels_moments_and_questions_have_nothing_to_do_with_each_other(self):
        base = np.array([draw_uniform(KEY, i, 0, 0, 0) for i in range(5_000)])
        others = [
            [draw_uniform(KEY, i, 1, 0, 0) for i in range(5_000)],
            [draw_uniform(KEY, i, 0, 1, 0) for i in range(5_000)],
            [draw_uniform(KEY, i, 0, 0, 1) for i in range(5_000)],
            [draw_uniform(KEY, i + 1, 0, 0, 0) for i in range(5_000)],
        ]
        for other in others:
            assert abs(np.corrcoef(base, other)[0, 1]) < 0.05


class TestSensing:
    def truth(self, **more):
        model = crowd(**more)
        model.sense()
        return model.swarm.distance.copy()

    def readings(self, imperfections, **more):
        model = crowd(imperfections, **more)
        model.sense()
        return model.swarm.distance.copy(), model.swarm.kind.copy()

    def test_a_reading_errs_in_proportion(self):
        true, (read, _) = self.truth(robots=150), self.readings(sensing(error=0.03), robots=150)
        seen = (true > 0) & (true < 40)
        relative = read[seen] / true[seen] - 1
        assert (relative.mean(), relative.std()) == (pytest.approx(0, abs=0.01), pytest.approx(0.03, abs=0.006))
        assert (read[true < 0] == -1).all()

    def test_dropouts_see_nothing_as_often_as_they_should(self):
        true, (read, kind) = self.truth(robots=150), self.readings(sensing(dropout=0.3), robots=150)
        seen = true >= 0
        lost = read[seen] < 0
        assert lost.mean() == pytest.approx(0.3, abs=0.08)
        assert (kind[seen][lost] == -1).all()
        assert np.array_equal(read[seen][~lost], true[seen][~lost])

    def test_outliers_are_anywhere_within_the_range(self):
        read, kind = self.readings(sensing(outliers=1.0), robots=150)
        assert 0 <= read.min() < 1
        assert 49 < read.max() <= 50
        assert (kind == 0).all()

    def test_a_reading_stays_for_a_period(self):
        model, rows = crowd(sensing(period=4)), []
        for _ in range(8):
            model.sense()
            rows.append(model.swarm.distance.copy())
            model.step()
        assert all(np.array_equal(rows[0], row) for row in rows[:4])
        assert all(np.array_equal(rows[4], row) for row in rows[4:])
        assert not np.array_equal(rows[0], rows[4])

    def test_chance_is_held(self):
        model, rows = crowd(sensing(outliers=1.0, hold=3)), []
        for _ in range(6):
            model.sense()
            rows.append(model.swarm.distance.copy())
            model.step()
        assert all(np.array_equal(rows[0], row) for row in rows[:3])
        assert not np.array_equal(rows[0], rows[3])

    def test_radiation_is_spoilt_by_the_same_scheme(self):
        model = SwarmModel(map="openspace_fire", rng=1)
        model.add_robots(AGENT_FIRE, poses=[(330, 300, 0.0)])
        model.sense()
        assert model.swarm.radiation[0, 0] == 1.0
        model.imperfections = sensing(dropout=1.0)
        model.sense()
        assert model.swarm.radiation[0, 0] == 0.0

    def test_a_robot_reads_no_radiation_with_a_sensor_that_it_does_not_have(self):
        model = crowd(sensing(outliers=1.0))
        model.add_robots(AGENT_FIRE, 2)
        model.sense()
        assert (model.swarm.radiation[:40] == 0).all()
        assert (model.swarm.radiation[40:] > 0).all()

    def test_the_robotariums_robot_has_seven_distance_sensors(self):
        assert len(ROBOTARIUM_ROBOT.proximity) == 7
        assert (ROBOTARIUM.sensing.error, ROBOTARIUM.sensing.dropout, ROBOTARIUM.sensing.outliers) == (
            0.03, 0.035, 0.014,
        )  # fmt: skip


class TestLines:
    def over(self, imperfections, steps=1, robots=400):
        """Return what the two eyes of many robots read in each step, half of them over black ground."""
        model = SwarmModel(map="openspace", rng=1)
        model.add_obstacle(rectangle((0, 0), (400, 600), contact=False))
        places = [(200 + 400 * (i % 2), 10 + 1.4 * i, 0.0) for i in range(robots)]
        model.add_robots(
            RobotDesign(name="eyes", sensors=(LineSensor(mount=(1, 1)), LineSensor(mount=(1, -1)))), poses=places
        )
        model.add_robots(RobotDesign(name="eye", sensors=(LineSensor(mount=(1, 1)),)), poses=[(600, 590, 0.0)])
        model.imperfections = imperfections
        return np.array([(model.sense(), model.swarm.line.copy(), model.step())[1] for _ in range(steps)])

    def test_dropouts_do_not_see_the_mark(self):
        (read,) = self.over(sensing(dropout=0.25))
        assert read[:400:2].mean() == pytest.approx(0.75, abs=0.08)
        assert not read[1::2].any()

    def test_outliers_are_black_or_white(self):
        (read,) = self.over(sensing(outliers=1.0))
        assert read[:400].mean() == pytest.approx(0.5, abs=0.06)
        assert not read[400, 1], "this robot has one eye"

    def test_errors_are_none_and_readings_stay_for_a_period(self):
        assert np.array_equal(self.over(sensing(error=5.0)), self.over(None))
        rows = self.over(sensing(outliers=1.0, period=3), steps=6)
        assert all(np.array_equal(rows[0], row) for row in rows[:3])
        assert not np.array_equal(rows[0], rows[3])


class TestDriving:
    def way(self, model, steps):
        return float(model.run(steps).swarm.position[0, 0]) - 100.0

    def test_a_lagging_wheel_comes_within_1_over_e_in_its_lag(self):
        lag = 10.0
        way = self.way(alone(driving(lag=lag)), 50)
        closed = sum(1 - np.exp(-(t + 1) / lag) for t in range(50))
        assert way == pytest.approx(closed)

    def test_dropped_commands_are_lost_ways(self):
        model = alone(Imperfections(driving=Imperfection(dropout=0.25)))
        model.swarm.columns["heading"][:] = 0.0
        moved = sum(float(model.run(1).swarm.command.mean() * (1 - model.swarm.slip.mean())) for _ in range(400))
        assert moved == pytest.approx(300, abs=30)

    def test_slip_is_the_lost_share_of_the_command(self):
        model = alone(driving(dropout=1.0)).run(1)
        assert (model.swarm.command.tolist(), model.swarm.slip.tolist()) == ([[1.0, 1.0]], [[1.0, 1.0]])

    def test_a_charge_lasts_as_many_steps_at_full_speed(self):
        assert self.way(alone(Imperfections(battery=30.0)), 100) == pytest.approx(30)

    def test_and_twice_as_many_at_half_speed(self):
        assert self.way(alone(Imperfections(battery=30.0), speed=0.5), 100) == pytest.approx(30)

    def test_break_downs_are_for_good_and_as_often_as_they_should_be(self):
        model = crowd(Imperfections(failure=0.01), robots=100).run(100)
        broken = int(model.swarm.columns["body.broken"].sum())
        assert broken == pytest.approx(100 * (1 - 0.99**100), abs=16)
        stands = np.flatnonzero(model.swarm.columns["body.broken"])
        before = model.swarm.position[stands].copy()
        pushed = np.abs(model.run(1).swarm.position[stands] - before).max(axis=1) > 0
        assert pushed.mean() < 0.2

    def test_wheels_never_turn_faster_than_they_can(self):
        model = alone(driving(error=2.0))
        places = [model.run(1).swarm.position[0].copy() for _ in range(50)]
        assert np.hypot(*np.diff(places, axis=0).T).max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_every_model_of_the_gallery_runs_with_imperfect_robots(name):
    model = find_model(name)(rng=1)
    model.imperfections = MEASURED
    model.run(20)
    assert np.isfinite(model.swarm.position).all()
