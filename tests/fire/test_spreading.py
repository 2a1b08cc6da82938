"""Fires that spread: how often, where to, and what is stored of it."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc, rectangle, scatter
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.fire import Spreading
from mesa_swarm.maps.map import Map
from mesa_swarm.recording import Recording


class Burning(SwarmModel):
    """Fires that spread among obstacles and robots, as a model that can be recorded."""

    def __init__(self, *, rate=0.02, n_robots=6, rng=None):
        super().__init__(map=Map(name="field", bounds=(0, 0, 400, 300)), rng=rng)
        self.add_obstacle(rectangle((180, 0), (200, 300)))
        self.add_obstacle(disc((60, 60), 15))
        self.add_fire((100, 150), radius=20)
        self.add_robots(AGENT9, n_robots)
        self.add_process(Spreading(rate=rate, reach=40.0, area=0.5, most=12))


def overlaps(model):
    """Return how deep the fires reach into each other, obstacles and robots at most, map units."""
    centres, radii = model.fires.position, model.fires.radius
    gaps = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1)) - radii[:, None] - radii[None]
    np.fill_diagonal(gaps, np.inf)
    shapes = [fire.shape.geometry for fire in model.fires]
    pairs = list(zip(shapes, radii, strict=True))
    bodies = [body for body in model.obstacle_list if getattr(body, "carrier", None) is None]
    solid = [b.shape.geometry.distance(s) - b.shape.radius - r for b in bodies for s, r in pairs]
    return -min([gaps.min(), *solid])


@pytest.mark.slow
def test_a_fire_throws_sparks_in_proportion_to_its_rate_and_temperature():
    ignited = []
    for rng in range(10_000, 10_060):
        model = SwarmModel(map=Map(name="field", bounds=(0, 0, 10_000, 10_000)), rng=rng)
        fire = model.add_fire((5_000, 5_000), radius=20, temperature=0.5)
        model.remove_process(model.processes[0])
        model.add_process(Spreading(rate=0.1, reach=4_000.0))
        assert fire.temperature == 0.5
        model.run(20)
        ignited.append(len(model.fires) - 1)
    # 20 steps of 0.1 * 0.5, and what the new fires at T = 0.1 ignite in turn.
    assert np.mean(ignited) == pytest.approx(1.0, abs=0.45)


def test_new_fires_lie_within_reach_and_overlap_nothing():
    for rng in range(10_000, 10_006):
        model = Burning(rng=rng)
        for _ in range(150):
            before = len(model.fires), model.swarm.position.copy()
            model.step()
            for row in range(before[0], len(model.fires)):
                away = np.hypot(*(model.fires.position[row] - model.swarm.position).T)
                assert (away >= model.fires.radius[row] + model.swarm.radius - 1e-9).all()
        assert overlaps(model) <= 1e-9
        x, y = model.fires.position.T
        assert (x < 180).all(), "the wall stops sparks of this reach"
        assert (np.minimum(x, y) > 0).all()
        assert (y < 300).all()


def burning(rng=1, **named):
    """Return a model in which fires spread as soon as they find room."""
    model = SwarmModel(map="openspace", rng=rng)
    model.add_fire((400, 300), radius=20)
    model.add_process(Spreading(rate=0.3, most=40, reach=60, **named))
    return model


def test_sparks_that_fall_on_driven_bodies_or_loads_go_out():
    model = burning()
    model.add_body(rectangle((430, 200), (480, 400)), kind="cart")
    model.add_load(rectangle((320, 200), (370, 400)), resistance=2.0)
    assert len(model.run(200).fires) > 5
    assert overlaps(model) <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("spreads_first", [True, False])
def test_sparks_fall_neither_on_wandering_bodies_nor_where_these_are_about_to_go(spreads_first):
    model = burning()
    (spreading,) = (one for one in model.processes if isinstance(one, Spreading))
    scatter(model, 25, speed=8, size=15, gap=2)
    if not spreads_first:
        model.remove_process(spreading)
        model.add_process(spreading)
    for _ in range(100):
        model.step()
        assert overlaps(model) <= 1e-9
    assert len(model.fires) > 5


def test_a_spark_may_fall_where_a_body_is_carried_but_not_on_its_robot():
    model = burning(area=0.01)
    (robot,) = model.add_robots(AGENT9, poses=[(435, 300, 0.0)])
    model.attach(robot, model.add_body(disc((500, 300), 60), kind="balloon"))
    model.run(200)
    away = np.hypot(*(model.fires.position - robot.position).T) - model.fires.radius
    assert away.min() >= robot.radius - 1e-9
    assert away.min() < 40


@pytest.mark.slow
def test_a_spark_reaches_no_farther_than_given_and_in_every_direction():
    places = []
    for rng in range(10_000, 10_080):
        model = SwarmModel(map=Map(name="field", bounds=(0, 0, 600, 600)), rng=rng)
        model.add_fire((300, 300), radius=20)
        model.add_process(Spreading(rate=1.0, reach=50.0, most=2))
        places.append(model.run(1).fires.position[1] - (300, 300))
    gaps = np.hypot(*np.array(places).T) - 20 - 10
    assert (gaps >= 0).all()
    assert (gaps <= 50).all()
    assert gaps.mean() == pytest.approx(25, abs=5)
    assert abs(np.exp(1j * np.arctan2(*np.array(places).T)).mean()) < 0.25


def test_no_more_fires_burn_than_given_and_a_burnt_place_never_burns_again():
    model = SwarmModel(map=Map(name="field", bounds=(0, 0, 400, 400)), rng=2)
    model.add_fire((200, 200), radius=20)
    model.add_process(Spreading(rate=1.0, reach=100.0, most=4))
    model.run(50)
    assert (~model.fires.out).sum() == 4
    for fire in model.fires.agents[1:]:
        fire.temperature = 1e-9
    model.fires.own["out"][1:] = True
    burnt = model.fires.position[1:].copy()
    model.run(20)
    fresh = model.fires.position[len(burnt) + 1 :]
    assert len(fresh)
    assert all(np.hypot(*(place - burnt).T).min() >= 20 - 1e-9 for place in fresh)


def test_fires_that_are_out_throw_no_sparks_and_a_rate_of_0_ignites_nothing():
    for rate, out in ((1.0, True), (0.0, False)):
        model = SwarmModel(map=Map(name="field", bounds=(0, 0, 400, 400)), rng=2)
        model.add_fire((200, 200), radius=20)
        model.fires.own["out"][:] = out
        model.add_process(Spreading(rate=rate))
        assert len(model.run(30).fires) == 1


def test_same_seed_same_fires_and_the_robots_draws_are_those_without_spreading():
    first, second = (Burning(rng=3).run(200) for _ in range(2))
    assert len(first.fires) > 1
    assert first.state_hash() == second.state_hash()
    plain = Burning(rng=3, rate=0.0)
    assert np.array_equal(plain.swarm.position, Burning(rng=3).swarm.position)


@pytest.mark.slow
def test_a_recorded_run_is_verified_resumed_and_shows_the_new_fires(tmp_path):
    model = Burning(rng=4)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(90)
    assert Burning.verify(tmp_path / "run.arrow").same
    for step in (20, 45):
        assert Burning.resume(tmp_path / "run.arrow", step=step).run(90 - step).state_hash() == model.state_hash()
    counts = [len(frame["fires"]) for frame in Recording(tmp_path / "run.arrow")]
    assert counts[0] == 1
    assert counts[-1] == len(model.fires) > 1


@pytest.mark.parametrize("name", ["rate", "reach", "area", "temperature", "most"])
@pytest.mark.parametrize("wrong", [-1, math.nan, "much", 1e9])
def test_wrong_values_are_refused_in_one_line(name, wrong):
    with pytest.raises(InvalidValueError, match=rf"^{name} is ") as caught:
        Spreading(**{name: wrong})
    assert "\n" not in str(caught.value)
