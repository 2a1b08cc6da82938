"""Each layer explains itself: what it did, and which readings made it do so."""

import math
import re

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT_FIRE, Radio, SwarmModel, all_round, disc
from mesa_swarm.control import (
    Align,
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Follow,
    Gather,
    HeadOn,
    Lead,
    MatchVelocity,
    Perimeter,
    Push,
    Respond,
    Separate,
    Subsumption,
    VectorSum,
)
from mesa_swarm.fire import FightFire
from mesa_swarm.models.fire_fighting import FireFighting
from support.explanations import AHEAD, FIRE, GLIDER, OBSTACLE, ROBOT, ROUND, explanation, first, watched

BESIDE = {side: disc((200 + 18 * math.cos(0.9), 150 + side * 18 * math.sin(0.9)), 3) for side in (1, -1)}


class TestAvoid:
    @pytest.mark.parametrize(
        ("obstacles", "does", "name", "index"),
        [
            ([AHEAD], "turns left while moving", "front", 0),
            ([BESIDE[1]], "turns right while moving", "left", 1),
            ([BESIDE[-1]], "turns left while moving", "right", 2),
        ],
    )
    def test_names_the_sensor_its_reading_and_the_distance(self, obstacles, does, name, index):
        model = watched(Avoid(distance=15), design=AGENT3, obstacles=obstacles)
        why = explanation(model.run(1))
        reading = model.watched["distance"][0, 0, index]
        assert (why.layer, why.does, why.sensors) == ("Avoid", does, (index,))
        assert why.reason == f"{name} sensor {reading:.1f} (an obstacle) < 15"

    def test_of_several_names_the_one_that_decided_and_marks_all(self):
        why = explanation(watched(Avoid(), design=AGENT3, obstacles=[AHEAD, *BESIDE.values()]).run(1))
        assert why.sensors == (0, 1, 2)
        assert why.reason.startswith("right sensor")

    def test_a_reading_that_is_rounded_up_to_the_distance_is_just_under_it(self):
        for x, words in ((224.97, "front sensor 15.0 (an obstacle) just under 15"), (224.9, "14.9 (an obstacle) < 15")):
            model = watched(Avoid(distance=15), design=AGENT3, obstacles=[disc((x, 150), 5)])
            assert explanation(model.run(1)).reason.endswith(words)

    def test_leaves_out_what_it_does_not_fear(self):
        model = watched(Avoid(loads="never", fires="never"), design=AGENT3, obstacles=[BESIDE[1]])
        model.add_load(disc((220, 150), 5), resistance=100)
        assert explanation(model.run(1)).sensors == (1,)
        model = watched(Avoid(fires="never"), design=AGENT3, obstacles=[BESIDE[1]])
        model.add_fire((222, 150), radius=4)
        assert explanation(model.run(1)).sensors == (1,)

    def test_distinguishes_a_load_and_a_fire_from_an_obstacle(self):
        model = watched(Avoid(), design=AGENT3)
        model.add_load(disc((220, 150), 5), resistance=100)
        assert "(a load)" in explanation(model.run(1)).reason
        model = watched(Avoid(), design=AGENT3)
        model.add_fire((220, 150), radius=5)
        assert "(a fire)" in explanation(model.run(1)).reason

    def test_when_hot_speaks_of_the_heat_that_it_knew(self):
        model = watched(Avoid(fires="when hot", distance=20), Explore(), design=AGENT_FIRE)
        model.add_fire((222, 150), radius=12)
        first(model).temperature = 200
        model.swarm.columns["hot"][0] = True
        named = set()
        for _ in range(400):
            named.add(explanation(model.run(1)).layer)
        assert named == {"Avoid", "Explore"}


