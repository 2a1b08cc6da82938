"""Controllers evolved in worlds, on many processes, and the file from which a run continues."""

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from mesa_swarm.control import Subsumption
from mesa_swarm.errors import InvalidValueError, LearningError, check_count, check_number, shortened
from mesa_swarm.experiments.compare import checked_jobs
from mesa_swarm.experiments.driving import driven_world, tallied
from mesa_swarm.experiments.experiment import shown_value, without_addresses
from mesa_swarm.experiments.pool import in_order
from mesa_swarm.files import write_whole
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.learning.policy import PolicyLayer, SensorLayout
from mesa_swarm.learning.reflex_policy import ReflexPolicy, genome_length, half_length, whole_genome
from mesa_swarm.progress import progress_bar
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.streams import Streams
from mesa_swarm.world.map import Map

FORMAT = "mesa_swarm evolution 1"
LARGEST_FILE = 100_000_000


class Diary:
    """What an evolution was told so far, in a file; without a file, nothing.

    Parameters
    ----------
    file : path, optional
        Ends with .json.
    settings : dict
        Of the evolution: texts and numbers.

    Raises
    ------
    LearningError
        If the name ends otherwise.
    """

    def __init__(self, file: str | os.PathLike[str] | None, settings: dict) -> None:
        self.file = None if file is None else Path(file)
        self.settings = json.loads(json.dumps(settings))
        if self.file is not None and self.file.suffix != ".json":
            raise LearningError(f"{self.file.name} does not end with .json; give the evolution's file such a name")

    def write(self, search: Evolution) -> None:
        """Write all that was told, whole or not at all."""
        if self.file is None:
            return
        text = json.dumps({"format": FORMAT, "settings": self.settings, "fitness": search.history})
        write_whole(self.file, text, LearningError)

    def retell(self, search: Evolution, most: int) -> None:
        """Tell a new search what the file says, if there is one; at most so many generations."""
        if self.file is None or not self.file.exists():
            return
        kept = self._read(self.file)
        changed = sorted(name for name, now in self.settings.items() if not _same(kept["settings"].get(name), now))
        if changed:
            raise LearningError(
                f"{self.file} is of an evolution with other {', '.join(changed)}; use its settings or another file"
            )
        try:
            for told in kept["fitness"][:most]:
                search.tell(told)
        except (TypeError, ValueError):
            raise self._refusal("its fitnesses are not numbers") from None
        except LearningError as error:
            raise self._refusal(str(error)) from None

    def _read(self, file: Path) -> dict:
        try:
            if file.stat().st_size > LARGEST_FILE:
                raise self._refusal(f"it has more than {LARGEST_FILE:,} bytes")
            kept = json.loads(file.read_bytes())
        except OSError as error:
            raise LearningError(f"{self.file} cannot be read: {error.strerror or error}") from None
        except (ValueError, RecursionError):
            raise self._refusal("it is not JSON") from None
        if not isinstance(kept, dict) or kept.get("format") != FORMAT:
            raise self._refusal(f"its format is not {FORMAT!r}")
        if not isinstance(kept.get("settings"), dict) or not isinstance(kept.get("fitness"), list):
            raise self._refusal("it has no settings or no fitness")
        return kept

    def _refusal(self, why: str) -> LearningError:
        return LearningError(f"{self.file} is no evolution that can be gone on with: {why}")


def _same(kept: object, now: object) -> bool:
    """Return whether a setting is what it was; older files name places in memory, which were others each time."""
    return now == (without_addresses(kept) if isinstance(kept, str) else kept)


