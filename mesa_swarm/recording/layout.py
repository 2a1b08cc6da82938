"""What is recorded and drawn of a model in a step: as NumPy arrays in memory, and as Arrow lists in the file."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from operator import is_not
from typing import Any
from weakref import ref

import numpy as np
import pyarrow as pa

from mesa_swarm.base.errors import (
    LONGEST_NAME,
    InvalidValueError,
    RecordingError,
    UnknownNameError,
    shortened,
    unknown_name,
)
from mesa_swarm.fire.fires_part import BURNING
from mesa_swarm.kernels.part import Kernel, Part, Prepared, Shown
from mesa_swarm.kernels.rows import copy_of, pick_of, row_kernel
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.looks import COLOUR, looks_of
from mesa_swarm.robots.devices import reserve_names
from mesa_swarm.world.fields import MOST_CELLS, MOST_PIXELS, ScalarField, average_blocks, levels_of
from mesa_swarm.world.statics import BORDER, FIRE, FIXED, ROBOT

DEFAULT = (
    *("position", "heading", "command", "layer", "distance", "kind", "temperature", "fires", "contacts", "loads"),
    *("fields", "events"),
)
# Columns of the swarm from which the contacts are made when a chunk is written.
CONTACT = ("collided", "contact_kind", "contact_index", "contact_normal", "contact_depth")
# Columns written by sensing.
READINGS = frozenset({"distance", "kind", "error", "radiation", "line"})
# Fields of tables, which are not by robot; integers are ids, counts and kinds.
TABLES = {
    "fires": ("fire", "x", "y", "radius", "temperature", "robots", "out"),
    "contacts": ("robot", "kind", "other", "normal_x", "normal_y", "depth"),
    "loads": ("load", "x", "y", "heading"),
    "fields": ("field", "peak", "total"),
    "events": ("step", "name", "unique_id", "value"),
    "shown": ("part", "x", "y", "radius"),
}
WHOLE = frozenset({"fire", "robots", "robot", "kind", "other", "load", "field", "unique_id", "part"})
# Fields of events, which are stored exactly.
EXACT: dict[str, Any] = {"step": np.int64, "name": f"U{LONGEST_NAME}", "value": np.float64}
# Begins the names of the columns that hold the pixels of a field: rows (columns,) from the bottom up.
PIXELS = "fields."
NO_PIXELS = np.empty((0, 1))
NO_DISCS = np.empty((0, 4))
NO_WIDTHS: Mapping[str, int] = {}
# Values of a robot in a column of a part that is recorded without being named.
MOST_VALUES = 8
# The first fields of a row.
FIRST_COLUMNS = {"step": pa.int64(), "state_hash": pa.string(), "robot": pa.list_(pa.int32())}
reserve_names((*TABLES, *FIRST_COLUMNS))


# ---- what a model has


class PartPicture:
    """Values of a part over the whole map, with what recordings and viewers ask of a field."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values
        self.peak, self.total = float(values.max(initial=0.0)), float(values.sum())

    def levels(self, most: int = MOST_PIXELS) -> np.ndarray:
        """Return the values as a picture of at most this many pixels, see `levels_of`."""
        return levels_of(average_blocks(self.values, most), self.peak)


def what_is_python(model: EngineModel, layout: "Layout") -> str:
    """Return what of a row Python alone can make, because it may change in each step; empty if there is nothing."""
    if layout.fields:
        return "pictures of fields"
    added = model.parts.added()
    showing = [part.name for part in added if getattr(part.shown, "__func__", None) is not Part.shown]
    if showing:
        return f"what part {showing[0]} shows"
    columns, others = columns_of_parts(model), columns_of_parts(model)
    unstable = [name for name, array in columns.items() if name in layout.of_parts and array is not others[name]]
    if unstable:
        return f"{unstable[0]}, an array made anew for each row"
    changing = added or any(process_number != BURNING for process_number in model.parts.processes.numbered)
    table = model.parts.bodies.table
    if changing and not np.isnan(table.temperature[table.kind != FIRE]).all():
        return "colours of bodies that radiate"
    return ""


