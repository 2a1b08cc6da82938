import pytest
from support.chunks import recorded_in_full_chunks

from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting


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
