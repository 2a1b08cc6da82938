"""Many worlds at once, as arrays: (worlds, robots, ...)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice, check_count, shortened
from mesa_swarm.environments.actions import checked_clip, shares
from mesa_swarm.environments.driven_worlds import DrivenWorld, StepArrays
from mesa_swarm.environments.scores import TeamEncoder
from mesa_swarm.environments.state import StateEncoder
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import Task
from mesa_swarm.environments.variation import Conditions, Options, Variation, checked_options
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.kernels.plan import BEGUN
from mesa_swarm.model.worlds import call_worlds
from mesa_swarm.physics.threads import check_threads
from mesa_swarm.robots.swarm import RESIZED

if TYPE_CHECKING:  # optional
    from gymnasium.spaces import Box

LARGEST_SEED = 2**63
# The stream of what varies from episode to episode, apart from that of the episodes' seeds.
VARYING = 1
# When the next episode of a world begins, in Gymnasium's words (the values of its AutoresetMode).
SAME_STEP, NEXT_STEP, DISABLED = "SameStep", "NextStep", "Disabled"
# A row of orders, see `drive_worlds`.
Order = tuple[int, int, int, int, bool]
# Worlds of which a step is taken, and all that is done in Python, before the next ones.
WORLDS = 64
AUTORESET_MODES = (SAME_STEP, NEXT_STEP, DISABLED)
Infos = dict[str, Any]


class VectorSwarmEnv:
    """Several worlds of one task, stepped together; needs neither Gymnasium nor PettingZoo.

    A world whose episode ends starts the next one in the same step, unless another `autoreset_mode` is chosen: its row
    of the observations is then the first of the new episode, and ``infos["final_obs"]`` holds the last observations of
    the old one. Where the task's `Variation` draws numbers of robots, the arrays have room for the most of them; rows
    of robots that an episode does not have are 0, what is done with their actions is nothing, and `present` is False.
    So it is with robots that are removed from a world, to which none may be added.

    Parameters
    ----------
    task : Task
        Such as ``CollisionAvoidance(n_robots=50)``.
    n_worlds : int
        At least 1.
    commanded : int, optional
        How many robots of each world are commanded, the first ones; all by default. The task's rules drive the others.
    clip : bool
        Whether wheel speeds beyond -1 and 1 are clipped instead of refused.
    autoreset_mode : str or gymnasium.vector.AutoresetMode
        "SameStep"; "NextStep": the step in which an episode ends returns its last observations, and the next step, in
        which the actions for that world do nothing, the first ones of the new episode, with rewards of 0; "Disabled":
        as far as the end the same, and then `reset` has to begin the next episode by its `mask`. The episodes
        themselves are the same in all modes.
    threads : int, optional
        How many threads share the worlds, 1 to 256; by default the number in the environment variable
        MESA_SWARM_THREADS, or 1. The numbers are the same for any number of threads.

    Attributes
    ----------
    worlds : list of TaskWorld
        The current worlds; their columns can be read: ``env.worlds[0].swarm.collided``.
    conditions : list of Conditions
        Map, number of robots, speed and imperfection of the current episodes.
    present : bool ndarray, shape (worlds, robots), read-only
        Which commanded robots the current episodes have.
    begun : bool ndarray, shape (worlds,)
        Which worlds have begun an episode in the last `reset` or step.
    observed : bool ndarray, shape (robots, width), read-only
        Which numbers the robots observe; of teams of several designs, the rows of others than the widest end in 0.

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> env = VectorSwarmEnv(CollisionAvoidance(n_robots=5, map="openspace"), n_worlds=3)
    >>> observations = env.reset(seed=1)
    >>> observations, reward, terminated, truncated, infos = env.step(np.ones((3, 5, 2)))
    >>> observations.shape, reward.shape, terminated.shape, env.state().shape
    ((3, 5, 9), (3, 5), (3,), (3, 46))
    """

    def __init__(
        self,
        task: Task,
        *,
        n_worlds: int,
        commanded: int | None = None,
        clip: bool = False,
        autoreset_mode: Any = SAME_STEP,
        threads: int | None = None,
    ) -> None:
        if not isinstance(task, Task):
            raise InvalidValueError(f"task is {shortened(task)}; expected a task such as CollisionAvoidance()")
        self.task = task
        self.n_worlds = check_count("n_worlds", n_worlds, minimum=1)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        self.autoreset_mode = check_choice("autoreset_mode", mode, AUTORESET_MODES)
        most = task.most_robots
        self.commanded = check_count("commanded", most if commanded is None else commanded, minimum=1, maximum=most)
        observer = task.observer()
        self.width = observer.width
        widths = np.array(observer.widths if isinstance(observer, TeamEncoder) else [self.width] * self.commanded)
        self.observed = np.arange(self.width) < widths[: self.commanded, None]
        self.observed.flags.writeable = False
        self.threads = check_threads(threads)
        self.worlds: list[TaskWorld] = []
        self.conditions: list[Conditions] = []
        self.present = np.zeros((self.n_worlds, self.commanded), bool)
        self.begun = np.zeros(self.n_worlds, bool)
        self._over = np.zeros(self.n_worlds, bool)
        self._returns = np.zeros((self.n_worlds, self.commanded))
        self._clip = checked_clip(task.actions, clip)
        self._arrays = StepArrays.of(self.n_worlds, self.commanded, task.numbers, self.width)
        self._driven: list[DrivenWorld | None] = []
        self._is_ready = np.zeros(self.n_worlds, bool)
        self._ended = np.zeros(self.n_worlds, bool)
        self._resized = RESIZED[0]
        self._states: StateEncoder | None = None
        self._space: Box | None = None
        self._generators = [np.random.default_rng() for _ in range(self.n_worlds)]

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what refers to arrays: a copy prepares its worlds anew."""
        return {**self.__dict__, "_driven": [], "_resized": -1}

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        options: Options | Sequence[Options] | None = None,
        mask: ArrayLike | None = None,
    ) -> np.ndarray:
        """Start an episode in every world and return the observations (worlds, robots, width), float32.

        Parameters
        ----------
        seed : int or sequence of int, optional
            World w gets child w of the seed (NumPy's ``SeedSequence(seed).spawn``): it has the same episodes whatever
            the number of worlds, and shares none with a world of another seed. Or each world gets a seed of its own,
            and is then world 0 of that seed. Without one the streams continue.
        options : dict or sequence of dict, optional
            Of the episodes that begin now, in all worlds or in each: "map", "n_robots", "speed" and "imperfection"
            are what they are given to be instead of drawn.
        mask : bool array_like, shape (worlds,), optional
            Which worlds start an episode: all by default. Seeds and options of the others change nothing.
        """
        conditions, is_new = self._options(options), self._mask(mask)
        if seed is not None:
            new_generators = generators(seed, self.n_worlds)
            self._generators = [new_generators[w] if is_new[w] else old for w, old in enumerate(self._generators)]
        new_worlds = {w: self._new_world(w, conditions[w]) for w in np.flatnonzero(is_new).tolist()}
        self.worlds = [new_worlds[w][0] if w in new_worlds else self.worlds[w] for w in range(self.n_worlds)]
        self.conditions = [new_worlds[w][1] if w in new_worlds else self.conditions[w] for w in range(self.n_worlds)]
        self._note_begun(is_new)
        return self._observations()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Infos]:
        """Take a step in every world.

        Parameters
        ----------
        actions : ndarray, shape (worlds, robots, w) or (worlds, robots)
            Wheel speeds and what else the task's actions have (``task.numbers``), from -1 to 1, or numbers of actions.

        Returns
        -------
        observations : float32 ndarray, shape (worlds, robots, width)
        reward : ndarray, shape (worlds, robots)
        terminated, truncated : bool ndarrays, shape (worlds,)
            Whether the task was done; whether the steps were used up.
        infos : dict
            "collided" (worlds, robots): which overlapped anything in this step; "present": which there were. If an
            episode has ended: "final_obs" (worlds, robots, width); "_final_obs" (worlds,): which have ended; and of
            these, 0 for others, "returns" (worlds, robots), the sums of rewards, and "measures", a dict of arrays
            (worlds,): steps, collisions and what else the task measures; infinity for what has not happened. The
            final observations are there only where `observations` are those of a new episode. If robots were removed:
            "removed" (worlds, robots), which were in this step or before it.

        Raises
        ------
        InvalidValueError
            If an action is wrong.
        SwarmError
            If a world has no episode, or robots were added to it.
        """
        self._check_running()
        commands = shares(self.task.actions, actions, (self.n_worlds, self.commanded), self._clip, self.task.numbers)
        arrays, is_new, present = self._arrays, self._over.copy(), self.present
        arrays.shares[:] = commands
        arrays.reward[is_new], arrays.collided[is_new] = 0.0, False
        for w in np.flatnonzero(is_new).tolist():
            self._renew(w, arrays.observations[w])
        # Episodes that have ended in a step that was interrupted are reported now.
        self._take_step(is_new | self._ended)
        self._ended[:] = False
        observations, reward, collided = arrays.observations.copy(), arrays.reward.copy(), arrays.collided.copy()
        self._note_begun(is_new)
        self._returns += reward
        terminated = arrays.finished & ~is_new
        truncated = arrays.late & ~terminated & ~is_new
        infos: Infos = {"collided": collided, **self._find_removed(present & ~is_new[:, None])}
        if terminated.any() or truncated.any():
            infos |= self._end(terminated | truncated, observations)
        infos["present"] = self.present
        return observations, reward, terminated, truncated, infos

    def _take_step(self, is_new: np.ndarray) -> None:
        """Take a step in each world but those that have just begun or ended: of those that can in compiled calls."""
        errors: list[BaseException] = []
        self._is_ready[:] = False
        rows = np.flatnonzero(~is_new).tolist()
        # All that is of one world at once, while its arrays are in the processor's cache.
        for first in range(0, len(rows), WORLDS * self.threads):
            try:
                self._drive(self._list_ready(rows[first : first + WORLDS * self.threads], errors))
            except BaseException as error:  # raised when all have taken their step
                errors.append(error)
        if errors:  # Ctrl-C counts more than an error of a world
            raise next((error for error in errors if not isinstance(error, Exception)), errors[0])
        arrays = self._arrays
        for w in np.flatnonzero(~(self._is_ready | is_new)).tolist():
            world = self.worlds[w]
            k = world.commanded
            world.advance(arrays.shares[w, :k], arrays.reward[w, :k])
            world.observe(arrays.observations[w, :k])
            world.roster().spread(world.swarm.columns["collided"], arrays.collided[w, :k])
            arrays.finished[w], arrays.late[w] = world.finished, world.out_of_time

    def _list_ready(self, rows: list[int], errors: list[BaseException]) -> list[tuple[DrivenWorld, Order]]:
        """Return which of some worlds can take their step in a compiled call, with the orders for it.

        An error of one world keeps none of the others from its step.
        """
        ready = []
        for w in rows:
            driven, world = self._driven[w], self.worlds[w]
            try:
                if driven is None or driven.world is not world:
                    driven = self._driven[w] = DrivenWorld(world, self._arrays, w)
                if driven.is_ready():
                    ready.append((driven, driven.begin_step()))
                    self._is_ready[w] = True
            except Exception as error:
                errors.append(error)
        return ready

    def _drive(self, ready: list[tuple[DrivenWorld, Order]]) -> None:
        """Take a step of worlds in one compiled call."""
        if not ready:
            return
        together = [driven for driven, _ in ready]
        blocks = np.array([driven.numbers for driven in together])
        orders = np.array([order for _, order in ready], np.int64)
        try:
            call_worlds(blocks, orders, self.threads, lambda row, code: together[row].attend(code))
        except BaseException:  # Ctrl-C, or an error in one of the worlds
            for driven in together:
                driven.break_off()
                w, world = driven.row, driven.world
                self._arrays.late[w] = world.out_of_time
                self._ended[w] = self._arrays.late[w] or self._arrays.finished[w]
            raise
        for driven in together:
            driven.end_step()
        self._arrays.late[[driven.row for driven in together]] = orders[:, BEGUN] + 1 >= self.task.max_steps

    def _check_running(self) -> None:
        """Refuse a step of worlds without an episode."""
        if not self.worlds:
            raise SwarmError("the environment has no episode yet; call reset() before step()")
        if self.autoreset_mode == DISABLED and self._over.any():
            raise SwarmError(
                f"the episode of world {self._over.argmax()} is over; before step() call reset(mask=...), with "
                'Gymnasium reset(options={"reset_mask": ...}), of the worlds whose episodes are over'
            )
        self._driven += [None] * (self.n_worlds - len(self._driven))
        if self._resized != RESIZED[0]:  # of any model, since this environment has made its worlds
            for world in self.worlds:
                world.roster()  # refuses robots that were added, before any world advances
            self._resized = RESIZED[0]

    def state(self) -> np.ndarray:
        """Return the states of all worlds for a central critic, float32, shape (worlds, numbers); see `StateEncoder`.

        A world whose episode has just ended has the state of the new one if that has begun.
        """
        if not self.worlds:
            raise SwarmError("the environment has no episode yet; call reset() before state()")
        if self._states is None:
            self._states = StateEncoder(self.task)
        states = np.empty((self.n_worlds, self._states.width), np.float32)
        for world, row in zip(self.worlds, states, strict=True):
            self._states.write(world, row)
        return states

    @property
    def state_space(self) -> "Box":
        """The space of one world's state, always the same object; needs Gymnasium."""
        if self._space is None:
            from mesa_swarm.environments.spaces import state_space  # noqa: PLC0415 - optional

            self._space = state_space(self.task)
        return self._space

    def _end(self, is_over: np.ndarray, observations: np.ndarray) -> Infos:
        """Return what the episodes were that have ended, and start the next ones if that is due in this step."""
        of_worlds = {w: measures(self.worlds[w]) for w in np.flatnonzero(is_over).tolist()}
        table = {name: np.zeros(self.n_worlds) for name in next(iter(of_worlds.values()))}
        for w, values in of_worlds.items():
            for name, value in values.items():
                table[name][w] = value
        infos: Infos = {"returns": np.where(is_over[:, None], self._returns, 0.0), "measures": table}
        if self.autoreset_mode != SAME_STEP:
            self._over = is_over
            return infos
        infos = {"final_obs": observations.copy(), "_final_obs": is_over, **infos}
        for w in of_worlds:
            self._renew(w, observations[w])
        self._note_begun(is_over)
        return infos

    def _renew(self, w: int, rows: np.ndarray) -> None:
        """Start the next episode of a world and write its first observations."""
        self.worlds[w], self.conditions[w] = self._new_world(w, None)
        k = self.worlds[w].commanded
        rows[k:] = 0.0
        self.worlds[w].observe(rows[:k])

    def _new_world(self, w: int, options: Options | None) -> tuple[TaskWorld, Conditions]:
        before = RESIZED[0]
        made = new_world(self.task, self.commanded, self._generators[w], options)
        self._resized += RESIZED[0] - before
        return made

    def _note_begun(self, is_new: np.ndarray) -> None:
        """Note which worlds have begun an episode, and which robots these have."""
        self.begun = is_new
        if is_new.any():
            self._over, self._ended = self._over & ~is_new, self._ended & ~is_new
            self._returns[is_new] = 0.0
            self._note_present()

    def _note_present(self) -> None:
        present = np.zeros((self.n_worlds, self.commanded), bool)
        for world, row in zip(self.worlds, present, strict=True):
            row[: world.commanded] = world.roster().present(world.commanded)
        present.flags.writeable = False
        self.present = present

    def _find_removed(self, before: np.ndarray) -> Infos:
        """Return which robots of those before have been removed, if any."""
        if all(self.worlds[w].roster().complete for w in np.flatnonzero(~self._is_ready).tolist()):
            return {}
        self._note_present()
        absent = before & ~self.present
        return {"removed": absent} if absent.any() else {}

    def _observations(self) -> np.ndarray:
        observations = np.zeros((self.n_worlds, self.commanded, self.width), np.float32)
        for w, rows in enumerate(observations):
            self.worlds[w].observe(rows[: self.worlds[w].commanded])
        return observations

    def _mask(self, mask: ArrayLike | None) -> np.ndarray:
        """Return which worlds are to start an episode."""
        if mask is None:
            return np.ones(self.n_worlds, bool)
        new_mask = np.array(mask)
        if new_mask.dtype != bool or new_mask.shape != (self.n_worlds,) or not new_mask.any():
            raise InvalidValueError(
                f"mask is {shortened(mask)}; expected True or False for each of the {self.n_worlds} worlds, at least "
                "one of them True"
            )
        if not self.worlds and not new_mask.all():
            raise SwarmError("the environment has no episode yet; call reset() of all worlds first")
        return new_mask

    def _options(self, options: Options | Sequence[Options] | None) -> list[Options | None]:
        if options is None or isinstance(options, Mapping):
            return [options] * self.n_worlds
        if not isinstance(options, (list, tuple)):
            raise InvalidValueError(
                f"options is {shortened(options)}; expected a dict, or a list of one for each world"
            )
        if len(options) != self.n_worlds:
            raise InvalidValueError(f"options has {len(options)} dicts for {self.n_worlds} worlds; expected one each")
        return list(options)


