"""Learning to fight fires by choosing among skills."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import check_count, check_number
from mesa_swarm.control.layer import RobotColumns, Senses, kernel_with, nearest_of
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import whole_power
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Integers, Reals, RealTables
from mesa_swarm.learning.actions import best_of, chosen
from mesa_swarm.learning.learner import (
    CHECKS,
    COUNT,
    INDEX,
    NUMBER,
    POSITIVE,
    UNBORN,
    Check,
    Declared,
    Lesson,
    TableLayer,
    begin_lesson,
    end_lesson,
)
from mesa_swarm.learning.table_learning import ValueTables
from mesa_swarm.robots.drive import approach, turn_towards
from mesa_swarm.robots.reasons import Moment, Reason
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
    return 4 * body_of(at_fire, hot, heat) + 2 * fire + robot


@compiled
def body_of(at_fire, hot, heat):
    """Return the index in `BODIES` of what a robot's body is in."""
    return (2 if heat > 0.0 else 3) if hot else (1 if at_fire else 0)


@compiled
def perform(skill, distance, kind, bearing, forward, i, d, at_fire, side, speed, radius):
    """Return the wheel speeds of a skill for robot i of design d."""
    if skill == WAIT or (skill == APPROACH and at_fire):
        return 0.0, 0.0
    if skill == BACK_OFF:
        return -speed, -speed
    sensor = nearest_of(distance, kind, i, ROBOT if skill == FOLLOW else FIRE)
    if sensor >= 0 and skill != EXPLORE:
        return approach(bearing[d, sensor], CRITICAL_ANGLE, speed, radius)
    ahead = sensor >= 0 and (sensor == forward[d, 0] or sensor == forward[d, 1] or sensor == forward[d, 2])
    if ahead and distance[i, sensor] < NEAR:
        away = -bearing[d, sensor] if bearing[d, sensor] != 0.0 else side
        return turn_towards(math.copysign(math.pi, away), speed, radius)
    return speed, speed


LARGEST_REWARD = 1e6


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class SkillPolicy(ValueTables):
    """Values of skills in each situation, which robots learned by `LearnFires`.

    ``LearnFires(start=policy, frozen=True)`` drives robots by it, on any map and of any design with proximity sensors;
    `save_policy` and `load_policy` store it. Its situations include a robot's heat, which is not among the readings
    with which `PolicyLayer` asks a `Policy`.

    Parameters
    ----------
    sensors : SensorLayout
        Of the robots that learned.
    values : ndarray, shape (copies, 16, 5)
        Of every skill of `SKILLS` in every situation of `SITUATIONS`. The k-th robot acts by set ``k % copies``.
    hold : int
        Steps for which a skill lasts in the same situation, at least 1.
    temperature, steps, training
        As for `QPolicy`.

    Raises
    ------
    InvalidValueError
        If the values have another shape, or are not finite.

    Examples
    --------
    >>> from mesa_swarm import AGENT_FIRE
    >>> from mesa_swarm.learning import SensorLayout
    >>> eyes = SensorLayout.of(AGENT_FIRE)
    >>> policy = SkillPolicy(sensors=eyes, values=np.eye(16, 5)[None], temperature=0.1, hold=50)
    >>> policy.best()["free, sees a fire"]
    'wait'
    """

    family: ClassVar[str] = "skills"
    own_layer: ClassVar[str] = "LearnFires"
    checks: ClassVar[dict[str, Check]] = {"temperature": POSITIVE, "hold": CHECKS["hold"]}
    temperature: float = 0.1
    hold: int = 50

    def __post_init__(self) -> None:
        self._check(len(SITUATIONS), len(SKILLS))

    def best(self, copy: int = 0) -> dict[str, str]:
        """Return the skill of the largest value in every situation, by their names, of one robot's table."""
        row = self.values[check_count("copy", copy, maximum=self.copies - 1)]
        return {name: SKILLS[k] for name, k in zip(SITUATIONS, row.argmax(axis=1).tolist(), strict=True)}


