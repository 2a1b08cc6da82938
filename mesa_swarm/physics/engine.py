"""The compiled engine: what sensing and moving do to the swarm's columns."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.random import Generator

from mesa_swarm.geometry.grid import Grid
from mesa_swarm.kernels.block import Block, KernelCall, code_address, stack_blocks
from mesa_swarm.kernels.draws import Stream, stream_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.physics.arcs import write_achieved_motion, write_wheel_slip
from mesa_swarm.physics.crowd import LISTED, Crowd, SortCalls, copy_sorted, fill_cells, find_cells
from mesa_swarm.physics.loads import (
    LoadArrays,
    find_stuck_loads,
    note_stuck_loads,
    push_all,
    push_loads_of_robots,
    return_loads,
    take_back_loads,
)
from mesa_swarm.physics.placing import settle_robots
from mesa_swarm.physics.sector_tables import clearance_of, tables_of_sectors
from mesa_swarm.physics.sensing import ChunkArrays, EyeArrays
from mesa_swarm.physics.sensor_noise import NO_NOISE, SensorNoise
from mesa_swarm.physics.separation import MARGIN
from mesa_swarm.physics.stage_kernels import (
    ONLY,
    REWIND,
    SETTLE,
    DeviceArrays,
    ErrorArrays,
    LoadCalls,
    MoveArrays,
    ProximityArrays,
    SenseArrays,
    SenseCalls,
    SettleArrays,
    WheelArrays,
    arrive,
    move_robots,
    move_robots_and_movers,
    sense_alone,
    sense_alone_beside_movers,
    sense_robots,
    sense_robots_and_movers,
    sense_rows,
    sense_rows_beside_movers,
    sense_together,
    set_out,
    settle_first,
)
from mesa_swarm.physics.stopping import StopBodiesArrays, stop_at_loads, stop_bodies
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.physics.threads import RowCrew
from mesa_swarm.physics.travel import Blocks, RobotArrays, calls_of_travel, travel
from mesa_swarm.robots.design import DRIVE_SPEED
from mesa_swarm.robots.drive import KINDS_OF_DRIVES, Drive, accelerate, lose_motion, slip_wheels
from mesa_swarm.robots.swarm import Swarm

FEWEST_CELLS = 64
CELLS_PER_ROBOT = 4
# Fewer robots are not shared among threads: these would wait for each other longer than they work.
FEWEST_ROWS = 500
# Nor are so few in a step that is taken by itself: to wake threads takes longer than they would save.
FEWEST_WAKING = 10_000
CONTACT_COLUMNS = ("contact_kind", "contact_index", "contact_normal", "contact_depth")
Rows = list[tuple[Drive, Any]]
# Of worlds without and with driven bodies: what senses alone and by threads, and what threads share.
SENSING = sense_alone, sense_together, sense_rows
SENSING_BESIDE_MOVERS = sense_alone_beside_movers, sense_together, sense_rows_beside_movers
# Of a block, and of a call, that there is not.
NO_NUMBERS = np.empty(0, np.int64)
NO_CALL = KernelCall(0, NO_NUMBERS)


class Engine(ABC):
    """Computes sensing and contact: `CompiledEngine` or the Shapely twin. What moves in which order they share.

    Attributes
    ----------
    threads : int
    crew : RowCrew or None
        The threads that share rows in compiled code, if any do.
    """

    crew: RowCrew | None = None

    def __init__(self) -> None:
        self.threads = 1
        self._version = -1
        self._surroundings: Surroundings | None = None
        self._drives: Rows = []
        self._motion = np.zeros((0, 3))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what refers to arrays: a copied or unpickled engine prepares anew."""
        return vars(type(self)()) | {"threads": self.threads}

    def at_work(self, robots: int) -> AbstractContextManager:
        """Return what lets threads share the steps of this number of robots, as long as it lasts."""
        return nullcontext()

    @abstractmethod
    def sense(self, swarm: Swarm, surroundings: Surroundings, step: int, noise: SensorNoise | None) -> None:
        """Write all readings of a step, counted from 0; `noise` is what errors are drawn from, None for none."""

    @abstractmethod
    def travel(self, swarm: Swarm, surroundings: Surroundings, motion: np.ndarray, turn_angle: float) -> np.ndarray:
        """Move driven bodies and all robots, resolve contacts, and return by how much faces turned each robot (rad).

        `motion` (n, 3) is along the body: ahead, to the left, map units a step, and the turn, rad.
        """

    def sensing(
        self, swarm: Swarm, surroundings: Surroundings, noise: SensorNoise | None, due: Mapping[str, bool]
    ) -> dict[str, Any]:
        """Return the fields of the stage that senses: its kernel, or what makes Python `due`, and what is compiled."""
        return {"python": "the Shapely twin"}

    def moving(
        self, swarm: Swarm, surroundings: Surroundings, driven: np.ndarray, turn_angle: float, stream: Generator | None
    ) -> dict[str, Any]:
        """Return the fields of the stage that moves robots, likewise; arguments are those of `move`."""
        return {"python": "the Shapely twin"}

    @abstractmethod
    def settle(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Move robots that overlap anything to free room nearby."""

    def settling(self, swarm: Swarm, surroundings: Surroundings) -> Kernel:
        """Return the kernel that has robots settled which overlap anything, for those that follow in a sequence."""

        def attend(code: int) -> None:
            self.settle(swarm, surroundings)
            swarm.disturbed = False

        block = Block(SettleArrays(swarm.disturbances))
        return Kernel(settle_first, block.numbers, block, attend)

    def move(
        self, swarm: Swarm, surroundings: Surroundings, driven: np.ndarray, turn_angle: float, stream: Generator | None
    ) -> None:
        """Move loads, driven bodies and robots, and write position, heading, slip and the contact columns.

        Parameters
        ----------
        driven : ndarray, shape (n, w)
            Speeds at which motors drive the wheels, map units a step: the column command, or what imperfections
            leave of it.
        turn_angle : float
            Robots that meet a flat face at an angle to its normal larger than this, rad, turn along it.
        stream : Generator, optional
            From which the wheels' slip is drawn; without it none slips by chance.
        """
        self._prepare(swarm, surroundings)
        columns, table, room = swarm.columns, swarm.table, surroundings.room
        motion, drives, collided = self._motion, self._drives, columns["collided"]
        wheels = rolling_wheels(swarm, driven, None if stream is None else stream.random(driven.shape))
        write_motion(swarm, drives, wheels, motion)
        if table.slides:
            lose_motion(motion, columns["design"], table.directed)
            wheels = wheels_of(swarm, drives, motion)
        start, start_heading = columns["position"].copy(), columns["heading"].copy()
        pushed = {} if room is None else push_all(surroundings, room, columns, motion)
        extra_turn = self.travel(swarm, surroundings, motion, turn_angle)
        while room is not None and (stuck := find_stuck_loads(surroundings, room, pushed, columns)):
            columns["position"][:], columns["heading"][:] = start, start_heading
            return_loads(surroundings, room, pushed, stuck)
            extra_turn = self.travel(swarm, surroundings, motion, turn_angle)
        if np.count_nonzero(collided):
            write_achieved_motion(start, columns["position"], start_heading, extra_turn, collided, motion)
            wheels = np.where(collided[:, None], wheels_of(swarm, drives, motion), wheels)
        write_slip(swarm, driven, wheels)

    def _prepare(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Make scratch arrays and tables anew when robots, designs or obstacles have changed."""
        if self._version == swarm.version and self._surroundings is surroundings:
            return
        self._renew(swarm, surroundings)
        self._version, self._surroundings = swarm.version, surroundings

    def _renew(self, swarm: Swarm, surroundings: Surroundings) -> None:
        self._motion, self._drives = np.zeros((len(swarm), 3)), drives_by_rows(swarm)


class CompiledEngine(Engine):
    """Sensing and contact by compiled functions on a uniform grid."""

    crew: RowCrew

    def __init__(self) -> None:
        super().__init__()
        self._sense_kernel: Kernel | None = None
        self._noise: SensorNoise | None = None
        self._move_kernel: Kernel | None = None
        self._driven: np.ndarray | None = None
        self._slip_stream: Generator | None = None
        self._turn_angle = np.zeros(1)
        self.crew = RowCrew()

    def at_work(self, robots: int) -> AbstractContextManager:
        """Let threads share the rows of steps, where there are enough robots."""
        return self.crew if self._parts(robots) > 1 else nullcontext()

    def _waking(self, robots: int) -> AbstractContextManager:
        """Do the same for a stage of a step that is taken by itself."""
        return self.at_work(robots) if robots >= FEWEST_WAKING else nullcontext()

    def sense(self, swarm: Swarm, surroundings: Surroundings, step: int, noise: SensorNoise | None) -> None:
        """Write the columns distance, kind, radiation and line."""
        kernel = self._sense_kernel_for(swarm, surroundings, noise)
        with self._waking(len(swarm)):
            kernel.run(step + 1, len(swarm))

    def move(
        self, swarm: Swarm, surroundings: Surroundings, driven: np.ndarray, turn_angle: float, stream: Generator | None
    ) -> None:
        """Move as `Engine.move` does, by a kernel; custom drives stage by stage."""
        kernel = self._move_kernel_for(swarm, surroundings, driven, stream)
        with self._waking(len(swarm)):
            if kernel is None:
                self._list_pairs()
                super().move(swarm, surroundings, driven, turn_angle, stream)
            else:
                self._turn_angle[ONLY] = turn_angle
                kernel.run(0, len(swarm))

    def sensing(
        self, swarm: Swarm, surroundings: Surroundings, noise: SensorNoise | None, due: Mapping[str, bool]
    ) -> dict[str, Any]:
        """Return the kernel that reads all sensors."""
        return _fields(self._sense_kernel_for(swarm, surroundings, noise), due, "sense_proximity")

    def _sense_kernel_for(self, swarm: Swarm, surroundings: Surroundings, noise: SensorNoise | None) -> Kernel:
        """Return the kernel that senses, made anew when robots, bodies or the noise of sensors are others."""
        self._prepare(swarm, surroundings)
        if self._sense_kernel is None or self._noise is not noise:
            self._noise = noise
            self._make_sensing(swarm, surroundings)
        return cast(Kernel, self._sense_kernel)

    def moving(
        self, swarm: Swarm, surroundings: Surroundings, driven: np.ndarray, turn_angle: float, stream: Generator | None
    ) -> dict[str, Any]:
        """Return the kernel that moves robots and loads, unless there are custom drives."""
        kernel = self._move_kernel_for(swarm, surroundings, driven, stream)
        self._turn_angle[ONLY] = turn_angle
        custom = [type(drive).__name__ for drive, _ in self._drives if type(drive) not in KINDS_OF_DRIVES]
        return _fields(kernel, dict.fromkeys(custom, True), "travel_pieces")

    def travel(self, swarm: Swarm, surroundings: Surroundings, motion: np.ndarray, turn_angle: float) -> np.ndarray:
        """Move as `Engine.travel` does; `motion` is `self._motion`, which the blocks hold already."""
        begin_way(surroundings)
        travel(self._crowd, turn_angle, self._travel.numbers, self._blocks)
        return self._extra_turn

    def settle(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Move robots that overlap anything to free room nearby."""
        self._prepare(swarm, surroundings)
        settle_robots(swarm, surroundings, self._crowd.arrays.grid)

    def _list_pairs(self) -> None:
        """List the pairs of robots near each other, unless sensing has."""
        if not self._crowd.near.state[LISTED]:
            self._crowd.sort()
            self._crowd.list_pairs(self._margin)
        self._crowd.near.state[LISTED] = False  # from here on they are elsewhere

    def _parts(self, n: int) -> int:
        """Return into how many ranges n rows are cut."""
        return self.threads if n >= FEWEST_ROWS else 1

    def _prepare(self, swarm: Swarm, surroundings: Surroundings) -> None:
        if self.crew.parts != self._parts(len(swarm)):
            self._version = -1
        super()._prepare(swarm, surroundings)

    def _renew(self, swarm: Swarm, surroundings: Surroundings) -> None:
        super()._renew(swarm, surroundings)
        n, columns, table, statics = len(swarm), swarm.columns, swarm.table, surroundings.statics
        self.crew.parts = self._parts(n)
        largest = float(swarm.radius.max(initial=0.0))
        self._margin = MARGIN * float(swarm.radius.min(initial=largest))
        cell = max(2 * largest + self._margin, 1e-9)
        grid = Grid.over(surroundings.bounds, cell, FEWEST_CELLS + CELLS_PER_ROBOT * n)
        self._crowd = Crowd(grid.numbers, columns["position"], columns["radius"], columns["number"], self.crew.parts)
        clearance = clearance_of(largest, table.reach, surroundings.bounds)
        self._eye_arrays = EyeArrays(
            largest_radius=largest,
            margin=self._margin,
            heading=columns["heading"],
            design=columns["design"],
            sensors=table.proximity,
            table=tables_of_sectors(table.proximity, clearance),
            clearance=clearance,
            counts=table.counts,
            reach=table.reach,
            edges=statics.edges,
            discs=statics.discs,
            static_kind=statics.kind,
            sight_cells=statics.sight_cells,
            distance=columns["distance"],
            kind=columns["kind"],
            chunk=ChunkArrays.of(columns["distance"].shape[1], n),
        )
        self._eyes = Block(self._eye_arrays)
        outputs = {name: columns[name] for name in ("position", "heading", "collided", *CONTACT_COLUMNS)}
        self._heat = Block(surroundings.radiating)
        self._extra_turn = np.zeros(n)
        robots = RobotArrays(motion=self._motion, radius=columns["radius"], extra_turn=self._extra_turn, **outputs)
        self._robots, self._statics = Block(robots), Block(surroundings.still)
        movers = None if surroundings.moving is None else surroundings.moving.block
        self._blocks = Blocks(self._robots.numbers, self._crowd.block, self._statics.numbers, movers)
        self._travel, self._shared = calls_of_travel(self.crew, self._crowd.block_of_pairs, self._blocks)
        self._sense_kernel = None
        self._move_kernel = self._driven = self._slip_stream = None

    def _make_sensing(self, swarm: Swarm, surroundings: Surroundings) -> None:
        """Make the kernel that senses."""
        columns, table, movers, statics = swarm.columns, swarm.table, self._blocks.movers, surroundings.statics
        robots = columns["position"], columns["heading"], columns["design"], table.proximity, table.counts
        walls = statics.edges, statics.kind, statics.rings, statics.bounds
        inside = *robots, *walls, columns["distance"], columns["kind"]
        calls, eyes = self._calls_of_sensing()
        blocks = self._eyes.numbers, self._crowd.block, NO_NUMBERS if movers is None else movers
        places = self._crowd.block_of_pairs, swarm.disturbances, int(table.exposed)
        shape, noise, marks = columns["distance"].shape, self._noise, surroundings.marks
        old_shape = shape if table.slow else (0, 0)
        errors = ErrorArrays(
            table=table.noise,
            errs=noise is not None,
            noise=NO_NOISE if noise is None else noise.arrays_for(shape),
            error=columns["error"],
            holds=table.slow,
            old_distance=np.empty(old_shape),
            old_kind=np.empty(old_shape, np.int8),
            noted=np.zeros(1, np.int64),
        )
        heat = table.radiation, self._heat.numbers, columns["radiation"]
        devices = DeviceArrays(*heat, table.line, marks.edges, marks.rings, marks.discs, columns["line"])
        parts = Block(ProximityArrays(*blocks, *places, *inside, calls)), Block(errors), Block(devices)
        block = Block(SenseArrays(*(part.numbers for part in parts)))
        function = sense_robots if movers is None else sense_robots_and_movers
        self._sense_kernel = Kernel(function, block.numbers, (block, parts, eyes), self._attend_sensing)

    def _calls_of_sensing(self) -> tuple[SenseCalls, list[Block]]:
        """Return what senses, and the blocks to which that refers besides the engine's."""
        crew, eyes, none = self.crew, self._eye_arrays, np.empty((0, 0), np.int64)
        alone, together, rows = SENSING if self._blocks.movers is None else SENSING_BESIDE_MOVERS
        if crew.parts == 1:
            return SenseCalls(code_address(alone), crew.numbers, SortCalls(0, 0, 0), 0, none, NO_NUMBERS), []
        (n, count), sorting = eyes.distance.shape, SortCalls(*map(code_address, (find_cells, fill_cells, copy_sorted)))
        blocks = [Block(eyes._replace(chunk=ChunkArrays.of(count, n))) for _ in range(crew.parts)]
        numbers, counts = stack_blocks(blocks), np.zeros(crew.parts, np.int64)
        sense, sense_part = code_address(together), code_address(rows)
        return SenseCalls(sense, crew.numbers, sorting, sense_part, numbers, counts), blocks

    def _attend_sensing(self, code: int) -> None:
        """Do what `sense_robots` cannot."""
        if code == REWIND:
            cast(SensorNoise, self._noise).rewind()
        else:
            self._crowd.make_room()

    def _move_kernel_for(
        self, swarm: Swarm, surroundings: Surroundings, driven: np.ndarray, stream: Generator | None
    ) -> Kernel | None:
        """Return the kernel that moves, made anew when what it takes is another; None where drives are custom ones."""
        self._prepare(swarm, surroundings)
        if any(type(drive) not in KINDS_OF_DRIVES for drive, _ in self._drives):
            return None
        if self._move_kernel is None or self._driven is not driven or self._slip_stream is not stream:
            self._driven, self._slip_stream = driven, stream
            self._move_kernel = self._make_moving(swarm, surroundings, driven, stream)
        return self._move_kernel

    def _make_moving(
        self, swarm: Swarm, surroundings: Surroundings, driven: np.ndarray, stream: Generator | None
    ) -> Kernel:
        n, crowd, movers = len(swarm), self._crowd, self._blocks.movers
        progress, wheels = np.zeros(3, np.int64), Block(wheels_of_swarm(swarm, driven, stream))
        calls, blocks = self._calls_of_loads(swarm, surroundings)
        arrays = MoveArrays(
            turn_angle=self._turn_angle,
            margin=self._margin,
            disturbed=swarm.disturbances,
            progress=progress,
            start=np.zeros((n, 2)),
            start_heading=np.zeros(n),
            wheels=wheels.numbers,
            set_out=NO_CALL,
            arrive=NO_CALL,
            loads=calls,
            robots=self._robots.numbers,
            crowd=crowd.block,
            statics=self._statics.numbers,
            movers=NO_NUMBERS if movers is None else movers,
            pairs=crowd.block_of_pairs,
            travel=self._travel.numbers,
        )
        block = Block(arrays)
        # Kernels of rows take the same block, whose numbers have no address before.
        (set_out_call, kept), (arrive_call, kept_too) = (
            self.crew.call_of(kernel, block.numbers) for kernel in (set_out, arrive)
        )
        block.replace(arrays._replace(set_out=set_out_call, arrive=arrive_call))
        function = move_robots if movers is None else move_robots_and_movers
        attend = partial(self._attend_moving, swarm, surroundings)
        return Kernel(function, block.numbers, (block, wheels, blocks, kept, kept_too), attend)

    def _calls_of_loads(self, swarm: Swarm, surroundings: Surroundings) -> tuple[LoadCalls, tuple[Block | None, ...]]:
        """Return what moves loads and lets them stop driven bodies, and the blocks to which that refers."""
        room = surroundings.room
        if room is None:
            return LoadCalls(False, NO_CALL, NO_CALL, NO_CALL, NO_CALL), ()
        loads, stop, stop_call = Block(LoadArrays.of(surroundings, room, swarm.columns, self._motion)), None, NO_CALL
        if surroundings.moving is not None:
            stop = Block(StopBodiesArrays.of(surroundings, room))
            stop_call = KernelCall(code_address(stop_bodies), stop.numbers)
        kernels = push_loads_of_robots, note_stuck_loads, take_back_loads
        push, note_stuck, take_back = (KernelCall(code_address(kernel), loads.numbers) for kernel in kernels)
        return LoadCalls(True, push, note_stuck, take_back, stop_call), (loads, stop)

    def _attend_moving(self, swarm: Swarm, surroundings: Surroundings, code: int) -> None:
        """Do what `move_robots` cannot."""
        if code == SETTLE:
            self.settle(swarm, surroundings)
            swarm.disturbed = False
        else:
            self._crowd.list_pairs(self._margin)


def wheels_of_swarm(swarm: Swarm, driven: np.ndarray, stream: Generator | None) -> WheelArrays:
    """Return how the wheels of a swarm of built-in drives roll; for `driven` and `stream` see `Engine.move`."""
    columns, table, none = swarm.columns, swarm.table, np.empty((0, 0))
    probability, magnitude = table.slip
    return WheelArrays(
        command=columns["command"],
        design=columns["design"],
        slip=columns["slip"],
        speed=columns[DRIVE_SPEED] if table.limited else none,
        driven=driven,
        spoiled=driven is not columns["command"],
        kinds=np.array([KINDS_OF_DRIVES[type(design.drive)] for design in swarm.designs], np.int64),
        acceleration=table.acceleration,
        sideways=table.sideways,
        probability=probability,
        magnitude=magnitude,
        directed=table.directed,
        limited=table.limited,
        slips=stream is not None,
        slides=table.slides,
        stream=Stream(0, 0) if stream is None else stream_of(stream),
        draws=none if stream is None else np.empty(driven.shape),
        rolled=np.empty(driven.shape),
    )


def _fields(kernel: Kernel | None, due: Mapping[str, bool], compiled: str) -> dict[str, Any]:
    """Return the fields of a stage: its kernel, unless something makes Python due."""
    python = ", ".join(reason for reason, is_so in due.items() if is_so)
    return {"python": python, "compiled": compiled} if python else {"kernel": kernel}


def begin_way(surroundings: Surroundings, stop: Callable[[Surroundings], None] = stop_at_loads) -> None:
    """Put driven bodies where they begin this step, and stop those that have a load in their way."""
    if surroundings.moving is not None and surroundings.moving.return_to_start():
        stop(surroundings)


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


def rolling_wheels(swarm: Swarm, driven: np.ndarray, draws: np.ndarray | None) -> np.ndarray:
    """Return the wheel speeds that acceleration and slip leave of those that are driven, shape (n, w)."""
    design, table = swarm.columns["design"], swarm.table
    if table.limited:
        accelerate(driven, table.acceleration, design, table.sideways, swarm.columns[DRIVE_SPEED])
        driven = swarm.columns[DRIVE_SPEED]
    if draws is None:
        return driven
    wheels = np.empty_like(driven)
    slip_wheels(driven, *table.slip, design, draws, wheels)
    return wheels


def write_slip(swarm: Swarm, driven: np.ndarray, wheels: np.ndarray) -> None:
    """Write which share of the commands wheels did not roll, with what imperfections took before they were driven."""
    command, slip = swarm.columns["command"], swarm.columns["slip"]
    # Motors of limited acceleration roll on where none is driven: only the others have a share of what is driven.
    if driven is not command and not swarm.table.limited:
        write_wheel_slip(driven, wheels, slip)
        wheels = driven * (1.0 - slip)
    write_wheel_slip(command, wheels, slip)


def write_motion(swarm: Swarm, drives: Rows, wheels: np.ndarray, motion: np.ndarray) -> None:
    """Write the motion (n, 3) that wheel speeds (n, w) make."""
    mixed = swarm.table.mixed
    motion.fill(0.0)
    for drive, rows in drives:
        own_motion = motion[rows]
        own = (rows, slice(getattr(drive, "numbers", 2))) if mixed else rows
        drive.motion(wheels[own], swarm.columns["radius"][rows], own_motion)
        motion[rows] = own_motion


def wheels_of(swarm: Swarm, drives: Rows, motion: np.ndarray) -> np.ndarray:
    """Return the wheel speeds (n, w) that would have made these motions (n, 3)."""
    wheels, mixed = np.zeros((len(motion), swarm.table.wheels)), swarm.table.mixed
    for drive, rows in drives:
        own = (rows, slice(getattr(drive, "numbers", 2))) if mixed else rows
        own_wheels = wheels[own]
        drive.wheels(motion[rows], swarm.columns["radius"][rows], own_wheels)
        wheels[own] = own_wheels
    return wheels