# The trials at the end take so many times more steps.
LONGER = 4
Maps = Sequence[Map | str | os.PathLike[str]] | Map | str | os.PathLike[str]


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
    squash, encoding : str
        See `ReflexPolicy`.
    mirrored : bool
        Whether controllers are their own mirror image, see `learning.mirror`: half as many weights to find.

    Raises
    ------
    InvalidValueError, UnknownNameError
    """

    design: RobotDesign = AGENT9
    robots: int = 15
    steps: int = 1000
    fitness: Fitness = field(default_factory=Fitness)
    units: int = 2
    squash: str = "linear"
    encoding: str = "distance"
    mirrored: bool = False

    def __post_init__(self) -> None:
        """Check the parameters."""
        if not isinstance(self.fitness, Fitness):
            raise InvalidValueError(f"fitness is {shortened(self.fitness)}; expected Fitness(kind='floreano')")
        for name, least in (("robots", 1), ("steps", 1), ("units", 0)):
            object.__setattr__(self, name, check_count(name, getattr(self, name), minimum=least))
        self.policy(np.zeros(self.genes))

    @property
    def sensors(self) -> SensorLayout:
        """The proximity sensors of the robots."""
        return SensorLayout.of(self.design)

    @property
    def genes(self) -> int:
        """How many weights are searched for."""
        length = half_length if self.mirrored else genome_length
        return length(self.sensors, self.units, self.encoding)

    def policy(self, genome: np.ndarray, steps: int = 1, **training: str | float) -> ReflexPolicy:
        """Return the policy that has these weights."""
        sensors, units, encoding = self.sensors, self.units, self.encoding
        weights = whole_genome(sensors, genome, units=units, encoding=encoding) if self.mirrored else genome
        return ReflexPolicy.of_genome(
            sensors, weights, units=units, encoding=encoding, squash=self.squash, steps=steps, training=training
        )

    def fitness_of(self, genome: np.ndarray, world: Map, rng: int) -> float:
        """Return what these weights are worth on a map, with a seed."""
        model = driven_world(Subsumption(PolicyLayer(policy=self.policy(genome))), self.design, self.robots, world, rng)
        return self.fitness.of(**tallied(model, self.steps, square=self.fitness.square).means())


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
    maps: Maps = ("original",),
    generations: int = 40,
    population: int = 16,
    sigma: float = 0.7,
    constant: float = 0.5,
    finalists: int = 5,
    final_trials: int = 4,
    final: Trial | None = None,
    final_maps: Maps | None = None,
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
    maps : sequence of map, name or path, or a single one
    generations, population : int
    sigma : float
        Standard deviation of the first candidates' weights, which begin around driving straight ahead.
    constant : float
        The weight from the constant to both wheels around which they begin; all other weights begin around 0.
    finalists, final_trials : int
        At least 1.
    final : Trial, optional
        How the finalists are tried, which differs from `trial` in robots, steps and fitness at most; by default for
        four times as many steps.
    final_maps : as maps, optional
        Where they are tried; by default on the same maps. Others tell who is good where none was bred.
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
    trial, worlds = checked_trial("trial", Trial() if trial is None else trial), checked_maps("maps", maps)
    last = Finals.of(trial, worlds, final, final_maps, finalists, final_trials)
    count = check_count("generations", generations, minimum=1, maximum=1_000_000)
    streams = Streams(np.random.SeedSequence(check_count("rng", rng, maximum=2**63 - 1)))
    workers = checked_jobs(jobs)
    seed = int(streams["search"].integers(2**31))
    search = Evolution(_first(trial, constant), sigma=sigma, population=population, seed=seed)
    begins = {"rng": rng, "sigma": sigma, "constant": constant, "population": population}
    diary = Diary(file, {**settings_of(trial, worlds), **begins})
    diary.retell(search, count)
    seeds = streams["worlds"].integers(2**63, size=count).tolist()
    with progress_bar(count, "generations", progress) as bar:
        bar.update(search.generations)
        for g in range(search.generations, count):
            tried = [(x, worlds[g % len(worlds)], seeds[g]) for x in search.ask()]
            search.tell(in_order(workers, trial.fitness_of, tried))
            diary.write(search)
            bar.update()
    policy = last.best(search, streams["final"], workers, trial.robots * trial.steps)
    return Evolved(policy, np.array(search.history))


@dataclass(frozen=True, slots=True, kw_only=True)
class Finals:
    """How the best of the last middles is found, in worlds in which none was tried.

    Parameters
    ----------
    trial : Trial
    worlds : list of Map
        They take turns.
    finalists, trials : int
        At least 1.
    """

    trial: Trial
    worlds: list[Map]
    finalists: int
    trials: int

    @classmethod
    def of(
        cls,
        trial: Trial,
        worlds: list[Map],
        final: Trial | None,
        maps: Maps | None,
        finalists: int,
        trials: int,
    ) -> "Finals":
        """Return the finals of an evolution with this trial on these worlds, or refuse them."""
        last = replace(trial, steps=LONGER * trial.steps) if final is None else checked_trial("final", final)
        if replace(last, robots=trial.robots, steps=trial.steps, fitness=trial.fitness) != trial:
            raise InvalidValueError("final differs from trial in more than robots, steps and fitness; make it the same")
        return cls(
            trial=last,
            worlds=worlds if maps is None else checked_maps("final_maps", maps),
            finalists=check_count("finalists", finalists, minimum=1),
            trials=check_count("final_trials", trials, minimum=1),
        )

    def best(self, search: Evolution, rng: np.random.Generator, workers: int, a_try: int) -> ReflexPolicy:
        """Return the policy of the middle that does best; `a_try` is the robot-steps of a candidate's trial."""
        means, worlds, trial = search.means[-self.finalists :], self.worlds, self.trial
        seeds = rng.integers(2**63, size=self.trials).tolist()
        tasks = [(x, worlds[k % len(worlds)], seeds[k]) for x in means for k in range(self.trials)]
        worth = np.reshape(in_order(workers, trial.fitness_of, tasks), (len(means), self.trials)).mean(axis=1)
        best = int(np.argmax(worth))
        return trial.policy(
            means[best],
            steps=search.generations * search.population * a_try + len(tasks) * trial.robots * trial.steps,
            learner="evolution",
            fitness=trial.fitness.kind,
            generations=search.generations,
            worth=float(worth[best]),
        )


