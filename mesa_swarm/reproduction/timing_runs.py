"""Runs that measure the processor time of a step (thesis 4.8)."""

from time import process_time

from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.experiments.workload import BY_SENSORS
from mesa_swarm.model import SwarmModel
from mesa_swarm.robots.design import RobotDesign

# Steps until as many robots meet as ever will.
WARM_UP = 50
BATCHES = 5
# Without control robots drive in circles: straight on, all would end in heaps at the border.
CIRCLE = (1.0, 0.8)


def timing_run(rng: int, *, robots: int, map: str, sensors: int, milliseconds: float) -> dict[str, float]:
    """Return the processor time of a step: the least mean of five batches, which others disturb least.

    Parameters
    ----------
    rng : int
    robots : int
    map : str
    sensors : int
        3, 6 or 9 and robots that avoid and explore; 0 and robots that are moved, and nothing but contact.
    milliseconds : float
        Of processor time for each batch, about.

    Examples
    --------
    >>> timing_run(1, robots=5, map="original", sensors=3, milliseconds=1.0)["seconds"] > 0
    True
    """
    model = timed_world(rng, robots, map, sensors).run(WARM_UP)
    started = process_time()
    model.run(20)
    each = max((process_time() - started) / 20, 1e-6)
    steps = max(int(milliseconds / 1000 / each), 5)
    return {"seconds": min(batch_seconds(model, steps) for _ in range(BATCHES))}


def timed_world(rng: int, robots: int, map: str, sensors: int) -> SwarmModel:
    """Return the world that is timed.

    Examples
    --------
    >>> timed_world(1, 3, "sparse", 0).swarm.distance.shape
    (3, 0)
    """
    model = SwarmModel(map=map, rng=rng)
    model.add_robots(BY_SENSORS[sensors] if sensors else RobotDesign(name="blind"), robots)
    if sensors:
        model.control = Subsumption(Avoid(distance=15), Explore())
    else:
        model.swarm.columns["command"][:] = CIRCLE
    return model


def batch_seconds(model: SwarmModel, steps: int) -> float:
    """Return the mean processor time of so many steps."""
    started = process_time()
    for _ in range(steps):
        model.step()
    return (process_time() - started) / steps
