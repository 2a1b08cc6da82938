import math

import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Gather, Subsumption
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import find_model

# Map units squared, as on openspace with 50 robots.
ROOM = 9600.0


@pytest.mark.parametrize("name", ["agglomeration", "chain_formation", "flocking"])
def test_step_of_fifty_robots_with_three_layers_and_what_is_collected(benchmark, name):
    model = find_model(name)(n_robots=50, rng=1).run(20)
    benchmark(model.step)
    assert len(model.control.layers) == 3
    assert len(model.datacollector.model_vars["collisions"]) == model.steps


def test_step_of_ten_thousand_robots_that_gather(benchmark):
    side = math.sqrt(ROOM * 10_000)
    model = SwarmModel(map=Map(name="large", bounds=(0, 0, side, side)), rng=1)
    model.add_robots(AGENT9.with_proximity(range=50), 10_000)
    gather = Gather(critical_angle_degrees=10, stop_distance=12)
    model.control = Subsumption(Avoid(distance=4), gather, Explore())
    model.run(10)
    benchmark(model.step)
    assert (model.swarm.layer == 1).any()
