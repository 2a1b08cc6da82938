"""Scattered obstacles: where they are, how they wander, and that nothing ever overlaps."""

import copy
import gc
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Point

from mesa_swarm import AGENT9, Recording, SwarmModel, Wander, disc, rectangle, scatter
from mesa_swarm.base.errors import InvalidValueError, PlacementError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.world.movers import room_on_way, sweep_geometry
from support.scenes import ahead, blind, empty


def least_gap(shapes):
    """Return the least distance of any two shapes."""
    return gaps(shapes, shapes)[np.triu_indices(len(shapes), 1)].min(initial=math.inf)


def gaps(ones, others):
    """Return the distances of shapes from others, shape (n, m)."""
    (some, some_radii), (more, radii) = (
        (np.array([s.geometry for s in shapes]), np.array([s.radius for s in shapes])) for shapes in (ones, others)
    )
    return shapely.distance(some[:, None], more) - some_radii[:, None] - radii


def crowd(seed, moving=6, still=6, robots=12, engine="compiled", speed=1.0, map="original"):
    """Return robots that explore among scattered obstacles, some of which wander."""
    model = SwarmModel(map=map, rng=seed, engine=engine)
    scatter(model, still, size=18)
    scatter(model, moving, size=18, speed=speed)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


@settings(max_examples=6, deadline=None)
@given(
    st.integers(0, 10_000),
    st.integers(1, 12),
    st.sampled_from(["both", "discs", "rectangles"]),
    st.sampled_from([0.0, 1.0]),
)
def test_scattered_obstacles_are_apart_from_each_other_from_walls_and_from_robots(seed, count, forms, speed):
    model = SwarmModel(map="original", rng=seed)
    robots = [Point(robot.position) for robot in model.add_robots(AGENT9, 10)]
    walls = [wall.shape for wall in model.obstacles]
    shapes = [body.shape for body in scatter(model, count, size=18, gap=11, forms=forms, speed=speed)]
    assert least_gap(shapes) >= 22
    assert gaps(shapes, walls).min() >= 11
    assert all(robot.distance(shape.geometry) - shape.radius >= 5 + 11 for shape in shapes for robot in robots)
    assert forms == "both" or {shape.kind for shape in shapes} == {forms.removesuffix("s")}


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.3, 1.0, 4.0]))
def test_wandering_obstacles_never_overlap_anything_and_none_stands_for_ever(seed, speed):
    model = crowd(seed, speed=speed)
    solid = [body for body in model.bodies if body.contact]
    walls, moving = [body.shape for body in solid if body.mode == "fixed"], model.movers.agents
    travelled = np.zeros(len(moving))
    for _ in range(60):
        before = model.movers.position.copy()
        model.step()
        travelled += np.hypot(*(model.movers.position - before).T)
        shapes = [body.shape for body in moving]
        assert least_gap(shapes) > 0
        assert gaps(shapes, walls).min() > 0
        robots = [disc(place, AGENT9.radius) for place in model.swarm.position]
        assert gaps(shapes, robots).min() > -1e-6 * AGENT9.radius
    assert (travelled > 0).all()
    assert travelled.mean() > 0.5 * 59 * speed


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([3.0, 20.0]))
def test_bodies_of_several_processes_never_overlap_each_other(seed, speed):
    model = SwarmModel(map="openspace", rng=seed)
    for count in (8, 8, 1):
        scatter(model, count, speed=speed, size=12, gap=0)
    for step in range(80):
        model.step()
        if step == 30:
            scatter(model, 8, speed=0.5 * speed, size=12, gap=0)  # where none is about to go
        assert least_gap([body.shape for body in model.movers.agents]) > 0


class Turnstile:
    """A process that turns a long body and moves it to and fro."""

    def step(self, model):
        """Ask for the next pose."""
        body = model.movers.agents[0]
        body.move_to((400 + 30 * math.sin(model.steps / 10), 300, body.heading + 0.2))


def test_wandering_bodies_keep_clear_of_where_an_earlier_process_sends_another_body():
    model = SwarmModel(map="openspace", rng=1)
    bar = model.add_body(rectangle((350, 297), (450, 303)))
    sheep = [model.add_body(disc((400 + 70 * math.cos(k), 300 + 70 * math.sin(k)), 5)) for k in range(6)]
    turnstile, wander = Turnstile(), Wander(sheep, speed=2.0)
    model.add_process(turnstile)
    model.add_process(wander)
    ways = []
    for _ in range(200):
        model.step()
        before = [body.position for body in sheep]
        geometry, radius = room_on_way(bar)
        for body, place in zip(sheep, before, strict=True):
            to = body.movers.aim[body.row]
            if (to != place).any() and geometry.distance(Point(place)) - radius > 5.1:
                ways.append(sweep_geometry(Point(place), to - place).distance(geometry) - radius - 5)
    assert len(ways) > 100
    assert min(ways) > 0


