"""Aggregation: gather into one cluster, by what each robot sees."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from mesa_swarm.analysis.spacing import nearest_neighbour_distances
from mesa_swarm.base.errors import check_number
from mesa_swarm.control import Avoid, Explore, Gather, Layer
from mesa_swarm.environments.scores import LARGEST_REWARD, Score, cluster_sizes
from mesa_swarm.environments.task import Task
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Flags, Integers, RealRows, Reals
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.swarm_model import SwarmModel

# How many steps there is room for at first.
FEWEST_STEPS = 256
FAR_SIGHTED = AGENT9.with_proximity(range=100)


@dataclass(frozen=True, kw_only=True)
class Aggregation(Task):
    """Gather into one cluster. Robots are in one cluster where steps of at most `link` lead from one to the other.

    A step is worth (s - 1) / (n - 1) to a robot in a cluster of s of the n robots, and `collision_cost` less if it
    overlapped anything in it. Never finished. Robots that are not commanded avoid what is very near, turn to the
    centroid of the robots that they see, stay there, and explore where they see none.

    Parameters
    ----------
    n_robots, map, design, encoding, actions, max_steps, variation, team, coverage_reward, messages, message_range
        As for `Task`.
    link : float
        Greatest distance between the centres of linked robots, map units, above 0: by default two diameters and a
        margin.
    collision_cost : float
        At least 0.

    Examples
    --------
    >>> Aggregation().observer().width
    36
    """

    design: RobotDesign | Sequence[RobotDesign] = FAR_SIGHTED
    map: str | os.PathLike | Map = "openspace"
    encoding: str = "typed"
    max_steps: int = 2000
    link: float = 25.0
    collision_cost: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("link", self.link, above=0, maximum=LARGEST_RANGE)
        check_number("collision_cost", self.collision_cost, minimum=0, maximum=LARGEST_REWARD)

    def others(self) -> tuple[Layer, ...]:
        """Return the layers of agglomeration, with random turns."""
        return Avoid(distance=4.0), Gather(stop_distance=12.0), Explore(turn_interval=100)

    def score(self, model: SwarmModel, count: int) -> Score:
        """Return what rewards the first `count` robots of a new world."""
        return AggregationScore(model, link=float(self.link), collision_cost=float(self.collision_cost))


class AggregationScore:
    """The share of the others that are in the robot's cluster, less `collision_cost` for a collision."""

    finished = False

    def __init__(self, model: SwarmModel, *, link: float, collision_cost: float) -> None:
        self._model = model
        self._rule = link, collision_cost
        # Of each step the share of robots in the largest cluster, and how many steps there are.
        self._largest, self._count = np.zeros(FEWEST_STEPS), np.zeros(1, np.int64)

    def remove_robots(self, rows: np.ndarray) -> None:
        """Do nothing: rewards depend on the last step only."""

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step."""
        self.kernel_for(out, np.zeros(1, np.bool_)).run(self._model.steps, len(self._model.swarm))

    def kernel_for(self, out: np.ndarray, finished: np.ndarray) -> Kernel:
        """Return what writes the rewards of a step."""
        block = Block(self._arrays(out))
        return Kernel(reward_clusters, block.numbers, block, partial(self._make_room, block, out))

    def _arrays(self, out: np.ndarray) -> "ClusterArrays":
        columns = self._model.swarm.columns
        sizes = np.zeros(len(columns["position"]), np.int64)
        return ClusterArrays(
            columns["position"], columns["collided"], *self._rule, sizes, self._largest, self._count, out
        )

    def _make_room(self, block: Block, out: np.ndarray, code: int) -> None:
        """Make room for the shares of more steps."""
        self._largest = np.concatenate([self._largest, np.zeros(len(self._largest))])
        block.replace(self._arrays(out))

    def measures(self) -> dict[str, float]:
        """Return the share of all robots in the largest cluster, its mean over the last quarter of the steps, and more.

        All are of the robots that are there. The last is the mean distance of all robots to the nearest other one, map
        units; NaN for a single robot.
        """
        position = self._model.swarm.position
        sizes = np.zeros(len(position), np.int64)
        cluster_sizes(position, self._rule[0], sizes)
        last = self._largest[self._count[0] * 3 // 4 : self._count[0]]
        return {
            "largest cluster": float(sizes.max() / len(sizes)) if len(sizes) else np.nan,
            "largest cluster, last quarter": float(np.mean(last)) if len(last) else np.nan,
            "neighbour distance": float(np.mean(nearest_neighbour_distances(position))) if len(sizes) > 1 else np.nan,
        }


class ClusterArrays(NamedTuple):
    """What `reward_clusters` takes; scratch for sizes, and the shares of robots in the largest cluster."""

    position: RealRows
    collided: Flags
    link: float
    collision_cost: float
    sizes: Integers
    largest: Reals
    steps: Integers
    reward: Reals


@compiled(nogil=True)
def reward_clusters(block, step, first, last):
    """Write the rewards of `AggregationScore`; return 1 if there is no room for another step's share."""
    c = unpack(block, ClusterArrays)
    sizes, largest, count, reward = c.sizes, c.largest, c.steps, c.reward
    n = sizes.shape[0]
    if count[0] == largest.shape[0]:
        return 1
    cluster_sizes(c.position, c.link, sizes)
    largest[count[0]] = sizes.max() / n
    count[0] += 1
    for i in range(reward.shape[0]):
        reward[i] = (sizes[i] - 1) / max(n - 1, 1) - c.collision_cost * c.collided[i]
    return 0
