"""Job files: their tables, their paths, their checks; never executed."""

import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, ValidationInfo

from mesa_swarm.base.errors import InvalidValueError, JobError, SwarmError, check_count, shortened, unknown_name
from mesa_swarm.base.files import check_present_format
from mesa_swarm.experiments.experiment import MOST_STEPS, Experiment, checked_experiment, checked_seeds
from mesa_swarm.experiments.run_records import OPTIONS, RunRecords, file_within, filled_in
from mesa_swarm.experiments.sampling import MOST_POINTS, Sample
from mesa_swarm.maps.map import builtin_name
from mesa_swarm.maps.map_parts import decode_text, file_content
from mesa_swarm.maps.toml import parse_toml
from mesa_swarm.model.gallery import check_model_name, find_model, is_address

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


def _checked_by(check: Callable, **limits: Any) -> BeforeValidator:
    """Return a validator with this package's messages: the check gets the key and the value."""

    def checked(value: Any, info: ValidationInfo) -> Any:
        return check(info.field_name, value, **limits)

    return BeforeValidator(checked)


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
    """The keys of `[record]`: a file for each run, and options that `record` takes; see `RunRecords`."""

    model_config = ConfigDict(extra="allow")

    file: str
    every: Annotated[int, _checked_by(check_count, minimum=1)] = 1
    columns: list[str] | None = None
    exact: bool = False

    def options(self) -> dict[str, Any]:
        """Return the options of `record`, which has more of them than are listed here."""
        given = {**dict(self), **(self.model_extra or {})}
        for key in given:
            if key != "file" and key not in OPTIONS:
                raise InvalidValueError(f"[record] {unknown_name('key', key, ('file', *OPTIONS))}")
        return {key: value for key, value in given.items() if key != "file"}


class RunTable(_Table):
    """The keys of one run; `robots` is short for the parameter n_robots."""

    name: Annotated[str | None, _checked_by(_check_name)] = None
    model: Annotated[str, _checked_by(lambda _, value: check_model_name(value))]
    map: str | None = None
    robots: Annotated[int | None, _checked_by(check_count)] = None
    steps: Annotated[int | None, _checked_by(check_count, minimum=1, maximum=MOST_STEPS)] = None
    seeds: Annotated[Any, _checked_by(lambda name, value: checked_seeds(value))] = 1
    measure: list[str] = []
    until: str | None = None
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
            raise InvalidValueError("grid and sample are both given; leave one out")
        return Sample(self.sample.kind, self.sample.ranges, self.sample.points, self.sample.rng)

    def records(self, folder: Path, experiment: Experiment) -> RunRecords | None:
        """Return how its runs are recorded, checked; None if they are not."""
        if self.record is None:
            return None
        records = RunRecords(folder=folder, file=self.record.file, options=self.record.options())
        records.check(experiment)
        return records


def checked_run(table: dict[str, Any]) -> RunTable:
    """Return the run of a table, checked."""
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


LARGEST_JOB = 1_000_000
MOST_EXPERIMENTS = 1_000
MOST_RECORDINGS = 10_000
LONGEST_MESSAGE = 300


@dataclass(frozen=True, slots=True)
class Job:
    """The experiments of a job file, in its order, and how each is recorded, None if it is not."""

    name: str
    experiments: tuple[Experiment, ...]
    records: tuple[RunRecords | None, ...]


def read_job(path: str | os.PathLike[str], until: str | None = None) -> Job:
    """Return the job of a .toml file or of a sample, after building the model of every experiment in it once.

    `until` is the condition of all runs, none of which may have one in the file. A JobError has on one line the file,
    the table in it, and what is wrong.
    """
    check_present_format(path, JobError)
    file = _found(path)
    with _naming(file.name):
        tables = _tables(parse_toml(decode_text(file_content(file, LARGEST_JOB), file.name), file.name))
        runs = []
        for number, table in enumerate(tables, start=1):
            runs.append(_run(number, table, file, tables, until))
            points = sum(len(experiment.points) for experiment, _ in runs)
            check_count("number of points of all runs", points, maximum=MOST_POINTS)
        job = Job(file.stem, *zip(*runs, strict=True))
        _check_names("two runs are named", [experiment.name for experiment in job.experiments])
        return _with_different_recordings(job)