def test_what_a_robot_carries_is_not_put_down_where_a_body_is_about_to_go():
    model = empty()
    (robot,) = model.add_robots(blind(), poses=[(100, 100, 0.0)])
    model.attach(robot, model.add_body(disc((200, 200), 5), kind="puck"))
    cart = model.add_body(rectangle((100, 190), (130, 200)))
    model.run(1)
    cart.position = (115, 5)
    assert model.release(robot) is False
    cart.position = cart.position
    assert model.release(robot) is True


def test_a_wandering_body_goes_straight_at_its_speed_until_something_is_in_the_way():
    model = SwarmModel(map="openspace", rng=4)
    (body,) = scatter(model, 1, speed=2.0)
    places = [model.run(1).movers.position[0].tolist() for _ in range(600)]
    steps = np.diff(places, axis=0)
    assert np.hypot(*steps.T) == pytest.approx(np.full(len(steps), 2.0), abs=1e-9)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(*steps.T)))) > 1e-9
    assert 0 < turns.sum() < 40
    x, y = np.array(places[1:-1])[turns].T
    edge = np.minimum.reduce([x - 20, 780 - x, y - 20, 580 - y])
    assert (edge < body.form.reach + 2.1).all()


def test_two_bodies_in_a_corridor_turn_before_each_other():
    model = SwarmModel(map="openspace", rng=2)
    for x0, y0, x1, y1 in ((20, 100, 780, 110), (20, 131, 780, 140)):
        model.add_obstacle(rectangle((x0, y0), (x1, y1)))
    bodies = [model.add_body(disc((x, 120.5), 10)) for x in (200, 260)]
    model.add_process(Wander(bodies, speed=1.0))
    order = []
    for _ in range(400):
        model.step()
        (left, y0), (right, y1) = (body.position for body in bodies)
        order.append(right - left)
        assert abs(y0 - 120.5) < 0.5 > abs(y1 - 120.5)
    assert min(order) > 20
    assert max(order) - min(order) > 1


def test_a_body_that_a_load_has_touched_can_leave_it():
    model = empty()
    body = model.add_body(disc((100, 100), 10))
    wander = model.add_process(Wander([body], speed=1.0))
    load = model.add_load(disc((120.2, 100), 10), resistance=0.1)
    model.add_robots(blind(), poses=[(140, 100, math.pi)])
    model.control = Subsumption(ahead)
    wander.azimuth[:] = math.pi / 2
    start = body.position
    model.run(30)
    assert np.hypot(*(body.position - start)) > 5
    assert least_gap([body.shape, load.shape]) > -1e-6


@pytest.mark.slow
def test_robots_avoid_wandering_obstacles():
    def met(avoids):
        model = crowd(5, moving=8, robots=30, map="openspace")
        if not avoids:
            model.control = Subsumption(Explore())
        count, ids = 0, [body.unique_id for body in model.movers.agents]
        for _ in range(300):
            model.step()
            count += int(np.isin(model.contacts.other, ids).sum())
        return count

    assert met(avoids=True) < 0.7 * met(avoids=False)  # AGENT9 sees little behind


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_on_both_engines_and_with_the_state_of_the_process():
    assert crowd(7).run(40).state_hash() == crowd(7).run(40).state_hash()
    assert crowd(7).run(40).state_hash() != crowd(8).run(40).state_hash()
    one, two = crowd(7, robots=4).run(15), crowd(7, robots=4, engine="shapely").run(15)
    assert one.movers.position == pytest.approx(two.movers.position, abs=1e-9)
    turned = crowd(7).run(40)
    turned.processes[0].azimuth[0] += 0.1
    assert turned.state_hash() != crowd(7).run(40).state_hash()


@pytest.mark.slow
def test_a_recording_with_wandering_obstacles_is_verified_and_resumed_to_the_same_state(tmp_path):
    options = {"n_robots": 6, "obstacles": 4, "moving_obstacles": 3, "rng": 3}
    model = CollisionAvoidance(**options)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(50)
    assert CollisionAvoidance.verify(tmp_path / "run.arrow").same
    resumed = CollisionAvoidance.resume(tmp_path / "run.arrow", step=40)
    assert resumed.run(10).state_hash() == model.state_hash()
    assert resumed.run(30).state_hash() == CollisionAvoidance(**options).run(80).state_hash()
    assert len(Recording(tmp_path / "run.arrow").at(50)["loads"]) == 3


def test_collision_avoidance_has_as_many_obstacles_as_are_given_and_none_by_default():
    plain = CollisionAvoidance(rng=1)
    model = CollisionAvoidance(obstacles=5, moving_obstacles=2, rng=1)
    assert (len(plain.processes), len(plain.movers), len(plain.bodies)) == (0, 0, 11)
    assert (len(model.processes), len(model.movers), len(model.bodies)) == (1, 2, 18)
    assert model.kinds[-1] == "moving_obstacle"


