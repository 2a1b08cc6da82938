"""Contacts as arrays, read after a step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import BORDER, FIRE, ROBOT


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Contacts:
    """The deepest contact of every robot that collided in a step; one row a robot.

    Parameters
    ----------
    robot : int64 ndarray, shape (k,)
        unique_id of the robot, ascending.
    kind : int64 ndarray, shape (k,)
        What it met: 0 obstacle or border, 1 robot, 2 fire, 3 load.
    other : int64 ndarray, shape (k,)
        unique_id of what it met, -1 for the border, or for what has been removed since.
    normal : ndarray, shape (k, 2)
        Unit vector from the other to the robot.
    depth : ndarray, shape (k,)
        Overlap before it was resolved, map units.
    """

    robot: np.ndarray
    kind: np.ndarray
    other: np.ndarray
    normal: np.ndarray
    depth: np.ndarray

    @classmethod
    def of(cls, swarm: Swarm, obstacles: Sequence, fires: Sequence) -> "Contacts":
        """Collect the contacts of the last step."""
        rows = np.flatnonzero(swarm.collided)
        kind, index = swarm.contact_kind[rows], swarm.contact_index[rows]
        others = {ROBOT: swarm.agents, FIRE: fires}
        ids = [
            -1 if i == BORDER else others.get(k, obstacles)[i].unique_id
            for k, i in zip(kind.tolist(), index.tolist(), strict=True)
        ]
        return cls(
            robot=np.array([swarm.agents[row].unique_id for row in rows], np.int64),
            kind=kind,
            other=np.array(ids, np.int64),
            normal=swarm.contact_normal[rows],
            depth=swarm.contact_depth[rows],
        )
