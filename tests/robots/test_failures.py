"""Batteries, and failures of single robots: what stands, what reads nothing, what is stored of it."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, AGENT_FIRE, LineSensor, Radio, RobotDesign, Sensor, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Lead, Subsumption
from mesa_swarm.dashboard.run.inspector import inspect
from mesa_swarm.fire import FightFire
from mesa_swarm.robots.drive import HolonomicDrive, OmniDrive
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from mesa_swarm.robots.swarm import LASTING
from support.scenes import empty


@dataclass(frozen=True, kw_only=True, slots=True)
class Clock(Sensor):
    """A custom sensor with two numbers."""

    name = "clock"
    width = 2

    @staticmethod
    def read(out):
        out[:] = 7.0


FULL = RobotDesign(name="full", sensors=(*AGENT_FIRE.sensors[:3], Clock(), LineSensor(), AGENT_FIRE.sensors[-1]))


class Crowd(SwarmModel):
    """Robots of which some fail, as a model that can be recorded."""

    def __init__(self, *, n_robots=12, battery=0.0, sensor_failure=0.0, wheel_failure=0.0, rng=None):
        super().__init__(map="original", rng=rng)
        self.add_robots(replace(AGENT9, battery=battery), n_robots)
        self.control = Subsumption(Avoid(distance=15), Explore())
        failing = Imperfections(sensor_failure=sensor_failure, wheel_failure=wheel_failure)
        if failing != Imperfections():
            self.imperfections = failing


def straight(design=AGENT3, n=1):
    """Return a model of robots in the open, far apart, that drive straight on."""
    model = empty(2000, 2000)
    model.add_robots(design, poses=[(200, 200 + 300 * k, 0.0) for k in range(n)])
    model.control = Subsumption(Explore())
    return model


def among_things():
    """Return a model of two robots that see an obstacle, feel a fire and stand on a mark."""
    model = SwarmModel(map="openspace", rng=1)
    for y in (200, 400):
        model.add_obstacle(disc((330, y), 10))
        model.add_obstacle(disc((300, y), 3, contact=False))
    model.add_fire((345, 300), radius=15)
    model.add_robots(FULL, poses=[(300, 200, 0.0), (300, 400, 0.0)])
    return model


class TestStop:
    def test_a_robot_that_stops_stands_until_it_is_repaired_and_others_go_on(self):
        model = straight(n=2).run(3)
        model.robots[0].fail("stop")
        assert model.robots[0].failures == ("stop",)
        before = model.swarm.position.copy()
        model.run(10)
        assert (model.swarm.position - before).tolist() == [[0.0, 0.0], [10.0, 0.0]]
        assert model.swarm.slip[0].tolist() == [1.0, 1.0]
        model.robots[0].repair()
        model.run(5)
        assert model.swarm.position[0, 0] == pytest.approx(before[0, 0] + 5)


class TestSensor:
    def test_one_that_fails_reads_nothing_and_the_others_what_they_did(self):
        model = among_things()
        for index in range(len(FULL.sensors)):
            model.robots[0].repair()
            model.sense()
            whole = {
                name: model.swarm.columns[name].copy() for name in ("distance", "kind", "line", "radiation", "clock")
            }
            assert whole["distance"][0, 0] > 0
            assert whole["line"].all()
            model.robots[0].fail("sensor", index=index)
            assert model.robots[0].failures == (f"sensor {index}",)
            model.sense()
            read = {name: model.swarm.columns[name] for name in whole}
            if index < 3:
                whole["distance"][0, index], whole["kind"][0, index] = -1, -1
            elif index == 3:
                whole["clock"][0] = math.nan
            elif index == 4:
                whole["line"][0, 0] = False
            else:
                whole["radiation"][0, 0] = 0.0
            for name, column in whole.items():
                assert np.array_equal(read[name], column, equal_nan=column.dtype.kind == "f"), (index, name)

    def test_a_robot_that_is_blind_ahead_runs_into_what_others_avoid(self):
        struck = []
        for blind in (False, True):
            model = empty()
            model.add_robots(AGENT3, poses=[(340, 150, 0.0)], tendency="left")
            model.control = Subsumption(Avoid(distance=15), Explore())
            for index in range(3 * blind):
                model.robots[0].fail("sensor", index=index)
            struck.append(model.run(80).total_collisions)
        assert struck[0] == 0 < struck[1]

    def test_reading_twice_is_the_same_and_noise_does_not_wake_a_sensor_that_failed(self):
        model = among_things()
        model.imperfections = Imperfections(sensing=Imperfection(outliers=1.0))
        model.robots[0].fail("sensor", index=0)
        for _ in range(5):
            model.sense()
            assert model.swarm.distance[0, 0] == -1
            model.step()


class TestWheel:
    def test_a_stuck_one_stands_and_the_robot_turns_about_it(self):
        model = straight()
        model.robots[0].fail("wheel", index=0)
        assert model.robots[0].failures == ("wheel 0 stuck",)
        pivot = model.swarm.position[0] + (0, AGENT3.radius)
        for _ in range(20):
            model.step()
            side = model.swarm.heading[0] + np.pi / 2
            wheel = model.swarm.position[0] + AGENT3.radius * np.array([np.cos(side), np.sin(side)])
            assert wheel == pytest.approx(pivot)
        assert model.swarm.command[0].tolist() == [1.0, 1.0]
        assert model.swarm.slip[0].tolist() == [1.0, 0.0]

    def test_a_free_one_follows_the_other_so_that_the_robot_never_turns(self):
        model = SwarmModel(map="original", rng=3)
        (robot,) = model.add_robots(AGENT3, poses=[(300, 200, 0.3)])
        model.control = Subsumption(Avoid(distance=40, turn="stationary"))
        robot.fail("wheel", index=1, how="free")
        assert robot.failures == ("wheel 1 free",)
        model.run(30)
        assert robot.heading == pytest.approx(0.3)

    def test_both_free_stand(self):
        model = straight()
        for index in range(2):
            model.robots[0].fail("wheel", index=index, how="free")
        assert model.run(5).swarm.position[0].tolist() == [200, 200]

    def test_each_of_an_omni_drive_may_be_stuck_but_none_free_and_bodies_that_slide_have_none(self):
        model = SwarmModel(rng=1)
        (omni,) = model.add_robots(RobotDesign(drive=OmniDrive()), 1)
        omni.fail("wheel", index=2)
        (slider,) = model.add_robots(RobotDesign(drive=HolonomicDrive()), 1)
        for robot, how in ((omni, "free"), (slider, "stuck"), (slider, "free")):
            with pytest.raises(InvalidValueError, match=r"^what is 'wheel', how is"):
                robot.fail("wheel", index=0, how=how)


class TestStoppedAtItsWheelsOnly:
    def test_it_still_senses_and_broadcasts_and_leads(self):
        model = empty(communication=Radio(message=("rank",)))
        robots = model.add_robots(AGENT9, poses=[(100, 150, 0.0), (130, 150, 0.0)])
        model.control = Subsumption(Lead())
        leader = robots[int(np.flatnonzero(model.run(2).swarm.layer == 0)[0])]
        leader.fail("stop")
        place = leader.position.tolist()
        model.run(5)
        assert leader.position.tolist() == place
        assert leader.layer == 0
        assert [robot.layer for robot in robots if robot is not leader] == [-1], "it is heard"
        assert (leader.command > 0).all()
        robots[0].fail("stop")
        model.sense()
        assert (robots[0].distance >= 0).any()

    @pytest.mark.parametrize("empty_battery", [False, True])
    def test_it_still_cools_a_fire_at_which_it_stands(self, empty_battery):
        def hottest(robots):
            model = empty()
            fire = model.add_fire((200, 150), radius=20, temperature=0.5)
            for robot in model.add_robots(replace(AGENT_FIRE, battery=9), poses=[(174.5, 150, 0.0)] * robots):
                if empty_battery:
                    model.swarm.columns[f"{LASTING}used"][:] = 9
                else:
                    robot.fail("stop")
            model.control = Subsumption(FightFire(), Explore())
            model.run(50)
            assert [robot.fire for robot in model.robots] == [0] * robots
            assert all(robot.failures for robot in model.robots)
            return fire.temperature

        assert hottest(1) < hottest(0)

    def test_it_still_holds_what_it_carries(self):
        model = empty()
        (robot,) = model.add_robots(AGENT9, poses=[(100, 150, 0.0)])
        puck = model.add_body(disc((200, 200), 2), kind="puck")
        model.attach(robot, puck)
        robot.fail("stop")
        model.run(3)
        assert puck.carrier is robot


class TestBattery:
    def test_it_empties_with_the_way_of_the_wheels_and_the_robot_then_stands(self):
        model = straight(replace(AGENT3, battery=40))
        levels = [float(model.run(1).swarm.battery[0]) for _ in range(50)]
        assert levels[:40] == pytest.approx([1 - k / 40 for k in range(1, 41)])
        assert levels[40:] == [0.0] * 10
        assert model.swarm.position[0, 0] == pytest.approx(240)
        assert model.robots[0].battery == 0.0

    def test_each_design_has_its_own_and_others_that_of_the_model(self):
        model = straight(replace(AGENT3, battery=10), n=2)
        model.add_robots(AGENT9, poses=[(200, 1000, 0.0)])
        assert model.run(5).swarm.battery.tolist() == [0.5, 0.5, 1.0]
        model.imperfections = Imperfections(battery=20)
        assert model.run(5).swarm.battery.tolist() == pytest.approx([0.5, 0.5, 0.75])

    def test_robots_without_one_are_as_ever_and_full(self):
        plain, charged = Crowd(rng=1).run(60), Crowd(rng=1, battery=1e6).run(60)
        assert plain.swarm.battery.tolist() == [1.0] * 12
        assert plain.imperfections is None
        assert np.array_equal(plain.swarm.position, charged.swarm.position)

    def test_an_empty_one_is_among_the_failures_until_it_is_repaired(self):
        model = straight(replace(AGENT3, battery=4), n=2)
        robot = model.run(3).robots[0]
        assert robot.failures == ()
        before = model.run(1).state_hash()
        assert robot.failures == ("battery empty",)
        robot.fail("stop")
        robot.fail("wheel", index=0)
        assert robot.failures == ("stop", "battery empty", "wheel 0 stuck")
        robot.repair()
        assert robot.failures == ()
        again = straight(replace(AGENT3, battery=4), n=2).run(4)
        assert again.state_hash() == before, "looking changes nothing"

    def test_an_empty_one_of_the_whole_model_is_shown_by_the_inspector(self):
        model = straight()
        model.imperfections = Imperfections(battery=4)
        model.watch(columns=tuple(name for name in model.swarm.columns if "." not in name))
        facts = dict(inspect(model.run(6), model.robots[0], 6)["facts"])
        assert (facts["Battery"], facts["Failed"]) == ("0 %", "battery empty")

    def test_repair_fills_it(self):
        model = straight(replace(AGENT3, battery=4)).run(6)
        model.robots[0].repair()
        assert model.swarm.battery[0] == 1.0
        assert model.run(2).swarm.position[0, 0] == pytest.approx(206)


class TestChance:
    @pytest.mark.parametrize(
        ("name", "what", "places"), [("sensor_failure", "sensor", 9), ("wheel_failure", "wheel", 2)]
    )
    def test_sensors_and_wheels_fail_with_the_probability_given(self, name, what, places):
        rate, steps, robots = 0.002, 100, 60
        model = SwarmModel(map="openspace", rng=10_001)
        model.add_robots(AGENT9, robots)
        model.control = Subsumption(Avoid(distance=15), Explore())
        model.imperfections = Imperfections(**{name: rate})
        model.run(steps)
        failed = [one for robot in model.robots for one in robot.failures]
        assert all(one.startswith(what) for one in failed)
        expected = robots * places * (1 - (1 - rate) ** steps)
        assert abs(len(failed) - expected) < 4 * math.sqrt(expected)

    def test_the_dial_turns_them_down(self):
        half = Imperfections(sensor_failure=0.2, wheel_failure=0.1).at(0.5)
        assert (half.sensor_failure, half.wheel_failure) == (0.1, 0.05)


class TestStored:
    def test_failures_by_chance_are_verified_and_resumed(self, tmp_path):
        model = Crowd(rng=2, battery=500.0, sensor_failure=0.002, wheel_failure=0.002)
        with model.record(tmp_path / "run.arrow", checkpoint_every=20):
            model.run(60)
        assert any(robot.failures for robot in model.robots)
        assert Crowd.verify(tmp_path / "run.arrow").same
        assert Crowd.resume(tmp_path / "run.arrow", step=30).run(30).state_hash() == model.state_hash()

    def test_failures_by_hand_are_recorded_verified_and_resumed(self, tmp_path):
        model = Crowd(rng=2)
        with model.record(tmp_path / "run.arrow", checkpoint_every=20):
            model.run(25)
            model.robots[3].fail("wheel", index=1)
            model.robots[4].fail("sensor", index=0)
            model.robots[5].fail("stop")
            model.run(10)
            model.robots[5].repair()
            model.run(25)
        assert Crowd.verify(tmp_path / "run.arrow").same
        for step in (30, 45):
            again = Crowd.resume(tmp_path / "run.arrow", step=step)
            assert again.robots[3].failures == ("wheel 1 stuck",)
            assert again.robots[5].failures == (("stop",) if step == 30 else ())
        assert again.run(15).state_hash() == model.state_hash()

    def test_robots_that_are_added_or_removed_take_theirs_with_them(self):
        model = straight(n=3)
        model.robots[1].fail("sensor", index=1)
        model.robots[2].fail("wheel", index=0)
        model.robots[0].remove()
        model.add_robots(AGENT9, poses=[(1500, 1500, 0.0)])
        assert [robot.failures for robot in model.robots] == [("sensor 1",), ("wheel 0 stuck",), ()]
        model.run(2)

    def test_the_fingerprint_differs_where_something_failed(self):
        hashes = set()
        for what, index in ((None, None), ("stop", None), ("sensor", 1), ("wheel", 1)):
            model = straight()
            if what:
                model.robots[0].fail(what, index)
            hashes.add(model.state_hash())
        assert len(hashes) == 4


def test_the_inspector_shows_the_battery_and_what_failed():
    model = Crowd(rng=1, battery=100.0)
    model.robots[0].fail("sensor", index=2)
    model.watch(columns=tuple(name for name in model.swarm.columns if "." not in name))
    model.run(10)
    facts = dict(inspect(model, model.robots[0], 10)["facts"])
    assert facts["Failed"] == "sensor 2"
    assert facts["Battery"].endswith("%")
    assert "Failed" not in dict(inspect(model, model.robots[1], 10)["facts"])


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        (("leg",), UnknownNameError, "what"),
        (("sensor",), InvalidValueError, "index is None"),
        (("sensor", 9), InvalidValueError, "index of a sensor is 9"),
        (("sensor", -1), InvalidValueError, "index of a sensor is -1"),
        (("wheel", 2), InvalidValueError, "index of a wheel is 2"),
        (("wheel", 0.5), InvalidValueError, "index of a wheel is 0.5"),
        (("wheel", 0, "loose"), UnknownNameError, "how"),
    ],
)
def test_wrong_failures_are_refused_in_one_line_and_change_nothing(given, error, words):
    model = SwarmModel(rng=1)
    (robot,) = model.add_robots(AGENT9, 1)
    before = model.state_hash()
    with pytest.raises(error, match=words) as caught:
        robot.fail(*given)
    assert "\n" not in str(caught.value)
    assert model.state_hash() == before


def test_a_removed_robot_neither_fails_nor_is_repaired():
    model = SwarmModel(rng=1)
    (robot,) = model.add_robots(AGENT9, 1)
    robot.remove()
    for act in (lambda: robot.fail("stop"), robot.repair, lambda: robot.failures, lambda: robot.battery):
        with pytest.raises(RemovedRobotError):
            act()
