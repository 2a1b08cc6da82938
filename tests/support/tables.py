"""Tables of bodies without a model, and loads that are put elsewhere by hand."""

import math
from types import SimpleNamespace

import numpy as np

from mesa_swarm import disc
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.world.bodies import BodyTable
from mesa_swarm.world.statics import FIRE, FIXED, OBSTACLE


def add_standing(table: BodyTable, shapes=(), fires=(), temperature=None) -> None:
    """Append shapes that stand still, and fires (x, y, radius), which burn unless they have another temperature."""
    for shape in shapes:
        table.add(SimpleNamespace(), shape, mode=FIXED, kind=OBSTACLE)
    heats = np.ones(len(fires)) if temperature is None else temperature
    for (x, y, radius), heat in zip(fires, heats, strict=True):
        table.add(SimpleNamespace(), disc((x, y), radius), mode=FIXED, kind=FIRE, temperature=heat)


def surroundings_of(bounds, shapes=(), fires=(), temperature=None, *, loads=(), sight: float, touch: float):
    """Return a world of shapes, loads and fires, in this order."""
    table = loads[0].table if loads else BodyTable()
    first = len(table)
    add_standing(table, shapes, fires, temperature)
    standing = np.arange(first, len(table))
    rows = [*standing[: len(shapes)], *(load.row for load in loads), *standing[len(shapes) :]]
    return Surroundings.of(bounds, table, np.array(rows, np.int64), sight=sight, touch=touch, apart=len(fires))


def put(load, pose) -> None:
    """Put a load elsewhere, unchecked."""
    load.table.put(load.row, pose)


def note(load, *, moved: bool, pushers: int) -> None:
    """Write what happened to a load in the last step."""
    load.table.moved[load.row], load.table.pushers[load.row] = moved, pushers


def farthest_from(load, pose) -> float:
    """Return an upper bound of the distance of a load's points from where they are at another pose."""
    x, y, heading = load.pose
    turned = 2.0 * abs(math.sin((heading - pose[2]) / 2.0))
    return math.hypot(x - pose[0], y - pose[1]) + load.form.reach * turned