def named_files(path: str | os.PathLike[str]) -> list[Path]:
    """Return the file of a job, and what its texts would name if they were files: a map, or a model's module."""
    file = _found(path)
    texts = _texts_in(parse_toml(decode_text(file_content(file, LARGEST_JOB), file.name), file.name))
    return [file, *(file.parent / (text.rpartition(":")[0] or text) for text in texts)]


def _texts_in(value: object) -> Iterator[str]:
    """Yield the texts in a value, at any depth."""
    if isinstance(value, str):
        yield value
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    for part in parts:
        yield from _texts_in(part)


def job_text(model: str, about: Sequence[str] = (), **keys: Any) -> str:
    """Return the text of a job file with one run, which `read_job` reads back.

    Parameters
    ----------
    model : str
        Its name or address.
    about : sequence of str
        Lines of comment at the beginning.
    **keys
        Of the run, without those that are empty; tables such as `grid` are mappings of names to numbers, texts, or
        lists of them.

    Examples
    --------
    >>> print(job_text("boids", steps=50, grid={"n_robots": [5, 10]}))
    model = "boids"
    steps = 50
    <BLANKLINE>
    [grid]
    n_robots = [5, 10]
    <BLANKLINE>
    """
    given = {name: value for name, value in {"model": model, **keys}.items() if value or value == 0}
    tables = {name: table for name, table in given.items() if isinstance(table, Mapping)}
    lines = [f"# {line}" for line in about]
    lines += [f"{name} = {_toml(value)}" for name, value in given.items() if name not in tables]
    for name, table in tables.items():
        lines += ["", f"[{name}]", *(f"{_toml_key(key)} = {_toml(value)}" for key, value in table.items())]
    return "\n".join([*lines, ""])


def _toml_key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else _toml(name)


def _toml(value: Any) -> str:
    """Return a value as TOML that reads back as the same."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, (bool, str)):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (int, float)):
        return repr(value)
    raise InvalidValueError(f"{shortened(value)} has no place in a job file; expected a number, a text, or a list")


def recorded_to(job: Job, file: Path) -> Job:
    """Return a job whose runs are recorded to files of this name; the options that it has for that stay.

    ``{seed}`` and ``{name}`` in the name stand for each run's. Its folder may be any.
    """
    filled_in(str(file), "name", 1)
    records = []
    for experiment, before in zip(job.experiments, job.records, strict=True):
        options = before.options if before else {}
        records.append(RunRecords(folder=file.parent, file=file.name, options=options))
        records[-1].check(experiment)
    return _with_different_recordings(replace(job, records=tuple(records)))


def sample_jobs() -> list[str]:
    """Return the names of the job files that come with the package."""
    folder = resources.files("mesa_swarm.experiments") / "standard_jobs"
    return sorted(file.name for file in folder.iterdir() if file.name.endswith(".toml"))


def _found(path: str | os.PathLike[str]) -> Path:
    """Return the path of a job file that is there, or of the sample with this name."""
    file = Path(path)
    samples = sample_jobs()
    try:
        if file.exists():
            return file
    except (OSError, ValueError):  # a name too long for the system, or with a null byte
        pass
    if str(path) in samples:
        return Path(str(resources.files("mesa_swarm.experiments"))) / "standard_jobs" / file.name
    raise JobError(f"{shortened(str(path))[1:-1]}: no such file; {unknown_name('sample job', file.name, samples)}")


@contextmanager
def _naming(file: str, place: str = "") -> Iterator[None]:
    """Turn whatever is wrong in a job into a JobError that names the file and the place."""
    try:
        yield
    except JobError:
        raise
    except SwarmError as error:
        words = " ".join(str(error).split())
        named = "" if words.startswith(f"{file}:") else file  # as where it is not TOML
        raise _refusal(named, place, words) from None
    except RecursionError:
        raise _refusal(file, "", "tables or lists are nested too deeply") from None


def _refusal(*parts: str) -> JobError:
    """Return an error of one line, however long and odd the file's name is."""
    text = " ".join(": ".join(part for part in parts if part).split())
    return JobError(text if len(text) <= LONGEST_MESSAGE else text[: LONGEST_MESSAGE - 3] + "...")