def new_world(
    task: Task, commanded: int, generator: np.random.Generator, options: Options | None = None
) -> tuple[TaskWorld, Conditions]:
    """Return a world for the next episode, its seed drawn from this stream, and the conditions drawn for it."""
    settings = checked_options(options, task.most_robots)
    if settings.get("n_robots", task.n_robots) != task.n_robots and len(task.designs) > 1:
        raise InvalidValueError(
            f"option n_robots is {settings['n_robots']}; expected {task.n_robots}, the number of the team: an agent "
            "always has the same design"
        )
    seed = int(generator.integers(LARGEST_SEED))
    if task.variation is None and not settings:
        return TaskWorld(task=task, commanded=commanded, rng=seed), Conditions(map=task.chart, n_robots=task.n_robots)
    variation = Variation() if task.variation is None else task.variation
    draws = variation.draw(stream(seed, VARYING), map=task.chart, n_robots=task.n_robots)
    conditions = replace(draws, **settings)
    world = TaskWorld(task=task.under(conditions), commanded=min(commanded, conditions.n_robots), rng=seed)
    world.imperfections = variation.imperfections.at(conditions.imperfection)
    world.sense()
    return world, conditions


def by_worlds(actions: ArrayLike, n_worlds: int, commanded: int) -> np.ndarray:
    """Return actions of a flat vector, one row an environment, as those of each world, shape (worlds, robots, ...)."""
    try:
        rows = fill_masked(actions)
    except ValueError:  # rows of different lengths
        raise InvalidValueError(f"actions are {shortened(actions)}; expected an array") from None
    count = n_worlds * commanded
    if rows.shape[:1] != (count,):
        raise InvalidValueError(
            f"actions have shape {rows.shape}; expected {count} rows, one for each robot of the {n_worlds} worlds"
        )
    return rows.reshape(n_worlds, commanded, *rows.shape[1:])


def measures(world: TaskWorld) -> dict[str, float]:
    """Return what `infos` hold of an episode that is over: its measures, infinity for what has not happened in it.

    NaN would make equal infos differ.
    """
    return {name: math.inf if math.isnan(value) else value for name, value in world.measures().items()}


def stream(seed: int, child: int = 0) -> np.random.Generator:
    """Return the generator of a child of a seed: 0 for a single environment, w for world w of a vector."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(child,)))


def generators(seed: int | Sequence[int], n_worlds: int) -> list[np.random.Generator]:
    """Return a generator for each world: of the children of a seed, or of a seed each."""
    if not isinstance(seed, (list, tuple, np.ndarray)):
        root = check_seed(seed)
        return [stream(root, w) for w in range(n_worlds)]
    if len(seed) != n_worlds:
        raise InvalidValueError(f"seed has {len(seed)} numbers for {n_worlds} worlds; expected one each")
    return [stream(check_seed(number)) for number in seed]


def check_seed(seed: object) -> int:
    """Return a seed as an int."""
    return check_count("seed", seed, maximum=LARGEST_SEED)
