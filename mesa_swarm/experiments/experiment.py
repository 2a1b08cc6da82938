"""Points, seeds and steps; each run with a key, which holds a fingerprint of the model's code."""

import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from types import CodeType
from typing import Any

from mesa_swarm.errors import InvalidValueError, SwarmError, check_choice, check_count, shortened
from mesa_swarm.experiments.plan import DEFAULT_STEPS, MOST_STEPS, check_results, checked_class, checked_seeds
from mesa_swarm.experiments.sampling import Points, Sample, grid_columns
from mesa_swarm.gallery import PACKAGE
from mesa_swarm.parameters import parameters_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.map import Map, builtin_maps

# What these contain is told apart by their versions.
VERSIONED = ("builtins", "mesa", "mesa_swarm")


def source_hash(model_class: type) -> str:
    """Return a fingerprint of the code of a model.

    It covers the files of the modules in which the class and its bases are written, those of the gallery too, and
    the code of their methods as it was loaded, which is all that there is of a class that was typed into a notebook.
    Packages with a version (mesa_swarm but for its gallery, and mesa) are left to it. Other files that a model
    imports, and other cells of a notebook, are not looked at: after a change in them, choose another folder for
    the results.

    Parameters
    ----------
    model_class : type

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> source_hash(find_model("boids")) == source_hash(find_model("boids"))
    True
    >>> source_hash(find_model("boids")) == source_hash(find_model("flocking"))
    False
    """
    found = blake2b(digest_size=8)
    for base in model_class.__mro__:
        if base.__module__.startswith(PACKAGE) or base.__module__.split(".")[0] not in VERSIONED:
            found.update(_file(base))
            found.update(repr(_methods(base)).encode())
    return found.hexdigest()


def _file(base: type) -> bytes:
    """Return the file in which a class is written, nothing if there is none."""
    path = getattr(sys.modules.get(base.__module__), "__file__", None)
    return Path(path).read_bytes() if path and Path(path).is_file() else b""


def _methods(base: type) -> list:
    """Return what the methods of a class do, by name."""
    members = sorted(vars(base).items())
    return [(name, _said(code)) for name, member in members for code in _codes(member)]


def _codes(member: object) -> list[CodeType]:
    parts = (member.fget, member.fset) if isinstance(member, property) else (member,)
    functions = [inspect.unwrap(part) for part in map(_bare, parts) if callable(part)]
    return [function.__code__ for function in functions if hasattr(function, "__code__")]


def _bare(member: object) -> object:
    return member.__func__ if isinstance(member, (staticmethod, classmethod)) else member


def _said(code: CodeType) -> tuple:
    """Return what a code object does, without where it was loaded from and where in memory it is."""
    return code.co_code.hex(), code.co_names, [_constant(value) for value in code.co_consts]


def _constant(value: object) -> object:
    if isinstance(value, CodeType):
        return _said(value)
    return sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value)


MOST_RUNS = 100_000_000
LONGEST_ERROR = 500
# So many points may be impossible before an experiment is refused as a whole.
POINTS_TRIED = 20
FIXED = ("rng", "steps", "state_hash", "error")