def test_removed_and_carried_bodies_are_left_out():
    model = SwarmModel(map="openspace", rng=1)
    one, two, three = scatter(model, 3, size=8, forms="discs", speed=1.0)
    (robot,) = model.add_robots(AGENT9, 1)
    model.run(3)
    model.attach(robot, one)
    two.remove()
    start = three.position
    model.run(10)
    assert np.hypot(*(three.position - start)) > 0
    assert one.position == pytest.approx(robot.position)
    three.remove()
    model.run(2)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"count": -1}, "count is -1"),
        ({"count": 2.5}, "count is 2.5"),
        ({"count": 3, "size": 0}, "size is 0"),
        ({"count": 3, "size": math.nan}, "size is nan"),
        ({"count": 3, "gap": -1}, "gap is -1"),
        ({"count": 3, "speed": -1}, "speed is -1"),
        ({"count": 3, "speed": math.inf}, "speed is inf"),
        ({"count": 3, "kind": 3}, "kind"),
    ],
)
def test_a_wrong_option_is_refused_in_one_line_and_nothing_is_added(options, why):
    model = SwarmModel(map="openspace", rng=1)
    with pytest.raises(InvalidValueError, match=f"^{why}") as error:
        scatter(model, **options)
    assert "\n" not in str(error.value)
    assert len(model.bodies) == 4


def test_what_does_not_fit_or_is_not_a_form_is_refused_and_nothing_is_added():
    model = SwarmModel(map="openspace", rng=1)
    with pytest.raises(
        PlacementError, match=r"^500 obstacles of size 60 with gaps of 12 do not fit on map openspace; ask"
    ):
        scatter(model, 500, size=60)
    with pytest.raises(ValueError, match="unknown forms 'disc'; did you mean 'discs'"):
        scatter(model, 5, forms="disc")
    assert len(model.bodies) == 4


def test_only_driven_bodies_without_agents_wander():
    model = SwarmModel(map="openspace", rng=1)
    wall = model.add_obstacle(disc((100, 100), 5))
    with pytest.raises(InvalidValueError, match="expected driven ones without an agent"):
        Wander([wall], speed=1)
    with pytest.raises(InvalidValueError, match=r"^speed is 0; expected a finite number above 0"):
        Wander([], speed=0)
    model.add_process(Wander([], speed=1))
    assert model.run(2).steps == 2


@pytest.mark.parametrize("wrong", [None, 3, disc((100, 100), 5)])
def test_what_is_not_a_sequence_of_bodies_does_not_wander(wrong):
    with pytest.raises(InvalidValueError, match=r"^bodies is .*; expected a list of driven ones, from add_body$"):
        Wander(wrong, speed=1)


def test_bodies_of_another_model_are_refused_and_their_namesakes_stay():
    mine, other = SwarmModel(map="openspace", rng=1), SwarmModel(map="openspace", rng=1)
    mine.add_body(disc((100, 100), 5))
    stranger = other.add_body(disc((200, 200), 5))
    wander = Wander([stranger], speed=1.0)
    with pytest.raises(InvalidValueError, match=r"^bodies of Wander are not of this model; expected some of its add_b"):
        mine.add_process(wander)
    assert mine.processes == ()
    other.add_process(wander)
    other.run(2).remove_process(wander)
    with pytest.raises(InvalidValueError, match="not of this model"):
        mine.add_process(wander)
    other.add_process(wander)
    with pytest.raises(InvalidValueError, match=r"^bodies of Wander are of several models"):
        Wander([stranger, *mine.movers.agents], speed=1.0)


@pytest.mark.slow
def test_bodies_of_a_model_that_is_gone_are_not_mistaken_for_others():
    wander = Wander([SwarmModel(map="openspace", rng=1).add_body(disc((100, 100), 5))], speed=1.0)
    gc.collect()
    model = SwarmModel(map="openspace", rng=1)
    model.add_body(disc((100, 100), 5))
    with pytest.raises(InvalidValueError, match="not of this model"):
        model.add_process(wander)


def test_a_copy_of_a_model_has_its_own_wandering_bodies():
    model = crowd(3).run(5)
    twin = copy.deepcopy(model)
    wander = twin.processes[0]
    twin.remove_process(wander)
    twin.add_process(wander)
    assert twin.run(5).movers.position.tolist() == model.run(5).movers.position.tolist()


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_what_a_shape_sweeps_over_holds_it_at_each_place_of_its_way(dx, dy):
    box = shapely.box(0, 0, 2, 1)
    path = sweep_geometry(box, (dx, dy)).buffer(1e-9)
    for share in (0.0, 0.3, 1.0):
        assert path.covers(shapely.transform(box, lambda points, share=share: points + share * np.array([dx, dy])))
    assert path.area == pytest.approx(2 + abs(dx) + 2 * abs(dy), abs=1e-6)