@dataclass(kw_only=True)
class LearnFires(TableLayer[SkillPolicy]):
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
        Of the choice, above 0. With a start, its temperature is the first.
    hold : int
        Steps, at least 1.
    shared : bool
        Whether all robots learn in one table, in the order of their ids.
    frozen : bool
        Whether it only chooses, without learning: by the values of its start, at random without one.
    start : SkillPolicy, optional
        The initial policy of new robots, from `policy()` or a file. The k-th robot ever made gets table
        ``k % copies``, or table 0 where they share one.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> LearnFires(put_out=0).arrival
    10.0
    """

    policy_class = SkillPolicy
    of_policies = ("hold",)
    stated = ("arrival", "put_out", "step_cost", "alpha", "gamma", "beta", "shared")
    checks: ClassVar[dict[str, Check]] = {
        **dict.fromkeys(("arrival", "put_out", "step_cost"), partial(check_number, minimum=0, maximum=LARGEST_REWARD)),
        "gamma": partial(check_number, minimum=0, maximum=0.999999),
    }
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
    start: SkillPolicy | None = None
    name: str = "LearnFires"

    def _check_sensors(self) -> None:
        """Permit all sensors: skills are the same for all."""

    def _columns(self) -> dict[str, Declared]:
        """Return the columns: a table, a robot's skill and since when, and its reward."""
        return {
            "values": ((len(SITUATIONS), len(SKILLS)), np.float64, 0.0),
            **dict.fromkeys(("situation", "skill", "last", "before"), INDEX),
            "kept": COUNT,
            "gain": NUMBER,
            "temperature": ((), np.float64, self._begun_at),
        }

    def begin_again(self) -> None:
        """Note that all fires are about to be lit again, which must not count as a fire put out."""
        self._column("before")[self._robots.columns["fire"] >= 0] = -1
        self._column("last")[:] = -1

    def kernel_of_lighting(self, asked: np.ndarray) -> Kernel:
        """Return what does the same in a run, where any of the numbers that `asked` holds, one a fire, is not NaN."""
        fire = self._robots.columns["fire"]
        return kernel_with(forget_fires, ForgetArrays(asked, fire, self._column("before"), self._column("last")))

    def arguments(self, robots: RobotColumns, senses: Senses) -> tuple[Any, "SkillRule"]:
        """Return what learns and chooses."""
        names = "values", "situation", "skill", "last", "before", "kept", "lessons", "gain", "temperature"
        rule: Any = (
            (float(self.arrival), float(self.put_out), float(self.step_cost)),
            (float(self.alpha), float(self.gamma), float(self.beta), float(self.last_temperature)),
            int(self.hold),
            (bool(self.shared), bool(self.frozen)),
        )
        memory: Any = map(self._column, names)
        return learn_skills, SkillRule(robots, self._lesson(), *memory, *rule)

    def reason(self, moment: Moment) -> Reason:
        """Return the situation, and the skill if its column was stored."""
        columns = moment.columns
        now = situation_of(moment.kind[np.newaxis], 0, columns["fire"] >= 0, columns["hot"], columns["heat"])
        skill = columns.get(f"{self._prefix}.skill", -1)
        chose = f"it chose to {SKILLS[int(skill)]}" if skill >= 0 else "it chose by what it learned"
        return Reason(f"{chose}: it is {SITUATIONS[now]}")


class ForgetArrays(NamedTuple):
    """What `forget_fires` takes: temperatures at which fires are to be lit, and columns of robots."""

    asked: Reals
    fire: Integers
    before: Integers
    last: Integers


@compiled(nogil=True)
def forget_fires(block, step, first_row, last_row):
    """Let robots forget the fires that they fought, if any fire is lit again."""
    a = unpack(block, ForgetArrays)
    if np.isnan(a.asked).all():
        return 0
    for i in range(a.fire.shape[0]):
        a.before[i] = -1 if a.fire[i] >= 0 else a.before[i]
        a.last[i] = -1
    return 0


