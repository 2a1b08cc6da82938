"""What robots carry, as compiled code grips it, puts it down and lets it go: the same as Shapely finds."""

import math

import mesa
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT9,
    Carried,
    Gripper,
    Map,
    RobotDesign,
    SwarmModel,
    disc,
    draw_number,
    polygon,
    process,
    rectangle,
)
from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control import Explore, Subsumption, behaviour
from mesa_swarm.world.bodies import placed
from mesa_swarm.world.movers import find_occupied_room

DESIGN = RobotDesign(sensors=(*AGENT9.sensors, Carried()), actuators=(Gripper(reach=4.0, field_of_view_degrees=150),))
FLOOR = Map(name="floor", bounds=(0, 0, 100, 100))
TURNS = np.radians([0, 15, -15, 30, -30, 45, -45, 60, -60])
SHAPES = {
    "disc": lambda x, y: disc((x, y), 2.0),
    "bar": lambda x, y: rectangle((x - 4, y - 1), (x + 4, y + 1)),
    "hook": lambda x, y: polygon([(x, y), (x + 6, y), (x + 6, y + 2), (x + 2, y + 2), (x + 2, y + 6), (x, y + 6)]),
}
shapes, places = st.sampled_from(sorted(SHAPES)), st.tuples(st.floats(20, 80), st.floats(20, 80))


@behaviour
def hold(me, grip=1.0):
    me.act.grip = grip
    return 0.0, 0.0


def crowded(shape, others, around):
    """Return a model with a robot that carries a body of a shape, other bodies, robots and obstacles."""
    model = SwarmModel(map=FLOOR, rng=1)
    carried = model.add_body(SHAPES[shape](30, 30), kind="puck")
    for name, place in others:
        model.add_body(SHAPES[name](*place), kind="puck")
    model.add_obstacle(rectangle((60, 40), (75, 90)))
    model.add_obstacle(disc((40, 62), 9))
    model.add_robots(DESIGN, poses=[(50, 50, 0.3), *((x, y, 0.0) for x, y in around)])
    model.attach(model.robots[0], carried)
    return model, carried


def place_by_shapely(model, carried):
    """Return where a body is to be put down, None where there is no room, by geometries alone."""
    robot = carried.carrier
    for turn in TURNS:
        azimuth, far = float(robot.heading) + turn, float(robot.radius) + (1 + 1e-6) * carried.form.reach
        pose = robot.position[0] + far * math.cos(azimuth), robot.position[1] + far * math.sin(azimuth), azimuth
        core = placed(carried.form.core, pose).buffer(carried.form.core_radius, 256)
        robots = [shapely.Point(other.position).buffer(float(other.radius), 256) for other in model.robots]
        solid = [geometry.buffer(radius, 256) for geometry, radius in find_occupied_room(model.bodies)]
        inside = shapely.box(*model.map.bounds).covers(core)
        if inside and all(shapely.intersection(core, other).area < 1e-6 for other in (*robots, *solid)):
            return pose
    return None


@given(shapes, st.lists(st.tuples(shapes, places), max_size=4), st.lists(places, max_size=3))
def test_a_body_is_put_down_where_shapely_finds_the_first_room(shape, others, around):
    model, carried = crowded(shape, others, around)
    pose = place_by_shapely(model, carried)
    assert model.release(model.robots[0]) == (pose is not None)
    if pose is not None:
        assert carried.position == pytest.approx(pose[:2], abs=1e-9)


@given(st.lists(st.tuples(shapes, places), min_size=1, max_size=6), st.floats(-3, 3))
def test_the_nearest_body_within_reach_is_gripped_and_no_other(others, heading):
    model = SwarmModel(map=FLOOR, rng=1)
    bodies = [model.add_body(SHAPES[name](*place), kind="puck") for name, place in others]
    model.add_robots(DESIGN, poses=[(50, 50, heading)])
    robot, gaps = model.robots[0], []
    for body in bodies:
        distance, azimuth = body.seen_from(np.array([50.0, 50.0]))
        bearing = math.remainder(azimuth - heading, math.tau)
        near = distance - robot.radius <= 4.0 and abs(bearing) <= math.radians(75)
        gaps.append(distance if near else math.inf)
    model.swarm.columns["act.grip"][:] = 1.0
    model.parts.robots.devices.act(model, model.parts.bodies.scene())
    carried = [body.carrier is not None for body in bodies]
    assert sum(carried) == (min(gaps) < math.inf)
    if sum(carried):
        assert gaps[carried.index(True)] == pytest.approx(min(gaps), abs=1e-9)


