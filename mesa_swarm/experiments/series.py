"""The series of runs as Parquet, a file a run: the rows that were collected of models, and those of their agents."""

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mesa
import numpy as np
import pyarrow as pa
from pyarrow import parquet

from mesa_swarm.base.errors import InvalidValueError, check_choice, shortened
from mesa_swarm.base.files import draft_of
from mesa_swarm.experiments.until import ALL_STEPS, CONDITION, MODEL, EndCondition
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.model.mesa_model import collected_of_agents
from mesa_swarm.swarm_model import SwarmModel

# The folder of the series beside a ledger, in it those of the data sets, and that of runs of earlier calls.
FOLDER, OF_MODEL, OF_AGENTS, EARLIER = "series", "model", "agents", "earlier"
# What may be chosen, with the data sets.
CHOICES = {"both": (OF_MODEL, OF_AGENTS), OF_MODEL: (OF_MODEL,), OF_AGENTS: (OF_AGENTS,)}
# Columns besides parameters and reporters; `run` is the key of the run.
RUN, RNG, STEP, AGENT = "run", "rng", "step", "unique_id"
# What is stored of each robot where a model has no reporters of agents.
POSE = ("x", "y", "heading")


class Watch:
    """Notes after which steps the rows of a model's data collector were collected, and whether a condition holds.

    It is passed to `SwarmModel.run` as `until`. With `poses` it keeps those of all robots for each row.
    """

    def __init__(self, model: SwarmModel, condition: EndCondition | None = None, *, poses: bool = False) -> None:
        self.steps: list[int] = []
        # The time of each row, by which Mesa 4 stores what it collects of agents.
        self.times: list[float] = []
        self.poses: list[np.ndarray] = []
        self.holds = False
        self._condition = condition
        self._keeps_poses = poses and not model.datacollector.agent_reporters
        self._note(model)

    def __call__(self, model: SwarmModel) -> bool:
        """Note the rows of a step, and return whether the run is to end."""
        self._note(model)
        self.holds = self._condition is not None and self._condition(model)
        return self.holds

    def _note(self, model: SwarmModel) -> None:
        new = count_rows(model.datacollector) - len(self.steps)
        self.steps += [model.steps] * new
        self.times += [getattr(model, "time", model.steps)] * new
        if self._keeps_poses and new:
            swarm = model.swarm
            step = np.full(len(swarm), model.steps)
            self.poses.append(np.column_stack([step, swarm.unique_ids, swarm.position, swarm.heading]))

    def ended_by(self, model: SwarmModel) -> str | None:
        """Return what ended the run of a model, None without a condition."""
        if self._condition is None:
            return None
        return CONDITION if self.holds else ALL_STEPS if model.running else MODEL

    def columns_of_agents(self, model: SwarmModel) -> dict[str, Sequence]:
        """Return step, unique_id and reports of all agents by step and unique_id; of poses where those were kept."""
        if self._keeps_poses:
            step, numbers, *poses = np.concatenate([np.empty((0, 5)), *self.poses]).T
            return {STEP: step.astype(int), AGENT: numbers.astype(int), **dict(zip(POSE, poses, strict=True))}
        rows = [
            {STEP: step, AGENT: agent.pop("AgentID"), **agent}
            for time, step in dict(zip(self.times, self.steps, strict=True)).items()
            for agent in sorted(
                collected_of_agents(model.datacollector, step, time), key=lambda agent: agent["AgentID"]
            )
        ]
        names = dict.fromkeys([STEP, AGENT, *(name for row in rows for name in row)])
        return {name: [row.get(name) for row in rows] for name in names}


def count_rows(collector: mesa.DataCollector) -> int:
    """Return how many rows a data collector has; without model reporters, of how many times it has rows of agents."""
    if collector.model_vars:
        return len(next(iter(collector.model_vars.values())))
    return len(collector._agent_records.keys() | collector._agenttype_records.keys())


def checked_series(series: object) -> tuple[str, ...]:
    """Return the data sets that are wanted: both for True, none for False or None.

    Examples
    --------
    >>> checked_series(True), checked_series("model"), checked_series(None)
    (('model', 'agents'), ('model',), ())
    """
    if series is None or isinstance(series, bool):
        return CHOICES["both"] if series else ()
    return CHOICES[check_choice("series", series, CHOICES)]


def check_reporters(model: SwarmModel) -> None:
    """Refuse reporters of a model that are named as a column that all series have."""
    collector = model.datacollector
    of_types = (name for reporters in collector.agenttype_reporters.values() for name in reporters)
    for name in (*collector.model_reporters, *collector.agent_reporters, *of_types):
        if name in (RUN, RNG, STEP, AGENT):
            raise InvalidValueError(f"reporter {shortened(name)} is named as another column of the series; rename it")