class SkillRule(NamedTuple):
    """What `learn_skills` takes.

    Parameters
    ----------
    robots : RobotColumns
    lesson : Lesson
    values : ndarray, shape (n, situations, skills)
    situation, skill, last, before, age, lessons : int64 ndarrays, shape (n,)
        Columns of robots: of the skill that each performs, and the fires that it fought.
    gain, temperature : ndarrays, shape (n,)
    rewards, rates : tuples of float
        Of an arrival, a fire put out, and a step; alpha, gamma, beta and T_c.
    hold : int
    options : tuple of bool
        Whether robots learn together, and only act.
    """

    robots: RobotColumns
    lesson: Lesson
    values: RealTables
    situation: Integers
    skill: Integers
    last: Integers
    before: Integers
    age: Integers
    lessons: Integers
    gain: Reals
    temperature: Reals
    rewards: tuple[float, float, float]
    rates: tuple[float, float, float, float]
    hold: int
    options: tuple[bool, bool]


@compiled(nogil=True)
def learn_skills(block, step, first_row, last_row):
    """Learn from the last step and write the commands of the skills that are chosen."""
    rule = unpack(block, SkillRule)
    if not begin_lesson(rule.lesson):
        return UNBORN
    robots, values, situation, skill = rule.robots, rule.values, rule.situation, rule.skill
    kind, hot, fire, layer = robots.kind, robots.hot, robots.fire, robots.layer
    last, before, age, lessons = rule.last, rule.before, rule.age, rule.lessons
    gain, temperature = rule.gain, rule.temperature
    alpha, gamma, beta, coolest = rule.rates
    shared, frozen = rule.options
    for i in range(layer.shape[0]):
        row = 0 if shared else i
        now = situation_of(kind, i, fire[i] >= 0, hot[i], robots.heat[i])
        if skill[i] >= 0:
            stood = robots.last_command[i, 0] == 0.0 and robots.last_command[i, 1] == 0.0
            gain[i] += whole_power(gamma, age[i]) * paid(fire[i], before[i], last[i], hot[i], stood, rule.rewards)
            age[i] += 1
            lessons[i] += 0 if frozen else 1
        if fire[i] >= 0:
            last[i] = fire[i]
        before[i] = fire[i]
        if skill[i] < 0 or now != situation[i] or age[i] >= rule.hold:
            if skill[i] >= 0 and not frozen:
                best = values[row, now, best_of(values[row, now])]
                target = gain[i] + whole_power(gamma, age[i]) * best
                values[row, situation[i], skill[i]] += alpha * (target - values[row, situation[i], skill[i]])
            situation[i], age[i], gain[i] = now, 0, 0.0
            skill[i] = chosen(values[row, now], temperature[i], rule.lesson.chance[i])
        if not frozen:
            temperature[i] -= beta * (temperature[i] - coolest)
        if layer[i] < 0:
            robots.command[i, 0], robots.command[i, 1] = perform(
                skill[i], robots.distance, kind, robots.bearing, robots.forward, i, robots.design[i], fire[i] >= 0,
                robots.tendency[i], robots.max_speed[i], robots.radius[i],
            )  # fmt: skip
            layer[i] = robots.place
    return end_lesson(rule.lesson, -1)  # means of rewards do not diverge


@compiled
def paid(fire, before, last, hot, stood, rewards):
    """Return the reward of a step; `before` and `last` are the fires fought in the step before, and most recently."""
    arrival, put_out, step_cost = rewards
    if fire >= 0:
        return 0.0 if fire in (before, last) else arrival
    # It no longer fights, but is neither hot nor gone away: the fire went out.
    went_out = before >= 0 and not hot and stood
    return put_out - step_cost if went_out else -step_cost
