"""Many worlds at once, as arrays: (worlds, robots, ...)."""

from collections.abc import Sequence

import numpy as np

from mesa_swarm.environments.actions import shares
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import Task
from mesa_swarm.errors import InvalidValueError, SwarmError, check_count, shortened

LARGEST_SEED = 2**63
Infos = dict[str, np.ndarray]


class VectorSwarmEnv:
    """Several worlds of one task, stepped together; needs neither Gymnasium nor PettingZoo.

    A world whose episode ends starts the next one in the same step: its row of the observations is then the first
    of the new episode, and ``infos["final_obs"]`` holds the last observations of the old one.

    Parameters
    ----------
    task : Task
        Such as ``CollisionAvoidance(n_robots=50)``.
    n_worlds : int
        At least 1.
    commanded : int, optional
        How many robots of each world are commanded, the first ones; all by default. The task's rules drive the others.

    Attributes
    ----------
    worlds : list of TaskWorld
        The current worlds; their columns can be read: ``env.worlds[0].swarm.collided``.

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> env = VectorSwarmEnv(CollisionAvoidance(n_robots=5, map="openspace"), n_worlds=3)
    >>> observations = env.reset(seed=1)
    >>> observations, reward, terminated, truncated, infos = env.step(np.ones((3, 5, 2)))
    >>> observations.shape, reward.shape, terminated.shape
    ((3, 5, 9), (3, 5), (3,))
    """

    def __init__(self, task: Task, *, n_worlds: int, commanded: int | None = None) -> None:
        if not isinstance(task, Task):
            raise InvalidValueError(f"task is {shortened(task)}; expected a task such as CollisionAvoidance()")
        self.task = task
        self.n_worlds = check_count("n_worlds", n_worlds, minimum=1)
        most = task.n_robots
        self.commanded = check_count("commanded", most if commanded is None else commanded, minimum=1, maximum=most)
        self.width = task.observer().width
        self.worlds: list[TaskWorld] = []
        self._generators = [np.random.default_rng() for _ in range(self.n_worlds)]

    def reset(self, *, seed: int | Sequence[int] | None = None) -> np.ndarray:
        """Start an episode in every world and return the observations (worlds, robots, width), float32.

        Parameters
        ----------
        seed : int or sequence of int, optional
            World w gets seed + w, or its own. A world with the same seed has the same episodes, whatever the number
            of worlds. Without one the streams continue.
        """
        if seed is not None:
            self._generators = [np.random.default_rng(each) for each in self._seeds(seed)]
        self.worlds = [self._new_world(w) for w in range(self.n_worlds)]
        return self._observations()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Infos]:
        """Take a step in every world.

        Parameters
        ----------
        actions : ndarray, shape (worlds, robots, 2) or (worlds, robots)
            Wheel speeds from -1 to 1, or numbers of actions, depending on the task.

        Returns
        -------
        observations : float32 ndarray, shape (worlds, robots, width)
        reward : ndarray, shape (worlds, robots)
        terminated, truncated : bool ndarrays, shape (worlds,)
            Whether the task was done; whether the steps were used up.
        infos : dict
            Empty, or "final_obs" (worlds, robots, width) if an episode has ended.
        """
        if not self.worlds:
            raise SwarmError("the environment has no episode yet; call reset() before step()")
        wheels = shares(self.task.actions, actions, (self.n_worlds, self.commanded))
        reward = np.empty((self.n_worlds, self.commanded))
        for world, command, row in zip(self.worlds, wheels, reward, strict=True):
            world.advance(command, row)
        observations = self._observations()
        terminated = np.array([world.finished for world in self.worlds])
        truncated = np.array([world.out_of_time for world in self.worlds]) & ~terminated
        infos = self._renew(np.flatnonzero(terminated | truncated), observations)
        return observations, reward, terminated, truncated, infos

    def _renew(self, ended: np.ndarray, observations: np.ndarray) -> Infos:
        """Start the next episode where one has ended; write its first observations and return the last ones."""
        if not len(ended):
            return {}
        final = observations.copy()
        for w in ended:
            self.worlds[w] = self._new_world(w)
            self.worlds[w].observe(observations[w])
        return {"final_obs": final}

    def _new_world(self, w: int) -> TaskWorld:
        return new_world(self.task, self.commanded, self._generators[w])

    def _observations(self) -> np.ndarray:
        observations = np.empty((self.n_worlds, self.commanded, self.width), np.float32)
        for world, rows in zip(self.worlds, observations, strict=True):
            world.observe(rows)
        return observations

    def _seeds(self, seed: int | Sequence[int]) -> list[int]:
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(seed) != self.n_worlds:
                raise InvalidValueError(f"seed has {len(seed)} numbers for {self.n_worlds} worlds; expected one each")
            return [check_seed(each) for each in seed]
        return [check_seed(seed) + w for w in range(self.n_worlds)]


def new_world(task: Task, commanded: int, generator: np.random.Generator) -> TaskWorld:
    """Return a world for the next episode, its seed drawn from this stream."""
    return TaskWorld(task=task, commanded=commanded, rng=int(generator.integers(LARGEST_SEED)))


def check_seed(seed: object) -> int:
    """Return a seed as an int."""
    return check_count("seed", seed, maximum=LARGEST_SEED)