def columns_of_parts(model: EngineModel) -> dict[str, np.ndarray]:
    """Return the columns of added parts that have a row a robot, named as in "boards.last_read"."""
    return {
        f"{part.name}.{name}": column.array
        for part in model.parts.added()
        for name, column in part.columns().items()
        if column.rows == "robots"
    }


def robot_columns(model: EngineModel) -> dict[str, np.ndarray]:
    """Return all columns that have a row a robot: those of the swarm, and those of added parts."""
    of_parts = columns_of_parts(model)
    return {**of_parts, **model.swarm.columns} if of_parts else model.swarm.columns


def narrow_columns(model: EngineModel) -> list[str]:
    """Return the names of those columns of added parts that are numbers, one or a few of a robot."""
    return [
        name
        for name, array in columns_of_parts(model).items()
        if array.dtype.kind in "biuf" and 0 < np.prod(array.shape[1:], dtype=int) <= MOST_VALUES
    ]


def shown_of(model: EngineModel) -> list[Shown]:
    """Return what each added part shows, checked, without those that show nothing."""
    pairs = [(part, part.shown()) for part in model.parts.added()]
    return [_check_picture(part, picture) for part, picture in pairs if picture is not None]


def with_discs(model: EngineModel) -> list[Shown]:
    """Return what is shown of the parts that have discs; their places in this list number them in tables."""
    return [picture for picture in shown_of(model) if picture.discs is not None]


def discs_of(model: EngineModel) -> np.ndarray:
    """Return the discs of all added parts, shape (k, 4): the place of the part in `with_discs`, x, y and radius."""
    tables = [picture.discs for picture in with_discs(model) if picture.discs is not None]
    numbered = [np.insert(discs, 0, place, axis=1) for place, discs in enumerate(tables)]
    return np.concatenate([np.empty((0, 4)), *numbered])


def pictures_of(model: EngineModel) -> Mapping[str, ScalarField | PartPicture]:
    """Return the fields of a model by name, and after them the pictures that added parts show."""
    pictures: dict[str, ScalarField | PartPicture] = dict(model.fields)
    for part_picture in shown_of(model):
        if part_picture.values is not None:
            name = part_picture.name if part_picture.name not in pictures else f"{part_picture.name} of a part"
            pictures[name] = PartPicture(part_picture.values)
    return pictures


def _check_picture(part: Part, picture: Shown) -> Shown:
    """Return what a part shows with arrays of floats; of discs those that can be drawn."""
    if not isinstance(picture, Shown):
        raise _unexpected(part, picture, "an object of mesa_swarm.kernels.part.Shown")
    if not isinstance(picture.name, str) or not picture.name:
        raise _unexpected(part, picture.name, "a name")
    if not isinstance(picture.colour, str) or (picture.colour and not COLOUR.fullmatch(picture.colour)):
        raise _unexpected(part, picture.colour, "a colour of # and six hexadecimal digits")
    discs = None if picture.discs is None else _discs(part, picture.discs)
    values = None if picture.values is None else _values(part, picture.values)
    return picture._replace(discs=discs, values=values)


def _discs(part: Part, discs: np.ndarray) -> np.ndarray:
    table = np.asarray(discs, float)
    if table.ndim != 2 or table.shape[1] != 3:
        raise _unexpected(part, f"discs of shape {table.shape}", "rows of x, y and radius")
    return table[np.isfinite(table).all(axis=1) & (table[:, 2] > 0)]


def _values(part: Part, values: np.ndarray) -> np.ndarray:
    picture = np.asarray(values, float)
    if picture.ndim != 2 or not 0 < picture.size <= MOST_CELLS:
        raise _unexpected(part, f"values of shape {picture.shape}", f"rows and columns of 1 to {MOST_CELLS:,} values")
    return np.maximum(np.nan_to_num(picture, posinf=0.0), 0.0)


def _unexpected(part: Part, value: object, expectation: str) -> InvalidValueError:
    return InvalidValueError(f"part {part.name} shows {shortened(value)}; expected {expectation}")


# ---- what is recorded of it