class TestExplore:
    def test_reports_that_no_other_layer_is_active(self):
        why = explanation(watched(Explore(speed=0.5)).run(1))
        assert (why.layer, why.does, why.reason, why.sensors) == (
            "Explore", "goes ahead at 0.5", "nothing else wants to drive", (),
        )  # fmt: skip

    def test_reports_when_it_turns_by_chance(self):
        model = watched(Explore(turn_interval=5))
        named = set()
        for _ in range(40):
            why = explanation(model.run(1))
            turns = model.swarm.command[0, 0] != model.swarm.command[0, 1]
            assert (why.reason == "a random turn is due") == turns
            assert why.does.endswith("on the spot") == turns
            named.add(bool(turns))
        assert named == {True, False}

    def test_without_random_turns_never_speaks_of_one_though_other_layers_turn_the_sum(self):
        model = watched(Explore(), design=AGENT3, obstacles=[AHEAD])
        model.control = VectorSum(Avoid(distance=15), Explore(), weights=(0.1, 1))
        why = explanation(model.run(1))
        assert (why.layer, why.does) == ("Explore", "turns left while moving")
        assert "random" not in why.reason


class TestFollow:
    @pytest.mark.parametrize(
        ("x", "sign", "does"),
        [(240, ">", "goes ahead at 1"), (225, "<=", "goes ahead at 0.7"), (220, "<=", "goes ahead at 0.7")],
    )
    def test_names_the_nearest_ahead_and_compares_the_gap(self, x, sign, does):
        model = watched(Follow(gap=15), poses=[(200, 150, 0.0), (x, 150, 0.0), (160, 150, 0.0)])
        why = explanation(model.run(1))
        assert (why.sensors, why.does) == ((0,), does)
        assert why.reason == f"nearest robot ahead: front sensor {x - 210:.1f} {sign} gap 15"

    def test_without_a_gap_names_none(self):
        why = explanation(watched(Follow(gap=None), poses=[(200, 150, 0.0), (240, 150, 0.0)]).run(1))
        assert why.reason == "nearest robot ahead: front sensor 30.0"

    def test_turns_to_one_at_the_side(self):
        why = explanation(
            watched(Follow(), poses=[(200, 150, 0.0), (200 + 30 * math.cos(1), 150 + 30 * math.sin(1), 0.0)]).run(1)
        )
        assert why.does == "turns left on the spot"
        assert "sensor at +60 degrees" in why.reason


class TestGather:
    def test_reports_where_the_centroid_is(self):
        why = explanation(watched(Gather(), poses=[(200, 150, 0.0), (200, 190, 0.0)]).run(1))
        assert (why.layer, why.does, why.sensors) == ("Gather", "turns left on the spot", (5,))
        assert why.reason == "the centroid of the robots it sees is 35.0 away at +90 degrees"

    def test_reports_that_it_stays_when_it_is_near(self):
        why = explanation(watched(Gather(stop_distance=40), poses=[(200, 150, 0.0), (225, 150, 0.0)]).run(1))
        assert why.does == "stays"


def test_head_on_names_the_robot_that_it_meets_or_has_met():
    poses = [(150, 150, 0.0), (230, 150, math.pi)]
    model = watched(HeadOn(distance=40), Explore(), poses=poses)
    reasons = []
    for _ in range(120):
        why = explanation(model.run(1))
        if why.layer == "HeadOn":
            assert all(model.watched["kind"][-1, 0, list(why.sensors)] == ROBOT)
            reasons.append(why.reason)
    assert reasons[0].startswith("it met a robot head-on (front sensor ")
    assert reasons[0].endswith("(a robot)): it turns round to lead or to follow")


@pytest.mark.slow
def test_head_on_by_number_explains_which_robot_waits():
    model = watched(HeadOn(distance=40, leader="number"), Explore(), poses=[(150, 150, 0.0), (230, 150, math.pi)])
    model.communication = Radio(message=("number", "follows"))
    reasons = set()
    for _ in range(60):
        model.step()
        reasons |= {why.reason for why in map(model.explain, model.robots) if why.layer == "HeadOn"}
    assert any(reason.endswith("it waits for that to turn round, and follows") for reason in reasons)
    assert any(reason.endswith("it turns round to lead or to follow") for reason in reasons)


