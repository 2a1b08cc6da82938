"""Random worlds are heard as a twin hears them that tries all pairs with Shapely."""

import copy

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import Radio, rectangle
from mesa_swarm.control import Subsumption
from support.messages import HEARD, Broadcasting
from support.random_worlds import random_world
from support.scenes import blind, empty

seeds = st.integers(0, 2**32 - 1)


def in_python(word, sender, hearer, probability):
    """Return whether a broadcast is lost, by Python's own whole numbers."""
    whole = 2**64

    def mixed(bits):
        bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9 % whole
        bits = (bits ^ bits >> 27) * 0x94D049BB133111EB % whole
        return bits ^ bits >> 31

    golden = 0x9E3779B97F4A7C15
    return (mixed((mixed((word + golden * sender) % whole) + golden * hearer) % whole) >> 11) / 2**53 < probability


def hears(model, place, sender, i, word):
    """Return whether robot i hears a sender at a place, by Shapely."""
    radio, way = model.communication, shapely.LineString([place, model.swarm.position[i]])
    if way.length > radio.range or in_python(word, sender, int(model.swarm.number[i]), radio.loss_probability):
        return False
    solids = [obstacle.shape for obstacle in model.obstacles if obstacle.contact]
    outlines = (s.geometry if s.is_disc else s.geometry.boundary for s in solids)
    return not radio.occlusion or all(o.distance(way) > s.radius for o, s in zip(outlines, solids, strict=True))


def framed(model, i, point):
    return shapely.affinity.rotate(
        shapely.Point(point - model.swarm.position[i]), -model.swarm.heading[i], origin=(0, 0), use_radians=True
    ).coords[0]


def twin(model, word):
    """Return what is heard in the next step, by trying all pairs."""
    swarm, radio, n = model.swarm, model.communication, len(model.swarm)
    out = {name: np.full_like(getattr(swarm, name), np.nan if name[6:] in ("from", "goal") else -1) for name in HEARD}
    beacons = [(np.array(b), k - len(radio.beacons)) for k, b in enumerate(radio.beacons)]
    robots = [(swarm.position[j], int(swarm.number[j])) for j in range(n)]
    goals = [b for b, _ in beacons] + list(swarm.sent_goal)
    for i in range(n):
        others = [k for k, (p, s) in enumerate(robots) if k != i and hears(model, p, s, i, word)]
        away = {j: np.hypot(*(swarm.position[j] - swarm.position[i])) for j in others if swarm.task[j] >= 0}
        if away and radio.state:
            j = min(away, key=away.get)
            out["heard_layer"][i], out["heard_task"][i] = swarm.layer[j], swarm.task[j]
            out["heard_from"][i] = framed(model, i, swarm.position[j])
        heard = [k for k, (p, s) in enumerate(beacons) if hears(model, p, s, i, word)]
        heard += [len(beacons) + j for j in others if np.isfinite(swarm.sent_goal[j]).all()]
        if heard and radio.goal:
            k = min(heard, key=lambda k: np.hypot(*(goals[k] - swarm.position[i])))
            out["heard_goal"][i] = framed(model, i, goals[k])
    return out


@pytest.mark.slow
@settings(max_examples=60)
@given(seeds)
def test_random_worlds_are_heard_as_a_twin_that_tries_all_pairs_hears_them(seed):
    rng = np.random.default_rng(seed)
    world = random_world(seed, most_robots=25)
    model = world.model()
    state, goal = [(True, True), (True, False), (False, True)][rng.integers(3)]
    model.communication = Radio(
        range=rng.uniform(5, 150),
        state=state,
        goal=goal,
        occlusion=bool(rng.random() < 0.7),
        loss_probability=rng.choice([0.0, 0.4]),
        beacons=rng.uniform((0, 0), (200, 150), (rng.integers(3) if goal else 0, 2)),
    )
    n = len(model.swarm)
    goals = np.where(rng.random((n, 1)) < 0.5, rng.uniform(-40, 40, (n, 2)), np.nan)
    model.control = Subsumption(Broadcasting(rng.integers(-1, 3, n), goals))
    model.step()
    ahead = copy.deepcopy(model.streams)["communication"]
    expected = twin(model, int(ahead.integers(2**64, dtype=np.uint64)))
    model.step()
    for name in HEARD:
        np.testing.assert_allclose(getattr(model.swarm, name), expected[name], rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.slow
@settings(max_examples=30)
@given(seeds)
def test_robots_created_in_another_order_hear_the_same(seed):
    rng = np.random.default_rng(seed)
    n = 40
    poses, goals = rng.uniform((10, 10, -3), (390, 290, 3), (n, 3)), rng.uniform(-40, 40, (n, 2))
    tasks, order = rng.integers(-1, 3, n), rng.permutation(n)
    models = []
    for rows in (np.arange(n), order):
        model = empty(communication=Radio(occlusion=True))
        model.add_obstacle(rectangle((180, 50), (200, 200)))
        model.add_robots(blind(radius=0.01), poses=poses[rows])
        model.control = Subsumption(Broadcasting(tasks[rows], goals[rows]))
        models.append(model.run(2).swarm)
    for name in HEARD:
        np.testing.assert_allclose(getattr(models[0], name)[order], getattr(models[1], name), rtol=0, atol=1e-9)
