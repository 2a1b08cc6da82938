"""Worlds of learners that take a step side by side in one compiled call: command, step, rewards and observations."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple, cast

import numpy as np

from mesa_swarm.environments.scores import ObservationEncoder, make_kernel
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel, Phase
from mesa_swarm.kernels.plan import CODE, TAKEN, Driver
from mesa_swarm.kernels.type_names import Flags, RealRows, Reals
from mesa_swarm.model.driving import list_due_of_model
from mesa_swarm.model.mesa_model import set_steps


class StepArrays(NamedTuple):
    """What a step of all worlds reads and writes, a row a world, with room for the most robots; absent ones have 0.

    Parameters
    ----------
    shares : float64 ndarray, shape (worlds, robots, numbers)
        Wheel speeds as shares of the greatest, and the other numbers of the task's actions.
    reward : float64 ndarray, shape (worlds, robots)
    collided : bool ndarray, shape (worlds, robots)
    observations : float32 ndarray, shape (worlds, robots, width)
    finished, late : bool ndarrays, shape (worlds,)
        Whether the task is done; whether the steps are used up.
    """

    shares: np.ndarray
    reward: np.ndarray
    collided: np.ndarray
    observations: np.ndarray
    finished: np.ndarray
    late: np.ndarray

    @classmethod
    def of(cls, worlds: int, robots: int, numbers: int, width: int) -> "StepArrays":
        """Return arrays for a number of worlds, robots, numbers of an action and of an observation."""
        return cls(
            np.zeros((worlds, robots, numbers)),
            np.zeros((worlds, robots)),
            np.zeros((worlds, robots), np.bool_),
            np.zeros((worlds, robots, width), np.float32),
            np.zeros(worlds, np.bool_),
            np.zeros(worlds, np.bool_),
        )


class MadeFor(NamedTuple):
    """What the kernels of a world were made for; they are made anew where one of these is another object."""

    plan: Any
    version: Any
    scene: Any
    step: Any
    constants: Any
    extinguish_range: Any
    turn_angle: Any
    collect_every: Any
    deciding: Kernel | None  # where layers drive robots besides those that are commanded


class DrivenWorld:
    """A world of a vector, and what of its steps one compiled call can take.

    The call takes all that `TaskWorld.advance` and `observe` do, where each stage has a kernel, all robots are there,
    and nothing watches: then robots read their sensors at the end of a step instead of at the beginning of the next.

    Attributes
    ----------
    world : TaskWorld
    numbers : int64 ndarray or None
        Of the block of its driver; None where the steps are taken in Python.
    """

    def __init__(self, world: TaskWorld, arrays: StepArrays, row: int) -> None:
        self.world, self.row = world, row
        self.numbers: np.ndarray | None = None
        self._arrays = arrays
        self._driver: Driver | None = None
        self._finishing: list[Callable[[], None]] = []  # of kernels that write into buffers
        self._parts, self._swarm = world.parts, world.swarm
        self._made_for: MadeFor | None = None
        self._robots = 0
        self._reading: tuple[Any, ...] = ()  # after which step, and of which robots and bodies, sensors were read
        for array in arrays[1:]:  # shares are those of the step that is about to be taken
            array[row] = 0

    def is_ready(self) -> bool:
        """Return whether the next step can be taken in a compiled call."""
        world, parts, made_for = self.world, self._parts, self._made_for
        # Everything that may be replaced between steps by hand: quick, as there may be thousands of worlds.
        if not (
            made_for is not None
            and made_for.plan is parts._plan
            and made_for.version is self._swarm.version
            and made_for.scene is parts.bodies.cache.scene
            and made_for.step is world.__dict__.get("step")
            and made_for.constants is parts.fires.constants
            and made_for.extinguish_range is parts.fires.extinguish_range
            and made_for.turn_angle is parts.robots.turn_angle
            and made_for.collect_every is world._collect_every
            and (made_for.deciding is None or made_for.deciding is parts.control.kernel())
        ):
            self._renew()
        return self.numbers is not None and not world.__dict__["observers"]

    def _renew(self) -> None:
        """Make the driver anew."""
        self.world.parts.replan()
        kernels = self._list_kernels()
        self._driver = None if kernels is None else Driver([(kernel, 1) for kernel in kernels], np.zeros(1, np.bool_))
        self.numbers = None if self._driver is None else self._driver.numbers
        self._finishing = [kernel.finish for kernel in kernels or () if kernel.finish is not None]
        parts, fires, self._robots = self._parts, self._parts.fires, len(self._swarm)
        self._made_for = MadeFor(
            *(parts._plan, self._swarm.version, parts.bodies.cache.scene, self.world.__dict__.get("step")),
            *(fires.constants, fires.extinguish_range, parts.robots.turn_angle, self.world._collect_every),
            deciding=parts.control.kernel() if self._driver and self.world.commanded < self._robots else None,
        )

    def _list_kernels(self) -> list[Kernel] | None:
        """Return the kernels of a step in their order, None if something is Python."""
        world, k = self.world, self.world.commanded
        stages = [stage for _, stage in world.parts.plan.stages]
        sensing = [stage.kernel for stage in stages if stage.phase is Phase.SENSE]
        others = [stage.kernel for stage in stages if stage.phase is not Phase.SENSE]
        if not (self._is_plain() and k and len(sensing) == 1 and all([*sensing, *others])):
            return None
        rows = [array[self.row, :k] for array in self._arrays[:4]]
        columns, (shares, reward, collided, observations) = world.swarm.columns, rows
        score: Any = world._score
        rewarding = score.kernel_for(reward, self._arrays.finished[self.row : self.row + 1])
        observing = world._observer.kernel_for(columns, observations)  # type: ignore[union-attr]
        if rewarding is None or observing is None:
            return None
        commanding = make_kernel(set_wheels, WheelCommandArrays(shares, columns["max_speed"], world._commands.wheels))  # type: ignore[union-attr]
        tallying = world._tally.kernel_for(columns)
        last = [make_kernel(note_collided, CollidedArrays(columns["collided"], collided)), observing]
        if world.task.coverage_reward:
            worth = float(world.task.coverage_reward)
            last.append(make_kernel(add_coverage, CoverageArrays(world._tally.fresh, worth, reward)))
        reading = [rewarding, *sensing] if world.task.rewards_state else [*sensing, rewarding]
        return [commanding, *others, tallying, *reading, *last]  # type: ignore[list-item]

    def _is_plain(self) -> bool:
        """Return whether the world, its score and its observations are what compiled functions can do."""
        world = self.world
        table = world.swarm.table
        return (
            type(world) is TaskWorld
            and "kernel_for" in vars(type(world._score))
            and type(world._observer) is ObservationEncoder
            and world.roster().complete
            and not (world.task.team or world.task.acts or world.task.messages or world.communication)
            and not (table.noisy or table.slow or world.imperfections or world.collect_every)
            and not any(stage.every > 1 for _, stage in world.parts.plan.stages)
            and not any(True for _ in list_due_of_model(world))
        )

    def begin_step(self) -> tuple[int, int, int, int, bool]:
        """Return the row of orders for a step, see `drive_worlds`."""
        world = self.world
        if not world._tally.steps:
            world.note_start()
        if self._swarm.disturbances[0] or self._parts.robots.cache.state is not self._reading:
            world.sense()  # as a step would: something has changed since
        self._driver.begin()  # type: ignore[union-attr]
        return 1, world._completed, world.steps, self._robots, True

    def attend(self, code: int) -> bool:
        """Do in Python what a kernel could not, so that the step goes on."""
        self._driver.attend(code)  # type: ignore[union-attr]
        return True

    def break_off(self) -> None:
        """Count the step if it is taken, or can be taken to its end; of one that fails that it has begun."""
        driver, world = cast(Driver, self._driver), self.world
        with suppress(Exception):  # the error of this world is raised already
            driver.finish_step(world._completed, world.steps, self._robots, lambda taken, more: None)
        if driver.progress[TAKEN]:
            self.end_step()
        elif driver.progress[CODE]:
            set_steps(world, world.steps + 1)

    def end_step(self) -> None:
        """Count the step, take what kernels have written, and note that sensors were read after it."""
        world, parts = self.world, self._parts
        for finish in self._finishing:
            finish()
        world._completed += 1
        set_steps(world, world.steps + 1)
        world._tally.steps += 1
        parts.robots.cache.state = self._reading = world._completed, self._swarm.version, parts.bodies.cache.scene


class WheelCommandArrays(NamedTuple):
    """What `set_wheels` takes: shares of the greatest speed, these speeds, and the wheels' commands."""

    shares: RealRows
    max_speed: Reals
    wheels: RealRows