def test_lead_states_that_it_leads():
    model = watched(Lead(), Explore(), poses=[(150, 150, 0.0), (230, 150, math.pi)])
    model.communication = Radio(message=("rank",))
    model.run(2)
    leads = [model.explain(robot) for robot in model.robots]
    assert sorted(why.layer for why in leads) == ["Explore", "Lead"]
    assert "no robot that it hears has a lower rank: it leads" in [why.reason for why in leads]


def test_match_velocity_reports_how_many_sensors_see_robots():
    model = watched(MatchVelocity(), Explore(), poses=[(100, 150, 0.0), (130, 150, 0.0)])
    why = explanation(model.run(30))
    seeing = np.flatnonzero(model.watched["kind"][-1, 0] == ROBOT)
    assert why.layer == "MatchVelocity"
    assert sorted(why.sensors) == seeing.tolist()
    assert why.reason == f"it matches the motion of the robots that {len(seeing)} of its sensors see"


@pytest.mark.parametrize(
    ("x", "where"), [(300, "outside"), (246, "on"), (251, "at the edge of"), (239, "at the edge of"), (225, "inside")]
)
def test_perimeter_reports_the_side_of_the_ring(x, where):
    why = explanation(
        watched(Perimeter(ring=40, tolerance=4), design=ROUND, poses=[(200, 150, 0.0), (x, 150, 0.0)]).run(1)
    )
    assert why.reason.endswith(f"away: {where} the ring of 40")


class TestPush:
    def model(self, x, beacons, **options):
        radio = Radio(range=2000, state=False, occlusion=True, beacons=beacons)
        model = watched(Push(**options), design=ROUND, poses=[(x, 150, 0.0)], communication=radio)
        model.add_load(disc((200, 150), 25), resistance=100)
        return explanation(model.run(1))

    def test_without_a_radio_the_reason_is_the_one_without_a_call(self):
        model = watched(Push(), design=ROUND, poses=[(100, 150, 0.0)])
        model.add_load(disc((200, 150), 25), resistance=100)
        assert explanation(model.run(1)).reason.endswith("no goal is to be heard here, so it pushes")

    def test_pushes_where_the_goal_is_hidden(self):
        why = self.model(100, [(380, 150)])
        assert (why.does, why.sensors) == ("goes ahead at 1", (0,))
        assert why.reason == "front sensor 70.0 (a load); no goal is to be heard here, so it pushes"

    def test_goes_round_where_it_hears_the_goal(self):
        why = self.model(100, [(20, 150)])
        assert why.reason.endswith("it hears the goal, so it goes round")
        assert "turns" in why.does

    def test_reports_that_it_pushes_from_anywhere(self):
        assert self.model(100, [(20, 150)], side="anywhere").reason.endswith("it pushes from anywhere")


@pytest.mark.parametrize(("to", "what"), [("goal", "a goal"), ("state", "a robot at work")])
def test_respond_reports_where_the_call_came_from(to, what):
    model = watched(
        FightFire(), Respond(to=to), design=AGENT_FIRE, poses=[(300, 150, 0.0), (136, 150, math.pi)],
        communication=Radio(range=300, state=to == "state", goal=to == "goal"),
    )  # fmt: skip
    model.add_fire((100, 150), radius=30)
    why = explanation(model.run(4))
    x, y = model.watched["heard_from" if to == "state" else "heard_goal"][-1, 0]
    away, degrees = math.hypot(x, y), math.degrees(math.atan2(y, x))
    assert why.reason == f"it heard of {what} {away:.0f} away at {degrees:+.0f} degrees"
    assert why.layer == "Respond"