def test_what_was_sent_elsewhere_keeps_its_way_free_until_it_is_there():
    model = SwarmModel(rng=1)
    one, other = (model.add_body(disc((x, 100), 2), kind="puck") for x in (200, 300))
    model.add_robots(DESIGN, poses=[(100, 100, 0.0)])
    model.run(1)
    model.attach(model.robots[0], one)
    other.position = (107, 100)
    assert model.release(model.robots[0])
    assert np.hypot(*(one.position - (107, 100))) >= 4.0


def test_robots_below_a_removed_one_still_carry_what_they_carried():
    model = SwarmModel(rng=1)
    pucks = [model.add_body(disc((100 + 50 * k, 300), 2), kind="puck") for k in range(4)]
    model.add_robots(DESIGN, poses=[(100 + 50 * k, 100, 0.0) for k in range(4)])
    model.control = Subsumption(hold())
    robots = list(model.robots)
    for robot, puck in zip(robots, pucks, strict=True):
        model.attach(robot, puck)
    model.remove_robots([robots[0], robots[2]])
    assert [puck.carrier for puck in pucks] == [None, robots[1], None, robots[3]]
    model.run(3)
    assert pucks[3].position.tolist() == robots[3].position.tolist()


# ---- processes that send bodies


@process(memory={"done": 0})
def send(bodies_aim, bodies_carrier, done, x=300.0, y=300.0):
    for b in range(len(bodies_carrier)):
        if bodies_carrier[b] >= 0:
            bodies_aim[b, 0], bodies_aim[b, 1] = x, y
            done[0] += 1


def carrying(**sent):
    model = SwarmModel(rng=1)
    puck = model.add_body(disc((108, 100), 2), kind="puck")
    model.add_robots(DESIGN, poses=[(100, 100, 0.0), (300, 250, 0.0)])
    model.control = Subsumption(hold())
    model.attach(model.robots[0], puck)
    return model, puck, model.add_process(send(**sent))


def test_a_process_sends_what_is_carried_elsewhere_and_it_is_there_at_once():
    model, puck, _ = carrying()
    model.run(1)
    assert (puck.carrier, puck.position.tolist()) == (None, [300.0, 300.0])
    model.run(1)
    assert model.robots[0].carried.tolist() == [-1]


def test_what_is_sent_where_a_robot_is_stays_with_its_robot_until_there_is_room():
    model, puck, sending = carrying(y=253.0)
    model.run(3)
    assert puck.carrier is model.robots[0]
    model.robots[1].position = (500, 250)
    model.run(1)
    assert (puck.carrier, puck.position.tolist()) == (None, [300.0, 253.0])
    assert sending.done == 4


@pytest.mark.parametrize("sent", [{"x": -5.0}, {"x": 1e9}, {"y": 1e300}])
def test_a_place_that_is_not_on_the_map_is_refused_in_one_line_and_forgotten(sent):
    model, puck, _ = carrying(**sent)
    with pytest.raises(BehaviourError, match=r"^a process sent body \d+ to \[.*\] in step 1; expected x and y within"):
        model.run(1)
    assert puck.carrier is model.robots[0]
    model.parts.processes.have({})
    model.run(5)


@process
def scatter_badly(bodies_aim, bodies_kind, step, kind=0):
    count = 0
    for b in range(len(bodies_kind)):
        if bodies_kind[b] == kind and step == 3:
            bodies_aim[b, 0] = 300.0 if count == 0 else np.nan if count < 3 else 5000.0
            count += 1


def test_where_one_body_is_refused_all_stay_and_none_is_hidden():
    model = SwarmModel(rng=1)
    model.add_obstacle(disc((-5, 50), 20))
    bodies = [model.add_body(disc((108 + 60 * k, 100), 2), kind="puck") for k in range(4)]
    model.add_robots(DESIGN, poses=[(100, 100, 0.0), (300, 88, math.pi / 2)])
    model.control = Subsumption(hold())
    model.attach(model.robots[0], bodies[0])
    model.add_process(scatter_badly(kind=model.kind_code("puck")))
    before = [body.position.tolist() for body in bodies[1:]]
    with pytest.raises(BehaviourError, match=rf"a process sent body {bodies[1].unique_id} to \[nan"):
        model.run(5)
    model.run(3)
    assert bodies[0].carrier is model.robots[0] or bodies[0].position[0] == 300
    assert [body.position.tolist() for body in bodies[1:]] == before
    assert not np.isnan(model.parts.bodies.scene().statics.discs[2:]).any()


