"""Automatic design: state machines and networks searched for a mission, by the same budget."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from pathlib import Path

import numpy as np

from mesa_swarm.analysis.clusters import clusters
from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.base.streams import Streams
from mesa_swarm.control import (
    Approach,
    Avoid,
    Chance,
    Condition,
    Explore,
    Follow,
    Halt,
    Layer,
    Retreat,
    RobotsSeen,
    Seen,
    StateMachine,
    Subsumption,
    Transition,
    Unseen,
)
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.experiments.fingerprints import shown_value
from mesa_swarm.experiments.run_tables import RunFiles, TableHead
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.learning.evolution import Candidate, MixedEvolution
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.learning.policy import PolicyLayer
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.robots.imperfections import Imperfections
from mesa_swarm.searches.drive_measures import driven_world, tallied
from mesa_swarm.searches.evolved_controllers import (
    Diary,
    Evolved,
    Maps,
    Trial,
    best_in_worlds,
    breed,
    checked_maps,
    evolve,
    trials_of,
)

# Distance between the centres of robots of one group: two robot diameters and a margin.
LINK = 25.0
# Interval at which groups are counted, in the second half of a run, steps.
COUNTED_EVERY = 25
# Numbers of a transition and of a state in a genome.
OF_TRANSITION, OF_STATE = 2, 1
MOST_STATES = 4


@dataclass(frozen=True, kw_only=True, slots=True)
class Mission:
    """What controllers are designed for: robots, and the score of a run, of which more is better.

    Parameters
    ----------
    name : str
        "aggregation": the share of robots in the largest group, mean over the second half of the run (groups link
        robots whose centres are within 25 map units). "avoidance": `fitness`, of fast robots that visit all of the map
        without collisions.
    design : RobotDesign
        With proximity sensors.
    robots, steps : int
        At least 1.
    fitness : Fitness
        Of "avoidance" only.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> mission = Mission(name="aggregation", robots=4, steps=50)
    >>> mission.score(StateMachine({"stay": Halt()}), Map.load("openspace"), 1)
    0.0
    """

    name: str = "aggregation"
    design: RobotDesign = AGENT9
    robots: int = 12
    steps: int = 400
    fitness: Fitness = field(default_factory=Fitness)

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_choice("mission", self.name, MISSIONS)
        if not isinstance(self.fitness, Fitness):
            raise InvalidValueError(f"fitness is {shortened(self.fitness)}; expected Fitness(...)")
        for name in ("robots", "steps"):
            object.__setattr__(self, name, check_count(name, getattr(self, name), minimum=1))

    def score(self, control: Arbiter, world: Map, rng: int, imperfections: Imperfections | None = None) -> float:
        """Return the score of robots that a control drives on a map, with a seed; of ideal robots by default."""
        model = driven_world(control, self.design, self.robots, world, rng)
        model.imperfections = imperfections
        if self.name == "avoidance":
            return self.fitness.of(**tallied(model, self.steps, square=self.fitness.square).means())
        shares = []
        for step in range(self.steps):
            model.step()
            if 2 * step >= self.steps and step % COUNTED_EVERY == 0:
                shares.append(clusters(model.swarm.position, LINK).largest_fraction)
        return float(np.mean(shares)) if shares else clusters(model.swarm.position, LINK).largest_fraction


MISSIONS = ("aggregation", "avoidance")


def _between(low: float, high: float, share: float) -> float:
    """Return the number at this share of the way from low to high, to three decimals."""
    return round(float(low + (high - low) * share), 3)


def _by_factors(low: float, high: float, share: float) -> float:
    """Return the number at this share of the way from low to high on a logarithmic scale, to three decimals."""
    return round(float(low * (high / low) ** share), 3)


# What a state does, by a number from 0 to 1.
BEHAVIOURS: dict[str, Callable[[float], tuple[Layer, ...]]] = {
    "explore": lambda u: (Avoid(distance=_between(5, 30, u)), Explore()),
    "wander": lambda u: (Avoid(distance=15), Explore(turn_interval=round(20 * 25**u))),
    "halt": lambda u: (Halt(),),
    "approach": lambda u: (Avoid(distance=_between(2, 15, u)), Approach(target="robot"), Explore()),
    "retreat": lambda u: (Avoid(distance=_between(5, 30, u)), Retreat(target="robot"), Explore()),
    "follow": lambda u: (Avoid(distance=5), Follow(gap=_between(5, 40, u)), Explore()),
}
# The condition of a transition, by two numbers from 0 to 1: of its probability and of its parameter; None for none.
CONDITIONS: dict[str, Callable[[float, float], Condition] | None] = {
    "none": None,
    "chance": lambda p, u: Chance(probability=_by_factors(0.001, 1, p)),
    "robots seen": lambda p, u: RobotsSeen(
        probability=_by_factors(0.01, 1, p), number=_between(0, 6, u), steepness=5.0
    ),
    "few robots seen": lambda p, u: RobotsSeen(
        probability=_by_factors(0.01, 1, p), number=_between(0, 6, u), steepness=5.0, fewer=True
    ),
    "obstacle seen": lambda p, u: Seen(probability=_by_factors(0.01, 1, p), kind="obstacle", within=_between(3, 50, u)),
    "robot seen": lambda p, u: Seen(probability=_by_factors(0.01, 1, p), kind="robot", within=_between(3, 50, u)),
    "no robot seen": lambda p, u: Unseen(probability=_by_factors(0.01, 1, p), kind="robot", within=_between(3, 50, u)),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class MachineSpace:
    """The machines that are searched: up to some states, with up to some transitions out of each.

    A genome has fixed length, as in AutoMoDe [1]_: of each state its behaviour and a number; of each of its transitions
    the condition, or none, the target, and two numbers. States that are out of reach of the first one are left out.

    Parameters
    ----------
    states : int
        At most 4, at least 2.
    transitions : int
        Out of each state, 1 to 4.

    Raises
    ------
    InvalidValueError

    References
    ----------
    .. [1] Francesca et al., AutoMoDe-Chocolate: automatic design of control software for robot swarms, Swarm
       Intelligence 9 (2015) 125-152.

    Examples
    --------
    >>> space = MachineSpace(states=2, transitions=1)
    >>> space.numbers, space.categories
    (6, (6, 6, 7, 7))
    >>> print(space.machine(np.full(6, 0.5), np.array([0, 2, 5, 0])))
    explore: Avoid(distance=17.5), Explore()
    halt: Halt()
    explore -> halt: Seen(probability=0.1, kind='robot', within=26.5)
    <BLANKLINE>
    """

    states: int = MOST_STATES
    transitions: int = 4

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count("states", self.states, minimum=2, maximum=MOST_STATES)
        check_count("transitions", self.transitions, minimum=1, maximum=4)

    @property
    def numbers(self) -> int:
        """How many numbers a genome has."""
        return self.states * (OF_STATE + OF_TRANSITION * self.transitions)

    @property
    def categories(self) -> tuple[int, ...]:
        """Of each categorical variable of a genome the number of categories: of states, of conditions, of targets."""
        slots = self.states * self.transitions
        targets = (self.states - 1,) * slots if self.states > 2 else ()
        return (len(BEHAVIOURS),) * self.states + (len(CONDITIONS),) * slots + targets

    def machine(self, numbers: np.ndarray, categories: np.ndarray) -> StateMachine:
        """Return the machine of a genome; numbers beyond 0 to 1 are reflected at these limits."""
        shares = 1.0 - np.abs(np.mod(numbers, 2.0) - 1.0)
        of_states, of_slots = np.split(shares, [self.states])
        slots = self.states * self.transitions
        kinds, conditions, targets = np.split(categories, [self.states, self.states + slots])
        behaviours = [tuple(BEHAVIOURS)[k] for k in kinds.tolist()]
        names = [f"{name} {behaviours[:k].count(name) + 1}" for k, name in enumerate(behaviours)]
        names = [name.removesuffix(" 1") for name in names]
        changes = []
        for slot, (p, u) in enumerate(of_slots.reshape(slots, OF_TRANSITION).tolist()):
            make = tuple(CONDITIONS.values())[int(conditions[slot])]
            source = slot // self.transitions
            step = 1 + int(targets[slot]) if len(targets) else 1
            if make is not None:
                changes.append((source, (source + step) % self.states, make(p, u)))
        reached = _reached(self.states, [(a, b) for a, b, _ in changes])
        states = {names[k]: BEHAVIOURS[behaviours[k]](float(of_states[k])) for k in reached}
        ways = [Transition(source=names[a], target=names[b], condition=c) for a, b, c in changes if a in reached]
        return StateMachine(states, ways)


def _reached(states: int, ways: Sequence[tuple[int, int]]) -> list[int]:
    """Return the states in reach of the first one, in ascending order."""
    found = {0}
    for _ in range(states):
        found |= {b for a, b in ways if a in found}
    return sorted(found)


@dataclass(frozen=True, slots=True, eq=False)
class Designed:
    """The outcome of a design: the machine, its mean score in the final trials, and the scores of all candidates."""

    machine: StateMachine
    worth: float
    scores: np.ndarray


def design_machine(
    mission: Mission | None = None,
    *,
    space: MachineSpace | None = None,
    maps: Maps = ("openspace",),
    generations: int = 40,
    population: int = 20,
    sigma: float = 0.25,
    finalists: int = 8,
    final_trials: int = 8,
    rng: int = 1,
    jobs: int = 1,
    file: str | os.PathLike[str] | None = None,
    progress: bool = False,
    tables: Sequence[str] = (),
) -> Designed:
    """Search for the state machine with the highest score in a mission, as AutoMoDe does [1]_, by CatCMA.

    All candidates of a generation are tried in the same world, the next generation in another one: maps take turns, and
    the places of the robots are drawn anew. The best candidates of the last generations are tried again in the same new
    worlds, and the best of them is returned. The result depends only on the arguments, and not on `jobs`.

    Parameters
    ----------
    mission : Mission, optional
    space : MachineSpace, optional
        Which machines are searched.
    maps : sequence of map, name or path, or a single one
    generations, population : int
        A population has at least 4.
    sigma : float
        Standard deviation of the first candidates' numbers, which are shares of their ranges.
    finalists, final_trials : int
        At least 1.
    rng : int
        Seed of everything random.
    jobs : int
        Processes, -1 for one on each core.
    file : path, optional
        A .json file that is written after each generation, from which an interrupted design continues.
    progress : bool
    tables : sequence of str
        Forms of tables with a row for each candidate of each generation, see `sweep`, which are written beside `file`.

    Returns
    -------
    Designed

    Raises
    ------
    SwarmError
        Before anything is tried, if anything is wrong, or the file is of a design with other settings.

    References
    ----------
    .. [1] Francesca, Brambilla, Brutschy, Trianni and Birattari, AutoMoDe: a novel approach to the automatic design of
       control software for robot swarms, Swarm Intelligence 8 (2014) 89-112.

    Examples
    --------
    >>> found = design_machine(
    ...     Mission(robots=3, steps=20), generations=2, population=4, finalists=1, final_trials=1, rng=3
    ... )
    >>> found.scores.shape, isinstance(found.machine, StateMachine)
    ((2, 4), True)
    """
    task, within = checked_mission(mission), MachineSpace() if space is None else space
    worlds = checked_maps("maps", maps)
    count = check_count("generations", generations, minimum=1, maximum=1_000_000)
    best = check_count("finalists", finalists, minimum=1)
    trials = check_count("final_trials", final_trials, minimum=1)
    check_number("sigma", sigma, above=0, maximum=10)
    streams, workers = Streams(np.random.SeedSequence(check_count("rng", rng, maximum=2**63 - 1))), checked_jobs(jobs)
    seed = int(streams["search"].integers(2**31))
    search = MixedEvolution(within.numbers, within.categories, sigma=sigma, population=population, seed=seed)
    settings = {"rng": rng, "sigma": sigma, "population": population, "space": asdict(within)}
    beside = None if file is None or not tables else Path(file).parent
    files = RunFiles.checked(beside, tables=tables, option="file")
    diary = Diary(file, {**settings, **settings_of_mission(task, worlds)})
    diary.replay(search, count)
    seeds = streams["worlds"].integers(2**63, size=count).tolist()
    work = partial(_score_of, task, within)
    breed(search, work, worlds, seeds, workers=workers, diary=diary, progress=progress)
    rows = trials_of(search, work, worlds, seeds, task.steps)
    files.write(TableHead(__name__, task.name, worlds[0].bounds), lambda: rows)
    seeds = streams["final"].integers(2**63, size=trials).tolist()
    last = search.best[-best:]
    won, worth = best_in_worlds(last, work, worlds, seeds, workers)
    return Designed(within.machine(*last[won]), worth, np.array(search.history))


def _score_of(mission: Mission, space: MachineSpace, candidate: Candidate, world: Map, rng: int) -> float:
    return mission.score(space.machine(*candidate), world, rng)


def checked_mission(mission: object) -> Mission:
    """Return a mission, the default one for None, or refuse anything else."""
    if mission is None:
        return Mission()
    if not isinstance(mission, Mission):
        raise InvalidValueError(f"mission is {shortened(mission)}; expected Mission(...)")
    return mission


def settings_of_mission(mission: Mission, worlds: Sequence[Map]) -> dict:
    """Return all that decides a score, as texts and numbers."""
    # A custom mission has a score of its own, which may depend on parameters of its own.
    more = [f"{one.name}={shown_value(getattr(mission, one.name))}" for one in fields(mission)[len(fields(Mission)) :]]
    custom = [] if type(mission) is Mission else [f"{type(mission).__module__}.{type(mission).__qualname__}", *more]
    return {
        "mission": " ".join([mission.name, *custom]),
        "robots": mission.robots,
        "steps": mission.steps,
        "design": repr(mission.design),
        "fitness": asdict(mission.fitness),
        "maps": [shown_value(each) for each in worlds],
    }


@dataclass(frozen=True, kw_only=True, slots=True)
class MissionTrial(Trial):
    """How a network is tried in a mission, for `evolve`; `mission` decides on robots, steps and score.

    Examples
    --------
    >>> mission = Mission(robots=3, steps=20)
    >>> trial = MissionTrial.of(mission, units=0)
    >>> trial.genes, trial.robots
    (40, 3)
    """

    mission: Mission = field(default_factory=Mission)

    @classmethod
    def of(cls, mission: Mission, units: int = 0) -> "MissionTrial":
        """Return the trial of networks with this number of hidden units, which distinguish robots from other things."""
        same = {"design": mission.design, "robots": mission.robots, "steps": mission.steps, "fitness": mission.fitness}
        return cls(**same, mission=mission, units=units, encoding="typed")  # type: ignore[arg-type]

    def fitness_of(self, genome: np.ndarray, world: Map, rng: int) -> float:
        """Return the score of these weights on a map, with a seed."""
        return self.mission.score(Subsumption(PolicyLayer(policy=self.policy(genome))), world, rng)


def evolve_network(
    mission: Mission,
    *,
    units: int = 0,
    maps: Maps = ("openspace",),
    generations: int = 40,
    population: int = 20,
    finalists: int = 8,
    final_trials: int = 8,
    rng: int = 1,
    jobs: int = 1,
) -> Evolved:
    """Evolve a network for a mission with the budget of `design_machine`: the contestant of AutoMoDe, EvoStick.

    As there, it has no hidden units by default: weights from readings to wheels. Parameters are those of
    `design_machine`; `units` of hidden units with memory, 0 to 64.

    Examples
    --------
    >>> small = {"generations": 2, "population": 4, "finalists": 1, "final_trials": 1}
    >>> evolve_network(Mission(robots=3, steps=20), **small).fitness.shape
    (2, 4)
    """
    trial = MissionTrial.of(checked_mission(mission), check_count("units", units, maximum=64))
    return evolve(
        trial,
        maps=maps,
        generations=generations,
        population=population,
        finalists=finalists,
        final_trials=final_trials,
        final=trial,
        rng=rng,
        jobs=jobs,
    )
