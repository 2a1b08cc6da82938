"""The Shapely engine: what the compiled engine computes, through Shapely alone.

Slow, short and readable. It shares the arithmetic of wheels, arcs and errors with the compiled engine, and
its constants, but nothing that measures a shape: it is the oracle that the other is tested against.
"""

from collections.abc import Iterator

import numpy as np

from mesa_swarm.physics.loads import carry
from mesa_swarm.physics.motion import achieved_motion, slip_of
from mesa_swarm.physics.scene import Scene
from mesa_swarm.physics.sensing import err
from mesa_swarm.physics.shapely_contact import travel
from mesa_swarm.physics.shapely_sensing import sense_line, sense_proximity, sense_radiation
from mesa_swarm.physics.shapely_settle import settle
from mesa_swarm.physics.shapely_solids import Solids
from mesa_swarm.robots.drive import Drive, slipped_wheels
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.robots.table import PERIOD


class ShapelyEngine:
    """Sensing and contact by Shapely: the readable twin of `CompiledEngine`.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> model = SwarmModel(map="original", rng=1, engine="shapely")
    >>> robots = model.add_robots(AGENT9, poses=[(770, 300, 0.0)])
    >>> model.sense()
    >>> round(float(robots[0].distance[0]), 9)
    5.0
    """

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._solids: Solids | None = None

    def sense(self, swarm: Swarm, scene: Scene, step: int, draws: np.ndarray | None) -> None:
        """Write the columns distance, kind, radiation and line."""
        columns, table = swarm.columns, swarm.table
        distance, kind = columns["distance"], columns["kind"]
        held = distance.copy(), kind.copy()
        sense_proximity(swarm, scene, self._solids_of(swarm, scene), distance, kind)
        if draws is not None:
            err(distance, columns["design"], table.proximity, table.noise, draws, step, columns["error"])
        waits = step % np.maximum(table.noise[swarm.design, :, PERIOD], 1) != 0
        distance[waits], kind[waits] = held[0][waits], held[1][waits]
        sense_radiation(swarm, scene, columns["radiation"])
        sense_line(swarm, scene, columns["line"])

    def move(self, swarm: Swarm, scene: Scene, turn_angle: float, draws: np.ndarray | None) -> None:
        """Write position, heading, slip and the contact columns."""
        columns = swarm.columns
        before, heading_before = swarm.position.copy(), swarm.heading.copy()
        wheels = rolling_wheels(swarm, draws)
        motion = motion_of(swarm, wheels)

        def go() -> np.ndarray:
            return travel(columns, motion, turn_angle, self._solids_of(swarm, scene))

        extra_turn = carry(scene, columns, motion, go)
        position, collided = columns["position"], columns["collided"]
        achieved_motion(before, position, heading_before, extra_turn, collided, motion)
        wheels = np.where(collided[:, None], wheels_of(swarm, motion), wheels)
        slip_of(columns["command"], wheels, columns["slip"])

    def settle(self, swarm: Swarm, scene: Scene) -> None:
        """Move robots that overlap anything to free room nearby."""
        settle(swarm.columns, scene.bounds, self._solids_of(swarm, scene))

    def _solids_of(self, swarm: Swarm, scene: Scene) -> Solids:
        """Return the scene's solids, collected anew when it has changed, and always where loads may have moved."""
        if self._solids is None or self._scene is not scene or scene.loads:
            largest = max((design.radius for design in swarm.designs), default=0.0)
            margin = 1.0 + 2.0 * (largest + swarm.table.reach.max(initial=0.0))
            self._scene, self._solids = scene, Solids.of(scene, margin)
        return self._solids


def rolling_wheels(swarm: Swarm, draws: np.ndarray | None) -> np.ndarray:
    """Return the wheel speeds that slip leaves of the commands, shape (n, 2)."""
    command = swarm.columns["command"]
    if draws is None:
        return command
    wheels = np.empty_like(command)
    slipped_wheels(command, *swarm.table.slip, swarm.columns["design"], draws, wheels)
    return wheels


def motion_of(swarm: Swarm, wheels: np.ndarray) -> np.ndarray:
    """Return the motions (n, 3) that these wheel speeds make."""
    motion = np.zeros((len(swarm), 3))
    for drive, rows in _by_design(swarm):
        made = motion[rows]
        drive.motion(wheels[rows], swarm.columns["radius"][rows], made)
        motion[rows] = made
    return motion


def wheels_of(swarm: Swarm, motion: np.ndarray) -> np.ndarray:
    """Return the wheel speeds (n, 2) that would have made these motions."""
    wheels = np.zeros((len(swarm), 2))
    for drive, rows in _by_design(swarm):
        made = wheels[rows]
        drive.wheels(motion[rows], swarm.columns["radius"][rows], made)
        wheels[rows] = made
    return wheels


def _by_design(swarm: Swarm) -> Iterator[tuple[Drive, np.ndarray]]:
    for d, design in enumerate(swarm.designs):
        yield design.drive, np.flatnonzero(swarm.design == d)
