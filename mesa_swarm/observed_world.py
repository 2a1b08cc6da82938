"""ObservedWorld: what one reads of a model after a step: contacts, what was kept, reasons, a fingerprint."""

import os
from collections.abc import Callable
from hashlib import blake2b
from typing import Any, SupportsIndex

import numpy as np

from mesa_swarm.control.arbiter import Arbiter, check_drives
from mesa_swarm.control.explain import Explanation, explanation
from mesa_swarm.errors import InvalidValueError, check_count, shortened
from mesa_swarm.physics.contacts import Contacts
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.snapshots import DECISIONS, Snapshots, check_kept
from mesa_swarm.streams import Seed
from mesa_swarm.world.map import Map
from mesa_swarm.world_model import World

# Indices that depend on the order in which things were created say nothing of the state.
NOT_HASHED = frozenset({"number", "design", "contact_index"})


class Observers(list):
    """What a model calls after each step, `observer.after_step(model, step)`; copies of a model have none.

    That is at the end of SwarmModel's step, to which a class may add more of its own. An observer that has
    `between_steps(model)` is called once more when all is done, and one that has `before_step(model)` before anything
    of the next step is: what is other then was changed by hand. Mesa has counted that step already. One that has
    `after_run(model, steps)` is called when `run` has taken so many steps without an error.

    What observes one run writes it to one place: two runs there would be a muddle.
    """

    def __reduce_ex__(self, protocol: SupportsIndex) -> tuple:
        return Observers, ()


class ObservedWorld(World):
    """A world that can be looked at; `SwarmModel` makes it step."""

    _control: Arbiter | None = None
    _completed: int = 0
    _snapshots: Snapshots | None = None

    def __init__(self, *, map: str | os.PathLike | Map, rng: Seed, history_every: int) -> None:
        super().__init__(map=map, rng=rng, history_every=history_every)
        self.observers = Observers()
        self._user_step: Callable[..., None] = self._whole_step  # what Mesa calls in its own wrapping of a step

    def _check_driven(self, design: RobotDesign) -> None:
        """Refuse robots that the control is not for."""
        if self._control is not None:
            check_drives(self._control, [design])

    @property
    def completed(self) -> int:
        """How many steps were taken to their end."""
        return self._completed

    def _whole_step(self, *given: Any, **named: Any) -> None:
        """Take the step that the class says, of which this class's own is a part; tell observers before and after.

        Of a step that fails they are told as well: what it has left is all that will come of it.
        """
        try:
            self._tell("before_step")
            type(self).step(self, *given, **named)
            self._tell("between_steps")
        except BaseException:
            self._schedule_again()
            self._tell("after_failure")
            raise

    def _tell(self, what: str) -> None:
        """Call what some observers have, and others have not."""
        for observer in list(self.observers):
            told = getattr(observer, what, None)
            if told is not None:
                told(self)

    def _schedule_again(self) -> None:
        """Let Mesa 3.5 take a step after one that failed, as Mesa 3.3 does: its schedule ends with an error."""
        schedule = getattr(self, "_default_schedule", None)
        if schedule is not None:
            schedule.pause()
            schedule.resume()

    def sense(self) -> None:
        """Read all sensors in the world as it is now."""
        raise NotImplementedError

    @property
    def contacts(self) -> "Contacts":
        """The deepest contact of every robot that collided in the last step."""
        return Contacts.of(self.swarm, self._obstacles, self.fires.agents)

    def watch(self, last: int | None = 100, *, every: int = 1, columns: tuple[str, ...] = DECISIONS) -> Snapshots:
        """Keep what robots knew and did from now on, and return where it is kept.

        Watching anew forgets what was kept; `last=None` keeps everything, which takes memory without end.

        Parameters
        ----------
        last : int or None
            How many snapshots to keep.
        every : int
            Steps from one to the next.
        columns : tuple of str
            Of the swarm, those that `explain` needs by default.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> kept = model.watch(last=50)
        >>> len(model.run(60).watched)
        50
        """
        self._snapshots = Snapshots(self.swarm, last=last, every=every, columns=columns)
        return self._snapshots

    @property
    def watched(self) -> Snapshots | None:
        """What `watch` keeps, None if nobody watches."""
        return self._snapshots

    def explain(self, robot: Robot, step: int | None = None) -> Explanation:
        """Say why a robot did what it did in the last step, or in one that is still kept: `watch` first.

        Parameters
        ----------
        robot : Robot
            One of `model.robots`.
        step : int, optional

        Returns
        -------
        Explanation
            As a text one sentence: what the robot did, the layer that won, the readings that triggered it.

        Raises
        ------
        InvalidValueError
            If nobody watches, columns are missing, there is no control, or the step is not kept.
        RemovedRobotError
            If the robot was removed.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> from mesa_swarm.control import Avoid, Explore, Subsumption
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, poses=[(765, 300, 0.0)], tendency="left")
        >>> model.control = Subsumption(Avoid(distance=10.5), Explore())
        >>> kept = model.watch()
        >>> print(model.run(1).explain(robot))
        step 1: robot 5 turns left while moving; Avoid: front sensor 10.0 (an obstacle) < 10.5
        """
        if not isinstance(robot, Robot) or robot.model is not self:
            raise InvalidValueError(f"robot is {shortened(robot)}; expected one of this model's robots")
        row, kept = robot.alive(), check_kept(self._snapshots, DECISIONS, "explain")
        if self._control is None:
            raise InvalidValueError("there is no control to explain; set model.control")
        wanted = int(kept.steps[-1]) if step is None else check_count("step", step)
        return explanation(self._control, self.swarm, kept, row, wanted)

    def state_hash(self) -> str:
        """Return a fingerprint of the published state: equal for equal runs, on every machine and Python.

        All sensors are read first, so that having looked at the readings or not makes no difference.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).state_hash() == SwarmModel(rng=1).state_hash()
        True
        """
        self.sense()
        digest = blake2b(digest_size=16)
        digest.update(f"{self._completed}".encode())
        for load in self._loads:
            digest.update(np.array([*load.pose, load.resistance]).tobytes())
        for prefix, columns in (("robots", self.swarm.columns), ("fires", self.fires.columns)):
            for name, column in sorted(columns.items()):
                if name not in NOT_HASHED:
                    digest.update(f"{prefix}.{name} {column.shape}".encode())
                    digest.update((column + 0 if column.dtype.kind == "f" else column).tobytes())
        return digest.hexdigest()
