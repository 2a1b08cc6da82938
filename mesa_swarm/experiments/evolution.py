"""evolve: reflexes and small networks that are bred in worlds, on many processes, with nothing lost on Ctrl-C."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from mesa_swarm.control import Subsumption
from mesa_swarm.errors import InvalidValueError, check_count, shortened
from mesa_swarm.experiments.compare import checked_jobs
from mesa_swarm.experiments.diary import Diary
from mesa_swarm.experiments.driving import driven_world, tallied
from mesa_swarm.experiments.experiment import shown_value
from mesa_swarm.experiments.pool import results_of
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.learning.policy import PolicyLayer, SensorLayout
from mesa_swarm.learning.reflex_policy import ReflexPolicy, genome_length
from mesa_swarm.progress import progress_bar
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.streams import Streams
from mesa_swarm.world.map import Map

# The trials at the end take so many times more steps.
LONGER = 4


@dataclass(frozen=True, kw_only=True)
class Trial:
    """How a candidate is tried: robots of one design, in one world, for so many steps.

    Parameters
    ----------
    design : RobotDesign
    robots, steps : int
        At least 1.
    fitness : Fitness
    units : int
        Hidden units, 0 for reflexes.
    squash : str
        See `ReflexPolicy`.
    """

    design: RobotDesign = AGENT9
    robots: int = 15
    steps: int = 1000
    fitness: Fitness = field(default_factory=Fitness)
    units: int = 2
    squash: str = "linear"

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_count("robots", self.robots, minimum=1)
        check_count("steps", self.steps, minimum=1)
        self.policy(np.zeros(genome_length(self.sensors, self.units)))

    @property
    def sensors(self) -> SensorLayout:
        """The proximity sensors of the robots."""
        return SensorLayout.of(self.design)

    def policy(self, genome: np.ndarray, steps: int = 1, **training: str | float) -> ReflexPolicy:
        """Return the policy that has these weights."""
        return ReflexPolicy.of_genome(
            self.sensors, genome, units=self.units, squash=self.squash, steps=steps, training=training
        )

    def fitness_of(self, genome: np.ndarray, world: Map, rng: int) -> float:
        """Return what these weights are worth on a map, with a seed."""
        model = driven_world(Subsumption(PolicyLayer(policy=self.policy(genome))), self.design, self.robots, world, rng)
        return self.fitness.of(**tallied(model, self.steps).means())


@dataclass(frozen=True, slots=True)
class Evolved:
    """What came of an evolution.

    Parameters
    ----------
    policy : ReflexPolicy
        The best of the middles of the last generations.
    fitness : ndarray, shape (generations, population)
        Of all candidates.
    """

    policy: ReflexPolicy
    fitness: np.ndarray


def evolve(
    trial: Trial | None = None,
    *,
    maps: Sequence[Map | str | os.PathLike[str]] = ("original",),
    generations: int = 40,
    population: int = 16,
    sigma: float = 0.7,
    finalists: int = 5,
    final_trials: int = 4,
    rng: int = 1,
    jobs: int = 1,
    file: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Evolved:
    """Breed a controller: weights from readings to wheels, and if asked for, a few units that remember.

    All candidates of a generation are tried in the same world, the next generation in another one: the maps take
    turns, and each time the places of the robots are drawn anew. In the end the middles of the last generations are
    tried in worlds of their own, the same for all, and the best is kept. The result depends on nothing but the
    arguments, least of all on `jobs`.

    Parameters
    ----------
    trial : Trial, optional
        How a candidate is tried, and what it is worth.
    maps : sequence of map, name or path
    generations, population : int
    sigma : float
        Standard deviation of the first candidates' weights, which begin around driving straight at half speed.
    finalists, final_trials : int
        At least 1; the trials at the end take four times as many steps.
    rng : int
        Seed of everything random.
    jobs : int
        Processes, -1 for one on each core.
    file : path, optional
        A .json file that is written after each generation. An evolution that was interrupted goes on from there;
        with more generations, also one that was done.
    progress : bool
        Whether to show a bar with the time left.

    Returns
    -------
    Evolved

    Raises
    ------
    SwarmError
        Before anything is tried, if anything is wrong, or the file is of an evolution with other settings.

    Examples
    --------
    >>> evolve(Trial(robots=3, steps=20), generations=2, population=4, finalists=1, final_trials=1).fitness.shape
    (2, 4)
    """
    trial, worlds = _checked(Trial() if trial is None else trial, maps)
    count = check_count("generations", generations, minimum=1, maximum=1_000_000)
    finals = check_count("finalists", finalists, minimum=1), check_count("final_trials", final_trials, minimum=1)
    streams = Streams(np.random.SeedSequence(check_count("rng", rng, maximum=2**63 - 1)))
    workers = checked_jobs(jobs)
    seed = int(streams["search"].integers(2**31))
    search = Evolution(_first(trial), sigma=sigma, population=population, seed=seed)
    diary = Diary(file, {**settings_of(trial, worlds), "rng": rng, "sigma": sigma, "population": population})
    diary.retell(search, count)
    seeds = streams["worlds"].integers(2**63, size=count).tolist()
    with progress_bar(count, "generations", progress) as bar:
        bar.update(search.generations)
        for g in range(search.generations, count):
            tried = [(x, worlds[g % len(worlds)], seeds[g]) for x in search.ask()]
            search.tell(_in_order(workers, trial.fitness_of, tried))
            diary.write(search)
            bar.update()
    return Evolved(_best(search, trial, worlds, finals, streams, workers), np.array(search.told))


def _checked(trial: Trial, maps: Sequence[Map | str | os.PathLike[str]]) -> tuple[Trial, list[Map]]:
    if not isinstance(trial, Trial):
        raise InvalidValueError(f"trial is {shortened(trial)}; expected Trial(...)")
    worlds = [Map.load(each) for each in maps]
    if not worlds:
        raise InvalidValueError("maps is empty; give at least one map")
    return trial, worlds


def _first(trial: Trial) -> np.ndarray:
    """Return the weights around which the search begins: straight ahead at half speed, whatever is near."""
    start = np.zeros(genome_length(trial.sensors, trial.units))
    start[-2:] = 0.5
    return start


def _best(
    search: Evolution, trial: Trial, worlds: list[Map], finals: tuple[int, int], streams: Streams, workers: int
) -> ReflexPolicy:
    """Return the policy of the middle of a generation that does best in worlds that none was tried in."""
    finalists, trials = search.means[-finals[0] :], finals[1]
    longer = replace(trial, steps=LONGER * trial.steps)
    seeds = streams["final"].integers(2**63, size=trials)
    tasks = [(x, worlds[k % len(worlds)], int(seeds[k])) for x in finalists for k in range(trials)]
    worth = np.reshape(_in_order(workers, longer.fitness_of, tasks), (len(finalists), trials)).mean(axis=1)
    best = int(np.argmax(worth))
    tried = search.generations * search.population * trial.steps + len(tasks) * longer.steps
    return trial.policy(
        finalists[best],
        steps=trial.robots * tried,
        learner="evolution",
        fitness=trial.fitness.kind,
        generations=search.generations,
        worth=float(worth[best]),
    )


def _in_order(workers: int, work: Callable, tasks: list[tuple]) -> list[float]:
    """Return what the work returns for each task, in their order, whoever is done first."""
    results = dict(results_of(workers, _numbered, ((k, work, task) for k, task in enumerate(tasks))))
    return [results[k] for k in range(len(tasks))]


def _numbered(k: int, work: Callable, task: tuple) -> tuple[int, float]:
    return k, work(*task)


def settings_of(trial: Trial, worlds: list[Map]) -> dict:
    """Return all that decides what a fitness is, as texts and numbers."""
    told = {name: getattr(trial, name) for name in ("robots", "steps", "units", "squash")}
    return {
        **told,
        "design": repr(trial.design),
        "fitness": asdict(trial.fitness),
        "maps": [shown_value(each) for each in worlds],
    }
