"""Gymnasium environments: one commanded robot, or all commanded robots of several worlds as a vector."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice, shortened
from mesa_swarm.environments.actions import checked_clip, shares
from mesa_swarm.environments.registration import need_learning_package
from mesa_swarm.environments.rendering import METADATA, Display, checked_mode
from mesa_swarm.environments.spaces import action_space, observation_space
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import TASKS, Task
from mesa_swarm.environments.variation import Options
from mesa_swarm.environments.vector import Infos, VectorSwarmEnv, by_worlds, check_seed, measures, new_world, stream
from mesa_swarm.geometry.masked_arrays import fill_masked

need_learning_package("gymnasium")

from gymnasium import Env  # noqa: E402 - the error above names what is missing
from gymnasium.vector import AutoresetMode, VectorEnv  # noqa: E402
from gymnasium.vector.utils import batch_space  # noqa: E402

# Gymnasium's option of `reset` that names the environments which start an episode.
MASK = "reset_mask"


class RobotEnv(Env):
    """The first robot of a world as a Gymnasium environment.

    Made by ``gymnasium.make("MesaSwarm/CollisionAvoidance-v0")``, or another of the registered names. The columns of
    the current `world` can be read: ``env.unwrapped.world.swarm.collided``. If the robot itself is removed from the
    world, the episode is terminated with its last observation again and a reward of 0. The others may be removed; none
    may be added.

    Parameters
    ----------
    task : Task
    render_mode : "rgb_array", "human" or None
        "human" shows every step in a window.
    clip : bool
        Whether wheel speeds beyond -1 and 1 are clipped instead of refused.

    Attributes
    ----------
    world : TaskWorld or None
    """

    metadata = METADATA

    def __init__(self, task: Task, *, render_mode: str | None = None, clip: bool = False) -> None:
        self.render_mode = checked_mode(render_mode)
        self.task = task
        self.observation_space = observation_space(task)
        self.action_space = action_space(task)
        self.world: TaskWorld | None = None
        self._last_row = np.empty(0, np.float32)
        self._width = task.observer().width
        self._clip = checked_clip(task.actions, clip)
        self._screen = Display(self.render_mode)

    def reset(self, *, seed: int | None = None, options: Options | None = None) -> tuple[np.ndarray, dict]:
        """Start an episode and return observation and info.

        Parameters
        ----------
        seed : int, optional
            Without one the stream of episodes continues.
        options : dict, optional
            Of this episode: "map", "n_robots", "speed" and "imperfection" are what they are given to be instead of
            drawn. The info names what they are.
        """
        super().reset(seed=None if seed is None else check_seed(seed))
        if seed is not None:
            self._np_random = stream(seed)  # the same episodes as behind the other interfaces
        self.world, conditions = new_world(self.task, 1, self.np_random, options)
        self._screen.show(self.world)
        return self._observation(), conditions.info

    def step(self, action: ArrayLike) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Take a step, given two wheel speeds or the number of an action.

        Returns
        -------
        observation, reward, terminated, truncated, info
            The info has "collided", whether the robot overlapped anything in this step, and after the last step of an
            episode "measures" of all of it, infinity for what has not happened in it.
        """
        world = self._running()
        reward = np.empty(1)
        world.advance(
            shares(self.task.actions, fill_masked(action)[None], reward.shape, self._clip, self.task.numbers), reward
        )
        is_over, out_of_time = world.finished, world.out_of_time
        info: dict = {"collided": bool(world.roster().remaining(1) and world.swarm.columns["collided"][0])}
        if is_over or out_of_time:
            info["measures"] = measures(world)
        self._screen.show(world)
        return self._observation(), float(reward[0]), is_over, out_of_time and not is_over, info

    def render(self) -> np.ndarray | None:
        """Return a picture of the world, uint8, shape (height, width, 3), or None if it is shown or not drawn."""
        return None if self.render_mode is None else self._screen.render(self._running())

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _running(self) -> TaskWorld:
        if self.world is None:
            raise SwarmError("the environment has no episode yet; call reset() first")
        return self.world

    def _observation(self) -> np.ndarray:
        """Return what the robot observes, or once it is removed what it last did."""
        world = self._running()
        if world.roster().remaining(1):
            rows = np.empty((1, self._width), np.float32)
            world.observe(rows)
            self._last_row = rows[0]
        return self._last_row.copy()