@compiled(nogil=True)
def set_wheels(block, step, first, last):
    """Set the wheels of commanded robots."""
    w = unpack(block, WheelCommandArrays)
    shares, max_speed, wheels = w.shares, w.max_speed, w.wheels
    for i in range(wheels.shape[0]):
        wheels[i, 0], wheels[i, 1] = shares[i, 0] * max_speed[i], shares[i, 1] * max_speed[i]
    return 0


class CollidedArrays(NamedTuple):
    """What `note_collided` takes: the column, and what is written."""

    collided: Flags
    out: Flags


@compiled(nogil=True)
def note_collided(block, step, first, last):
    """Write which commanded robots overlapped anything."""
    c = unpack(block, CollidedArrays)
    collided, out = c.collided, c.out
    for i in range(out.shape[0]):
        out[i] = collided[i]
    return 0


class CoverageArrays(NamedTuple):
    """What `add_coverage` takes: 1 for robots that were first in a cell, what that is worth, and rewards."""

    fresh: Reals
    worth: float
    reward: Reals


@compiled(nogil=True)
def add_coverage(block, step, first, last):
    """Add what it is worth to be the first in a cell."""
    c = unpack(block, CoverageArrays)
    fresh, worth, reward = c.fresh, c.worth, c.reward
    for i in range(reward.shape[0]):
        reward[i] += worth * fresh[i]
    return 0
