import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from support.chunks import recorded_in_full_chunks


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Return the path of a closed recording of 600 steps of 12 robots, in three chunks."""
    path = tmp_path_factory.mktemp("recorded") / "run.arrow"
    model = FireFighting(n_robots=12, strategy="A", rng=5)
    return recorded_in_full_chunks(model, path, 600)


@pytest.fixture(scope="session")
def recorded_run(recorded):
    """Return the same, for those who have a `recorded` of their own."""
    return recorded
