"""One world of a task for one episode, and the layer through which a learner drives robots."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError, check_count, shortened
from mesa_swarm.base.streams import Seed
from mesa_swarm.control import Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.layer import Senses, kernel_with
from mesa_swarm.control.team import Key
from mesa_swarm.environments.actions import shares
from mesa_swarm.environments.scores import MESSAGE, EpisodeTally, TeamEncoder, cells_in_reach
from mesa_swarm.environments.task import Task
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Integers, RealRows
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.swarm_model import SwarmModel

NONE_GONE: NDArray[np.int64] = np.empty(0, np.int64)


class Roster:
    """The robots with which an episode began, numbered by their first rows; they may be removed, but none be added.

    Parameters
    ----------
    swarm : Swarm
        As it is when the episode begins.

    Attributes
    ----------
    ids : int64 ndarray, shape (rows,)
        The unique_id of the robot in each row.
    numbers : int64 ndarray, shape (rows,)
        The number of the robot in each row, ascending.
    complete : bool
        Whether all robots are still there.
    """

    def __init__(self, swarm: Swarm) -> None:
        self.ids = swarm.unique_ids
        self._first_count = len(self.ids)
        self.numbers = np.arange(self._first_count)
        self.complete = True

    def find_gone(self, swarm: Swarm) -> NDArray[np.int64]:
        """Return the rows of robots that were removed since the last `drop`, as they were numbered before.

        Raises
        ------
        SwarmError
            If robots were added.
        """
        ids = swarm.unique_ids
        if np.array_equal(ids, self.ids):
            self.ids = ids
            return NONE_GONE
        new_ids = np.setdiff1d(ids, self.ids)
        if len(new_ids):
            raise SwarmError(
                f"robot {new_ids[0]} was added to the world of an episode, which keeps the robots with which it began; "
                "give the task more by n_robots, or add none"
            )
        return np.flatnonzero(~np.isin(self.ids, ids))

    def drop(self, rows: NDArray[np.int64]) -> None:
        """Note that the robots of these rows were removed."""
        self.ids = np.delete(self.ids, rows)
        self.numbers = np.delete(self.numbers, rows)
        self.complete = len(self.numbers) == self._first_count

    def remaining(self, first: int) -> int:
        """Return how many of the first robots are still there; they have the first rows."""
        return first if self.complete else int(np.searchsorted(self.numbers, first))

    def present(self, first: int) -> NDArray[np.bool_]:
        """Return which of the first robots are still there."""
        there = np.zeros(first, np.bool_)
        there[self.numbers[: self.remaining(first)]] = True
        return there

    def spread(self, rows: np.ndarray, out: np.ndarray) -> None:
        """Write rows of robots to the places of their numbers, as many as `out` has room for; 0 for removed robots."""
        k = self.remaining(len(out))
        if not self.complete:
            out[:] = 0
            out[self.numbers[:k]] = rows[:k]
        else:
            out[:] = rows[:k]


Control = Arbiter | Mapping[Key, Arbiter | None]


class Commanded:
    """Drive the first `count` robots of a swarm by commands from outside; the layers below drive the others.

    Their `wheels` (count, 2) are rim speeds left and right, map units a step, 0 at first; robots are driven by them
    from the next step on. They exist once the layer belongs to a swarm: ``model.control.layers[0].wheels``.

    Parameters
    ----------
    count : int
        At least 1.
    acts : sequence of str
        Names of actuators of one number; `acts` (count, number of names) of the layer is what they are set to, 0 at
        first.
    sends : dict of name and width
        Messages that are sent; `sends` (count, sum of widths) of the layer are the numbers, 0 at first.
    """

    name = "Commanded"
    _wheels: np.ndarray | None = None

    def __init__(self, count: int, *, acts: Sequence[str] = (), sends: Mapping[str, int] | None = None) -> None:
        self.count = check_count("count", count, minimum=1)
        self._actuators, self._messages = tuple(acts), dict(sends or {})
        self.acts, self.sends = np.empty((0, 0)), np.empty((0, 0))

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Allocate the commands: a copy of this layer belongs to each swarm."""
        self._wheels = np.zeros((self.count, 2))
        self.acts = np.zeros((self.count, len(self._actuators)))
        self.sends = np.zeros((self.count, sum(self._messages.values())))

    @property
    def wheels(self) -> np.ndarray:
        """The commands of the robots; LearningError if the layer is in no model."""
        if self._wheels is None:
            raise LearningError(
                "this Commanded is in no model, which would use a copy of it; write to the wheels of the copy, such as "
                "model.control.layers[0].wheels"
            )
        return self._wheels

    def remove_robots(self, rows: np.ndarray) -> None:
        """Forget the commands of robots, by their rows, that were removed: those behind them move up."""
        self._wheels = np.delete(self.wheels, rows, axis=0)
        self.acts, self.sends = np.delete(self.acts, rows, axis=0), np.delete(self.sends, rows, axis=0)
        self.count = len(self._wheels)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Copy the commands; this is the uppermost layer."""
        if len(layer) < self.count:
            raise InvalidValueError(
                f"{self.name}({self.count}) has {len(layer)} robots to command; add robots, or command fewer"
            )
        command[: self.count, :2] = self.wheels
        layer[: self.count] = index
        for k, name in enumerate(self._actuators):
            senses.act[name][: self.count] = self.acts[:, k]
        first = 0
        for name, width in self._messages.items():
            outbox = senses.send[name]
            outbox[: self.count] = self.sends[:, first : first + width].reshape(self.count, *outbox.shape[1:])
            first += width

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel | None:
        """Return what `decide` does, where robots are commanded no more than their wheels."""
        if self._actuators or self._messages or len(layer) < self.count:
            return None
        return kernel_with(command_robots, CommandArrays(self.wheels, command, layer, index))

    def reason(self, moment: Moment) -> Reason:
        """Return that the decision came from outside."""
        return Reason("it was commanded from outside")


class CommandArrays(NamedTuple):
    """What `command_robots` takes: the commands from outside, the columns command and layer, and the layer's place."""

    wheels: RealRows
    command: RealRows
    layer: Integers
    place: int


