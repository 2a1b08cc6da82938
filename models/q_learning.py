"""Q-learning: robots that learn to drive fast without collisions.

WHAT IS IT? These robots are not programmed to avoid collisions. Each learns continuously, together with
the others, from a reward that is high for driving ahead and low near obstacles.

HOW IT WORKS. A robot has a small network for each of its actions, which estimates the value of the action from
the infrared readings. It chooses at random, with higher probability for higher values, and more at random the higher
its temperature T. One step later it corrects the network by the reward and by the value of the new state.
T falls from 1 to 0.2: robots first explore, then use what they have learned.

HOW TO USE IT. `reward` (a) is the mean wheel speed, (b) rewards driving straight ahead only, (c) is as (b) without the
jump at the critical distance. `critical` is that distance, as a share of the range: the thesis's 0.4 has no unit; 0.08
is 0.4 of a robot's diameter, chosen because collisions then fall with T, as its text states without numbers.
`reward_of` is the state that is rewarded: in which the action was chosen, or the next. `beta` is the rate at which T
falls, `gamma` the discount factor. `memory` "table" replaces the networks by a look-up table of coarse readings,
without `encoding`, `eta` and `self_adjusting`. `shared` lets robots learn together, `self_adjusting` lets each adapt T,
and gamma, to its collisions, and `typed` distinguishes kinds of bodies.

THINGS TO NOTICE. Collisions become rarer as T falls, yet recur: a network that learns of one situation changes others.

THINGS TO TRY. Reward (a): why do robots quiver? Four actions: do robots turn to and fro beside walls? `critical` 0.4:
why are there hardly any collisions to begin with? gamma 0.9: at what distance do robots turn?

EXTENDING IT. A reflex above the learner: `model.control = Subsumption(Avoid(distance=3), model.learner)`.
REFERENCE. Thesis, chapters 6 to 8.
"""

from typing import Annotated, Any, ClassVar

import numpy as np

from mesa_swarm import AGENT9, Choice, Seed, Slider, SwarmModel, held, measure
from mesa_swarm.control import Subsumption
from mesa_swarm.errors import InvalidValueError, check_count, shortened
from mesa_swarm.learning import TableQLearning, q_learning
from mesa_swarm.model.parameters import YES_NO, is_yes


class QLearning(SwarmModel):
    """Robots that learn to avoid collisions.

    Examples
    --------
    >>> QLearning(n_robots=3, rng=1).run(5).steps
    5
    """

    compares = "beta", (1e-4, 5e-3)
    steps_to_compare = 33_000
    earlier_defaults: ClassVar = {"reward_of": "next state"}  # of recordings without this parameter

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 100, 1, "robots")] = 15,
        reward: Annotated[str, Choice(("a", "b", "c"), "(a) speed, (b) driving straight, (c) b, continuous")] = "b",
        actions: Annotated[int, Slider(4, 8, 4, "number of actions: 8, or the first 4 of them")] = 8,
        beta: Annotated[float, Slider(0, 0.01, 1e-4, "fraction by which T approaches its final value per step")] = 1e-4,
        alpha: Annotated[float, Slider(0, 1, 0.05, "learning rate: weight of a new experience")] = 0.4,
        eta: Annotated[float, Slider(0, 1, 0.05, "learning rate of the networks")] = 0.1,
        gamma: Annotated[float, Slider(0, 0.95, 0.05, "discount factor: weight of the next step's value")] = 0.7,
        first_temperature: Annotated[float, Slider(0.01, 5, 0.01, "temperature T of choices at the start")] = 1.0,
        last_temperature: Annotated[float, Slider(0.01, 5, 0.01, "temperature T to which it falls")] = 0.2,
        critical: Annotated[float, Slider(0.005, 1, 0.001, "reading below which only distance is rewarded")] = 0.08,
        reward_of: Annotated[str, Choice(("state", "next state"), "whose readings are rewarded")] = "state",
        encoding: Annotated[str, Choice(("distance", "typed"), "inputs: distances, or also body kinds")] = "distance",
        memory: Annotated[str, Choice(("networks", "table"), "what values are learned in")] = "networks",
        shared: Annotated[str, Choice(YES_NO, "whether all robots share one set of networks")] = "no",
        self_adjusting: Annotated[str, Choice(q_learning.ADJUSTING, "adapted to collisions: T, gamma")] = "no",
        map: Annotated[str, Choice(("original", "sparse", "openspace"), "walls and obstacles")] = "original",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("temperature", "reward", "forward_speed"))
        self.add_robots(AGENT9, check_count("n_robots", n_robots, minimum=1))
        common: dict[str, Any] = {
            "reward": reward, "actions": actions, "alpha": alpha, "gamma": gamma, "beta": beta, "critical": critical,
            "first_temperature": first_temperature, "last_temperature": last_temperature, "reward_of": reward_of,
            "shared": is_yes("shared", shared),
        }  # fmt: skip
        networks = q_learning.QLearning(encoding=encoding, eta=eta, **q_learning.adjusted(self_adjusting), **common)
        of_networks: dict[str, Any] = {"encoding": encoding, "eta": eta, "self_adjusting": self_adjusting}
        in_a_table = q_learning.in_a_table(memory, networks, **of_networks)
        self.control = Subsumption(TableQLearning(**common) if in_a_table else networks)

    @measure
    @staticmethod
    def temperature(control_temperature: np.ndarray) -> float:
        """Return the mean T of the robots."""
        return np.mean(control_temperature)

    @measure
    @staticmethod
    def reward(control_reward: np.ndarray) -> float:
        """Return the mean reward of the robots for their last actions."""
        return np.mean(control_reward)

    @measure
    @staticmethod
    def forward_speed(command: np.ndarray, max_speed: np.ndarray) -> float:
        """Return the mean commanded forward speed, as a fraction of the maximum."""
        return np.mean((command[:, 0] + command[:, 1]) / 2 / max_speed)

    @property
    def learner(self) -> q_learning.QLearning | TableQLearning:
        """The learning layer, with its networks or tables."""
        layers = () if self.control is None else self.control.layers
        learner = next((layer for layer in layers if isinstance(layer, q_learning.QLearning | TableQLearning)), None)
        if learner is None:
            raise InvalidValueError(f"the model is driven by {shortened(layers)}; expected a layer that learns")
        return learner

    def results(self) -> dict[str, float]:
        """Return the measures used by a comparison: collisions per robot and 1,000 steps, in all and at the end."""
        counts = np.array(self.datacollector.model_vars["collisions"][-3_000:], dtype=float)
        robots, steps = max(len(self.swarm), 1), max(self.steps, 1)
        return {
            "collisions per robot and 1,000 steps": 1000.0 * self.total_collisions / (robots * steps),
            "the same in the last 3,000 steps": 1000.0 * float(counts.sum()) / (robots * max(len(counts), 1)),
            "forward speed in the end": self.forward_speed,
        }