class Layout:
    """Which columns are recorded of a model, and whether real numbers are float64 (`exact`) or float32.

    Columns of robots that an added part has are named as in "boards.last_read"; "shown" is the discs of such parts.

    With "fields" all fields are recorded that the model has now, or those named as "fields.trail": their
    values if `exact`, else pictures (`levels_of`); of one that the model no longer has, pictures without rows.
    `widths` are the columns of pictures by the names of fields that the model may have had once.
    """

    def __init__(
        self, model: EngineModel, columns: Sequence[str], exact: bool, widths: Mapping[str, int] = NO_WIDTHS
    ) -> None:
        self.real = np.float64 if exact else np.float32
        pictures, sources = pictures_of(model), robot_columns(model)
        pixels = {PIXELS + name: name for name in (*pictures, *widths)}
        names = _checked_names(columns, (*sources, *TABLES, *pixels))
        field_names = tuple(pixels[name] for name in names if name in pixels)
        self.fields = field_names or (tuple(pictures) if "fields" in names else ())
        shapes = {name: sources[name].shape[1:] for name in names if not is_table(name)}
        self.columns = tuple(name for name in shapes if 0 not in shapes[name])
        part_columns = columns_of_parts(model)
        self.of_parts = {name: self._row_of(part_columns[name]) for name in self.columns if name in part_columns}
        self.tables = tuple(name for name in names if name in TABLES and (name != "fields" or self.fields))
        self.has_readings = not READINGS.union(model.swarm.table.readings).isdisjoint(self.columns)
        self.schema = self._schema(sources, shapes, pictures, widths)

    def prepare(self, model: EngineModel) -> None:
        """Update sensor readings for the current poses, if they are recorded; the next step reuses them."""
        if self.has_readings:
            model.sense()

    def stored_type(self, dtype: np.dtype) -> np.dtype:
        """Return the type in which a column is stored: fewer bits where that is lossless or requested."""
        if dtype.kind == "f":
            return np.dtype(self.real)
        return np.dtype(np.int32) if dtype == np.int64 else dtype

    def _row_of(self, column: np.ndarray) -> np.ndarray:
        """Return a robot's row of a part's column in its stored type: NaN or 0, as it is once the part was removed."""
        kind = np.dtype(self.real) if column.dtype.kind == "f" else column.dtype
        return np.full(column.shape[1:], np.nan if kind.kind == "f" else 0, kind)

    def _schema(
        self,
        sources: Mapping[str, np.ndarray],
        shapes: dict[str, tuple],
        pictures: Mapping[str, ScalarField | PartPicture],
        widths: Mapping[str, int],
    ) -> pa.Schema:
        fields = list(FIRST_COLUMNS.items())
        for name in self.columns:
            row = self.of_parts.get(name)
            value = _arrow_type(name, self.stored_type(sources[name].dtype) if row is None else row.dtype)
            for width in reversed(shapes[name]):
                value = pa.list_(value, width)
            fields.append((name, pa.list_(value)))
        real = pa.from_numpy_dtype(self.real)
        fields += [(name, pa.list_(table_type(name, real))) for name in self.tables]
        for name in self.fields:
            pixels = self.pixels(pictures.get(name))
            width = widths.get(name, pixels.shape[1])
            fields.append((PIXELS + name, pa.list_(pa.list_(pa.from_numpy_dtype(pixels.dtype), width))))
        return pa.schema(fields)

    def pixels(self, field: ScalarField | PartPicture | None) -> np.ndarray:
        """Return what is stored of the values of a field, no rows of one that was removed."""
        if field is None:
            return NO_PIXELS.astype(np.float64 if self.real is np.float64 else np.uint8)
        return field.values if self.real is np.float64 else field.levels()


def default_columns(model: EngineModel) -> tuple[str, ...]:
    """Return the columns that are recorded if none are named: `DEFAULT`, and those of the model's looks and parts."""
    looks = looks_of(model)
    sources = () if looks is None else (getattr(looks.column, "source", None), looks.label)
    of_sources = [name for name in sources if isinstance(name, str) and name in model.swarm.columns]
    of_parts = (*narrow_columns(model), "shown") if model.parts.added() else ()
    return tuple(dict.fromkeys((*DEFAULT, *of_sources, *of_parts)))


def is_table(column: str) -> bool:
    """Return whether a column has rows of its own, rather than one a robot."""
    return column in TABLES or column.startswith(PIXELS)


