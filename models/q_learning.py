"""Q-learning: robots that teach themselves to drive fast and to touch nothing.

WHAT IS IT? Nobody tells these robots how to avoid collisions. Each learns for itself, without a break and with
the others about, from a reward: it is good to drive ahead, and bad to be near something.

HOW IT WORKS. A robot has a small network for each of its actions, which says what the action is worth, given what
the infrared sensors read. It chooses by chance, the more so the higher its temperature T, and rather what is worth
more. One step later it corrects the network by the reward it got and by what its new situation is worth.
T falls from 1 to 0.2: first robots try things, then they do what they have learned.

HOW TO USE IT. `reward` (a) pays the mean wheel speed, (b) driving straight ahead only, (c) as (b) without the leap at
the critical distance. `beta` is how fast T falls. `gamma` is how far robots look ahead. `shared` lets all robots
learn with one set of networks, `self_adjusting` lets each set T by how often it bumps, and `typed` tells robots,
fires and loads from obstacles.

THINGS TO NOTICE. Most collisions happen in the first thousand steps. Some come back, long after: what a network
learns of one situation changes what it says of others. With beta 0.005 collisions end sooner than with 0.0001.

THINGS TO TRY. Reward (a): why do robots quiver? Eight actions: are there more collisions, and why? gamma 0.9: at what
distance do robots turn? A single robot: does it learn as well without the others?

EXTENDING IT. A reflex above the learner: `model.control = Subsumption(Avoid(distance=3), model.learner)`.

REFERENCE. Thesis, chapters 6 to 8.
"""

from typing import Annotated

import numpy as np

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.errors import InvalidValueError, check_choice, check_count, shortened
from mesa_swarm.learning import q_learning
from mesa_swarm.parameters import Choice, Slider
from mesa_swarm.reporters import held
from mesa_swarm.streams import Seed

YES_NO = ("no", "yes")


class QLearning(SwarmModel):
    """Robots that teach themselves to avoid collisions.

    Examples
    --------
    >>> QLearning(n_robots=3, rng=1).run(5).steps
    5
    """

    compares = "beta", (1e-4, 5e-3)
    steps_to_compare = 33_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 100, 1, "robots")] = 15,
        reward: Annotated[str, Choice(("a", "b", "c"), "pays (a) speed, (b) going straight, (c) b but no leap")] = "b",
        actions: Annotated[int, Slider(4, 8, 4, "what robots can do: 8, or the first 4 of them")] = 4,
        beta: Annotated[float, Slider(0, 0.01, 1e-4, "share by which T nears its end in each step")] = 1e-4,
        alpha: Annotated[float, Slider(0, 1, 0.05, "how much of a new experience counts")] = 0.4,
        eta: Annotated[float, Slider(0, 1, 0.05, "learning rate of the networks")] = 0.1,
        gamma: Annotated[float, Slider(0, 0.95, 0.05, "what the next step's value counts")] = 0.7,
        first_temperature: Annotated[float, Slider(0.01, 5, 0.01, "T at the start")] = 1.0,
        last_temperature: Annotated[float, Slider(0.01, 5, 0.01, "T in the end")] = 0.2,
        critical: Annotated[float, Slider(0.05, 1, 0.05, "reading below which only nearness counts")] = 0.4,
        encoding: Annotated[str, Choice(("distance", "typed"), "what robots know of what they see")] = "distance",
        shared: Annotated[str, Choice(YES_NO, "whether all learn with the same networks")] = "no",
        self_adjusting: Annotated[str, Choice(YES_NO, "whether a robot sets T by its own bumps")] = "no",
        map: Annotated[str, Choice(("original", "sparse", "openspace"), "the world")] = "original",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("temperature", "reward", "forward_speed"))
        self.add_robots(AGENT9, check_count("n_robots", n_robots, minimum=1))
        layer = q_learning.QLearning(
            reward=reward, actions=actions, encoding=encoding, alpha=alpha, eta=eta, gamma=gamma, beta=beta,
            first_temperature=first_temperature, last_temperature=last_temperature, critical=critical,
            shared=_is_yes("shared", shared), self_adjusting=_is_yes("self_adjusting", self_adjusting),
        )  # fmt: skip
        self.control = Subsumption(layer)

    @property
    def temperature(self) -> float:
        """Mean T of the robots."""
        return float(np.mean(self.learner.temperature))

    @property
    def reward(self) -> float:
        """Mean reward that the robots got for their last actions."""
        return float(np.mean(self.learner.last_reward))

    @property
    def forward_speed(self) -> float:
        """Mean speed ahead that was commanded, as a share of the largest."""
        return float(np.mean(self.swarm.command.mean(axis=1) / self.swarm.max_speed))

    @property
    def learner(self) -> q_learning.QLearning:
        """The layer that learns, with what it knows."""
        layers = () if self.control is None else self.control.layers
        learner = next((layer for layer in layers if isinstance(layer, q_learning.QLearning)), None)
        if learner is None:
            raise InvalidValueError(f"the model is driven by {shortened(layers)}; expected a layer that learns")
        return learner

    def results(self) -> dict[str, float]:
        """Return what a comparison compares: collisions per robot and 1,000 steps, and those of the end."""
        counts = np.array(self.datacollector.model_vars["collisions"][-3_000:], dtype=float)
        robots, steps = max(len(self.swarm), 1), max(self.steps, 1)
        return {
            "collisions per robot and 1,000 steps": 1000.0 * self.total_collisions / (robots * steps),
            "the same in the last 3,000 steps": 1000.0 * float(counts.sum()) / (robots * max(len(counts), 1)),
            "forward speed in the end": self.forward_speed,
        }


def _is_yes(name: str, answer: str | bool) -> bool:
    """Return whether it is yes; sweeps and scripts say True and False."""
    return bool(answer) if isinstance(answer, bool | np.bool_) else check_choice(name, answer, YES_NO) == "yes"
