"""Robots that drive at constant speeds, in the open or at a wall."""

from mesa_swarm.control import Subsumption
from support.scenes import blind, circle, empty


def alone(left, right, steps=1, pose=(200, 150, 0.0), design=None, **options):
    """Drive one robot at constant rim speeds (shares of its greatest) and return the model."""
    model = empty(**options)
    model.add_robots(design or blind(), poses=[pose])
    model.control = Subsumption(circle(left=left, right=right))
    return model.run(steps)


def pose_of(model):
    return (*model.swarm.position[0], model.swarm.heading[0])


def at_wall(heading, command=(1.0, 1.0), steps=1, **options):
    """Return a model in which a robot touched the right-hand border (a flat face) before the last steps."""
    pose = (395, 150, heading)
    return alone(*command, steps, pose, **options)
