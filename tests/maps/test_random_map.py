"""Random maps: always the same for a number, whole, and with room for robots."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.world.placement import free_space
from support.scenes import PROMISED, ahead, worst_overlap


def test_a_number_always_gives_the_same_map_and_another_number_another():
    assert random_map(5) == random_map(5)
    assert len({random_map(k).to_toml() for k in range(6)}) == 6


def test_a_number_names_the_same_map_in_every_release():
    # Stored numbers; digits beyond a hundredth may depend on how a processor takes a sine.
    sums = {4: (12, 91105.617), 11: (12, 100285.804)}
    for number, (count, area) in sums.items():
        made = random_map(number)
        assert len(made.obstacles) == count
        assert sum(o.geometry.area + math.pi * o.radius**2 for o in made.obstacles) == pytest.approx(area, abs=0.01)
        assert (made.name, made.bounds) == (f"random {number}", (0, 0, 800, 600))


def test_discs_and_walls_are_of_the_sizes_of_rooms_and_lie_within_the_map():
    inside = [o for number in range(12) for o in random_map(number).obstacles[4:]]
    radii = [o.radius for o in inside if o.is_disc]
    assert 15 <= min(radii) < 25
    assert 45 < max(radii) <= 60
    assert 0.25 < len(radii) / len(inside) < 0.65
    sides = np.array(
        [sorted(np.hypot(*np.diff(o.geometry.exterior.coords, axis=0).T)) for o in inside if not o.is_disc]
    )
    thickness, length = np.sort(sides)[:, [0, -1]].T
    assert sides == pytest.approx(np.sort(sides)[:, [0, 0, 3, 3]])
    assert 15 <= thickness.min() < 20
    assert thickness.max() <= 60
    assert 200 < length.max() <= 320
    assert all(((o.geometry.centroid.x, o.geometry.centroid.y) >= np.array([20, 20])).all() for o in inside)
    walls = np.array([o.bounds for o in inside if not o.is_disc])
    assert (walls[:, :2] >= 0).all()
    assert (walls[:, 2:] <= (800, 600)).all()


@pytest.mark.parametrize("number", range(8))
def test_one_gets_from_everywhere_to_everywhere_through_passages_of_the_width_asked_for(number):
    made = random_map(number, passage=40)
    space = free_space(made.bounds, made.obstacles, 20)
    assert len(shapely.get_parts(space)) == 1
    assert space.area > 0.25 * 800 * 600


def test_there_are_as_many_obstacles_as_asked_for_unless_they_find_no_room(monkeypatch):
    assert [len(random_map(3, obstacles=k).obstacles) for k in (0, 1, 8)] == [4, 5, 12]
    monkeypatch.setattr("mesa_swarm.maps.random_map.TRIES", 1)
    assert 4 < len(random_map(3, obstacles=30).obstacles) < 34


def test_it_is_as_large_as_asked_for_and_one_piece():
    made = random_map(4, obstacles=3, size=(400, 300))
    assert made.bounds == (0, 0, 400, 300)
    assert all(made.bounds[2] >= shapely.bounds(o.geometry)[2] for o in made.obstacles)
    assert len(shapely.get_parts(free_space(made.bounds, made.obstacles, 15))) == 1
    assert random_map(4, size=(800, 600)) == random_map(4)


def test_robots_live_there():
    model = SwarmModel(map=random_map(2), rng=1)
    model.add_robots(AGENT9, 15)
    start = model.swarm.position.copy()
    model.control = Subsumption(ahead)
    model.run(30)
    assert (np.hypot(*(model.swarm.position - start).T) > 1).sum() > 10
    assert worst_overlap(model) <= PROMISED


@given(st.integers(0, 2**31 - 1), st.integers(0, 6), st.sampled_from([20.0, 30.0, 60.0]))
@settings(max_examples=8)
def test_fires_stand_apart_can_be_reached_and_change_no_obstacle(number, fires, passage):
    made = random_map(number, obstacles=4, passage=passage, fires=fires)
    plain = random_map(number, obstacles=4, passage=passage)
    assert (made.obstacles, made.name, plain.fires) == (plain.obstacles, plain.name, ())
    assert made == random_map(number, obstacles=4, passage=passage, fires=fires)
    centres = shapely.points(np.array([fire.position for fire in made.fires]).reshape(-1, 2))
    for fire, centre in zip(made.fires, centres, strict=True):
        gaps = [shapely.distance(o.geometry, centre) - o.radius for o in made.obstacles]
        gaps += [
            shapely.distance(at, centre) - other.radius
            for other, at in zip(made.fires, centres, strict=True)
            if at is not centre
        ]
        assert min(gaps) - fire.radius >= passage - 1e-6
    burning = [disc(fire.position, fire.radius) for fire in made.fires]
    assert len(shapely.get_parts(free_space(made.bounds, [*made.obstacles, *burning], 0.49 * passage))) == 1


def test_there_are_as_many_fires_as_asked_for_unless_they_find_no_room():
    assert [len(random_map(3, fires=k).fires) for k in (0, 1, 5)] == [0, 1, 5]
    assert [fire.radius == 40 for fire in random_map(3, fires=5).fires] == [True] + 4 * [False]
    assert random_map(3, fires=5).fires[:2] == random_map(3, fires=2).fires
    assert 0 < len(random_map(1, obstacles=0, passage=60, size=(300, 300), fires=30).fires) < 30


@pytest.mark.parametrize(
    "wrong",
    [
        {"number": 1, "fires": -1},
        {"number": 1, "fires": 31},
        {"number": -1},
        {"number": 0.5},
        {"number": 1, "obstacles": 31},
        {"number": 1, "passage": 0},
        {"number": 1, "size": (100, 300)},
        {"number": 1, "size": 400},
        {"number": 1, "size": "400 x 300"},
        {"number": 1, "size": (400, 300, 200)},
    ],
)
def test_what_is_no_map_is_refused_in_one_line(wrong):
    with pytest.raises(InvalidValueError) as caught:
        random_map(**wrong)
    assert "\n" not in str(caught.value)
