"""The compiled and the Shapely engine are two independent readings of PHYSICS 3 and 4: they agree.

Random worlds are compared where they are generic: where the oracle's own outcome does not jump when every robot
is moved by 1e-10. A world that is not (a sector's edge that grazes a vertex, two bodies equally near, a jam that
is chaotic) is one of very small measure, and is passed over where they differ: the tests see to it that few are.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT3,
    AGENT9,
    HolonomicDrive,
    Map,
    ProximitySensor,
    RobotDesign,
    SwarmModel,
    polygon,
    rectangle,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.physics import shapely_engine
from support.pace import in_time
from support.random_worlds import DESIGNS, ODD, Commanded, crowd, differences, outcome, random_world, state

ENGINES = ("compiled", "shapely")
EXACT = 1e-9
# A long crowded run multiplies rounding.
CLOSE = 1e-6
NUDGE, JUMP = 1e-10, 1e-6

# The same bodies and sensors, on wheels and on rollers.
MIXED = tuple(design for one in DESIGNS for design in (one, replace(one, drive=HolonomicDrive())))

seeds = st.integers(0, 2**32 - 1)
# A world takes about a fifth of a second, a jam many times that.
deep = settings(max_examples=in_time(1000))
long = settings(max_examples=40)


def mixed(world):
    """Return the world with every second robot on rollers."""
    (design,) = world.designs
    gliding = replace(design, drive=HolonomicDrive())
    return replace(world, designs=(design, gliding), design=np.arange(len(world.poses)) % 2)


def is_generic(world, oracle):
    """Return whether the oracle's outcome stays the same when the robots are moved very slightly."""
    nudged = outcome(world.nudged(NUDGE).model("shapely"))
    return max(differences(oracle, nudged).values()) < JUMP


def check_agreement(world):
    """Assert that both engines make the same of a world, unless it is not generic."""
    ours, oracle = (outcome(world.model(engine)) for engine in ENGINES)
    found = differences(ours, oracle)
    assume(max(found.values()) <= EXACT or is_generic(world, oracle))
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=EXACT)


def check_run(models, steps):
    """Assert that both models do and read the same at each step."""
    for _ in range(steps):
        for model in models:
            model.sense()
        ours, oracle = models
        read = {"distance": ours.swarm.distance, "kind": ours.swarm.kind}
        seen = {"distance": oracle.swarm.distance, "kind": oracle.swarm.kind}
        assert max(differences(read, seen).values()) < CLOSE
        for model in models:
            model.step()
        assert max(differences(state(ours), state(oracle)).values()) < CLOSE


@pytest.mark.slow
@settings(max_examples=25)
@given(seeds)
def test_both_engines_read_and_do_the_same_in_random_worlds(seed):
    check_agreement(random_world(seed))


@pytest.mark.slow
@settings(max_examples=15)
@given(seeds)
def test_both_engines_read_and_do_the_same_in_random_worlds_of_robots_with_wheels_and_without(seed):
    check_agreement(random_world(seed, designs=MIXED))


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_both_engines_do_the_same_for_thirty_steps_of_a_crowd_with_wheels_and_without(seed):
    models = [mixed(crowd(seed, n=16, size=110.0)).model(engine) for engine in ENGINES]
    check_run(models, 30)
    assert models[0].total_collisions > 50


@pytest.mark.long
@deep
@given(seeds)
def test_both_engines_read_and_do_the_same_in_a_thousand_random_worlds(seed):
    check_agreement(random_world(seed, most_robots=25))


@pytest.mark.slow
@pytest.mark.parametrize("designs", [DESIGNS, MIXED], ids=["on wheels", "mixed"])
def test_hardly_any_random_world_is_not_generic(designs):
    worlds = [random_world(seed, designs=designs) for seed in range(15)]
    generic = [is_generic(world, outcome(world.model("shapely"))) for world in worlds]
    assert sum(generic) >= 14


@pytest.mark.slow
@settings(max_examples=3)
@given(seeds)
def test_both_engines_do_the_same_in_a_jam(seed):
    check_agreement(crowd(seed, n=14, size=60.0))


@pytest.mark.long
@long
@given(seeds, st.integers(2, 16))
def test_both_engines_do_the_same_in_many_jams(seed, n):
    check_agreement(crowd(seed, n=n, size=60.0))


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_both_engines_do_the_same_for_thirty_steps_of_a_crowd_that_avoids(seed):
    models = [crowd(seed, n=20, size=110.0).model(engine) for engine in ENGINES]
    for model in models:
        model.control = Subsumption(Avoid(), Explore())
    check_run(models, 30)
    assert models[0].total_collisions > 0


@pytest.mark.slow
def test_both_engines_do_the_same_for_thirty_steps_of_a_crowd_driven_blindly():
    models = [crowd(1, n=20, size=110.0).model(engine) for engine in ENGINES]
    check_run(models, 30)
    assert models[0].total_collisions > 150