def _tables(job: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the tables of the runs: those of `[[run]]`, else the file is one."""
    if "run" not in job:
        return [job]
    for key in job:
        if key != "run":
            raise InvalidValueError(f"{shortened(key)} stands beside [[run]]; move it into the runs")
    tables = job["run"]
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise InvalidValueError("write [[run]] with double brackets")
    check_count("number of runs", len(tables), minimum=1, maximum=MOST_EXPERIMENTS)
    return tables


def _check_names(what: str, names: Iterable[object]) -> None:
    seen = set()
    for name in names:
        if name in seen:
            raise InvalidValueError(f"{what} {shortened(name)}; give each a name of its own")
        seen.add(name)


def _with_different_recordings(job: Job) -> Job:
    _check_names("two runs are recorded to", _recordings(job))
    return job


def _recordings(job: Job) -> Iterator[str]:
    """Yield the files of all recordings in lower case: some systems do not distinguish capitals."""
    recorded = [e for e, records in zip(job.experiments, job.records, strict=True) if records is not None]
    count = sum(len(experiment.seeds) for experiment in recorded)
    check_count("number of recordings", count, maximum=MOST_RECORDINGS)
    for experiment, records in zip(job.experiments, job.records, strict=True):
        if records is not None:
            for seed in experiment.seeds:
                yield records.path(experiment.name, seed).as_posix().lower()


def _run(
    number: int, table: dict[str, Any], file: Path, tables: list, until: str | None
) -> tuple[Experiment, RunRecords | None]:
    with _naming(file.name, f"run {number}" if len(tables) > 1 else ""):
        run = checked_run(table)
        settings, varied = _with_maps(run, file.parent)
        if run.until is not None and until is not None:
            raise InvalidValueError("until is set here and on the command line (--until); leave one out")
        experiment = checked_experiment(
            find_model(_model_of(run.model, file.parent)),
            varied,
            seeds=run.seeds,
            steps=run.steps,
            settings=settings,
            measure=run.measure,
            until=until if run.until is None else run.until,
            name=run.name or f"run_{number:0{len(str(len(tables)))}}",
        )
        return experiment, run.records(file.parent, experiment)


def _with_maps(run: RunTable, folder: Path) -> tuple[dict[str, Any], Mapping | Sample]:
    """Return settings and grid of a run, with the files of maps looked for in the job's folder."""
    settings, varied = run.settings(), run.varied()
    if "map" in settings:
        settings["map"] = _map_of(settings["map"], folder)
    if isinstance(varied, Mapping) and isinstance(varied.get("map"), list):
        varied = {**varied, "map": [_map_of(value, folder) for value in varied["map"]]}
    return settings, varied


def _model_of(name: str, folder: Path) -> str:
    """Return a model's name or address, the file of one looked for in the job's folder."""
    if not is_address(name) or ".py" not in name:
        return name
    file, ending, class_name = name.rpartition(".py")
    return f"{file_within(folder, file + ending)}{class_name}"


def _map_of(value: object, folder: Path) -> object:
    """Return a map's file in the job's folder, or the name of a built-in one."""
    if not isinstance(value, str):
        raise InvalidValueError(f"map is {shortened(value)}; expected the name of a map or of a file")
    built_in = builtin_name(value)
    is_file = value.lower().endswith(".map") and (folder / value).exists()
    return built_in if built_in and not is_file else file_within(folder, value)
