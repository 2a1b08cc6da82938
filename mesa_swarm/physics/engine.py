"""The compiled engine: what sensing and moving do to the swarm's columns."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from mesa_swarm.geometry.block import Block
from mesa_swarm.geometry.grid import Grid
from mesa_swarm.physics.crowd import Crowd
from mesa_swarm.physics.loads import carry
from mesa_swarm.physics.motion import achieved_motion, slip_of
from mesa_swarm.physics.packed import MOVING, SENSING, move_packed, sense_packed
from mesa_swarm.physics.sensing import err, sense_inside, sense_line, sense_proximity, sense_radiation
from mesa_swarm.physics.separation import MARGIN
from mesa_swarm.physics.settle import settle
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.physics.threads import ROW_THREADS, OnRows
from mesa_swarm.physics.travel import travel, travel_pieces, travel_together
from mesa_swarm.robots.design import DRIVE_SPEED, PERIOD
from mesa_swarm.robots.drive import DifferentialDrive, Drive, accelerate, lose_motion, slipped_wheels
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import Statics

FEWEST_CELLS = 64
CELLS_PER_ROBOT = 4
# Fewer robots are not shared among threads: to wake these takes longer than they would save.
FEWEST_ROWS = 10_000
CONTACT_COLUMNS = ("contact_kind", "contact_index", "contact_normal", "contact_depth")
Rows = list[tuple[Drive, Any]]


class Engine(Protocol):
    """Computes sensing and contact: `CompiledEngine` or the Shapely twin."""

    threads: int

    def sense(self, swarm: Swarm, surroundings: Surroundings, step: int, draws: np.ndarray | None) -> None:
        """Write all readings; `draws` (n, s), uniform in [0, 1), are for the sensors' errors."""

    def move(self, swarm: Swarm, surroundings: Surroundings, turn_angle: float, draws: np.ndarray | None) -> np.ndarray:
        """Move all robots by their commands, resolve contacts, and return the speeds at which wheels rolled (n, w).

        `draws` (n, w) are for the wheels' slip.
        """

    def settle(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Move robots that overlap anything to free room nearby."""


class CompiledEngine:
    """Sensing and contact by compiled functions on a uniform grid."""

    def __init__(self) -> None:
        self.threads = 1
        self._version = -1
        self._surroundings: Surroundings | None = None
        self._listed = False  # whether pairs are those of the present places
        self._motion, self._extra_turn = np.zeros((0, 3)), np.zeros(0)
        self._drives: Rows = []
        self._wheels = np.zeros((0, 2))
        self._looking: Block | None = None
        self._moving: Block | None = None

    def sense(self, swarm: Swarm, surroundings: Surroundings, step: int, draws: np.ndarray | None) -> None:
        """Write the columns distance, kind, radiation and line."""
        self._prepare(swarm, surroundings)
        columns, table = swarm.columns, swarm.table
        position, heading, design = columns["position"], columns["heading"], columns["design"]
        if columns["distance"].shape[1]:
            old = (columns["distance"].copy(), columns["kind"].copy()) if table.slow else None
            self._sense_proximity(swarm, surroundings, step, draws)
            if old:
                hold_readings(swarm, step, *old)
        if columns["radiation"].shape[1]:
            sources, temperature = surroundings.sources, surroundings.temperature
            sense_radiation(position, heading, design, table.radiation, sources, temperature, columns["radiation"])
        if columns["line"].shape[1]:
            marks = surroundings.marks
            sense_line(position, heading, design, table.line, marks.edges, marks.rings, marks.discs, columns["line"])

    def move(self, swarm: Swarm, surroundings: Surroundings, turn_angle: float, draws: np.ndarray | None) -> np.ndarray:
        """Write position, heading, slip and the contact columns; return the speeds at which wheels rolled."""
        self._prepare(swarm, surroundings)
        columns, crowd = swarm.columns, self._crowd
        if not self._listed:
            crowd.sort(columns["position"], columns["radius"], columns["number"])
            crowd.list_pairs(self._margin)
        self._listed = False  # from here on they are elsewhere
        together = self._parts(len(self._extra_turn)) > 1
        if self._moving is not None and draws is None and not together and surroundings.room is None:
            crowd.pairs = travel(move_packed, (self._moving.numbers,), crowd.pairs, turn_angle, *self._travelling)
            return self._wheels

        def go() -> np.ndarray:
            begin_way(surroundings)
            if not together:
                moved = self._travelling[:2] + self._travelling[3:]
                crowd.pairs = travel(travel_pieces, moved, crowd.pairs, turn_angle, *self._travelling)
            else:
                crowd.pairs = travel_together(self._share, crowd.pairs, turn_angle, *self._travelling)
            return self._extra_turn

        return move_by_commands(swarm, surroundings, draws, self._drives, self._motion, go)

    def settle(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Move robots that overlap anything to free room nearby."""
        self._prepare(swarm, surroundings)
        columns = swarm.columns
        bodies = columns["position"], columns["radius"], columns["number"]
        settle(*bodies, self._crowd.cells, self._statics, surroundings.statics.rings)

    def _sense_proximity(self, swarm: Swarm, surroundings: Surroundings, step: int, draws: np.ndarray | None) -> None:
        columns, table, statics = swarm.columns, swarm.table, surroundings.statics
        self._look(columns, surroundings)
        self._listed = True
        distance, kind = columns["distance"], columns["kind"]
        if table.exposed or swarm.disturbed:
            walls = statics.edges, statics.kind, statics.rings, statics.bounds
            robots = columns["position"], columns["heading"], columns["design"], table.proximity, table.counts
            sense_inside(*robots, *walls, distance, kind)
        if draws is not None:
            err(distance, columns["design"], table.proximity, table.noise, draws, step, columns["error"])

    def _look(self, columns: dict[str, np.ndarray], surroundings: Surroundings) -> None:
        """Write the readings without error, and list the pairs of robots near each other."""
        crowd, n = self._crowd, len(self._crowd.order)
        if self._looking is not None and self._parts(n) == 1:
            crowd.pairs = crowd.pairs_from(0, n, sense_packed, self._looking.numbers)
            return
        crowd.sort(columns["position"], columns["radius"], columns["number"])
        moving = None if surroundings.moving is None else surroundings.moving.seen

        def rows(first: int, last: int) -> np.ndarray:
            return crowd.pairs_from(first, last, sense_proximity, moving, *self._sensing)

        crowd.pairs = rows(0, n) if self._parts(n) == 1 else np.concatenate(self._share(n, rows))

    def _parts(self, n: int) -> int:
        """Return into how many ranges n rows are cut."""
        return self.threads if n >= FEWEST_ROWS else 1

    def _share(self, n: int, rows: OnRows) -> list[Any]:
        """Call ``rows(first, last)`` for the ranges of n rows, in as many threads, and return the results."""
        return ROW_THREADS.share(n, self._parts(n), rows)

    def _prepare(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Make the grids and the scratch arrays anew when robots, designs or obstacles have changed."""
        if self._version == swarm.version and self._surroundings is surroundings:
            return
        n = len(swarm)
        radius = swarm.radius
        self._largest_radius = float(radius.max(initial=0.0))
        self._margin = MARGIN * float(radius.min(initial=self._largest_radius))
        cell = max(2 * self._largest_radius + self._margin, 1e-9)
        grid = Grid.over(surroundings.bounds, cell, FEWEST_CELLS + CELLS_PER_ROBOT * n)
        self._crowd, self._listed = Crowd(grid.numbers, grid.cells, n), False
        self._motion, self._extra_turn = np.zeros((n, 3)), np.zeros(n)
        statics = surroundings.statics
        touched = statics.grid.numbers, statics.touched_start, statics.touched_items
        movers = None if surroundings.moving is None else surroundings.moving.numbers
        self._statics = statics.edges, statics.discs, statics.owner, statics.body, statics.bounds, *touched, movers
        self._drives = drives_by_rows(swarm)
        self._version, self._surroundings = swarm.version, surroundings
        self._collect_arguments(swarm, statics)

    def _collect_arguments(self, swarm: Swarm, statics: Statics) -> None:
        """Collect what `sense_proximity` and `travel` take of arrays that stay the same until robots change."""
        columns, table, crowd = swarm.columns, swarm.table, self._crowd
        self._sensing: tuple[Any, ...] = (
            *(crowd.order, crowd.listed, crowd.radii, self._largest_radius, self._margin, crowd.cells, crowd.start),
            *(columns["heading"], columns["design"], table.proximity, table.counts, table.reach),
            *(statics.edges, statics.discs, statics.kind, statics.grid.numbers),
            *(statics.seen_start, statics.seen_items, columns["distance"], columns["kind"]),
        )
        self._travelling: tuple[Any, ...] = (
            *(crowd.arrays, crowd.listed, crowd.cells, columns["position"], columns["heading"], self._motion),
            *(columns["radius"], self._statics, columns["collided"]),
            *(columns[name] for name in CONTACT_COLUMNS),
            self._extra_turn,
        )
        self._looking = self._moving = None
        if self._statics[-1] is None:  # no body moves
            self._pack(swarm)

    def _pack(self, swarm: Swarm) -> None:
        """Put the same arguments into blocks, as far as robots are plain."""
        columns, crowd, (_, _, _, largest_radius, margin, cells, _, *rest) = swarm.columns, self._crowd, self._sensing
        where = columns["position"], columns["radius"], columns["number"]
        self._looking = Block(SENSING, *where, cells, *crowd.sorted, largest_radius, margin, *rest)
        drives, table = [drive for drive, _ in self._drives], swarm.table
        if [type(drive) for drive in drives] == [DifferentialDrive] and not (
            table.limited or table.mixed or table.slides
        ):
            command, n = columns["command"], len(swarm)
            self._wheels = np.zeros((n, 2))
            scratch = command, self._wheels, columns["slip"], np.zeros((n, 2)), np.zeros(n)
            self._moving = Block(MOVING, *scratch, *self._travelling[:2], *self._travelling[3:])


def begin_way(surroundings: Surroundings) -> None:
    """Put driven bodies where they begin this step, and stop those that have a load in their way."""
    if surroundings.moving is not None:
        surroundings.moving.return_to_start(surroundings.blocked_by_loads)


def hold_readings(swarm: Swarm, step: int, old_distance: np.ndarray, old_kind: np.ndarray) -> None:
    """Put back the old readings of sensors that are not due in this step: those whose period does not divide it."""
    waits = step % np.maximum(swarm.table.noise[swarm.design, :, PERIOD], 1) != 0
    distance, kind = swarm.columns["distance"], swarm.columns["kind"]
    distance[waits], kind[waits] = old_distance[waits], old_kind[waits]


def drives_by_rows(swarm: Swarm) -> Rows:
    """Return each drive with the rows of the robots that have it; all rows as a slice, which does not copy."""
    drives: list[Drive] = []
    for design in swarm.designs:
        if design.drive not in drives:
            drives.append(design.drive)
    if len(drives) == 1:
        return [(drives[0], slice(None))]
    of_design = np.array([drives.index(design.drive) for design in swarm.designs], np.int64)
    return [(drive, np.flatnonzero(of_design[swarm.design] == k)) for k, drive in enumerate(drives)]


def move_by_commands(
    swarm: Swarm,
    surroundings: Surroundings,
    draws: np.ndarray | None,
    drives: Rows,
    motion: np.ndarray,
    travel: Callable[[], np.ndarray],
) -> np.ndarray:
    """Write the motion (n, 3), then slip, and return the speeds at which wheels rolled (n, w).

    `travel` moves all robots by the motion and returns by how much faces turned each.
    """
    columns = swarm.columns
    wheels = rolling_wheels(swarm, draws)
    write_motion(swarm, drives, wheels, motion)
    if swarm.table.slides:
        lose_motion(motion, columns["design"], swarm.table.directed)
        wheels = wheels_of(swarm, drives, motion)
    before, heading_before = columns["position"].copy(), columns["heading"].copy()
    extra_turn, collided = carry(surroundings, columns, motion, travel), columns["collided"]
    if np.count_nonzero(collided):
        achieved_motion(before, columns["position"], heading_before, extra_turn, collided, motion)
        wheels = np.where(collided[:, None], wheels_of(swarm, drives, motion), wheels)
    slip_of(columns["command"], wheels, columns["slip"])
    return wheels


def rolling_wheels(swarm: Swarm, draws: np.ndarray | None) -> np.ndarray:
    """Return the wheel speeds that acceleration and slip leave of the commands, shape (n, w)."""
    command, table = swarm.columns["command"], swarm.table
    if table.limited:
        reached = swarm.columns[DRIVE_SPEED]
        accelerate(command, table.acceleration, swarm.columns["design"], table.sideways, reached)
        command = reached
    if draws is None:
        return command
    wheels = np.empty_like(command)
    slipped_wheels(command, *table.slip, swarm.columns["design"], draws, wheels)
    return wheels


def write_motion(swarm: Swarm, drives: Rows, wheels: np.ndarray, motion: np.ndarray) -> None:
    """Write the motion (n, 3) that wheel speeds (n, w) make."""
    mixed = swarm.table.mixed
    for drive, rows in drives:
        made = motion[rows]
        own = (rows, slice(getattr(drive, "numbers", 2))) if mixed else rows
        drive.motion(wheels[own], swarm.columns["radius"][rows], made)
        motion[rows] = made


def wheels_of(swarm: Swarm, drives: Rows, motion: np.ndarray) -> np.ndarray:
    """Return the wheel speeds (n, w) that would have made these motions (n, 3)."""
    wheels, mixed = np.zeros((len(motion), swarm.table.wheels)), swarm.table.mixed
    for drive, rows in drives:
        own = (rows, slice(getattr(drive, "numbers", 2))) if mixed else rows
        made = wheels[own]
        drive.wheels(motion[rows], swarm.columns["radius"][rows], made)
        wheels[own] = made
    return wheels
