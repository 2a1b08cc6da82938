"""All commanded robots of several worlds as a vector environment of Stable-Baselines3, for one shared policy."""

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, Self

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.environments.registration import need_learning_package
from mesa_swarm.environments.rendering import Display, checked_mode
from mesa_swarm.environments.tasks import Task
from mesa_swarm.environments.variation import Options
from mesa_swarm.environments.vector import Infos, VectorSwarmEnv, by_worlds

Indices = int | Iterable[int] | None


class SharedPolicyVecEnv:
    """A flat `VectorSwarmEnv` as Stable-Baselines3's VecEnv: each commanded robot is one environment.

    Environment w k + i is robot i of world w, where k robots of each world are commanded. After the last step of an
    episode an info has "terminal_observation", "TimeLimit.truncated", whether the steps were used up, and "episode":
    r, the robot's sum of rewards, l, the steps, and the measures of the world by name. Wheel speeds beyond -1 and 1
    are clipped. Needs the extra `sb3`.

    Parameters
    ----------
    task : Task
    n_worlds : int
    commanded : int, optional
        How many robots of each world are commanded; all by default. At most the least number that the task's
        `Variation` draws: learners would take rows of absent robots for experiences.
    render_mode : "rgb_array" or None
    seed : int or sequence of int, optional
        Of the first `reset`: one for all worlds, or one for each.

    Attributes
    ----------
    swarms : VectorSwarmEnv

    Raises
    ------
    SwarmError
        If Stable-Baselines3 is not installed.
    InvalidValueError

    Examples
    --------
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> from stable_baselines3 import PPO  # doctest: +SKIP
    >>> env = SharedPolicyVecEnv(CollisionAvoidance(n_robots=15), n_worlds=4, seed=1)  # doctest: +SKIP
    >>> model = PPO("MlpPolicy", env, n_steps=128).learn(100_000)  # doctest: +SKIP
    """

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """Return an instance that is a VecEnv as well, which is imported only now."""
        need_learning_package("stable_baselines3", "sb3")
        kind: Any = cls
        return object.__new__(_with_base(kind))

    def __init__(
        self,
        task: Task,
        *,
        n_worlds: int,
        commanded: int | None = None,
        render_mode: str | None = None,
        seed: int | Sequence[int] | None = None,
    ) -> None:
        from mesa_swarm.environments.spaces import action_space, observation_space  # noqa: PLC0415 - optional

        if checked_mode(render_mode) == "human":
            raise InvalidValueError("render_mode is 'human'; expected 'rgb_array' or None: many worlds have no window")
        clip = isinstance(getattr(task, "actions", None), str)
        self.swarms = VectorSwarmEnv(task, n_worlds=n_worlds, commanded=commanded, clip=clip)
        _check_present(task, self.swarms.commanded)
        self._screen, self._mode = Display(render_mode), render_mode
        self._actions = np.empty(0)
        self._next: dict[str, Any] = {"seed": seed, "options": None}
        count = self.swarms.n_worlds * self.swarms.commanded
        super().__init__(count, observation_space(task), action_space(task))  # type: ignore[call-arg]  # of VecEnv

    def seed(self, seed: int | Sequence[int] | None = None) -> list[int | None]:
        """Give the next `reset` a seed, or one for each world; return that of each environment."""
        self._next["seed"] = seed
        seeds: list[Any] = list(seed) if isinstance(seed, (list, tuple, np.ndarray)) else [seed] * self.swarms.n_worlds
        return [number for number in seeds for _ in range(self.swarms.commanded)]

    def set_options(self, options: Options | Sequence[Options] | None = None) -> None:
        """Give the next `reset` options, one dict for all worlds or one for each; see `VectorSwarmEnv.reset`.

        Option "n_robots" is at least the number of commanded robots.
        """
        self._next["options"] = options

    def reset(self) -> np.ndarray:
        """Start an episode in every world and return the observations (environments, width)."""
        arguments, self._next = self._next, {"seed": None, "options": None}
        observations = self.swarms.reset(**arguments)
        if not self.swarms.present.all():
            raise InvalidValueError(
                f"option n_robots is {self.swarms.present.sum(axis=1).min()}; expected at least "
                f"{self.swarms.commanded}, the commanded robots: Stable-Baselines3 has no mask for absent ones"
            )
        self.reset_infos = self._conditions()
        return self._flat(observations)

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions of the next step, one row an environment."""
        self._actions = by_worlds(actions, self.swarms.n_worlds, self.swarms.commanded)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict]]:
        """Take the step; return observations, rewards (float32), which environments have ended, and their infos."""
        observations, reward, terminated, truncated, raw = self.swarms.step(self._actions)
        _check_none_missing(raw, terminated | truncated)
        infos = [{"collided": collided} for collided in raw["collided"].ravel().tolist()]
        if "measures" in raw:
            self._close_episodes(infos, raw, truncated)
        is_over = np.repeat(terminated | truncated, self.swarms.commanded)
        return self._flat(observations), reward.ravel().astype(np.float32), is_over, infos

    def close(self) -> None:
        """Do nothing: no process and no window is open."""

    def get_images(self) -> list[np.ndarray | None]:
        """Return a picture of each world."""
        if not self.swarms.worlds:
            raise SwarmError("the environment has no episode yet; call reset() before render()")
        return [self._screen.render(world) for world in self.swarms.worlds]

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute of environments, which all share: "render_mode", or one of `swarms`, such as "task"."""
        value = self._mode if attr_name == "render_mode" else getattr(self.swarms, attr_name)
        return [value for _ in self._choose_environments(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Refuse: the environments share their worlds."""
        raise InvalidValueError(f"{attr_name} cannot be set; make a new SharedPolicyVecEnv, or change `swarms`")

    def env_method(self, method_name: str, *arguments: Any, indices: Indices = None, **keywords: Any) -> list[Any]:
        """Refuse: the environments share their worlds."""
        raise InvalidValueError(f"{method_name} cannot be called on single environments; call a method of `swarms`")

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Return False for each: no environment is wrapped."""
        return [False for _ in self._choose_environments(indices)]

    def _close_episodes(self, infos: list[dict], raw: Infos, truncated: np.ndarray) -> None:
        k, final = self.swarms.commanded, self._flat(raw["final_obs"])
        conditions = self._conditions()
        for w in np.flatnonzero(raw["_final_obs"]).tolist():
            measures = {name: float(values[w]) for name, values in raw["measures"].items()}
            for e in range(w * k, (w + 1) * k):
                total = float(raw["returns"].flat[e])
                infos[e]["terminal_observation"] = final[e]
                infos[e]["TimeLimit.truncated"] = bool(truncated[w])
                infos[e]["episode"] = {"r": total, "l": int(measures["steps"]), **measures}
                self.reset_infos[e] = conditions[e]

    def _conditions(self) -> list[dict[str, Any]]:
        return [conditions.info for conditions in self.swarms.conditions for _ in range(self.swarms.commanded)]

    def _choose_environments(self, indices: Indices) -> list[int]:
        count = self.swarms.n_worlds * self.swarms.commanded
        every = range(count) if indices is None else [indices] if isinstance(indices, int) else indices
        return list(every)

    def _flat(self, array: np.ndarray) -> np.ndarray:
        return array.reshape(-1, array.shape[-1])


@cache
def _with_base(cls: Any) -> Any:
    """Return a class that is derived from Stable-Baselines3's VecEnv too."""
    from stable_baselines3.common.vec_env import VecEnv  # noqa: PLC0415 - optional, and slow to load

    if issubclass(cls, VecEnv):
        return cls
    return type(cls.__name__, (cls, VecEnv), {"__module__": cls.__module__, "__doc__": cls.__doc__})


def _check_none_missing(infos: Infos, is_over: np.ndarray) -> None:
    """Refuse that robots are removed from a world whose episode goes on."""
    if "removed" in infos and (absent := infos["removed"] & ~is_over[:, None]).any():
        w, i = np.argwhere(absent)[0].tolist()
        raise SwarmError(
            f"robot {i} of world {w} was removed during an episode; Stable-Baselines3 has no mask for absent robots: "
            "let commanded robots stay, or use PettingZoo"
        )


def _check_present(task: Task, commanded: int) -> None:
    """Refuse a number of commanded robots that an episode may not have."""
    varied = None if task.variation is None else task.variation.n_robots
    if varied is not None and commanded > varied[0]:
        raise InvalidValueError(
            f"commanded is {commanded} and the least of n_robots {varied[0]}; expected at most that many: "
            "Stable-Baselines3 has no mask for absent robots"
        )