@pytest.mark.slow
@pytest.mark.parametrize("name", ["original", "sparse", "openspace", "openspace_fire"])
def test_both_engines_run_every_built_in_map_with_noise_and_slip(name):
    noisy = AGENT3.with_proximity(error_probability=0.5, error_magnitude=0.2, hold=2, period=3)
    slippery = RobotDesign(sensors=noisy.sensors, slip_probability=0.3, slip_magnitude=0.5)
    models = [SwarmModel(map=name, engine=engine, rng=5) for engine in ENGINES]
    for model in models:
        model.add_robots(slippery, 6)
        model.add_robots(ODD, 3)
        model.control = Subsumption(Avoid(), Explore())
    check_run(models, 15)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("pieces", [10, 20, 26])
def test_a_robot_driven_at_a_corner_doubles_its_distance_from_the_balance_in_every_piece_of_a_step(engine, pieces):
    """Of half a radius each: pushed from a depth of half a radius back to one, away from the corner.

    So 200 pieces make a step at 100 radii chaotic, in either engine: rounding becomes a radius in 50 of them.
    """
    aside = 1e-9
    model = SwarmModel(map=Map(name="corner", bounds=(0, 0, 400, 200)), engine=engine, rng=1)
    model.add_obstacle(polygon([(200, 100), (300, 20), (300, 180)]))
    design = RobotDesign(radius=5.0, max_speed=2.5 * pieces, drive=HolonomicDrive())
    model.add_robots(design, poses=[(195.0, 100.0 + aside, 0.0)])
    model.control = Commanded(np.array([[2.5 * pieces, 0.0]]))
    model.step()
    x, y = model.swarm.position[0]
    # A place at 100 is rounded by 1e-14, and that doubles as well.
    assert y - 100.0 == pytest.approx(aside * 2.0**pieces, rel=1e-3)
    assert math.hypot(x - 200.0, y - 100.0) == pytest.approx(5.0, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_side_sensor_of_a_robot_that_slides_along_a_wall_reads_zero_wherever_it_met_the_wall(engine):
    wall = Map(name="wall", bounds=(0, 0, 400, 400), obstacles=[rectangle((100, 0), (120, 400))])
    for x in np.linspace(60, 85, 7):
        model = SwarmModel(map=wall, engine=engine, rng=1)
        (robot,) = model.add_robots(AGENT9, poses=[(x, 100.3, math.radians(60))])
        model.control = Subsumption(Explore())
        model.run(100).sense()
        assert robot.heading == pytest.approx(math.pi / 2)
        assert robot.distance[6] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("heading", [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_a_front_sensor_of_a_robot_that_stands_against_a_wall_reads_zero(engine, heading):
    room = Map(name="room", bounds=(0.1, 0.1, 99.7, 99.7))
    for offset in np.linspace(0, 1, 11 if engine == "compiled" else 4):
        model = SwarmModel(map=room, engine=engine, rng=1)
        (robot,) = model.add_robots(AGENT3, poses=[(50.3 + offset, 49.6 + offset, heading)])
        model.control = Subsumption(Explore())
        model.run(60).sense()
        assert robot.distance[0] == pytest.approx(0.0, abs=1e-5)
        assert robot.kind[0] == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sensor_exactly_on_the_face_that_it_looks_at_reads_zero(engine):
    model = SwarmModel(map=Map(name="room", bounds=(0, 0, 140, 140)), engine=engine, rng=1)
    for position in np.linspace(20.3, 110.1, 40):
        model.remove_robots(model.robots)
        (robot,) = model.add_robots(AGENT9, poses=[(position, 5.0, 0.0)])
        model.sense()
        assert robot.distance[6] == pytest.approx(0.0, abs=EXACT)
        assert robot.kind[6] == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sensor_beyond_the_border_or_inside_a_wall_reads_zero(engine):
    feeler = RobotDesign(sensors=(ProximitySensor(mount=(9.0, 0.0), field_of_view_degrees=20),))
    model = SwarmModel(map=Map(name="room", bounds=(0, 0, 200, 100)), engine=engine, rng=1)
    model.add_obstacle(rectangle((100, 40), (120, 60)))
    model.add_robots(feeler, poses=[(6, 50, math.pi), (94, 50, 0.0), (150, 50, 0.0)])
    model.step()
    model.sense()
    assert model.swarm.distance[:, 0].tolist() == [0.0, 0.0, 41.0]
    assert model.swarm.kind[:, 0].tolist() == [0, 0, 0]


@pytest.mark.slow
def test_crowds_include_those_where_robots_are_put_back(monkeypatch):
    """The jams above are worth something only if they reach the last resort."""
    calls = []
    real = shapely_engine.return_overlapping
    monkeypatch.setattr(shapely_engine, "return_overlapping", lambda *args: (calls.append(1), real(*args)))
    for seed in range(4):
        outcome(crowd(seed, n=14, size=60.0).model("shapely"))
    assert calls
