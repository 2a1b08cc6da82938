"""PettingZoo environment: a ParallelEnv whose agents are the robots of one world, and the same with turns (AEC)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, SwarmError, shortened
from mesa_swarm.environments.actions import checked_clip, shares
from mesa_swarm.environments.registration import need_learning_package
from mesa_swarm.environments.rendering import METADATA, Display, checked_mode
from mesa_swarm.environments.spaces import action_space, observation_space, state_space
from mesa_swarm.environments.state import StateEncoder
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import Task
from mesa_swarm.environments.variation import Conditions, Options
from mesa_swarm.environments.vector import check_seed, measures, new_world, stream

need_learning_package("pettingzoo")

from gymnasium.spaces import Discrete, Space  # noqa: E402 - the error above names what is missing
from pettingzoo import AECEnv, ParallelEnv  # noqa: E402 - the error above names what is missing
from pettingzoo.utils.conversions import parallel_to_aec  # noqa: E402
from pettingzoo.utils.wrappers import AssertOutOfBoundsWrapper  # noqa: E402

# PettingZoo's tests of its interface reset with these options, whatever the environment.
PROBE = {"options": 1}


class ParallelSwarmEnv(ParallelEnv):
    """Robots of one world as PettingZoo agents ``robot_0``, ``robot_1``, ...; all end together, unless removed before.

    Made by `parallel_env` in `collision_avoidance_v0` and the other modules of tasks. The columns of the current
    `world` can be read: ``env.world.swarm.collided``. Where the task's `Variation` draws numbers of robots, `agents`
    are the first of `possible_agents`.

    The agent of a robot that is removed from `world` leaves `agents` in the step in which, or before which, that is
    done: it is terminated, with its last observation again and a reward of 0. `reset` brings all back. A world to
    which robots are added is refused.

    Parameters
    ----------
    task : Task
    name : str
        Of the environment, such as "collision_avoidance_v0".
    render_mode : "rgb_array", "human" or None
        "human" shows every step in a window.
    clip : bool
        Whether wheel speeds beyond -1 and 1 are clipped instead of refused.

    Attributes
    ----------
    world : TaskWorld or None
    conditions : Conditions or None
        Map, number of robots, speed and imperfection of the current episode.
    state_space : gymnasium.spaces.Box
        Of `state`.
    """

    def __init__(self, task: Task, *, name: str, render_mode: str | None = None, clip: bool = False) -> None:
        self.metadata = {**METADATA, "name": name, "is_parallelizable": True}
        self.render_mode = checked_mode(render_mode)
        self.task = task
        self.possible_agents = [f"robot_{i}" for i in range(task.most_robots)]
        self.agents: list[str] = []
        self._numbers = {agent: number for number, agent in enumerate(self.possible_agents)}
        self.observation_spaces = {agent: observation_space(task, i) for i, agent in enumerate(self.possible_agents)}
        self.action_spaces = {agent: action_space(task) for agent in self.possible_agents}
        self.state_space = state_space(task)
        self._last_observations: dict[str, np.ndarray] = {}
        self.world: TaskWorld | None = None
        self.conditions: Conditions | None = None
        self._width = task.observer().width
        self._widths = {agent: space.shape[0] for agent, space in self.observation_spaces.items()}
        self._clip = checked_clip(task.actions, clip)
        self._states = StateEncoder(task)
        self._generator = np.random.default_rng()
        self._screen = Display(self.render_mode)
        self._no_measures: dict[str, float] = {}

    def observation_space(self, agent: str) -> Space:
        """Return the space of an agent's observations, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space:
        """Return the space of an agent's actions, always the same object."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: Options | None = None) -> tuple[dict, dict]:
        """Start an episode; return observations and infos by agent.

        Parameters
        ----------
        seed : int, optional
            Without one the stream of episodes continues.
        options : dict, optional
            Of this episode: "map", "n_robots", "speed" and "imperfection" are what they are given to be instead of
            drawn.
        """
        if seed is not None:
            self._generator = stream(check_seed(seed))
        settings = None if isinstance(options, dict) and options == PROBE else options
        self.world, self.conditions = new_world(self.task, self.task.most_robots, self._generator, settings)
        self.agents = self.possible_agents[: self.world.commanded]
        self._no_measures = dict.fromkeys(self.world.measures(), 0.0)
        self._screen.show(self.world)
        self._last_observations = self._observations(self.world)
        return dict(self._last_observations), self._infos(self.world, self._no_measures)

    def step(self, actions: dict) -> tuple[dict, dict, dict, dict, dict]:
        """Take a step, given an action of each agent.

        Returns
        -------
        observations, rewards, terminations, truncations, infos : dicts by agent
            An info has "collided", whether the robot overlapped anything in this step, and the measures of the whole
            episode, the same for all agents: 0 until its last step, and then infinity for what has not happened in it.

        Raises
        ------
        InvalidValueError
            If an action is missing or wrong; none is needed of an agent whose robot was removed.
        SwarmError
            If no episode has begun, or robots were added to the world.
        """
        world = self._running()
        reward = np.empty(world.commanded)
        world.advance(
            shares(self.task.actions, self._order_actions(world, actions), reward.shape, self._clip, self.task.numbers),
            reward,
        )
        is_over, out_of_time = world.finished, world.out_of_time
        infos = self._infos(world, measures(world) if is_over or out_of_time else self._no_measures)
        observations, rewards = self._observations(world), self._by_agent(reward.tolist())
        terminated = dict.fromkeys(self.agents, is_over)
        truncated = dict.fromkeys(self.agents, out_of_time and not is_over)
        absent = self._find_removed(world)
        for agent in absent:
            observations[agent], terminated[agent], truncated[agent] = (
                self._last_observations[agent].copy(),
                True,
                False,
            )
        if is_over or out_of_time:
            self.agents = []
        elif absent:
            self.agents = [agent for agent in self.agents if agent not in absent]
        self._last_observations = observations
        self._screen.show(world)
        return dict(observations), rewards, terminated, truncated, infos

    def state(self) -> np.ndarray:
        """Return the state of the world for a central critic, float32, one row; see `StateEncoder`."""
        state = np.empty(self._states.width, np.float32)
        self._states.write(self._running_world("state"), state)
        return state

    def render(self) -> np.ndarray | None:
        """Return a picture of the world, uint8, shape (height, width, 3), or None if it is shown or not drawn."""
        return None if self.render_mode is None else self._screen.render(self._running_world("render"))

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _running_world(self, method: str) -> TaskWorld:
        if self.world is None:
            raise SwarmError(f"the environment has no episode yet; call reset() before {method}()")
        return self.world

    def _running(self) -> TaskWorld:
        if self.world is None or not self.agents:
            raise SwarmError("the episode is over or not begun; call reset() before step()")
        return self.world

    def _order_actions(self, world: TaskWorld, actions: dict) -> list:
        """Return an action of each robot with which the episode began, 0 for those that were removed."""
        absent = self._find_removed(world)
        acting_agents = [agent for agent in self.agents if agent not in absent] if absent else self.agents
        if not isinstance(actions, dict) or (acting_agents and not actions):
            raise InvalidValueError(f"actions are {shortened(actions)}; expected a dict of one for each agent")
        try:
            acting = list(map(actions.__getitem__, acting_agents))
        except KeyError as error:
            raise InvalidValueError(f"actions lack {error.args[0]}; expected one for each agent") from None
        if len(actions) > len(acting_agents) and not actions.keys() <= set(self.agents):
            raise InvalidValueError(f"actions are {shortened(actions)}; expected a dict of one for each agent")
        if len(acting) == world.commanded:
            return acting
        idle = (0.0,) * self.task.numbers if isinstance(self.task.actions, str) else 0
        in_order: list = [idle] * world.commanded
        for agent, action in zip(acting_agents, acting, strict=True):
            in_order[self._numbers[agent]] = action
        return in_order

    def _find_removed(self, world: TaskWorld) -> set[str]:
        """Return the agents whose robots have been removed since the last step."""
        roster = world.roster()
        if roster.complete:
            return set()
        there = self._by_agent(roster.present(world.commanded).tolist())
        return {agent for agent in self.agents if not there[agent]}

    def _by_agent(self, values: Sequence[Any] | np.ndarray) -> dict[str, Any]:
        """Return the values of the agents that there were before the step, of one for each robot of the episode."""
        if len(values) == len(self.agents):
            return dict(zip(self.agents, values, strict=True))
        return {agent: values[self._numbers[agent]] for agent in self.agents}

    def _infos(self, world: TaskWorld, whole: dict[str, float]) -> dict[str, dict]:
        """Return an info of each agent, always with the same names: TorchRL has room for these only."""
        collided = np.empty(world.commanded, np.bool_)
        world.roster().spread(world.swarm.columns["collided"], collided)
        return {agent: {"collided": collided, **whole} for agent, collided in self._by_agent(collided.tolist()).items()}

    def _observations(self, world: TaskWorld) -> dict[str, np.ndarray]:
        observations = np.empty((world.commanded, self._width), np.float32)
        world.observe(observations)
        return {agent: row[: self._widths[agent]] for agent, row in self._by_agent(observations).items()}


def parallel_of(
    task: type[Task],
    name: str,
    parameters: dict,
    *,
    render_mode: str | None = None,
    max_cycles: int | None = None,
    clip: bool = False,
) -> ParallelSwarmEnv:
    """Return the environment of a task with these parameters; `max_cycles` is another name of `max_steps`."""
    if max_cycles is not None:
        if "max_steps" in parameters:
            raise InvalidValueError(f"max_cycles is {shortened(max_cycles)} beside max_steps; give one of them")
        parameters = {**parameters, "max_steps": max_cycles}
    return ParallelSwarmEnv(task.of(parameters), name=name, render_mode=render_mode, clip=clip)


def with_turns(env: ParallelSwarmEnv) -> AECEnv:
    """Return the environment in which agents act in turn (AEC), with PettingZoo's checks of actions and of order."""
    turns = parallel_to_aec(env)
    spaces = env.action_spaces.values()
    return AssertOutOfBoundsWrapper(turns) if all(isinstance(space, Discrete) for space in spaces) else turns