@process
def drift(bodies_aim, bodies_kind, kind=0, stride=1.0):
    for b in range(len(bodies_kind)):
        if bodies_kind[b] == kind:
            bodies_aim[b, 0] += stride


def test_bodies_go_where_a_process_sends_them_and_robots_give_way():
    model = SwarmModel(rng=1)
    sheep = model.add_body(disc((100, 100), 5), kind="sheep")
    model.add_robots(AGENT9, poses=[(115, 100, 0.0)])
    model.add_process(drift(kind=model.kind_code("sheep")))
    assert "driven: up to 1000 steps" in str(model.run(1).plan)
    model.run(30)
    assert sheep.position.tolist() == [130.0, 100.0]
    assert np.hypot(*(model.robots[0].position - sheep.position)) >= 10.0 - 1e-6


def test_a_process_reads_where_bodies_are_and_cannot_move_them_itself():
    @process
    def shove(bodies_position):
        bodies_position[0, 0] = 3.0

    model = SwarmModel(rng=1)
    model.add_body(disc((100, 100), 5))
    model.add_process(shove)
    with pytest.warns(match="plain Python"), pytest.raises(BehaviourError, match="read-only"):
        model.run(1)


# ---- bodies that no process can send


@process
def send_all(bodies_aim, bodies_aim_heading, bodies_kind, step, kind=0, when=3, turn=0.0):
    for b in range(len(bodies_kind)):
        if bodies_kind[b] == kind and step == when:
            bodies_aim[b, 0] += 50.0 if turn == 0.0 else 0.0
            bodies_aim_heading[b] += turn


class Walker(mesa.Agent):
    def __init__(self, model, **attributes):
        super().__init__(model)
        self.__dict__ |= attributes


MADE = {
    "is at rest": {"mode": "fixed"},
    "is pushed by robots": {"mode": "pushed", "resistance": 0.5},
    "follows an agent": {},
}


def world_of(why, beside=(), **sent):
    """Return a model with two bodies of a kind that cannot be sent, and a process that sends them all the same."""
    model = SwarmModel(rng=1)
    for x in beside:
        model.add_body(disc((x, 300), 5), kind="sheep")
    for x in (300, 500):
        agent = {"agent": Walker(model, position=(x, 100), heading=0.0)} if why == "follows an agent" else {}
        model.add_body(disc((x, 100), 5), kind="thing", **MADE[why], **agent)
    model.add_robots(AGENT9, 3)
    model.add_process(send_all(kind=model.kind_code("thing"), **sent))
    return model


@pytest.mark.parametrize("turn", [0.0, 0.5])
@pytest.mark.parametrize("beside", [(), (200, 400)])
@pytest.mark.parametrize("why", MADE)
def test_a_body_that_cannot_be_sent_is_refused_in_one_line_and_all_stay(why, beside, turn):
    model = world_of(why, beside, turn=turn)
    first, places = model.bodies[-2], [body.position.tolist() for body in model.bodies]
    start = rf"^a process sent body {first.unique_id}, which {why}, to \[3[05]0.0, 100.0, 0..\] in step 3; expected "
    with pytest.raises(BehaviourError, match=start) as raised:
        model.run(5)
    assert "\n" not in str(raised.value)
    table = model.parts.bodies.table
    assert not table.are_to_move(np.arange(len(table))).any()
    model.run(5)
    assert [body.position.tolist() for body in model.bodies] == places


@pytest.mark.parametrize("why", MADE)
def test_single_steps_refuse_the_same_as_a_compiled_run(why):
    one, other = world_of(why), world_of(why)
    with pytest.raises(BehaviourError) as of_run:
        one.run(5)
    other.step()
    other.step()
    with pytest.raises(BehaviourError) as of_steps:
        other.step()
    assert str(of_run.value) == str(of_steps.value)
    assert one.steps == other.steps == 3