def table_type(table: str, real: pa.DataType) -> pa.DataType:
    """Return the Arrow type of a row of a table."""
    types = {field: field_type(field, real.to_pandas_dtype()) for field in TABLES[table]}
    return pa.struct(
        [(field, pa.string() if kind.kind == "U" else pa.from_numpy_dtype(kind)) for field, kind in types.items()]
    )


class Chunk:
    """A buffer of rows, between two changes of the population.

    Attributes
    ----------
    why_not : str
        Why no kernel can write its rows; empty if one can, or none was made yet.
    """

    why_not = ""

    def __init__(self, layout: Layout, model: EngineModel, capacity: int) -> None:
        self.layout = layout
        self.capacity = capacity
        self.steps = np.zeros(capacity, np.int64)
        self.hashes: list[str | None] = [None] * capacity
        self._robots = _ids(model.swarm.agents)
        self._obstacles, self._fires = _ids(model.obstacle_list), _ids(model.fires.agents)
        self._loads, table = _ids(model.displaced), model.parts.bodies.table
        # Arrays only: a buffer that held bodies, and with them the model, would keep a recording open for ever.
        self._of_bodies = table.position, table.heading, table.temperature
        self._rows_of_fires = np.flatnonzero(table.kind == FIRE)
        self._rows_of_loads = np.flatnonzero(table.mode != FIXED)
        self._places = model.fires.discs.astype(layout.real)
        count = len(self._loads) if "loads" in layout.tables else 0
        self._load_poses = np.zeros((capacity, count, 3), layout.real)
        pictures = pictures_of(model)
        self._fields = [pictures.get(name) for name in layout.fields]
        self._pixels = [self._picture_rows(*pair) for pair in zip(layout.fields, self._fields, strict=True)]
        self._sums = np.zeros((capacity, len(self._fields), 2), layout.real)
        # The model is not to be kept by its recording.
        self._log, self._events = model.events, ref(model.parts.events)
        # How many events there were before each row, and after the last.
        self.event_counts = np.zeros(capacity + 1, np.int64)
        standing = [name for name in layout.columns if name not in layout.of_parts]
        self._robot_rows = self._buffers(model.swarm.columns, standing)
        self._part_rows = self._buffers_of_parts(len(self._robots))
        self._drawn_discs = [NO_DISCS] * capacity
        self._shown_now = discs_of(model) if "shown" in layout.tables else NO_DISCS
        self._contact_rows = self._buffers(model.swarm.columns, CONTACT if "contacts" in layout.tables else ())
        fires = ("temperature", "robots", "out") if "fires" in layout.tables else ()
        fire_columns = model.fires.columns
        self._heat = fire_columns["temperature"].copy()  # as it is now: the table of bodies has it
        self._copying = Prepared()
        self._fire_rows = self._buffers({**fire_columns, "temperature": self._heat}, fires)
        self._check_widths()
        self._pairs = [*self._robot_rows.values(), *self._contact_rows.values(), *self._fire_rows.values()]

    @property
    def row_bytes(self) -> int:
        """Bytes of a row in memory."""
        buffers = [*(rows for _, rows in self._pairs), *self._pixels, *self._part_rows.values()]
        return sum(rows.nbytes for rows in buffers) // self.capacity + self._shown_now.nbytes + 1

    def fits(self, model: EngineModel) -> bool:
        """Return whether the model still has the arrays of bodies and the fields that rows of this chunk show."""
        table = model.parts.bodies.table
        # Others where a body has come and gone, though the same bodies are there.
        if any(map(is_not, (table.position, table.heading, table.temperature), self._of_bodies)):
            return False
        if not self._fields:
            return True
        pictures = pictures_of(model)
        return all(_is_same(pictures.get(n), field) for n, field in zip(self.layout.fields, self._fields, strict=True))

    def _flush_events(self) -> None:
        """Let the log have what compiled functions have reported, before its events are counted."""
        events = self._events()
        if events is not None:
            events.flush()

    def put(self, model: EngineModel, row: int, state_hash: str | None, event_count: int) -> None:
        """Store the present state of the model as a row; `event_count` events are in rows before the first one."""
        self._flush_events()
        if not row:
            self.event_counts[0] = event_count
        self.event_counts[row + 1] = len(self._log)
        if len(self._heat):
            self._heat[:] = model.fires.temperature
        for source, rows in self._pairs:
            rows[row] = source
        if self._load_poses.size:
            position, heading, _ = self._of_bodies
            self._load_poses[row, :, :2] = position[self._rows_of_loads]
            self._load_poses[row, :, 2] = heading[self._rows_of_loads]
        pictures = pictures_of(model) if self._fields else {}
        for place, name in enumerate(self.layout.fields):
            field = pictures.get(name)
            if field is None:
                continue
            self._pixels[place][row] = self.layout.pixels(field)
            self._sums[row, place] = field.peak, field.total
        self._put_parts(model, row)
        self.steps[row] = model.completed
        self.hashes[row] = state_hash

    def copy(self, rows: int) -> "Chunk":
        """Return the first rows in buffers of their own, for a thread that writes them while others are added here."""
        other = copy(self)
        for name in ("_robot_rows", "_contact_rows", "_fire_rows"):
            pairs = {column: (source, buffer[:rows].copy()) for column, (source, buffer) in vars(self)[name].items()}
            setattr(other, name, pairs)
        other._part_rows = {name: buffer[:rows].copy() for name, buffer in self._part_rows.items()}
        other._pixels = [pixels[:rows].copy() for pixels in self._pixels]
        other._load_poses, other._sums = self._load_poses[:rows].copy(), self._sums[:rows].copy()
        other._drawn_discs, other.hashes = self._drawn_discs[:rows], self.hashes[:rows]
        other.steps, other.event_counts = self.steps[:rows].copy(), self.event_counts[: rows + 1].copy()
        return other

    def complete(self, first: int, end: int, event_count: int) -> None:
        """Add to rows that a kernel has written what it does not write: events, and that they have no state hash.

        `event_count` events are in rows before these.
        """
        self._flush_events()
        self.hashes[first:end] = [None] * (end - first)
        self.event_counts[first : end + 1] = event_count
        if len(self._log) > event_count:
            self.event_counts[first + 1 : end + 1] = np.searchsorted(self._log.step, self.steps[first:end], "right")

    def kernel(self, model: EngineModel, counts: np.ndarray, write: Callable[[], None]) -> Kernel | None:
        """Return what writes rows as `put` does, see `row_kernel`, None if Python has to; `why_not` names the cause.

        It is made anew when parts have other arrays.
        """
        arrays, prepared = self._arrays_of_parts(model), self._copying
        if prepared.state is None or any(map(is_not, arrays.values(), prepared.state.values())):
            prepared.state, prepared.kernel = arrays, None
            copies = self._copies(arrays)
            absent = [name for name, kernel in copies.items() if kernel is None]
            self.why_not = f"{absent[0]} is copied in Python" if absent else ""
            if not absent:
                prepared.kernel = row_kernel(
                    [kernel for kernel in copies.values() if kernel], counts, self.steps, write
                )
        return prepared.kernel

    def _arrays_of_parts(self, model: EngineModel) -> dict[str, np.ndarray]:
        columns = columns_of_parts(model) if self._part_rows else {}
        return {name: columns.get(name, row) for name, row in self.layout.of_parts.items()}

    def _copies(self, of_parts: dict[str, np.ndarray]) -> dict[str, Kernel | None]:
        """Return a kernel for each column and table that has numbers of its own in each row."""
        pairs = {**self._robot_rows, **self._contact_rows}
        pairs |= {f"{name} of fires": pair for name, pair in self._fire_rows.items()}
        pairs |= {name: (of_parts[name], rows) for name, rows in self._part_rows.items()}
        copies = {name: copy_of(*pair) for name, pair in pairs.items()}
        position, heading, temperature = self._of_bodies
        if len(self._heat) and "temperature" in self._fire_rows:
            target = self._fire_rows["temperature"][1]
            copies["temperature of fires"] = pick_of(temperature, self._rows_of_fires, target)
        if self._load_poses.size:
            copies["places of loads"] = pick_of(position, self._rows_of_loads, self._load_poses)
            copies["headings of loads"] = pick_of(heading, self._rows_of_loads, self._load_poses, 2)
        return copies

    def _put_parts(self, model: EngineModel, row: int) -> None:
        """Store columns and discs of added parts, which may have other arrays in every step."""
        columns = columns_of_parts(model) if self._part_rows else {}
        for name, rows in self._part_rows.items():
            values = columns.get(name, self.layout.of_parts[name])
            if name in columns and values.shape != rows.shape[1:]:
                raise RecordingError(f"{name} has values of shape {values.shape}; expected {rows.shape[1:]} as before")
            rows[row] = values
        if "shown" in self.layout.tables:
            self._drawn_discs[row] = discs_of(model)

    def batch(self, rows: int) -> pa.RecordBatch:
        """Return the first rows as an Arrow batch."""
        arrays = [pa.array(self.steps[:rows]), pa.array(self.hashes[:rows], pa.string())]
        arrays.append(_as_lists(np.broadcast_to(self._robots, (rows, len(self._robots)))))
        values = {**{name: values for name, (_, values) in self._robot_rows.items()}, **self._part_rows}
        arrays += [_as_lists(values[name][:rows]) for name in self.layout.columns]
        makers = {"fires": self._fire_table, "contacts": self._contact_table, "loads": self._load_table}
        makers |= {"fields": self._field_table, "events": self._event_table, "shown": self._shown_table}
        arrays += [makers[name](rows) for name in self.layout.tables]
        arrays += [_as_lists(pixels[:rows]) for pixels in self._pixels]
        return pa.record_batch(arrays, schema=self.layout.schema)

    def _buffers(self, columns: dict[str, np.ndarray], names: Sequence[str]) -> dict[str, tuple]:
        absent = [name for name in names if name not in columns]
        if absent:
            raise RecordingError(f"column {absent[0]!r} was removed after the recording began; start another one")
        type_of = self.layout.stored_type
        return {
            name: (columns[name], np.zeros((self.capacity, *columns[name].shape), type_of(columns[name].dtype)))
            for name in names
        }

    def _buffers_of_parts(self, robots: int) -> dict[str, np.ndarray]:
        rows = self.layout.of_parts.items()
        return {name: np.zeros((self.capacity, robots, *row.shape), row.dtype) for name, row in rows}

    def _picture_rows(self, name: str, field: ScalarField | PartPicture | None) -> np.ndarray:
        """Return a buffer for the pictures of a field."""
        picture, width = self.layout.pixels(field), self.layout.schema.field(PIXELS + name).type.value_type.list_size
        if field is not None and picture.shape[1] != width:
            raise RecordingError(
                f"field {name} has pictures of {picture.shape[1]} columns; expected {width} as when the recording "
                "began; start another recording"
            )
        return np.zeros((self.capacity, len(picture), width), picture.dtype)

    def _check_widths(self) -> None:
        for name, (source, _) in self._robot_rows.items():
            item_type = self.layout.schema.field(name).type.value_type
            if source.ndim == 2 and source.shape[1] != item_type.list_size:
                raise RecordingError(
                    f"{name} has {source.shape[1]} values a robot; expected {item_type.list_size} as when the "
                    "recording began; add robots of all designs before model.record(...)"
                )

    def _fire_table(self, rows: int) -> pa.Array:
        count = len(self._fires)
        columns = {name: values[:rows].ravel() for name, (_, values) in self._fire_rows.items()}
        x, y, radius = (np.tile(self._places[:, i], rows) for i in range(3))
        values = {"fire": np.tile(self._fires, rows), "x": x, "y": y, "radius": radius, **columns}
        return self._table("fires", np.full(rows, count), values)

    def _contact_table(self, rows: int) -> pa.Array:
        columns = {name: values[:rows] for name, (_, values) in self._contact_rows.items()}
        at_contact = np.nonzero(columns["collided"])
        kind, index, normal, depth = (columns[name][at_contact] for name in CONTACT[1:])
        values = {
            "robot": self._robots[at_contact[1]],
            "kind": kind,
            "other": self._ids_of(kind, index),
            "normal_x": normal[:, 0],
            "normal_y": normal[:, 1],
            "depth": depth,
        }
        return self._table("contacts", np.count_nonzero(columns["collided"], axis=1), values)

    def _ids_of(self, kind: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Return the unique_ids of the objects in contact: -1 for the border."""
        ids = np.full(len(kind), -1, np.int32)
        is_body = index != BORDER
        for of_kind, selection in (
            (self._robots, is_body & (kind == ROBOT)),
            (self._fires, is_body & (kind == FIRE)),
            (self._obstacles, is_body & (kind != ROBOT) & (kind != FIRE)),
        ):
            ids[selection] = of_kind[index[selection]]
        return ids

    def _load_table(self, rows: int) -> pa.Array:
        x, y, heading = (self._load_poses[:rows, :, i].ravel() for i in range(3))
        values = {"load": np.tile(self._loads, rows), "x": x, "y": y, "heading": heading}
        return self._table("loads", np.full(rows, len(self._loads)), values)

    def _field_table(self, rows: int) -> pa.Array:
        peak, total = (self._sums[:rows, :, i].ravel() for i in range(2))
        count = len(self._fields)
        values = {"field": np.tile(np.arange(count, dtype=np.int32), rows), "peak": peak, "total": total}
        return self._table("fields", np.full(rows, count), values)

    def _shown_table(self, rows: int) -> pa.Array:
        discs = np.concatenate([NO_DISCS, *self._drawn_discs[:rows]])
        values = dict(zip(TABLES["shown"], (discs[:, 0].astype(np.int32), *discs[:, 1:].T), strict=True))
        return self._table("shown", np.array([len(table) for table in self._drawn_discs[:rows]]), values)

    def _event_table(self, rows: int) -> pa.Array:
        first, end = self.event_counts[0], self.event_counts[rows]
        columns = zip(*self._log.rows(first, end), strict=True) if end > first else ((),) * len(TABLES["events"])
        return self._table(
            "events", np.diff(self.event_counts[: rows + 1]), dict(zip(TABLES["events"], columns, strict=True))
        )

    def _table(self, name: str, counts: np.ndarray, values: dict[str, Any]) -> pa.Array:
        row_type = self.layout.schema.field(name).type.value_type
        arrays = [pa.array(values[field.name], field.type) for field in row_type]
        struct = pa.StructArray.from_arrays(arrays, fields=list(row_type))
        return pa.ListArray.from_arrays(np.concatenate([[0], np.cumsum(counts)]).astype(np.int32), struct)


def _is_same(first: ScalarField | PartPicture | None, second: ScalarField | PartPicture | None) -> bool:
    """Return whether rows of one field fit behind those of another: it is the same, or a part's of the same shape."""
    if isinstance(first, PartPicture) and isinstance(second, PartPicture):
        return first.values.shape == second.values.shape
    return first is second


def field_type(field: str, real: type) -> np.dtype:
    """Return the type of a field of a table."""
    if field in EXACT:
        return np.dtype(EXACT[field])
    return np.dtype(np.bool_ if field == "out" else np.int32 if field in WHOLE else real)


def _arrow_type(name: str, dtype: np.dtype) -> pa.DataType:
    try:
        return pa.from_numpy_dtype(dtype)
    except pa.ArrowNotImplementedError:
        raise RecordingError(f"column {shortened(name)} is of type {dtype}; expected numbers or booleans") from None


def _ids(agents: Sequence) -> np.ndarray:
    return np.array([agent.unique_id for agent in agents], np.int32)


def _as_lists(rows: np.ndarray) -> pa.Array:
    """Return an array of shape (k, n, ...) as k lists of n values, or of n lists of a fixed length."""
    count, length = rows.shape[:2]
    values = pa.array(np.ascontiguousarray(rows).reshape(-1))
    for width in reversed(rows.shape[2:]):
        values = pa.FixedSizeListArray.from_arrays(values, width)
    return pa.ListArray.from_arrays(np.arange(count + 1, dtype=np.int32) * np.int32(length), values)


def _checked_names(columns: Sequence[str], known_names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(columns, str) or not all(isinstance(name, str) for name in columns):
        raise InvalidValueError(f"columns is {shortened(columns)}; expected names such as ('position', 'fires')")
    for name in columns:
        if name not in known_names:
            raise UnknownNameError(unknown_name("column", name, known_names))
        if name in FIRST_COLUMNS:
            raise InvalidValueError(f"column {name} has the name of a field of every row; give it another one")
    return tuple(dict.fromkeys(columns))
