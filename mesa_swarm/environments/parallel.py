"""PettingZoo environment: a ParallelEnv whose agents are the robots of one world."""

import numpy as np

from mesa_swarm.environments.actions import shares
from mesa_swarm.environments.camera import METADATA, Camera, checked_mode
from mesa_swarm.environments.registration import need
from mesa_swarm.environments.spaces import action_space, observation_space
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import Task
from mesa_swarm.environments.vector import check_seed, new_world
from mesa_swarm.errors import InvalidValueError, SwarmError, shortened

need("pettingzoo")

from gymnasium.spaces import Space  # noqa: E402 - the error above names what is missing
from pettingzoo import ParallelEnv  # noqa: E402 - the error above names what is missing


class ParallelSwarmEnv(ParallelEnv):
    """Robots of one world as PettingZoo agents ``robot_0``, ``robot_1``, ...; all end together.

    Made by `parallel_env` in `collision_avoidance_v0`, `find_fires_v0` and `extinguish_fires_v0`. The columns of the
    current `world` can be read: ``env.world.swarm.collided``.
    """

    def __init__(self, task: Task, *, name: str, render_mode: str | None = None) -> None:
        self.metadata = {**METADATA, "name": name, "is_parallelizable": True}
        self.render_mode = checked_mode(render_mode)
        self.task = task
        self.possible_agents = [f"robot_{i}" for i in range(task.n_robots)]
        self.agents: list[str] = []
        self.observation_spaces = {agent: observation_space(task) for agent in self.possible_agents}
        self.action_spaces = {agent: action_space(task) for agent in self.possible_agents}
        self.world: TaskWorld | None = None
        self._width = task.observer().width
        self._generator = np.random.default_rng()
        self._camera = Camera(task.chart)

    def observation_space(self, agent: str) -> Space:
        """Return the space of an agent's observations, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space:
        """Return the space of an agent's actions, always the same object."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict | None = None) -> tuple[dict, dict]:
        """Start an episode; return observations and infos by agent. Without a seed the stream of episodes continues."""
        if seed is not None:
            self._generator = np.random.default_rng(check_seed(seed))
        self.world = new_world(self.task, self.task.n_robots, self._generator)
        self.agents = self.possible_agents[:]
        return self._observations(self.world), {agent: {} for agent in self.agents}

    def step(self, actions: dict) -> tuple[dict, dict, dict, dict, dict]:
        """Take a step, given an action of each agent.

        Returns
        -------
        observations, rewards, terminations, truncations, infos : dicts by agent
        """
        world, agents = self._running(), self.agents
        reward = np.empty(len(agents))
        world.advance(shares(self.task.actions, self._ordered(actions), reward.shape), reward)
        finished, out_of_time = world.finished, world.out_of_time
        if finished or out_of_time:
            self.agents = []
        return (
            self._observations(world),
            dict(zip(agents, reward.tolist(), strict=True)),
            dict.fromkeys(agents, finished),
            dict.fromkeys(agents, out_of_time and not finished),
            {agent: {} for agent in agents},
        )

    def render(self) -> np.ndarray | None:
        """Return a picture of the world, uint8, shape (height, width, 3), or None without a render mode."""
        if self.render_mode is None:
            return None
        if self.world is None:
            raise SwarmError("the environment has no episode yet; call reset() before render()")
        return self._camera.picture(self.world)

    def _running(self) -> TaskWorld:
        if self.world is None or not self.agents:
            raise SwarmError("the episode is over or not begun; call reset() before step()")
        return self.world

    def _ordered(self, actions: dict) -> list:
        """Return the actions in the order of the robots."""
        if not isinstance(actions, dict) or len(actions) != len(self.agents):
            raise InvalidValueError(f"actions are {shortened(actions)}; expected a dict of one for each agent")
        try:
            return list(map(actions.__getitem__, self.agents))
        except KeyError as missing:
            raise InvalidValueError(f"actions lack {missing.args[0]}; expected one for each agent") from None

    def _observations(self, world: TaskWorld) -> dict[str, np.ndarray]:
        observations = np.empty((len(self.possible_agents), self._width), np.float32)
        world.observe(observations)
        return dict(zip(self.possible_agents, observations, strict=True))