def test_where_a_body_at_rest_is_refused_nothing_that_is_carried_is_let_go():
    model, puck, _ = carrying()
    model.add_process(send_all(kind=model.kind_code("obstacle"), when=1))
    with pytest.raises(BehaviourError, match="which is at rest"):
        model.run(1)
    assert puck.carrier is model.robots[0]


def test_what_is_moved_by_hand_or_pushed_is_not_taken_for_a_request_of_a_process():
    class Moved(SwarmModel):
        """All bodies are moved before and after each step, and by a process in Python."""

        def step(self):
            self.move(0.5)
            super().step()
            self.move(0.5)

        def move(self, way):
            for body in (*self.loads[:1], *self.movers):
                if body.kind != "sheep" and body.mode != "carried":
                    body.move_to((body.position[0] + way, body.position[1], body.heading + 0.1))

    @process
    def shift(model):
        model.loads[0].move_to((*(model.loads[0].position + 0.5), 0.1))
        model.movers[1].position = model.movers[1].position + 0.5

    model = Moved(rng=1)
    model.add_body(disc((300, 300), 5), kind="sheep")
    model.add_body(disc((100, 400), 5), kind="door")
    model.add_body(disc((200, 400), 5), kind="wolf", agent=Walker(model, position=(200, 400)))
    model.add_load(disc((100, 200), 6), resistance=0.5)
    pushed = model.add_load(disc((115, 100), 6), resistance=0.5)
    carried = model.add_body(disc((400, 500), 2), kind="puck")
    model.add_robots(DESIGN, poses=[(100, 100, 0.0)])
    model.attach(model.robots[0], carried)
    model.control = Subsumption(advance)
    model.add_process(shift)
    model.add_process(drift(kind=model.kind_code("sheep")))
    model.run(20)
    assert pushed.position[0] > 116
    assert carried.position.tolist() == model.robots[0].position.tolist()
    assert model.movers[0].position.tolist() == [319.0, 300.0]


@behaviour
def advance(me):
    me.act.grip = 1.0
    return 1.0, 1.0


@pytest.mark.parametrize("pushed", [True, False])
def test_driven_steps_with_loads_that_move_take_no_place_for_a_request(pushed):
    model = SwarmModel(rng=1)
    model.add_kind("puck")
    load = model.add_load(disc((115, 100), 6), resistance=0.5)
    sheep = model.add_body(disc((300, 300), 5), kind="sheep") if pushed else None
    model.add_robots(DESIGN, poses=[(100, 100, 0.0)])
    model.control = Subsumption(advance)
    model.add_process(drift(kind=model.kind_code("sheep") if pushed else -1))
    model.run(10)
    load.move_to((load.position[0] + 5, 100, 1.0))
    model.run(10)
    assert "driven: up to 1000 steps" in str(model.plan)
    assert load.position[0] > 121
    assert sheep is None or sheep.position.tolist() == [319.0, 300.0]


def test_a_process_may_send_what_the_agent_of_a_body_leaves_open():
    model = SwarmModel(rng=1)
    turned = model.add_body(disc((300, 100), 5), kind="turned", agent=Walker(model, position=(300, 100)))
    placed_ = model.add_body(disc((300, 200), 5), kind="placed", agent=Walker(model, heading=0.25))
    model.add_robots(AGENT9, 1)
    model.add_process(send_all(kind=model.kind_code("turned"), turn=0.5))
    model.add_process(send_all(kind=model.kind_code("placed")))
    model.run(5)
    assert turned.pose == (300.0, 100.0, 0.5)
    assert placed_.pose == (350.0, 200.0, 0.25)


# ---- as many numbers as one likes


@process(memory={"drawn": [0.0, 0.0, 0.0]})
def draw(stream, drawn, chance):
    for k in range(3):
        drawn[k] = draw_number(stream)


@pytest.mark.parametrize("driven", [True, False])
def test_a_process_draws_as_many_numbers_as_it_likes_from_its_stream(driven):
    model = SwarmModel(rng=7)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(Explore())
    drawing = model.add_process(draw)
    model.run(3) if driven else [model.step() for _ in range(3)]
    numbers = SwarmModel(rng=7).streams["process draw"].random(12)
    assert drawing.drawn.tolist() == numbers[9:].tolist()