@dataclass(frozen=True, slots=True)
class Task:
    """One run to do: its settings in full, seed and steps, and the key under which it is kept."""

    key: str
    settings: dict[str, Any]
    rng: int
    steps: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a run: results, or the error that ended it."""

    steps: int = 0
    state_hash: str | None = None
    results: dict[str, float | None] | None = None
    error: str | None = None


@dataclass(frozen=True, slots=True)
class Experiment:
    """What is to be run: every point with every seed. Made by `checked_experiment`.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> two = checked_experiment(find_model("fire_fighting"), {"strategy": ["A", "B"]}, seeds=[7], steps=5)
    >>> [(task.settings, task.rng) for task in two.tasks()]
    [({'strategy': 'A'}, 7), ({'strategy': 'B'}, 7)]
    """

    model_class: type
    settings: dict[str, Any]
    points: Sequence[dict[str, Any]]
    seeds: Sequence[int]
    steps: int
    measure: tuple[str, ...] = ()
    name: str = "run"
    source: str = ""

    def __len__(self) -> int:
        """Count the runs."""
        return len(self.points) * len(self.seeds)

    def tasks(self) -> Iterator[Task]:
        """Yield the runs in the order of the table: point by point, and of each the seeds."""
        for point in self.points:
            settings = {**self.settings, **point}
            for rng in self.seeds:
                yield Task(self.key(settings, rng), settings, rng, self.steps)

    def key(self, settings: Mapping[str, Any], rng: int) -> str:
        """Return the fingerprint of all that decides a run: model, source, version, parameters, seed and steps."""
        defaults = {name: parameter.default for name, parameter in parameters_of(self.model_class).items()}
        place = f"{self.model_class.__module__}:{self.model_class.__qualname__}"
        parameters = {name: shown_value(value) for name, value in {**defaults, **settings}.items()}
        said = [place, self.source, _version(), parameters, rng, self.steps]
        return blake2b(json.dumps(said, sort_keys=True, default=repr).encode(), digest_size=16).hexdigest()

    @property
    def columns(self) -> list[str]:
        """The parameters that are set, in the order of the table."""
        return list({**self.settings, **(self.points[0] if self.points else {})})


def checked_experiment(
    model: type | str,
    varied: Mapping[str, Sequence] | Sample | Sequence[Mapping] = (),
    *,
    seeds: int | Sequence[int] = 30,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measure: Sequence[str] = (),
    name: str = "run",
) -> Experiment:
    """Return an experiment after building its model once.

    Parameters
    ----------
    model : type or str
        A SwarmModel with a method ``results``, or the name of one of the gallery.
    varied : mapping, Sample or sequence of mappings
        A grid (values by parameter), a sample, or settings of your own, point by point.
    seeds : int or sequence, array or Series of int
        Seeds 1, 2, ... seeds, or these; the same at every point.
    steps : int, optional
        By default what the model's attribute ``steps_to_compare`` says, else 3,000.
    settings : mapping, optional
        Other parameters, the same in all runs.
    measure : sequence of str
        The results that are wanted, all of them by default.

    Raises
    ------
    SwarmError
        If anything about it is wrong.
    """
    model_class = checked_class(model)
    fixed = checked_settings(model_class, settings or {})
    points = _points(model_class, varied)
    for both in fixed.keys() & points[0].keys():
        raise InvalidValueError(f"{both} is set and varied at once; leave one out")
    default = getattr(model_class, "steps_to_compare", DEFAULT_STEPS)
    steps = check_count("steps", default if steps is None else steps, minimum=1, maximum=MOST_STEPS)
    experiment = Experiment(
        model_class, fixed, points, checked_seeds(seeds), steps, tuple(measure), name, source_hash(model_class)
    )
    check_count("number of runs", len(experiment), minimum=1, maximum=MOST_RUNS)
    _check_measures(experiment)
    return experiment


def checked_settings(model_class: type, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings as the types of a model's parameters, files of maps read.

    Raises
    ------
    SwarmError

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> checked_settings(find_model("fire_fighting"), {"n_robots": 3})
    {'n_robots': 3}
    """
    known, checked = parameters_of(model_class), {}
    for name, value in settings.items():
        check_choice(f"parameter of {model_class.__name__}", name, known)
        is_file = name == "map" and value not in builtin_maps()
        # Files of maps are read once and here, so that workers elsewhere need none.
        checked[name] = known[name].checked(Map.load(value) if is_file else value)
    return checked


