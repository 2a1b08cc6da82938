"""Foraging: food, the nest, the gripper, what they are worth, and what robots observe of them."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, Map, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError, PlacementError
from mesa_swarm.environments import Foraging
from mesa_swarm.environments.foraging import FOOD_CODE, nest_in
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.world.placement import free_space
from support.task_worlds import rewarded, world_of

BLANK = Map(name="blank", bounds=(0, 0, 400, 400))
# Its centre and radius: the middle of the map, and 45.
NEST = np.array([200.0, 200.0])


def with_food(task, poses, food) -> TaskWorld:
    """Return a world whose robots stand at these poses and whose items of food are at these places."""
    world = world_of(task, poses)
    for body, place in zip(world.movers.agents, food, strict=True):
        body.position = place
    world.sense()
    return world


def test_an_item_is_picked_up_carried_home_and_paid_for_once():
    task = Foraging(map=BLANK, items=1, step_cost=0.5, pick_up=2.0, delivery=7.0)
    world = with_food(task, [(300, 200, 0.0), (60, 60, 0.0)], [(309, 200)])
    assert rewarded(world, [(0, 0), (0, 0)]) == [1.5, -0.5]
    (robot, _) = world.robots
    assert world.carried_by(robot) is not None
    robot.heading = np.pi
    # Delivered where its centre is within the nest's radius less that of food, 42.5: after 58 steps.
    paid = [rewarded(world, [(1, 1), (0, 0)]) for _ in range(60)]
    assert paid[:57] == [[-0.5, -0.5]] * 57
    assert paid[57] == [6.5, -0.5]
    assert paid[58:] == [[-0.5, -0.5]] * 2
    measured = world.measures()
    assert measured["items delivered"] == 1.0
    assert measured["items per 1,000 robot-steps"] == pytest.approx(1000 / (2 * 61))
    assert not world.finished


def test_food_that_was_delivered_appears_elsewhere_again():
    world = with_food(Foraging(map=BLANK, items=1), [(243, 200, np.pi)], [(234, 200)])
    rewarded(world, [(0, 0)])
    for _ in range(3):
        rewarded(world, [(1, 1)])
    (place,) = world.movers.position
    assert world.events.name.tolist() == ["delivered"]
    assert np.hypot(*(place - NEST)) > 45 + 12 - 1e-9


def test_a_commanded_gripper_closes_above_0_and_to_put_down_costs_what_picking_up_was_worth():
    task = Foraging(map=BLANK, items=1, step_cost=0.0, pick_up=2.0, grip="commanded")
    world = with_food(task, [(300, 200, 0.0)], [(309, 200)])
    paid = [rewarded(world, [(0, 0, grip)])[0] for grip in (0.0, -1.0, 0.1, 1.0, -0.1, -1.0)]
    assert paid == [0.0, 0.0, 2.0, 0.0, -2.0, 0.0]


def test_an_automatic_gripper_works_with_numbers_of_actions():
    world = TaskWorld(task=Foraging(map=BLANK, n_robots=4, actions=4, items=60, max_steps=150), rng=4)
    world.play(lambda seen: np.full(len(seen), 3))
    assert (world.swarm.carried[:, 0] == FOOD_CODE).any()
    with pytest.raises(InvalidValueError, match=r"^grip is 'commanded' with actions=4; expected 'continuous' actions"):
        Foraging(grip="commanded", actions=4)


@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_observations_agree_with_numpy_and_lie_within_0_and_1(seed):
    task = Foraging(map=BLANK, n_robots=6, items=40)
    world = TaskWorld(task=task, rng=seed)
    for body, robot in zip(world.movers.agents, list(world.robots)[:3], strict=False):
        world.attach(robot, body)
    world.sense()
    out = np.full((6, task.observer().width), np.nan, np.float32)
    world.observe(out)
    swarm = world.swarm
    dx, dy = (NEST - swarm.position).T
    bearing = np.arctan2(dy, dx) - swarm.heading
    expected = [
        np.where(swarm.kind < 0, 1.0, swarm.distance / 50.0),
        *(swarm.kind == kind for kind in (0, 1, FOOD_CODE)),
        np.column_stack([np.hypot(dx, dy) <= 45, np.arange(6) < 3, np.hypot(dx, dy) / 1000]),
        0.5 + 0.5 * np.column_stack([np.cos(bearing), np.sin(bearing)]),
    ]
    assert np.allclose(out, np.hstack(expected), rtol=0, atol=1e-6)
    assert out.min() >= 0
    assert out.max() <= 1


@given(st.integers(0, 2**32))
@settings(max_examples=6)
def test_on_random_maps_nest_and_food_are_free_and_food_is_reached_from_the_nest(number):
    chart = random_map(number, obstacles=6)
    task = Foraging(map=chart, n_robots=5, items=15, nest_radius=30)
    world = TaskWorld(task=task, rng=number)
    x, y = task.nest_place()
    assert free_space(chart.bounds, chart.obstacles, 30).distance(shapely.Point(x, y)) < 0.1
    space = free_space(chart.bounds, chart.obstacles, 5.0)
    part = min(shapely.get_parts(space), key=lambda one: one.distance(shapely.Point(x, y)))
    assert len(world.movers) == 15
    for place in world.movers.position:
        assert part.contains(shapely.Point(place))
        assert np.hypot(*(place - (x, y))) > 30 + 11
        gaps = [shapely.distance(o.geometry, shapely.Point(place)) - o.radius for o in chart.obstacles]
        assert min(gaps) >= 12 - 1e-6


@pytest.mark.slow
def test_the_rule_finds_food_and_carries_it_home_and_a_seed_always_gives_the_same_episode():
    worlds = [TaskWorld(task=Foraging(map=BLANK, n_robots=5, max_steps=400), commanded=0, rng=3) for _ in range(2)]
    first, again = (world.play() for world in worlds)
    assert first["items delivered"] >= 3
    assert first == again
    assert worlds[0].state_hash() == worlds[1].state_hash()
    assert len(worlds[0].movers) == 30


def test_designs_get_what_they_lack_and_may_differ():
    task = Foraging(design=(AGENT9, AGENT3), n_robots=3)
    assert [len(design.line) for design in task.designs] == [1, 1]
    assert task.observer().widths == (41, 41, 17)
    assert Foraging(design=task.designs, n_robots=3) == task


WALLED = Map(name="walled", bounds=(0, 0, 400, 400), obstacles=[rectangle((0, 0), (400, 200)), disc((200, 300), 30)])


def test_a_nest_is_at_the_free_place_nearest_to_the_middle_unless_it_is_given():
    x, y = nest_in(WALLED, 45.0, None)
    assert np.hypot(x - 200, y - 300) == pytest.approx(75, rel=0.01)
    assert Foraging(map=BLANK).nest_place() == (200.0, 200.0)
    assert Foraging(map=BLANK, nest=(100, 60)).nest_place() == (100.0, 60.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Foraging(map=WALLED, nest=(200, 240)), r"nest is \(200, 240\), where one of radius 45 touches"),
        (lambda: Foraging(map=WALLED, nest_radius=150), "map walled has no room for a nest of radius 150"),
        (lambda: Foraging(items=0), "items is 0; expected a whole number"),
        (lambda: Foraging(delivery=-1), "delivery is -1; expected"),
        (lambda: Foraging(map=Map(name="hut", bounds=(0, 0, 60, 60)), nest_radius=25), "map hut has no room for food"),
    ],
)
def test_what_has_no_room_or_is_out_of_range_is_refused_in_one_line(make, message):
    with pytest.raises(InvalidValueError, match=f"^{message}"):
        make()


def test_more_food_than_there_is_room_for_is_refused():
    hut = Map(name="hut", bounds=(0, 0, 160, 160))
    with pytest.raises(PlacementError, match=r"^no room for another item of food on map hut; use fewer items"):
        TaskWorld(task=Foraging(map=hut, items=200, n_robots=1), rng=1)
