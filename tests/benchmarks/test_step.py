import pytest

from mesa_swarm_studies.benchmarks.speed import contact_alone, on_map, peer_workload


@pytest.mark.parametrize("n", [50, 200, 1000, 5000, 10_000])
def test_step_of_the_peer_workload(benchmark, n):
    model = peer_workload(n)
    model.step()
    benchmark(model.step)
    assert len(model.robots) == n


def test_step_of_contact_alone(benchmark):
    model = contact_alone(1000)
    model.step()
    benchmark(model.step)
    assert model.swarm.distance.shape == (1000, 0)


@pytest.mark.parametrize("sensors", [3, 6, 9])
@pytest.mark.parametrize("name", ["original", "sparse", "openspace"])
def test_step_on_a_map_of_the_thesis(benchmark, name, sensors):
    model = on_map(50, name, sensors)
    model.step()
    benchmark(model.step)
    assert model.swarm.distance.shape == (50, sensors)
