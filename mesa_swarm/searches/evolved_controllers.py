"""Controllers evolved in worlds, on many processes, and the file from which a run continues."""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, LearningError, check_count, check_number, shortened
from mesa_swarm.base.files import write_whole
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.base.streams import Streams
from mesa_swarm.control import Subsumption
from mesa_swarm.experiments.fingerprints import shown_value, without_addresses
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.runs import Run
from mesa_swarm.experiments.worker_pool import checked_jobs, in_order
from mesa_swarm.learning.evolution import Evolution, MixedEvolution
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.learning.policy import PolicyLayer, SensorLayout
from mesa_swarm.learning.reflex_policy import ReflexPolicy, genome_length, half_length, whole_genome
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.searches.drive_measures import driven_world, tallied

FORMAT = "mesa_swarm evolution 1"
LARGEST_FILE = 100_000_000


class Diary:
    """The fitness that an evolution has received so far, in a .json file; without a file, nothing is stored."""

    def __init__(self, file: str | os.PathLike[str] | None, settings: dict) -> None:
        self.file = None if file is None else Path(file)
        self.settings = json.loads(json.dumps(settings))
        if self.file is not None and self.file.suffix != ".json":
            raise LearningError(f"{self.file.name} does not end with .json; give the evolution's file such a name")

    def write(self, search: Evolution | MixedEvolution) -> None:
        """Write the fitness of all generations, whole or not at all."""
        if self.file is not None:
            text = json.dumps({"format": FORMAT, "settings": self.settings, "fitness": search.history})
            write_whole(self.file, text, LearningError)

    def replay(self, search: Evolution | MixedEvolution, most: int) -> None:
        """Pass the fitness in the file, if there is one, to a new search; that of this many generations at most."""
        if self.file is None or not self.file.exists():
            return
        stored = self._read(self.file)
        changed = sorted(name for name, now in self.settings.items() if not _same(stored["settings"].get(name), now))
        if changed:
            raise LearningError(
                f"{self.file} is of an evolution with other {', '.join(changed)}; use its settings or another file"
            )
        try:
            for fitness in stored["fitness"][:most]:
                search.tell(fitness)
        except (TypeError, ValueError):
            raise self._refusal("its fitnesses are not numbers") from None
        except LearningError as error:
            raise self._refusal(str(error)) from None

    def _read(self, file: Path) -> dict:
        try:
            if file.stat().st_size > LARGEST_FILE:
                raise self._refusal(f"it has more than {LARGEST_FILE:,} bytes")
            stored = json.loads(file.read_bytes())
        except OSError as error:
            raise LearningError(f"{self.file} cannot be read: {error.strerror or error}") from None
        except (ValueError, RecursionError):
            raise self._refusal("it is not JSON") from None
        if not isinstance(stored, dict) or stored.get("format") != FORMAT:
            raise self._refusal(f"its format is not {FORMAT!r}")
        if not isinstance(stored.get("settings"), dict) or not isinstance(stored.get("fitness"), list):
            raise self._refusal("it has no settings or no fitness")
        return stored

    def _refusal(self, why: str) -> LearningError:
        return LearningError(f"{self.file} is not an evolution that can be continued: {why}; use another file")


def _same(stored: object, now: object) -> bool:
    """Return whether a setting is unchanged; older files have addresses in memory, which differ each time."""
    return now == (without_addresses(stored) if isinstance(stored, str) else stored)


# Factor of the steps of the trials at the end.
LONGER = 4
Maps = Sequence[Map | str | os.PathLike[str]] | Map | str | os.PathLike[str]


