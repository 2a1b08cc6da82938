from dataclasses import replace

import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from support.chunks import recorded_in_full_chunks


def recorded(model, path, steps, **more):
    with model.record(path, **more):
        model.run(steps)
    return Recording(path)


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """Return a closed recording of 300 steps of 15 robots and 7 fires, in two chunks."""
    path = tmp_path_factory.mktemp("run") / "run.arrow"
    return Recording(recorded_in_full_chunks(FireFighting(n_robots=15, strategy="A", rng=1), path, 300))


@pytest.fixture(scope="session")
def pushed(tmp_path_factory):
    """Return a recording of a load that was moved by hand after 20 of 40 steps."""
    path = tmp_path_factory.mktemp("pushed") / "run.arrow"
    model = CooperativeTransport(n_robots=3, load="box", rng=2)
    with model.record(path):
        model.run(20)
        model.loads[0].move_to((400.0, 200.0, 0.5))
        model.run(20)
    return Recording(path)


@pytest.fixture(scope="session")
def rebuilt(tmp_path_factory):
    """Return a recording in which an obstacle stands during steps 6 to 10, and a wide robot from step 6 on."""
    path = tmp_path_factory.mktemp("rebuilt") / "run.arrow"
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    with model.record(path):
        model.run(5)
        wall = model.add_obstacle(disc((400, 300), 50))
        model.add_robots(replace(AGENT9, name="wide", radius=20.0), poses=[(600, 200, 0.0)])
        model.run(5)
        wall.remove()
        model.run(5)
    return Recording(path)


@pytest.fixture(scope="session")
def fires(tmp_path_factory):
    """Return the path of a recording of 300 steps of 20 robots and seven fires."""
    path = tmp_path_factory.mktemp("viewing") / "fires.arrow"
    model = FireFighting(n_robots=20, communication="goal", rng=5)
    return recorded_in_full_chunks(model, path, 300)


@pytest.fixture(scope="session")
def transport(tmp_path_factory):
    """Return the path of a recording of 120 steps of 12 robots, a mark and a load that they move."""
    path = tmp_path_factory.mktemp("viewing") / "transport.arrow"
    model = CooperativeTransport(n_robots=12, load="box", resistance=0.5, rng=1)
    with model.record(path):
        model.run(120)
    return path