class TestFightFire:
    def test_its_words_agree_with_what_it_does_in_every_step(self):
        model = FireFighting(n_robots=1, rng=1)
        model.remove_robots(model.robots)
        (x, y), radius = model.fires.position[1], model.fires.radius[1]
        model.add_robots(AGENT_FIRE, poses=[(x + radius + 30, y, math.pi)])
        model.watch()
        does = {
            "it goes to a fire": ("goes ahead", "turns"),
            "it puts out a fire": ("stays",),
            "and backs out of the heat": ("backs up",),
            "and waits until it is cool": ("stays",),
        }
        heard = set()
        for _ in range(600):
            why = explanation(model.run(1))
            (words,) = [words for words in does if words in why.reason] if why.layer == "FightFire" else [None]
            heard.add(words)
            assert words is None or why.does.startswith(does[words]), why
            kinds = model.watched["kind"][-1, 0, list(why.sensors)]
            assert (kinds == FIRE).all()
        assert set(does) <= heard

    def test_names_the_nearest_sensor_that_sees_the_fire(self):
        model = watched(FightFire(), design=AGENT_FIRE, poses=[(180, 150, math.pi)])
        model.add_fire((100, 150), radius=30)
        why = explanation(model.run(1))
        assert why.reason == "it goes to a fire (front sensor 45.0 (a fire))"
        assert why.sensors == (0,)


class TestBoids:
    POSES = ((200, 150, 0.0), (217, 150, 0.0))

    @pytest.mark.parametrize(("what", "things"), [("robots", {ROBOT}), ("others", {OBSTACLE}), ("everything", {0, 1})])
    def test_separate_names_only_what_it_separates_from(self, what, things):
        model = watched(Separate(what=what), design=GLIDER, poses=self.POSES, obstacles=[disc((183, 150), 5)])
        why = explanation(model.run(1))
        assert set(model.watched["kind"][-1, 0, list(why.sensors)].tolist()) == things
        assert (model.watched["distance"][-1, 0, list(why.sensors)] < 15).all()
        assert why.reason.startswith("near: ")
        assert ("(a robot)" in why.reason, "(an obstacle)" in why.reason) == (ROBOT in things, OBSTACLE in things)

    def test_cohere_reports_how_far_the_centroid_is(self):
        why = explanation(watched(Cohere(), design=GLIDER, poses=[(200, 150, 0.0), (240, 150, 0.0)]).run(1))
        assert re.fullmatch(r"the centroid of the robots it sees is 3\d\.\d away", why.reason)
        assert re.fullmatch(r"moves at 0\.\d+ towards [+-]0 degrees", why.does)

    def test_align_reports_how_many_sensors_see_robots(self):
        model = watched(Align(), Cruise(), design=GLIDER, poses=[(100, 150, 0.0), (130, 150, 0.0)])
        assert explanation(model.run(1)).layer == "Cruise"
        why = explanation(model.run(9))
        assert why.layer == "Align"
        assert why.reason == f"it moves as the robots that {len(why.sensors)} of its sensors see"

    def test_cruise_needs_nothing(self):
        why = explanation(watched(Cruise(speed=0.5), design=GLIDER).run(1))
        assert (why.does, why.reason) == ("moves at 0.5 towards +0 degrees", "it goes on as before")


@pytest.mark.parametrize("heading_degrees", range(0, 360, 15))
def test_push_names_the_sensor_that_decides_also_among_equals(heading_degrees):
    model = SwarmModel(map="openspace", rng=1)
    model.add_load(disc((300, 300), 20), resistance=9)
    model.add_robots(all_round(12, range=150), poses=[(240, 300, math.radians(heading_degrees))])
    model.control = Subsumption(Push(side="anywhere"))
    model.watch()
    why = explanation(model.run(1))
    bearing = model.swarm.table.bearing[0, why.sensors[0]]
    turns = 0 if abs(bearing) <= math.radians(20) else math.copysign(1, bearing)
    assert why.does.split()[1] == {0: "ahead", 1: "left", -1: "right"}[turns]
