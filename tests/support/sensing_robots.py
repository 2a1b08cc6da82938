"""A robot that carries given sensors, and what it reads."""

from mesa_swarm import RobotDesign
from support.scenes import empty

OBSTACLE, ROBOT, FIRE, NOTHING = 0, 1, 2, -1


def carrying(*sensors, radius=5.0):
    return RobotDesign(radius=radius, sensors=sensors)


def looker(*sensors, heading=0.0, model=None, **options):
    """Return a world with one robot at (200, 150) that carries these sensors."""
    model = model or empty(**options)
    return model, model.add_robots(carrying(*sensors), poses=[(200, 150, heading)])[0]


def seen(model):
    model.sense()
    return model.swarm.distance[0].tolist(), model.swarm.kind[0].tolist()
