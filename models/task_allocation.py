"""Task allocation: robots that begin a task when its stimulus exceeds their threshold.

WHAT IS IT? A task should be done by as many robots as it needs, though no robot knows how many are at work. Each robot
perceives the stimulus of the task, which grows while too few work and falls while too many do.

HOW IT WORKS. In each step the stimulus s grows by `demand` and falls by `efficiency` times the share of robots at work.
A robot at rest begins with probability s^2 / (s^2 + threshold^2); one at work stops with probability `quitting`,
whatever the stimulus; both times `PACE`, which is the length of a step. There are two castes: minors with a low and
majors with a high threshold. Robots at rest stand still; robots at work explore the map and avoid each other.

HOW TO USE IT. `demand` divided by `efficiency` is the share of robots that the task needs; `major_share` is the share
of majors among the robots; a robot works for 1 / `quitting` time units at a time.

THINGS TO NOTICE. The share at work follows the demand, for any thresholds: only the stimulus differs. Majors hardly
work while there are enough minors, and take over when there are not.

THINGS TO TRY. A demand above the efficiency. Change `model.task.demand` during a run; remove the minors during a run.

EXTENDING IT. Let thresholds fall in robots that work and rise in others (Theraulaz et al. 1998). Let robots perceive
the stimulus only near the place of the task, with a `Field` and a `FieldSensor`.

REFERENCE. Bonabeau, Theraulaz and Deneubourg, Proceedings of the Royal Society B 263 (1996) 1565-1569.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mesa_swarm import AGENT9, Actuator, RobotDesign, Seed, Sensor, Slider, SwarmModel, process, share, value
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, behaviour
from mesa_swarm.errors import check_count, check_number

# Time units a step: the paper's rates are for a time unit.
PACE = 0.05
CASTES = ("minor", "major")
COLLECTED = {
    "active": share("act.work", empty=0.0),
    "active_minors": value("task.shares", 0),
    "active_majors": value("task.shares", 1),
    "stimulus": value("task.stimulus"),
}


@dataclass(frozen=True, kw_only=True)
class Urge(Sensor):
    """The probability with which a robot of this threshold responds to the stimulus, 0 to 1."""

    name: str = "urge"
    threshold: float = 1.0

    @staticmethod
    def read(task_stimulus: np.ndarray, threshold: float, out: np.ndarray) -> None:
        """Fill `out` (n, 1)."""
        out[:, 0] = task_stimulus[0] ** 2 / (task_stimulus[0] ** 2 + threshold**2)


@dataclass(frozen=True, kw_only=True)
class Work(Actuator):
    """A robot's work at the task: 1 in each step in which it works."""

    name: str = "work"


@process(memory={"stimulus": 0.0, "shares": [0.0, 0.0]})
def task(
    act_work: np.ndarray, design: np.ndarray, stimulus: np.ndarray, shares: np.ndarray, demand: float = 1.0,
    efficiency: float = 3.0,
) -> None:  # fmt: skip
    """Let the stimulus grow by demand and fall by work; count the share of each caste at work."""
    for caste in range(2):
        robots, at_work = 0, 0.0
        for i in range(len(design)):
            if design[i] == caste:
                robots, at_work = robots + 1, at_work + act_work[i]
        shares[caste] = at_work / robots if robots > 0 else np.nan
    active = act_work.sum() / max(len(act_work), 1)
    stimulus[0] = max(stimulus[0] + PACE * (demand - efficiency * active), 0.0)


@behaviour(memory={"working": 0})
def respond(me: Any, quitting: float = 0.2) -> tuple[float, float]:
    """Begin and stop by chance; rest, or leave the robot to the layers below."""
    if me.chance < PACE * (quitting if me.memory.working else me.urge[0]):
        me.memory.working = 1 - me.memory.working
    me.act.work = me.memory.working
    return PASS if me.memory.working else (0.0, 0.0)


class TaskAllocation(SwarmModel):
    """Robots of two castes that share a task without knowing how many work at it.

    Examples
    --------
    >>> TaskAllocation(n_robots=10, rng=1).run(5).steps
    5
    """

    compares = "demand", (0.5, 1.5)
    steps_to_compare = 2_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 200, 1, "robots")] = 50,
        major_share: Annotated[float, Slider(0, 1, 0.05, "share of robots that are majors")] = 0.5,
        demand: Annotated[float, Slider(0, 3, 0.1, "growth of the stimulus per time unit")] = 1.0,
        efficiency: Annotated[float, Slider(0.1, 10, 0.1, "fall of the stimulus if all robots work")] = 3.0,
        quitting: Annotated[float, Slider(0, 1, 0.05, "rate at which robots at work stop")] = 0.2,
        minor_threshold: Annotated[float, Slider(0.1, 50, 0.1, "stimulus at which a minor begins with 50 %")] = 1.0,
        major_threshold: Annotated[float, Slider(0.1, 50, 0.1, "stimulus at which a major begins with 50 %")] = 8.0,
        rng: Seed = None,
    ) -> None:
        super().__init__(map="openspace", rng=rng, model_reporters=COLLECTED)
        count = check_count("n_robots", n_robots)
        majors = round(count * check_number("major_share", major_share, minimum=0, maximum=1))
        thresholds = {"minor_threshold": minor_threshold, "major_threshold": major_threshold}
        urges = [Urge(threshold=check_number(name, value, above=0)) for name, value in thresholds.items()]
        for name, urge, size in zip(CASTES, urges, (count - majors, majors), strict=True):
            self.add_robots(RobotDesign(name=name, sensors=(*AGENT9.sensors, urge), actuators=(Work(),)), size)
        wanted, fall = check_number("demand", demand, minimum=0), check_number("efficiency", efficiency, above=0)
        self.task = self.add_process(task(demand=wanted, efficiency=fall))
        self.control = Subsumption(respond(quitting=quitting), Avoid(distance=15), Explore())

    @property
    def active(self) -> float:
        """Share of all robots at work, 0 without robots."""
        return float(np.mean(self.swarm.columns["act.work"])) if len(self.swarm) else 0.0

    @property
    def active_minors(self) -> float | None:
        """Share of the minors at work, None without minors."""
        return self._active("minor")

    @property
    def active_majors(self) -> float | None:
        """Share of the majors at work, None without majors."""
        return self._active("major")

    @property
    def stimulus(self) -> float:
        """The stimulus of the task, at least 0."""
        return self.task.stimulus

    def _active(self, caste: str) -> float | None:
        of_caste = np.array([design.name == caste for design in self.swarm.designs], bool)[self.swarm.design]
        return float(np.mean(self.swarm.columns["act.work"][of_caste])) if of_caste.any() else None

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison."""
        return {"share at work": self.active, "majors at work": self.active_majors, "stimulus": self.stimulus}