def robot_env(
    *, task: str, render_mode: str | None = None, clip: bool = False, n_robots: int = 1, **parameters: object
) -> RobotEnv:
    """Return the environment that Gymnasium makes, of `n_robots` in all; `parameters` are others of the task."""
    settings = TASKS[check_choice("task", task, TASKS)].of({**parameters, "n_robots": n_robots})
    return RobotEnv(settings, render_mode=render_mode, clip=clip)


class RobotVectorEnv(VectorEnv):
    """A flat `VectorSwarmEnv`, for learners with one shared policy.

    Environment w k + i is robot i of world w, where k robots of each world are commanded. With one commanded robot,
    environment 0 is what `RobotEnv` is with the same seed, and so is each one that has a seed of its own. A world
    whose episode ends starts the next in the same step, unless another `autoreset_mode` is chosen:
    ``infos["final_obs"]`` holds the last observations, and ``infos["_final_obs"]`` which environments have ended.

    A robot that is removed from its world terminates its environment; until the world's next episode its rows are 0
    and ``infos["present"]`` is False.

    Parameters
    ----------
    task : Task
    n_worlds : int
    commanded : int, optional
        How many robots of each world are commanded; all by default.
    render_mode : "rgb_array" or None
    clip : bool
        Whether wheel speeds beyond -1 and 1 are clipped instead of refused.
    autoreset_mode : gymnasium.vector.AutoresetMode or str
        SAME_STEP ("SameStep"); NEXT_STEP ("NextStep"), which Gymnasium's NormalizeObservation needs; or DISABLED
        ("Disabled"): worlds whose episode is over are reset by ``reset(options={"reset_mask": mask})``.

    Attributes
    ----------
    swarms : VectorSwarmEnv

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> env = RobotVectorEnv(CollisionAvoidance(n_robots=5, map="openspace"), n_worlds=3)
    >>> observations, infos = env.reset(seed=1)
    >>> env.num_envs, observations.shape
    (15, (15, 9))
    """

    metadata = {**METADATA, "render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 Gymnasium's own form

    def __init__(
        self,
        task: Task,
        *,
        n_worlds: int,
        commanded: int | None = None,
        render_mode: str | None = None,
        clip: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ) -> None:
        if checked_mode(render_mode) == "human":
            raise InvalidValueError("render_mode is 'human'; expected 'rgb_array' or None: many worlds have no window")
        self.render_mode = render_mode
        self.swarms = VectorSwarmEnv(
            task, n_worlds=n_worlds, commanded=commanded, clip=clip, autoreset_mode=autoreset_mode
        )
        self.metadata = {**self.metadata, "autoreset_mode": AutoresetMode(self.swarms.autoreset_mode)}
        self.num_envs = self.swarms.n_worlds * self.swarms.commanded
        self.single_observation_space, self.single_action_space = observation_space(task), action_space(task)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._screen = Display(render_mode)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: Options | Sequence[Options] | None = None
    ) -> tuple[np.ndarray, Infos]:
        """Start an episode in every world; `seed` and `options` are one for all worlds or a sequence of one each.

        See `VectorSwarmEnv.reset`. Option "reset_mask", of one dict for all worlds, is a bool array: the environments
        that start an episode, all of a world or none. The infos are the conditions of the episodes: "map", "n_robots",
        "speed", "imperfection", and "present", whether an environment has a robot in this episode.
        """
        mask = None
        if isinstance(options, Mapping) and MASK in options:
            mask = self._mask_of_worlds(options[MASK])
            options = {name: value for name, value in options.items() if name != MASK}
        observations = self._flat(self.swarms.reset(seed=seed, options=options, mask=mask))
        return observations, self._conditions() | self._present()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Infos]:
        """Take a step in every world; all arrays have one row an environment.

        The infos are Gymnasium's, with masks whose names begin with "_": "collided" in each step; where an episode has
        ended "final_obs", "final_info" with "measures" of the whole episode, and what `reset` returns of the new one.
        Where the next episode does not begin in the same step: "measures", and in the step in which it does what
        `reset` returns.
        """
        shape = self.swarms.n_worlds, self.swarms.commanded
        observations, reward, *ends, raw = self.swarms.step(by_worlds(actions, *shape))
        terminated, truncated, is_new = (np.repeat(worlds, shape[1]) for worlds in (*ends, self.swarms.begun))
        is_over, collided = terminated | truncated, raw["collided"].ravel()
        infos = _mask_infos({"collided": collided & ~is_new}, ~is_new) if not is_new.all() else {}
        if is_new.any():
            infos |= self._conditions()
        if is_over.any():
            infos |= self._final(raw, collided, is_over)
        if "removed" in raw:
            absent = raw["removed"].ravel()
            terminated, truncated = terminated | absent, truncated & ~absent
            infos |= self._final_of_removed(observations, infos, absent)
        infos |= self._present()
        return self._flat(observations), reward.ravel(), terminated, truncated, infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return a picture of every world, or None without a render mode."""
        if self.render_mode is None:
            return None
        if not self.swarms.worlds:
            raise SwarmError("the environment has no episode yet; call reset() before render()")
        pictures = [self._screen.render(world) for world in self.swarms.worlds]
        return tuple(picture for picture in pictures if picture is not None)

    def _final(self, raw: Infos, collided: np.ndarray, is_over: np.ndarray) -> Infos:
        """Return the infos of episodes that have ended."""
        whole = {name: np.repeat(values, self.swarms.commanded) for name, values in raw["measures"].items()}
        of_episodes = {"measures": _mask_infos(whole, is_over)}
        if "final_obs" not in raw:
            return _mask_infos(of_episodes, is_over)
        last = {"collided": collided & is_over, **of_episodes}
        return {
            "final_obs": self._flat(raw["final_obs"]),
            "_final_obs": is_over,
            **_mask_infos({"final_info": _mask_infos(last, is_over)}, is_over),
        }

    def _final_of_removed(self, observations: np.ndarray, infos: Infos, absent: np.ndarray) -> Infos:
        """Return the final observations, 0, of removed robots beside those of episodes that have ended."""
        if self.metadata["autoreset_mode"] != AutoresetMode.SAME_STEP:
            return {}
        zeros = np.zeros_like(self._flat(observations))
        is_over = infos.get("_final_obs", np.zeros(self.num_envs, bool))
        return {"final_obs": infos.get("final_obs", zeros), "_final_obs": is_over | absent}

    def _mask_of_worlds(self, mask: object) -> np.ndarray:
        """Return which worlds a mask of environments resets: all environments of a world or none."""
        if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (self.num_envs,):
            raise InvalidValueError(
                f"option {MASK} is {shortened(mask)}; expected a bool array of {self.num_envs}, one an environment"
            )
        rows = mask.reshape(self.swarms.n_worlds, -1)
        is_split = rows.any(axis=1) & ~rows.all(axis=1)
        if is_split.any():
            raise InvalidValueError(
                f"option {MASK} has some environments of world {is_split.argmax()} only; expected all of its "
                f"{rows.shape[1]} or none: they share the world"
            )
        return np.asarray(rows.all(axis=1))

    def _conditions(self) -> Infos:
        """Return the conditions of the episodes that have just begun, as Gymnasium merges infos."""
        is_new, k, infos = self.swarms.begun, self.swarms.commanded, Infos()
        worlds = zip(self.swarms.conditions, is_new.tolist(), strict=True)
        of_worlds = [conditions.info if new else {} for conditions, new in worlds]
        for name, kind in (("map", object), ("n_robots", int), ("speed", float), ("imperfection", float)):
            blank = None if kind is object else 0
            values = np.array([row.get(name, blank) for row in of_worlds], kind)
            infos |= _mask_infos({name: np.repeat(values, k)}, np.repeat(is_new, k))
        return infos

    def _present(self) -> Infos:
        return _mask_infos({"present": self.swarms.present.ravel()}, np.ones(self.num_envs, bool))

    def _flat(self, array: np.ndarray) -> np.ndarray:
        return array.reshape(self.num_envs, -1)


def _mask_infos(values: Infos, where: np.ndarray) -> Infos:
    """Return infos, each with the mask of the environments that have it."""
    return {**values, **{f"_{name}": where.copy() for name in values}}


def robot_vector_env(
    *,
    task: str,
    num_envs: int,
    render_mode: str | None = None,
    clip: bool = False,
    n_robots: int = 1,
    commanded: int = 1,
    autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    **parameters: object,
) -> RobotVectorEnv:
    """Return the environment that ``gymnasium.make_vec`` makes, of `num_envs` worlds.

    The first `commanded` robots of each world are commanded: with several of them the environments are as many times
    more. ``autoreset_mode=AutoresetMode.NEXT_STEP``, or "NextStep", begins the next episode a step later.
    """
    settings = TASKS[check_choice("task", task, TASKS)].of({**parameters, "n_robots": n_robots})
    return RobotVectorEnv(
        settings,
        n_worlds=num_envs,
        commanded=commanded,
        render_mode=render_mode,
        clip=clip,
        autoreset_mode=autoreset_mode,
    )
