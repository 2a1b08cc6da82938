"""Learning to fight fires by choosing among skills."""

import math
from dataclasses import dataclass

import numpy as np

from mesa_swarm.control.layer import Senses, nearest_of
from mesa_swarm.errors import LearningError, check_count, check_flag, check_name, check_number
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import best_of, chosen
from mesa_swarm.learning.learner import LearningLayer
from mesa_swarm.robots.drive import approach, turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import FIRE, ROBOT

SKILLS = ("explore", "approach", "wait", "back off", "follow")
EXPLORE, APPROACH, WAIT, BACK_OFF, FOLLOW = range(len(SKILLS))
BODIES = ("free", "at a fire", "too hot, in the heat", "too hot, out of the heat")
SEEN = ("", ", sees a robot", ", sees a fire", ", sees a fire and a robot")
SITUATIONS = tuple(body + seen for body in BODIES for seen in SEEN)
# Robots turn towards things farther than this from straight ahead; as `Follow` and `FightFire` by default.
CRITICAL_ANGLE = math.radians(10.0)
# Exploring robots turn away from a fire nearer than this; as `Avoid` by default.
NEAR = 15.0


@compiled
def situation_of(kind, i, at_fire, hot, heat):
    """Return the index in `SITUATIONS` of robot i's situation: its body, whether it sees a fire, and a robot."""
    fire, robot = 0, 0
    for s in range(kind.shape[1]):
        if kind[i, s] == FIRE:
            fire = 1
        elif kind[i, s] == ROBOT:
            robot = 1
    body = (2 if heat > 0.0 else 3) if hot else (1 if at_fire else 0)
    return 4 * body + 2 * fire + robot


@compiled
def perform(skill, distance, kind, bearing, forward, i, d, at_fire, side, speed, radius):
    """Return the wheel speeds of a skill for robot i of design d."""
    if skill == WAIT or (skill == APPROACH and at_fire):
        return 0.0, 0.0
    if skill == BACK_OFF:
        return -speed, -speed
    seen = nearest_of(distance, kind, i, ROBOT if skill == FOLLOW else FIRE)
    if seen >= 0 and skill != EXPLORE:
        return approach(bearing[d, seen], CRITICAL_ANGLE, speed, radius)
    ahead = seen >= 0 and (seen == forward[d, 0] or seen == forward[d, 1] or seen == forward[d, 2])
    if ahead and distance[i, seen] < NEAR:
        away = -bearing[d, seen] if bearing[d, seen] != 0.0 else side
        return turn_towards(math.copysign(math.pi, away), speed, radius)
    return speed, speed


LARGEST_REWARD = 1e6