def column_of(parameter: str, reporters: Collection[str]) -> str:
    """Return the name of the column of a parameter: its own, unless a reporter has that name too."""
    return f"parameter {parameter}" if parameter in reporters else parameter


@dataclass(frozen=True, slots=True)
class RunSeries:
    """Where the series of runs are stored, and which: the data sets "model" and "agents", a folder each."""

    folder: Path
    parts: tuple[str, ...] = CHOICES["both"]

    @property
    def folders(self) -> list[Path]:
        """The folder of each data set, to be read as one table."""
        return [self.folder / part for part in self.parts]

    def file(self, part: str, key: str) -> Path:
        """Return the file of a run, which is there when it is whole."""
        return self.folder / part / f"{key}.parquet"

    def has(self, key: str) -> bool:
        """Return whether all files of a run are there."""
        return all(self.file(part, key).exists() for part in self.parts)

    def write(self, head: Mapping[str, Any], model: SwarmModel, watch: Watch) -> None:
        """Write what was collected in a run, each file whole or not at all.

        Parameters
        ----------
        head : mapping of str to value
            The columns that are the same in all rows; "run" is the key of the run.
        model : SwarmModel
            After the run.
        watch : Watch
            That watched it.
        """
        for part in self.parts:
            of_model = {STEP: watch.steps, **model.datacollector.model_vars}
            columns = of_model if part == OF_MODEL else watch.columns_of_agents(model)
            count = len(columns[STEP])
            named = {column_of(name, columns): as_array([value])[0] for name, value in head.items()}
            constant = {name: pa.repeat(value, count) for name, value in named.items()}
            with draft_of(self.file(part, head[RUN])) as draft:
                changing = {name: as_array(values) for name, values in columns.items()}
                parquet.write_table(pa.table({**constant, **changing}), draft)

    def agree(self, keys: Collection[str]) -> None:
        """Let all files have the same columns of the same types, so that their folder can be read as one table.

        Files of runs without a key in `keys`, which an earlier call has done, are moved into the folder ``earlier``.
        """
        for part in self.parts:
            files = sorted((self.folder / part).glob("*.parquet"))
            schemas = {file: parquet.read_schema(file) for file in files if file.stem in keys}
            for file in files:
                if file not in schemas:
                    (self.folder / EARLIER / part).mkdir(parents=True, exist_ok=True)
                    os.replace(file, self.folder / EARLIER / part / file.name)
            common = _common_schema(list(schemas.values()))
            for file, schema in schemas.items():
                if not schema.equals(common):
                    with draft_of(file) as draft:
                        parquet.write_table(_as_schema(parquet.ParquetFile(file).read(), common), draft)


def as_array(values: Sequence[Any]) -> pa.Array:
    """Return values as an Arrow array of their type, as texts where they have no common one; NaN and masked are null.

    Examples
    --------
    >>> as_array([1, None, 2.5]).type, as_array([1, "A"]).to_pylist()
    (DataType(double), ['1', 'A'])
    """
    if isinstance(values, np.ndarray):
        return pa.array(values, from_pandas=True)
    plain = [_plain(value) for value in values]
    try:
        return pa.array(plain, from_pandas=True)
    except (pa.ArrowException, OverflowError, TypeError, ValueError):
        return pa.array([None if value is None else str(value) for value in plain])


def _plain(value: Any) -> Any:
    """Return a value of NumPy as one of Python's."""
    is_numpy = isinstance(value, (np.generic, np.ndarray))
    return fill_masked(value).tolist() if is_numpy else value


def _common_schema(schemas: list[pa.Schema]) -> pa.Schema:
    """Return all columns in the order in which they first occur, each of a type that holds what it has in any file."""
    types: dict[str, set[pa.DataType]] = {}
    for field in (field for schema in schemas for field in schema):
        types.setdefault(field.name, set()).add(field.type)
    return pa.schema([(name, _common_type(of_files)) for name, of_files in types.items()])


def _common_type(types: set[pa.DataType]) -> pa.DataType:
    """Return the type of a column that has these types in some files: of numbers if all are, else text."""
    try:
        whole = pa.unify_schemas([pa.schema([("", each)]) for each in types], promote_options="permissive")
    except pa.ArrowException:
        return pa.string()
    return pa.float64() if whole.types == [pa.null()] else whole.types[0]


def _as_schema(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return a table with the columns of a schema, those that it lacks without values."""
    lacking = {name: pa.nulls(len(table)) for name in schema.names if name not in table.schema.names}
    columns = {name: lacking[name] if name in lacking else table[name] for name in schema.names}
    return pa.table([_as_type(columns[field.name], field.type) for field in schema], schema=schema)


def _as_type(column: Any, kind: pa.DataType) -> Any:
    if kind != pa.string():
        return column.cast(kind)
    return pa.array([None if value is None else str(value) for value in column.to_pylist()], kind)
