"""The tables of a job file, checked by pydantic; what is wrong is said in this package's words."""

import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, ValidationInfo

from mesa_swarm.errors import InvalidValueError, check_choice, check_count, shortened, unknown_name
from mesa_swarm.experiments.experiment import Experiment, checked_seeds
from mesa_swarm.experiments.plan import MOST_STEPS
from mesa_swarm.experiments.run_records import OPTIONS, RunRecords
from mesa_swarm.experiments.sampling import MOST_POINTS, Sample
from mesa_swarm.gallery import model_names

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


def _field(check: Callable, value: Any, info: ValidationInfo) -> Any:
    return check(info.field_name, value)


def _checked_by(check: Callable, **limits: Any) -> BeforeValidator:
    """Return a validator that refuses in this package's words: the check gets the key and the value."""
    return BeforeValidator(partial(_field, partial(check, **limits)))


def _check_name(name: str, value: object) -> str:
    if not isinstance(value, str) or not NAME.fullmatch(value):
        wanted = "letters, digits, - and _, at most 60, for it names a folder"
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {wanted}")
    return value


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, protected_namespaces=())


class SampleTable(_Table):
    """The keys of `[sample]`: see `Sample`."""

    kind: str
    points: Annotated[int, _checked_by(check_count, minimum=1, maximum=MOST_POINTS)]
    ranges: dict[str, Any]
    rng: Annotated[int, _checked_by(check_count)] = 1


def _as_table(value: Any) -> Any:
    """Return the name of a file as the table that it is short for."""
    return {"file": value} if isinstance(value, str) else value


class RecordTable(_Table):
    """The keys of `[record]`: a file for each run, and options that `record` takes.

    Parameters
    ----------
    file : str
        Relative to the job's folder; ``{seed}`` and ``{name}`` stand for the seed and the run's name.
    every : int
        Steps from one row to the next.
    columns : list of str, optional
        By default what one needs to look at the run.
    exact : bool
        Whether real numbers keep all 64 bits.
    """

    model_config = ConfigDict(extra="allow")

    file: str
    every: Annotated[int, _checked_by(check_count, minimum=1)] = 1
    columns: list[str] | None = None
    exact: bool = False

    def options(self) -> dict[str, Any]:
        """Return what is passed on to `record`, which knows more options than are listed here."""
        given = {**dict(self), **(self.model_extra or {})}
        for key in given:
            if key != "file" and key not in OPTIONS:
                raise InvalidValueError(f"[record] {unknown_name('key', key, ('file', *OPTIONS))}")
        return {key: value for key, value in given.items() if key != "file"}


class RunTable(_Table):
    """The keys of one run.

    Parameters
    ----------
    name : str, optional
        Of its folder of results; by default run_1, run_2, ...
    model : str
        One of `mesa-swarm list`.
    map : str, optional
        A built-in one, or a file in the job's folder.
    robots : int, optional
        Short for the parameter n_robots.
    steps : int, optional
        At most; by default what the model says.
    seeds : int or list of int
        How many (1, 2, ...), or which.
    measure : list of str, optional
        The results that are wanted; by default all.
    parameters, grid, sample : table, optional
        Fixed values; lists of values; a `SampleTable`.
    record : str or table, optional
        A file to record to, or a `RecordTable`.
    """

    name: Annotated[str | None, _checked_by(_check_name)] = None
    model: Annotated[str, _checked_by(lambda name, value: check_choice(name, value, model_names()))]
    map: str | None = None
    robots: Annotated[int | None, _checked_by(check_count)] = None
    steps: Annotated[int | None, _checked_by(check_count, minimum=1, maximum=MOST_STEPS)] = None
    seeds: Annotated[Any, _checked_by(lambda name, value: checked_seeds(value))] = 1
    measure: list[str] = []
    parameters: dict[str, Any] = {}
    grid: dict[str, Any] | None = None
    sample: SampleTable | None = None
    record: Annotated[RecordTable | None, BeforeValidator(_as_table)] = None

    def settings(self) -> dict[str, Any]:
        """Return the parameters, with those that have keys of their own."""
        settings = {"map": self.map, "n_robots": self.robots}
        own = {name: value for name, value in settings.items() if value is not None}
        for name in own.keys() & self.parameters.keys():
            raise InvalidValueError(f"{name} is set twice, by its own key and under parameters; leave one out")
        return {**own, **self.parameters}

    def varied(self) -> Mapping | Sample:
        """Return the grid or the sample, an empty grid if there is neither."""
        if self.sample is None:
            return self.grid or {}
        if self.grid is not None:
            raise InvalidValueError("grid and sample are both given; keep one of them")
        return Sample(self.sample.kind, self.sample.ranges, self.sample.points, self.sample.rng)

    def records(self, folder: Path, experiment: Experiment) -> RunRecords | None:
        """Return how its runs are recorded, checked; None if they are not."""
        if self.record is None:
            return None
        records = RunRecords(folder=folder, file=self.record.file, options=self.record.options())
        records.check(experiment)
        return records


def checked_run(table: dict[str, Any]) -> RunTable:
    """Return what a table says of one run.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_run({"model": "boids", "steps": 10}).steps
    10
    """
    try:
        return RunTable.model_validate(table)
    except ValidationError as error:
        raise InvalidValueError(_first_problem(error)) from None


def _first_problem(error: ValidationError) -> str:
    """Return the worst mistake in words: a misspelt key explains a missing one."""
    problems = sorted(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
    problem = problems[0]
    place, key = problem["loc"][:-1], problem["loc"][-1]
    where = "".join(f"[{part}] " for part in place if part in ("sample", "record"))
    if problem["type"] == "extra_forbidden":
        known = SampleTable if place else RunTable
        return f"{where}{unknown_name('key', key, known.model_fields)}"
    if problem["type"] == "missing":
        return f"{where}{key} is missing"
    if problem["type"] == "value_error":
        return f"{where}{problem['ctx']['error']}"
    wanted = problem["msg"].replace("Input should be", "expected").replace("dictionary", "table")
    wanted = re.sub(r" or instance of \w+", "", wanted)
    keys = {*RunTable.model_fields, *SampleTable.model_fields, *RecordTable.model_fields}
    name = next(part for part in reversed(problem["loc"]) if part in keys)
    return f"{where}{name} is {shortened(problem['input'])}; {wanted}"
