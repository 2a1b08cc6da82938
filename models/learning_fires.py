"""Learning to fight fires: robots that learn a strategy from rewards.

WHAT IS IT? Strategies A and B were written by hand. These robots learn what to do in which situation from two rewards:
for finding a fire, and for extinguishing one. The question is whether they gather at the large fire.

HOW IT WORKS. Layers: Avoid, LearnFires. A robot uses one of five skills (explore, approach, wait, back off,
follow) until its situation changes: free, at a fire, too hot in the heat or out of it; a fire in sight or not; a
robot in sight or not. For each situation it stores a value of each skill, updates it by the reward of the skill, and
chooses at random, the more so the higher its temperature T. When all fires are out, or after `round_steps`, they are
relit at the same places: a round.

HOW TO USE IT. With `controller` "shared" all robots learn in one table, with "own" each in its own. For comparison
there are strategies A and B, a follower (A, and it follows visible robots), and random skills.

THINGS TO NOTICE. Early rounds reach the step limit, with the large fire burning. Later, robots that share a table
back out of the heat, wait in front of the fire and return: strategy B, without being programmed.

THINGS TO TRY. put_out 0: do they still extinguish fires? arrival 0? gamma 0.9, at which a rest is never worth it?

EXTENDING IT. Reward all robots when a fire goes out.

REFERENCE. Thesis 9.5 and 10.4. Sutton, Precup and Singh, Artificial Intelligence 112 (1999).
"""

from typing import Annotated

import numpy as np

from mesa_swarm import AGENT_FIRE, Choice, Seed, Slider, SwarmModel, process, value
from mesa_swarm.control import Avoid, Explore, Follow, Subsumption
from mesa_swarm.errors import InvalidValueError, check_choice, check_count
from mesa_swarm.fire import FightFire
from mesa_swarm.learning.fire_learning import LearnFires

CONTROLLERS = ("shared", "own", "A", "B", "follower", "random")


def rounds(
    fires_out: np.ndarray, fires_robots: np.ndarray, fires_light: np.ndarray, lasted: np.ndarray, all_out: np.ndarray,
    largest_out: np.ndarray, began: np.ndarray, at_largest: np.ndarray, lit_at: np.ndarray, step: int,
    largest: int = 0, round_steps: int = 6_000,
) -> None:  # fmt: skip
    """End a round when all fires are out or the step limit is reached: events of the first robot; and begin another."""
    at_largest[0] = fires_robots[largest]
    if len(lasted) > 0 and (fires_out.all() or step - began[0] >= round_steps):
        lasted[0], all_out[0], largest_out[0] = step - began[0], fires_out.all(), fires_out[largest]
        began[0], at_largest[0] = step, 0
        fires_light[:] = lit_at


class LearningFires(SwarmModel):
    """Robots that learn to fight fires.

    >>> LearningFires(rng=1).run(10).results()["rounds"]
    0
    """

    compares = "controller", CONTROLLERS
    steps_to_compare = 60_000
    # Number of robots that fight the largest fire.
    robots_at_largest = value("rounds.at_largest")

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 50, 1, "robots")] = 10,
        controller: Annotated[str, Choice(CONTROLLERS, "what drives the robots")] = "shared",
        arrival: Annotated[float, Slider(0, 100, 1, "reward for arriving at another fire")] = 10.0,
        put_out: Annotated[float, Slider(0, 100, 1, "reward for those at a fire that goes out")] = 10.0,
        step_cost: Annotated[float, Slider(0, 1, 0.001, "cost of a step away from fires")] = 0.01,
        alpha: Annotated[float, Slider(0, 1, 0.01, "learning rate: weight of a new experience")] = 0.1,
        gamma: Annotated[float, Slider(0, 0.9999, 0.0001, "discount factor: weight of the next step's value")] = 0.999,
        beta: Annotated[float, Slider(0, 0.01, 1e-5, "fraction by which T approaches its final value per step")] = 1e-4,
        first_temperature: Annotated[float, Slider(0.01, 50, 0.01, "temperature T of choices at the start")] = 5.0,
        last_temperature: Annotated[float, Slider(0.01, 50, 0.01, "temperature T to which it falls")] = 0.1,
        round_steps: Annotated[int, Slider(100, 20_000, 100, "maximum steps of a round")] = 6_000,
        map: Annotated[str, Choice(("openspace_fire",), "walls and obstacles")] = "openspace_fire",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, history_every=0, model_reporters={"robots_at_largest": "robots_at_largest"})
        if not len(self.fires):
            raise InvalidValueError(f"map {self.map.name} has no fires; choose one with fires, such as openspace_fire")
        self.add_robots(AGENT_FIRE, check_count("n_robots", n_robots))
        learner = LearnFires(
            arrival=arrival, put_out=put_out, step_cost=step_cost, alpha=alpha, gamma=gamma, beta=beta,
            first_temperature=first_temperature, last_temperature=last_temperature,
            shared=controller == "shared", frozen=controller == "random",
        )  # fmt: skip
        most = check_count("round_steps", round_steps, minimum=1)
        memory = {"began": 0, "at_largest": 0, "lit_at": self.fires.temperature}
        counting = process(memory=memory, events=("lasted", "all_out", "largest_out"))(rounds)
        self.add_process(counting(largest=int(np.argmax(self.fires.area)), round_steps=most))
        self.control = Subsumption(*_layers(check_choice("controller", controller, CONTROLLERS), learner))

    @property
    def rounds(self) -> np.ndarray:
        """Of each round, a row: how many steps it lasted, whether all fires went out, and whether the largest did."""
        names, values = self.events.name, self.events.value
        return np.column_stack([values[names == name] for name in ("lasted", "all_out", "largest_out")])

    def results(self) -> dict[str, float | None]:
        """Return the results of the second half: of the rounds, and of the steps with robots at the largest fire."""
        later = self.rounds[len(self.rounds) // 2 :]
        lasted, out, largest = later.mean(axis=0) if len(later) else (None,) * 3
        fighting = np.array(self.datacollector.model_vars["robots_at_largest"][self.steps // 2 :], dtype=float)
        together = fighting[fighting > 1].sum() / fighting.sum() if fighting.any() else None
        shares = {"rounds with the largest out": largest, "rounds with all fires out": out, "steps of a round": lasted}
        return {**shares, "rounds": len(self.rounds), "fighting at the largest in company": together}


def _layers(controller: str, learner: LearnFires) -> tuple:
    if controller in ("shared", "own", "random"):
        return Avoid(fires="never"), learner
    if controller == "B":
        return Avoid(fires="never"), FightFire(strategy="B"), Explore()
    following = (Follow(),) if controller == "follower" else ()
    return Avoid(fires="when hot"), FightFire(strategy="A"), *following, Explore()