@dataclass(frozen=True, kw_only=True, slots=True)
class Trial:
    """How a candidate is tried: robots of one design, in one world, for a number of steps.

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
        Whether controllers are their own mirror image, see `learning.reflex_policy`: half as many weights to find.
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
        """Return the fitness of these weights on a map, with a seed."""
        model = driven_world(Subsumption(PolicyLayer(policy=self.policy(genome))), self.design, self.robots, world, rng)
        return self.fitness.of(**tallied(model, self.steps, square=self.fitness.square).means())


@dataclass(frozen=True, slots=True, eq=False)
class Evolved:
    """The outcome of an evolution: the best policy, and the fitness of all candidates (generations, population)."""

    policy: ReflexPolicy
    fitness: np.ndarray


def _fixed(trial: Trial) -> dict[str, Any]:
    """Return what the trials of finalists have in common with the others; in a dict NaN equals itself."""
    return {f.name: getattr(trial, f.name) for f in fields(trial) if f.name not in ("robots", "steps", "fitness")}


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
    """Breed a controller: weights from readings to wheels, and optionally a few units with memory.

    All candidates of a generation are tried in the same world, the next generation in another one: the maps take
    turns, and each time the places of the robots are drawn anew. In the end the means of the last generations are
    tried in other worlds, the same for all, and the best is returned. The result depends only on the arguments, and
    not on `jobs`.

    Parameters
    ----------
    trial : Trial, optional
        How a candidate is tried, and its fitness.
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
        Where they are tried; by default on the same maps. Others measure how controllers generalise.
    rng : int
        Seed of everything random.
    jobs : int
        Processes, -1 for one on each core.
    file : path, optional
        A .json file that is written after each generation. An evolution that was interrupted continues from there;
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
    last = replace(trial, steps=LONGER * trial.steps) if final is None else checked_trial("final", final)
    if type(last) is not type(trial) or _fixed(last) != _fixed(trial):
        raise InvalidValueError("final differs from trial in more than robots, steps and fitness; make it the same")
    last_worlds = worlds if final_maps is None else checked_maps("final_maps", final_maps)
    finalists = check_count("finalists", finalists, minimum=1)
    final_trials = check_count("final_trials", final_trials, minimum=1)
    count = check_count("generations", generations, minimum=1, maximum=1_000_000)
    streams = Streams(np.random.SeedSequence(check_count("rng", rng, maximum=2**63 - 1)))
    workers = checked_jobs(jobs)
    seed = int(streams["search"].integers(2**31))
    search = Evolution(_first(trial, constant), sigma=sigma, population=population, seed=seed)
    begins = {"rng": rng, "sigma": sigma, "constant": constant, "population": population}
    diary = Diary(file, {**settings_of(trial, worlds), **begins})
    diary.replay(search, count)
    seeds = streams["worlds"].integers(2**63, size=count).tolist()
    breed(search, trial.fitness_of, worlds, seeds, workers=workers, diary=diary, progress=progress)
    seeds = streams["final"].integers(2**63, size=final_trials).tolist()
    means = search.means[-finalists:]
    best, worth = best_in_worlds(means, last.fitness_of, last_worlds, seeds, workers)
    searched = search.generations * search.population * trial.robots * trial.steps
    policy = last.policy(
        means[best],
        steps=searched + len(means) * final_trials * last.robots * last.steps,
        learner="evolution",
        fitness=last.fitness.kind,
        generations=search.generations,
        worth=worth,
    )
    return Evolved(policy, np.array(search.history))


def breed(
    search: Evolution | MixedEvolution,
    worth: Callable[[Any, Map, int], float],
    worlds: Sequence[Map],
    seeds: Sequence[int],
    *,
    workers: int,
    diary: Diary,
    progress: bool,
) -> None:
    """Let a search propose generations of candidates, as many as there are seeds, and pass it what they are worth.

    All candidates of a generation are tried in one world, with one seed; the maps take turns.
    """
    with progress_bar(len(seeds), "generations", progress) as bar:
        bar.update(search.generations)
        for g in range(search.generations, len(seeds)):
            tried = [(candidate, worlds[g % len(worlds)], seeds[g]) for candidate in search.ask()]
            search.tell(in_order(workers, worth, tried))
            diary.write(search)
            bar.update()


def trials_of(
    search: Evolution | MixedEvolution,
    worth: Callable[..., float],
    worlds: Sequence[Map],
    seeds: Sequence[int],
    steps: int,
) -> list[tuple[Run, Outcome]]:
    """Return the trials of a search that `breed` has driven as rows of a table: each candidate of each generation."""
    return [
        (
            Run(worth, {"generation": g, "candidate": k, "map": worlds[g % len(worlds)]}, seeds[g], steps),
            Outcome(steps, results={"fitness": fitness}),
        )
        for g, generation in enumerate(search.history)
        for k, fitness in enumerate(np.asarray(generation).tolist())
    ]


def best_in_worlds(
    candidates: Sequence[Any],
    worth: Callable[[Any, Map, int], float],
    worlds: Sequence[Map],
    seeds: Sequence[int],
    workers: int,
) -> tuple[int, float]:
    """Return the number and the mean worth of the best candidate, tried with each seed in worlds that take turns."""
    tried = [(candidate, worlds[k % len(worlds)], seed) for candidate in candidates for k, seed in enumerate(seeds)]
    means = np.reshape(in_order(workers, worth, tried), (len(candidates), len(seeds))).mean(axis=1)
    best = int(np.argmax(means))
    return best, float(means[best])


def checked_trial(name: str, trial: object) -> Trial:
    """Return a trial, or refuse anything else."""
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
    """Return all that decides a fitness, as texts and numbers."""
    numbers = {name: getattr(trial, name) for name in ("robots", "steps", "units", "squash", "encoding", "mirrored")}
    return {
        **numbers,
        "design": without_addresses(_described(trial.design)),
        "fitness": asdict(trial.fitness),
        "maps": [shown_value(each) for each in worlds],
    }


def _described(design: RobotDesign) -> str:
    """Return a design as text; what files of earlier versions do not know is left out where it has no effect."""
    # The repr of a custom drive may not show its values, which are in a __dict__ or in slots.
    drive, held = design.drive, object.__getstate__(design.drive)
    if held == {"acceleration": None}:
        plain = f"drive={drive!r}, actuators=()", f"drive={object.__repr__(drive)}"
        return repr(design).replace(*plain)
    return f"{design!r} {held!r}" if held else repr(design)
