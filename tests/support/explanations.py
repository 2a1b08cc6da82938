"""Watched models, and explanations of what their first robot does."""

import re

from mesa_swarm import AGENT9, HolonomicDrive, ProximitySensor, RobotDesign, disc
from mesa_swarm.control import Subsumption
from support.scenes import empty

EYES = tuple(ProximitySensor(bearing_degrees=10.0 * k, field_of_view_degrees=10, range=150) for k in range(36))
ROUND, GLIDER = RobotDesign(sensors=EYES), RobotDesign(sensors=EYES, drive=HolonomicDrive())
OBSTACLE, ROBOT, FIRE, LOAD = range(4)
AHEAD = disc((220, 150), 5)


def watched(*layers, design=AGENT9, poses=((200, 150, 0.0),), obstacles=(), tendency="left", **options):
    """Return a watched model whose first robot is at (200, 150) and heads right."""
    model = empty(**options)
    for shape in obstacles:
        model.add_obstacle(shape)
    model.add_robots(design, poses=list(poses), tendency=tendency)
    model.control = Subsumption(*layers)
    model.watch()
    return model


def first(model):
    return next(iter(model.robots))


def explanation(model, step=None):
    """Return the explanation of the first robot, asserting that it is a sentence of one line."""
    why = model.explain(first(model), step)
    assert re.fullmatch(r"step [\d,]+: robot \d+ [^\n]+", str(why))
    assert "nan" not in str(why)
    return why
