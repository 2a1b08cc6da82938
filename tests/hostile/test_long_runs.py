"""Memory stays flat over long runs, but for what is collected on request."""

import gc
import tracemalloc
from contextlib import ExitStack

import pytest

from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.flocking import Flocking
from mesa_swarm.models.q_learning import QLearning
from support.hostile import _status

pytestmark = pytest.mark.slow
MODELS = [FireFighting, QLearning, CooperativeTransport, Flocking]


def grown(model, first, last):
    """Return by how many bytes Python's objects, and the process, grow from one step to another."""
    _step(model, 20)  # compiles
    tracemalloc.start()
    try:
        _step(model, first)  # fills windows
        gc.collect()
        before, resident = tracemalloc.get_traced_memory()[0], _status("VmRSS")
        _step(model, last - first)
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - before, (_status("VmRSS") - resident) * (1 << 20)
    finally:
        tracemalloc.stop()


def _step(model, steps):
    """Take steps, also after the model is done."""
    for _ in range(steps):
        model.step()


def begun(model_class, tmp_path, watched, stack):
    model = model_class(n_robots=20, rng=1)
    model.collect_every = model.fires.history.every = 0
    if watched:
        model.watch(last=50)
        stack.enter_context(model.record(tmp_path / "long.arrow", every=10, checkpoint_every=1000, overwrite=True))
    return model


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize("model_class", MODELS, ids=lambda model: model.__name__)
def test_ten_times_as_many_steps_take_no_more_memory(model_class, watched, tmp_path, tally, amount):
    first = amount(300, 50_000)  # at length a million robot-steps, then ten million
    with ExitStack() as stack:
        objects, resident = grown(begun(model_class, tmp_path, watched, stack), first, amount(1500, 10 * first))
    area = tally("long runs: " + ("watched and recorded" if watched else "alone"))
    # Of a recording a few bytes a chunk and a checkpoint remain.
    area.check(f"{model_class.__name__} objects", objects < 100_000, f"grew by {objects} bytes")
    area.check(f"{model_class.__name__} process", resident < 20_000_000, f"grew by {resident:.0f} bytes")


def test_what_is_collected_is_what_grows(tally):
    every = {k: grown(_collecting(k), 200, 2200)[0] for k in (1, 10)}
    area = tally("long runs: collected")
    area.check("each step", 40_000 < every[1] < 2_000_000, f"grew by {every[1]} bytes")
    area.check("every tenth", every[10] < every[1] / 5, f"grew by {every[10]} bytes")


def test_the_history_of_fires_grows_too_and_its_own_setting_ends_that(tally):
    every = {k: grown(_collecting(0, k), 200, 2200)[0] for k in (1, 0)}
    area = tally("long runs: fires' history")
    area.check("each step", 200_000 < every[1] < 2_000_000, f"grew by {every[1]} bytes")
    area.check("never", every[0] < 40_000, f"grew by {every[0]} bytes")


def _collecting(every, history_every=0):
    model = FireFighting(n_robots=5, history_every=history_every, rng=1)
    model.collect_every = every
    return model