def carried_out(
    model_class: type,
    task: Task,
    observed: Callable[[Any], AbstractContextManager] = nullcontext,
    progress: bool = False,
    beyond: tuple[type[Exception], ...] = (),
) -> Outcome:
    """Do one run; an error of the model is an outcome too.

    Parameters
    ----------
    model_class : type
    task : Task
    observed : callable
        Called with the model; what it returns is entered while the model runs, such as a recorder.
    progress : bool
        Whether to show a bar of its steps.
    beyond : tuple of exception classes
        These are raised: they are no fault of the run.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> task = Task("", {"n_robots": -1}, rng=1, steps=5)
    >>> carried_out(find_model("fire_fighting"), task).error
    'InvalidValueError: n_robots is -1; expected a whole number at least 0 and at most 2147483647'
    """
    try:
        model = model_class(**task.settings, rng=task.rng)
        with observed(model):
            model.run(task.steps, progress=progress)
        check_results(model_class, model)
        results = {name: None if value is None else float(value) for name, value in model.results().items()}
        return Outcome(model.steps, model.state_hash(), results)
    except beyond:
        raise
    except (Exception, SystemExit) as error:
        return Outcome(error=error_in_words(error))


def error_in_words(error: BaseException) -> str:
    """Return an error as one line that is the same whenever it happens.

    Examples
    --------
    >>> error_in_words(ValueError("no <Robot object at 0x7f00>"))
    'ValueError: no <Robot object>'
    """
    words = " ".join(without_addresses(str(error)).split())
    # Names of files may hold what cannot be written as text.
    return f"{type(error).__name__}: {words}".encode("utf-8", "backslashreplace").decode()[:LONGEST_ERROR]


def without_addresses(text: str) -> str:
    """Return a text without the places of objects in memory, which are others in each process.

    Examples
    --------
    >>> without_addresses("<Drive object at 0x7f00>")
    '<Drive object>'
    """
    return re.sub(r" at 0x[0-9a-fA-F]+", "", text)


def shown_value(value: object) -> object:
    """Return a parameter's value as it is kept: a map by name and content.

    Examples
    --------
    >>> shown_value(Map.load("original")).partition(" ")[0], shown_value(2.5)
    ('original', 2.5)
    """
    if not isinstance(value, Map):
        return value
    return f"{value.name} ({blake2b(value.to_toml().encode(), digest_size=8).hexdigest()})"


@cache
def _version() -> str:
    """Return ours; looking it up takes a millisecond, and each run asks several times."""
    return version("mesa-swarm")


def _points(model_class: type, varied: Mapping | Sample | Sequence[Mapping]) -> Sequence[dict[str, Any]]:
    """Return the points, checked; those of grids and samples are made when they are asked for."""
    if isinstance(varied, Sample):
        return varied.points_of(model_class)
    if isinstance(varied, Mapping):
        columns = grid_columns(model_class, varied)
        if "map" in columns:
            columns["map"] = [checked_settings(model_class, {"map": each})["map"] for each in columns["map"]]
        return Points(columns, crossed=True)
    points = [checked_settings(model_class, point) for point in varied or [{}]]
    for point in points:
        if point.keys() != points[0].keys():
            both = f"{shortened(list(points[0]))} and {shortened(list(point))}"
            raise InvalidValueError(f"points set {both}; expected the same parameters in all")
    return points


def _check_measures(experiment: Experiment) -> None:
    """Refuse results that are unknown, not numbers, or named as a column of the table already is."""
    model = first_built(experiment)
    check_results(experiment.model_class, model)
    results = model.results()
    for name in experiment.measure:
        check_choice(f"result of {experiment.model_class.__name__}", name, results)
    check_columns(results, {*FIXED, *experiment.columns})


def check_columns(results: Iterable[str], taken: Set[str]) -> None:
    """Refuse results that are named as other columns of the table are.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> check_columns({"steps": 1.0}, {"rng", "steps"})
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: result 'steps' is named as another column; rename it in results()
    """
    for name in results:
        if name in taken:
            raise InvalidValueError(f"result {shortened(name)} is named as another column; rename it in results()")


def first_built(experiment: Experiment) -> SwarmModel:
    """Return the model at the first point at which it can be built: others may fail, and are recorded so."""
    first_error = None
    for point in islice(experiment.points, POINTS_TRIED):
        try:
            return experiment.model_class(**experiment.settings, **point, rng=experiment.seeds[0])
        except SwarmError as error:
            first_error = first_error or error
    raise first_error or InvalidValueError("there are no points; give at least one")