@dataclass(kw_only=True)
class LearnFires(LearningLayer):
    """Learn the values of skills in each situation: explore, approach, wait, back off, follow; always active.

    A situation is: free, at a fire, too hot in the heat, or too hot out of it; whether a fire is seen; whether a
    robot is. A skill lasts until the situation changes, at most `hold` steps. Then the table of that robot is
    corrected, as in Q-learning over stretches of several steps (Sutton, Precup and Singh, Artificial Intelligence
    112, 1999): ``Q(s, k) <- Q(s, k) + alpha (R + gamma^n max_k' Q(s', k') - Q(s, k))``, where R is the discounted
    reward of the n steps; and the next skill is chosen by Boltzmann's probabilities (7.4).

    A step away from fires costs `step_cost`; the first step at a fire is worth `arrival`, unless it is the one that
    the robot fought last; when a fire goes out, that is worth `put_out` to those that stand there and fight it, and
    nothing to those that wait nearby. Put ``Avoid(fires="never")`` above: its actions count as part of the world.

    Parameters
    ----------
    arrival, put_out, step_cost : float
        Rewards and the cost, at least 0.
    alpha : float
        Weight of a new experience, 0 to 1.
    gamma : float
        Discount of the next step's value, 0 to below 1; near 1, as a rest lasts hundreds of steps.
    beta : float
        Share of its difference to the limit by which the temperature falls in each step, 0 to 1.
    first_temperature, last_temperature : float
        Of the choice, above 0.
    hold : int
        Steps, at least 1.
    shared : bool
        Whether all robots learn in one table, in the order of their ids.
    frozen : bool
        Whether it only chooses, without learning: at random if frozen from the start.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> LearnFires(put_out=0).arrival
    10.0
    """

    arrival: float = 10.0
    put_out: float = 10.0
    step_cost: float = 0.01
    alpha: float = 0.1
    gamma: float = 0.999
    beta: float = 1e-4
    first_temperature: float = 5.0
    last_temperature: float = 0.1
    hold: int = 50
    shared: bool = False
    frozen: bool = False
    name: str = "LearnFires"

    def __post_init__(self) -> None:
        check_name("name", self.name)
        for name in ("arrival", "put_out", "step_cost"):
            check_number(name, getattr(self, name), minimum=0, maximum=LARGEST_REWARD)
        for name in ("alpha", "beta"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)
        check_number("gamma", self.gamma, minimum=0, maximum=0.999999)
        for name in ("first_temperature", "last_temperature"):
            check_number(name, getattr(self, name), above=0, maximum=LARGEST_REWARD)
        check_count("hold", self.hold, minimum=1)
        for name in ("shared", "frozen"):
            check_flag(name, getattr(self, name))

    def _start_elsewhere(self) -> None:
        """Refuse to: tables cannot be stored as a policy, from which robots of another model could start."""
        if self._column("values").any():
            raise LearningError(f"{self.name} has learned in another model; give this one a new LearnFires(...)")

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns: a table, a robot's skill and since when, and its reward."""
        swarm.remember(f"{prefix}.values", (len(SITUATIONS), len(SKILLS)), np.float64, 0.0)
        for name in ("situation", "skill", "last", "before"):
            swarm.remember(f"{prefix}.{name}", (), np.int64, -1)
        swarm.remember(f"{prefix}.kept", (), np.int64, 0)
        swarm.remember(f"{prefix}.gain", (), np.float64, 0.0)
        swarm.remember(f"{prefix}.temperature", (), np.float64, self.first_temperature)

    @property
    def values(self) -> np.ndarray:
        """Every robot's values of the skills in each situation (n, 16, 5); a copy."""
        return self._column("values").copy()

    @property
    def temperature(self) -> np.ndarray:
        """Of every robot's choice (n,); a copy."""
        return self._column("temperature").copy()

    def begin_again(self) -> None:
        """Note that all fires are about to be lit again, which must not count as a fire put out."""
        self._column("before")[self._robots.columns["fire"] >= 0] = -1
        self._column("last")[:] = -1

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Learn from the last step, choose skills where due, and drive robots that no other layer drives."""
        values = self._column("values")
        learn_skills(
            senses.distance, senses.kind, senses.heat, senses.hot, senses.fire, senses.last_command,
            senses.tendency, senses.max_speed, senses.radius, senses.design, senses.bearing, senses.forward,
            values, tuple(map(self._column, ("situation", "skill", "last", "before", "kept"))),
            tuple(map(self._column, ("gain", "temperature"))), self._rng.random(len(layer)),
            (float(self.arrival), float(self.put_out), float(self.step_cost)),
            (float(self.alpha), float(self.gamma), float(self.beta), float(self.last_temperature)),
            int(self.hold), (bool(self.shared), bool(self.frozen)),
            command, layer, index,
        )  # fmt: skip
        if self.shared:
            values[1:] = values[:1]

    def reason(self, moment: Moment) -> Reason:
        """Return the situation, and the skill if its column was stored."""
        columns = moment.columns
        now = situation_of(moment.kind[np.newaxis], 0, columns["fire"] >= 0, columns["hot"], columns["heat"])
        skill = columns.get(f"{self._prefix}.skill", -1)
        chose = f"it chose to {SKILLS[int(skill)]}" if skill >= 0 else "it chose by what it learned"
        return Reason(f"{chose}: it is {SITUATIONS[now]}")


@compiled
def learn_skills(
    distance, kind, heat, hot, fire, last_command, tendency, max_speed, radius, design, bearing, forward,
    values, doing, worth, chance, rewards, rates, hold, options, command, layer, index,
):  # fmt: skip
    """Learn from the last step and write the commands of the skills that are chosen."""
    situation, skill, last, before, age = doing
    gain, temperature = worth
    alpha, gamma, beta, coolest = rates
    shared, frozen = options
    for i in range(layer.shape[0]):
        row = 0 if shared else i
        now = situation_of(kind, i, fire[i] >= 0, hot[i], heat[i])
        if skill[i] >= 0:
            stood = last_command[i, 0] == 0.0 and last_command[i, 1] == 0.0
            gain[i] += gamma ** age[i] * paid(fire[i], before[i], last[i], hot[i], stood, rewards)
            age[i] += 1
        if fire[i] >= 0:
            last[i] = fire[i]
        before[i] = fire[i]
        if skill[i] < 0 or now != situation[i] or age[i] >= hold:
            if skill[i] >= 0 and not frozen:
                best = values[row, now, best_of(values[row, now])]
                target = gain[i] + gamma ** age[i] * best
                values[row, situation[i], skill[i]] += alpha * (target - values[row, situation[i], skill[i]])
            situation[i], age[i], gain[i] = now, 0, 0.0
            skill[i] = chosen(values[row, now], temperature[i], chance[i])
        if not frozen:
            temperature[i] -= beta * (temperature[i] - coolest)
        if layer[i] < 0:
            command[i, 0], command[i, 1] = perform(
                skill[i], distance, kind, bearing, forward, i, design[i], fire[i] >= 0,
                tendency[i], max_speed[i], radius[i],
            )  # fmt: skip
            layer[i] = index


@compiled
def paid(fire, before, last, hot, stood, rewards):
    """Return the reward of a step; `before` and `last` are the fires fought in the step before, and most recently."""
    arrival, put_out, step_cost = rewards
    if fire >= 0:
        return 0.0 if fire in (before, last) else arrival
    # It no longer fights, but is neither hot nor gone away: the fire went out.
    went_out = before >= 0 and not hot and stood
    return put_out - step_cost if went_out else -step_cost
