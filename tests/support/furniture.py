"""Worlds to which things were added in an order, and robots with noise."""

from mesa_swarm import AGENT9, AGENT_FIRE, disc, rectangle
from mesa_swarm.control import Avoid, Explore, Subsumption
from support.scenes import empty


def furnished(order, seed=3):
    """Return a world to which obstacles, fires and robots with given poses were added in this order."""
    model = empty(rng=seed)
    solids = [rectangle((100, 100), (140, 200)), disc((250, 80), 20), rectangle((300, 150), (320, 300))]
    add = {
        "obstacles": lambda: [model.add_obstacle(s) for s in solids],
        "backwards": lambda: [model.add_obstacle(s) for s in solids[::-1]],
        "fires": lambda: [model.add_fire((200 + 60 * k, 250), radius=15) for k in range(2)],
        "robots": lambda: model.add_robots(AGENT_FIRE, poses=[(30 + 24 * k, 40, 2.2 * k) for k in range(14)]),
    }
    for name in order:
        add[name]()
    model.control = Subsumption(Avoid(distance=8), Explore(turn_interval=60))
    return model


def noisy(**slip):
    design = AGENT9.with_proximity(error_probability=0.3, error_magnitude=0.5)
    return design.with_slip(**slip) if slip else design
