"""Small worlds of solid bodies as both engines take them, without a model."""

from typing import NamedTuple

import numpy as np

from mesa_swarm import disc, polygon, rectangle
from mesa_swarm.geometry.grid import Grid
from mesa_swarm.kernels.block import Block
from mesa_swarm.physics.contact import ContactArrays, StaticArrays
from mesa_swarm.physics.crowd import CrowdArrays
from mesa_swarm.physics.shapely_engine import Solids, Touches
from mesa_swarm.physics.surroundings import Surroundings

from .tables import surroundings_of

BOUNDS = (10.0, -5.0, 110.0, 75.0)
SHAPES = (
    rectangle((40, 20), (60, 35)),
    disc((85, 55), 8),
    polygon([(20, 50), (45, 52), (22, 66), (30, 56)]),
    rectangle((70, 0), (80, 10), contact=False),
    disc((95, 10), 5),
)
FIRES = np.array([[70.0, 30.0, 4.0], [30.0, 10.0, 3.0]])
TEMPERATURE = np.array([1.0, 0.0])


class SolidWorld(NamedTuple):
    """A world: for compiled functions, and for their twins."""

    surroundings: Surroundings
    statics: StaticArrays
    rings: np.ndarray
    solids: Solids
    grid: tuple


def solid_world(shapes=SHAPES, fires=FIRES, bounds=BOUNDS, touch=6.0) -> SolidWorld:
    """Return a world in which bodies within `touch` of a centre can be touched."""
    temperature = np.resize(TEMPERATURE, len(fires))
    around = surroundings_of(bounds, shapes, fires.reshape(-1, 3), temperature, sight=70.0, touch=touch)
    grid = Grid.over(bounds, 3 * touch, 400).numbers
    return SolidWorld(around, around.solids, around.statics.rings, Solids.of(around, 50.0), grid)


def crowd_in(world: SolidWorld, position: np.ndarray, radius: np.ndarray, **arrays) -> tuple[CrowdArrays, tuple]:
    """Return robots at these places, in that order, and what compiled functions take of them and the world.

    Other `arrays` replace the robots' own: `before`, `reference`, `free`, `contacts`.
    """
    number = np.arange(len(radius))
    crowd = CrowdArrays.of(world.grid, position, radius, number)
    crowd = crowd._replace(places=position, radii=radius, numbers=number, reference=position.copy())._replace(**arrays)
    return crowd, (Block(crowd).numbers, Block(world.statics).numbers, None)


def contacts_of(n: int) -> tuple[ContactArrays, Touches]:
    """Return where n robots' contacts are noted, for compiled functions and for their twins."""
    columns = {
        "number": np.arange(n),
        "contact_kind": np.zeros(n, np.int64),
        "contact_index": np.zeros(n, np.int64),
        "contact_normal": np.zeros((n, 2)),
        "contact_depth": np.zeros(n),
    }
    return ContactArrays.of(n), Touches(columns)