@compiled(nogil=True)
def command_robots(block, step, first, last):
    """Command the wheels of the first robots from outside."""
    c = unpack(block, CommandArrays)
    wheels, command, layer, place = c.wheels, c.command, c.layer, c.place
    for i in range(wheels.shape[0]):
        command[i, 0], command[i, 1] = wheels[i, 0], wheels[i, 1]
        layer[i] = place
    return 0


class TaskWorld(SwarmModel):
    """A world for one episode: `advance`, then `observe`, `finished`, `out_of_time` and `measures`.

    The first `commanded` robots are commanded and rewarded; the task's rules drive the others. Where none is
    commanded, rules drive all robots, and all of them are rewarded and measured. Its DataCollector collects
    nothing, so that memory does not grow with the steps.

    Robots may be removed from the world, but none be added. All arrays by robot keep a row for each robot with which
    the episode began: those of removed robots are 0, and what they did counts in the measures. The world is
    finished when no rewarded robot is left.

    Parameters
    ----------
    task : Task
    commanded : int, optional
        0 to the task's number of robots: all by default, and 0 with a `control`.
    control : Arbiter, or dict of them by design, optional
        Drives all robots, instead of the task's rules; see `SwarmModel.control`.
    rng : int, SeedSequence or Generator, optional

    Raises
    ------
    InvalidValueError
        If robots are to be commanded and driven by `control` at once.
    SwarmError
        By the methods: if robots were added; if some were removed and the task's score cannot do without them.

    Examples
    --------
    >>> from mesa_swarm.control import Avoid, Explore, Subsumption
    >>> from mesa_swarm.environments import CollisionAvoidance
    >>> task = CollisionAvoidance(n_robots=5, map="openspace", max_steps=20)
    >>> rules = TaskWorld(task=task, control=Subsumption(Avoid(), Explore()), rng=1).play()
    >>> straight_on = TaskWorld(task=task, rng=1).play(lambda seen: np.ones((5, 2)))
    >>> rules["steps"], straight_on["speed ahead"]
    (20.0, 1.0)
    """

    def __init__(
        self, *, task: Task, commanded: int | None = None, control: Control | None = None, rng: Seed = None
    ) -> None:
        super().__init__(
            map=task.map,
            rng=rng,
            history_every=0,
            collect_every=0,
            fire_constants=task.constants,
            communication=task.radio,
        )
        self.task = task
        self.commanded = _checked_commanded(task, commanded, control)
        self.rewarded = self.commanded or task.n_robots
        for design, count in task.blocks():
            self.add_robots(design, count)
        task.furnish(self)
        self.control = self._driver() if control is None else control
        arbiter: Any = self.control
        # The copy of Commanded that belongs to this swarm.
        self._commands: Commanded | None = arbiter.layers[0] if self.commanded else None
        self._observer = task.observer()
        self._score = task.score(self, self.rewarded)
        self._tally = EpisodeTally(self.rewarded, self.map.bounds)
        self._roster = Roster(self.swarm)
        self._start_positions = np.empty((0, 2))
        self._radius = float(self.swarm.radius.min())
        self.sense()

    def _driver(self) -> Arbiter:
        """Return what drives the robots without a `control`."""
        others = self.task.others() if self.commanded < self.task.n_robots else ()
        if not self.commanded:
            return Subsumption(*others)
        sends = {MESSAGE: self.task.messages} if self.task.messages else {}
        return Subsumption(Commanded(self.commanded, acts=self.task.acts, sends=sends), *others)

    @property
    def finished(self) -> bool:
        """Whether the task is done, or no rewarded robot left to do it."""
        return self._score.finished or not self._roster.remaining(self.rewarded)

    @property
    def out_of_time(self) -> bool:
        """Whether the episode's steps are used up."""
        return self.steps >= self.task.max_steps

    def advance(self, shares: np.ndarray | None, reward: np.ndarray) -> None:
        """Take a step, and write the rewards (k,) of the robots that are rewarded.

        `shares` (k, w) are, of each commanded robot, the wheel speeds as shares of the greatest and the other numbers
        of the task's actions; None where none is commanded. Robots that were removed before or in the step receive 0.
        """
        roster = self.roster()
        if not self._tally.steps:
            self.note_start()
        if shares is not None and self._commands is not None:
            present_shares = shares if roster.complete else shares[roster.numbers[: self._commands.count]]
            self._command(self._commands, present_shares)
        self.step()
        roster = self.roster()  # without those that were removed in the step
        self._tally.add(self.swarm.columns)
        present_rewards = reward if roster.complete else np.zeros(roster.remaining(self.rewarded))
        if len(present_rewards):
            self._reward(present_rewards)
        if present_rewards is not reward:
            roster.spread(present_rewards, reward)

    def note_start(self) -> None:
        """Note where the rewarded robots begin the episode, from where they can reach the cells of the coverage."""
        self._start_positions = self.swarm.position[: self._roster.remaining(self.rewarded)].copy()

    def _reward(self, reward: np.ndarray) -> None:
        """Read the sensors, and write the rewards of the rewarded robots that are there."""
        if self.task.rewards_state:
            self._score.reward(reward)
            self._perceive()
        else:
            self._perceive()
            self._score.reward(reward)
        if self.task.coverage_reward:
            reward += self.task.coverage_reward * self._tally.fresh
        if self.task.team:
            reward += self.task.team * (reward.mean() - reward)

    def _command(self, commands: Commanded, shares: np.ndarray) -> None:
        """Set wheels, actuators and messages of the commanded robots."""
        fastest = self.swarm.columns["max_speed"][: commands.count, None]
        np.multiply(shares[:, :2], fastest, out=commands.wheels)
        if commands.acts.size:
            self.task.set_acts(self, shares, commands.acts)
        if commands.sends.size:
            commands.sends[:] = shares[:, self.task.numbers - self.task.messages :]

    def _perceive(self) -> None:
        """Read all sensors, and let robots hear what was sent in the last step, as in the next step."""
        self.sense()
        if self.communication is not None:
            self.parts.radio.exchange()

    def observe(self, out: np.ndarray) -> None:
        """Write the observations of the first robots, as many as `out` (k, width) has rows; 0 for removed ones."""
        roster = self.roster()
        if roster.complete:
            self._observer.observe(self.swarm.columns, out)
            return
        rows = np.empty((roster.remaining(len(out)), out.shape[1]), out.dtype)
        self._observer.observe(self.swarm.columns, rows)
        roster.spread(rows, out)

    def roster(self) -> Roster:
        """Return which robots are still there, once those that were removed are dropped from all that is kept of them.

        Raises
        ------
        SwarmError
            If robots were added, or if some were removed and the task's score cannot do without them.
        """
        if self.swarm.unique_ids is not self._roster.ids:  # which is the same array until robots change
            absent = self._roster.find_gone(self.swarm)
            if len(absent):
                self._drop(absent)
        return self._roster

    def _drop(self, absent: np.ndarray) -> None:
        """Drop robots, by their rows before they were removed, from the commands, the score and the measures."""
        rewarded = absent[absent < self._roster.remaining(self.rewarded)]
        score: Any = self._score
        if len(rewarded) and not hasattr(score, "remove_robots"):
            raise SwarmError(
                f"robot {self._roster.numbers[absent[0]]} was removed from the world, and {type(score).__name__} has "
                "no remove_robots(rows); define it, or let the robots stay"
            )
        if self._commands is not None:
            self._commands.remove_robots(absent[absent < self._commands.count])
        if len(rewarded):
            score.remove_robots(rewarded)
        self._tally.remove_robots(rewarded)
        if isinstance(self._observer, TeamEncoder):
            self._observer = self._observer.without(absent)
        self._roster.drop(absent)

    def measures(self) -> dict[str, float]:
        """Return measures of the episode so far, of the robots that are rewarded.

        Returns
        -------
        dict of float
            "steps"; "collisions" and "worst robot", the collisions of the mean and of the worst robot per 1,000
            steps; "speed ahead", the mean share of max_speed; "coverage", the visited share of the cells, of 40 x 40,
            that robots can reach from where they begin; then the task's own. NaN stands for what is not known yet.
        """
        rewarded = self.roster().remaining(self.rewarded)
        begun_at = self._start_positions if self._tally.steps else self.swarm.position[:rewarded]
        reachable = cells_in_reach(self, begun_at, self._radius)
        measures_of_score = getattr(self._score, "measures", dict)
        return {**self._tally.measures(reachable), **measures_of_score()}

    def play(self, policy: Callable[[np.ndarray], ArrayLike] | None = None) -> dict[str, float]:
        """Take all steps of the episode and return its measures, with the "reward" of a robot and step.

        Parameters
        ----------
        policy : callable, optional
            Returns an action of each commanded robot for their observations, a float32 ndarray (k, width): wheel
            speeds (k, 2) and what else the task's actions have, or numbers of actions (k,). Needed where robots are
            commanded.
        """
        if (policy is None) == bool(self.commanded):
            cure = "a policy for them" if self.commanded else "None: no robot is commanded"
            raise InvalidValueError(f"policy is {shortened(policy)}, {self.commanded} commanded; expected {cure}")
        observations = np.empty((self.commanded, self._observer.width), np.float32)
        reward, total = np.empty(self.rewarded), np.zeros(self.rewarded)
        while not (self.finished or self.out_of_time):
            command = None
            if policy is not None:
                self.observe(observations)
                command = shares(self.task.actions, policy(observations), (self.commanded,), numbers=self.task.numbers)
            self.advance(command, reward)
            total += reward
        return {"reward": float(total.mean()) / max(self._tally.mean_steps, 1.0), **self.measures()}


def _checked_commanded(task: Task, commanded: int | None, control: Control | None) -> int:
    """Return how many robots are commanded."""
    if commanded is None:
        return task.n_robots if control is None else 0
    check_count("commanded", commanded, maximum=task.n_robots)
    if commanded and control is not None:
        raise InvalidValueError(
            f"commanded is {commanded} beside a control, which drives all robots; give one of them only"
        )
    return commanded