def checked_trial(name: str, trial: object) -> Trial:
    """Return what is a trial, or refuse it."""
    if not isinstance(trial, Trial):
        raise InvalidValueError(f"{name} is {shortened(trial)}; expected Trial(...)")
    return trial


def checked_maps(name: str, maps: Maps) -> list[Map]:
    """Return the maps, or refuse them; at least one."""
    if isinstance(maps, Map | str | os.PathLike):
        return [Map.load(maps)]
    if not isinstance(maps, Iterable):
        raise InvalidValueError(f"{name} is {shortened(maps)}; expected maps, names or paths")
    worlds = [Map.load(each) for each in maps]
    if not worlds:
        raise InvalidValueError(f"{name} is empty; give at least one map")
    return worlds


def _first(trial: Trial, constant: float) -> np.ndarray:
    """Return the weights around which the search begins: straight ahead, whatever is near."""
    start = np.zeros(trial.genes)
    start[-1 if trial.mirrored else -2 :] = check_number("constant", constant, minimum=-1000, maximum=1000)
    return start


def settings_of(trial: Trial, worlds: list[Map]) -> dict:
    """Return all that decides what a fitness is, as texts and numbers."""
    told = {name: getattr(trial, name) for name in ("robots", "steps", "units", "squash", "encoding", "mirrored")}
    # A drive of one's own may have no repr that says what it holds, be it in a __dict__ or in slots.
    held = object.__getstate__(trial.design.drive)
    return {
        **told,
        "design": without_addresses(f"{trial.design!r} {held!r}" if held else repr(trial.design)),
        "fitness": asdict(trial.fitness),
        "maps": [shown_value(each) for each in worlds],
    }
