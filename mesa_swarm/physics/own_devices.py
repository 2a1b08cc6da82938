"""Custom sensors and actuators: their functions, called with the columns and numbers that they name."""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import BehaviourError, InvalidValueError, SwarmError, UncompiledBehaviourWarning, shortened
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.custom_kernels import kernel_of_function
from mesa_swarm.kernels.draws import Stream
from mesa_swarm.kernels.part import Kernel, Prepared, kernel_of
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import ByteRows, Integers, RealRows
from mesa_swarm.physics.broadcasts import obstacles_of
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.actuators import ACT, Actuator
from mesa_swarm.robots.design import places_of_custom_sensors
from mesa_swarm.robots.devices import Device, DeviceFunction, device_function_of, own_function
from mesa_swarm.robots.sensors import Sensor
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.read_only import locked_view, writable_view

# Begins the names of columns of layers.
OF_LAYERS = "control_"
# The parameter of a sensor's function that it fills.
OUT = "out"
# What functions may take of the surroundings.
OF_SCENE: dict[str, Callable] = {"obstacles": obstacles_of, "owners": lambda scene: scene.statics.owner}


class OwnDevices:
    """The sensors and actuators of a swarm with functions of their own, bound to the rows of their robots."""

    def __init__(self) -> None:
        self._version, self._prepared, self._of_actuators = -1, Prepared(), Prepared()
        self._readers: list[Reader] = []
        self._doers: list[Doer] = []

    def __getstate__(self) -> dict:
        """Leave out what is bound: a copied or unpickled model binds its devices again."""
        return vars(OwnDevices())

    def sense(self, model: Any, scene: Surroundings) -> None:
        """Read all custom sensors; robots without them read NaN."""
        swarm = model.swarm
        self.bind(model)
        kernel = self.sensing(model, scene)
        if kernel is not None:
            kernel.run(model.completed + 1, len(swarm))
            return
        for name in swarm.table.readings:
            swarm.columns[name].fill(np.nan)
        for reader in self._readers:
            _call_device(reader.read, reader.sensor, model, scene)

    def sensing(self, model: Any, scene: Surroundings) -> Kernel | None:
        """Return the kernel that reads all custom sensors, None where one has none, or has not been read yet."""
        swarm, prepared = model.swarm, self._prepared
        if self._version != swarm.version:
            return None
        state = swarm.version, scene, [reader.places(model) for reader in self._readers]
        if prepared.state != state:
            kernels = [reader.kernel(model) for reader in self._readers]
            prepared.state, prepared.kernel = state, None
            if None not in kernels:
                clearing = [_clearing(swarm.columns[name]) for name in swarm.table.readings]
                prepared.kernel = sequence_of([*clearing, *(kernel for kernel in kernels if kernel is not None)])
        return prepared.kernel

    def without_kernels(self, model: Any) -> list[str]:
        """Return the names of the custom sensors that have no kernel."""
        return [reader.sensor.name for reader in self._readers if reader.kernel(model) is None]

    def act(self, model: Any, scene: Surroundings) -> None:
        """Let all actuators do what is set."""
        self.bind(model)
        kernel = self.acting(model, scene)
        if kernel is not None:
            kernel.run(model.completed + 1, len(model.swarm))
            return
        self._check_set(model)
        for doer in self._doers:
            _call_device(doer.act, doer.actuator, model, scene)

    def acting(self, model: Any, scene: Surroundings) -> Kernel | None:
        """Return the kernel of all actuators, None where one has none, or nothing was done by them yet."""
        swarm, prepared = model.swarm, self._of_actuators
        if self._version != swarm.version:
            return None
        state = swarm.version, scene
        if prepared.state != state:
            kernels = [doer.kernel(model) for doer in self._doers]
            prepared.state, prepared.kernel = state, None
            if None not in kernels:
                checks = [self._check_of(model, name) for name in swarm.table.actions]
                prepared.kernel = sequence_of([*checks, *(kernel for kernel in kernels if kernel is not None)])
        return prepared.kernel

    def actuators_without_kernels(self, model: Any) -> list[str]:
        """Return the names of the actuators that have no kernel."""
        return [doer.actuator.name for doer in self._doers if doer.kernel(model) is None]

    def _check_of(self, model: Any, name: str) -> Kernel:
        """Return the kernel that refuses numbers to which actuators are set that are not finite."""
        column = model.swarm.columns[f"{ACT}{name}"]
        block = Block(ColumnArray(column.reshape(len(column), math.prod(column.shape[1:]))))
        return Kernel(check_column, block.numbers, block, lambda code: self._check_set(model))

    def _check_set(self, model: Any) -> None:
        """Refuse numbers that are not finite: what they do cannot be undone."""
        for name in model.swarm.table.actions:
            column = model.swarm.columns[f"{ACT}{name}"]
            if not np.isfinite(column).all():
                row = int(np.argmin(np.isfinite(column).reshape(len(column), -1).all(axis=1)))
                raise BehaviourError(
                    f"act.{name} of robot {model.swarm.agents[row].unique_id} is {shortened(column[row])} in step "
                    f"{model.steps}; expected finite numbers"
                )

    def bind(self, model: Any) -> None:
        """Find the rows of the robots of each device, after a check of what it needs."""
        swarm = model.swarm
        if self._version == swarm.version:
            return
        for design in dict.fromkeys(swarm.designs):
            for device in (*design.sensors, *design.actuators):
                device.check_bodies(model)
        self._readers = [Reader(swarm, sensor, first, rows) for sensor, first, rows in _sensors_by_rows(swarm)]
        self._doers = [Doer(swarm, actuator, rows) for actuator, rows in _actuators_by_rows(swarm)]
        self._version = swarm.version
        model.parts.replan()  # what was not bound has no kernels


class ColumnArray(NamedTuple):
    """What `clear_column` and `check_column` take: a column."""

    column: RealRows


@compiled(nogil=True)
def clear_column(block, step, first, last):
    """Let all robots read nothing, NaN."""
    unpack(block, ColumnArray).column[:] = np.nan
    return 0


@compiled(nogil=True)
def check_column(block, step, first, last):
    """Return whether any number is not finite."""
    column = unpack(block, ColumnArray).column
    for i in range(column.shape[0]):
        for w in range(column.shape[1]):
            if not math.isfinite(column[i, w]):
                return 1
    return 0


def _clearing(column: np.ndarray) -> Kernel:
    block = Block(ColumnArray(column))
    return Kernel(clear_column, block.numbers, block)


class GatherArrays(NamedTuple):
    """What `gather_bytes` takes: rows of a column as bytes, which of them, and rows for these."""

    column: ByteRows
    rows: Integers
    part: ByteRows


class ScatterArrays(NamedTuple):
    """What `scatter_reals` takes: rows, which rows of a column they are, and where theirs begin in it."""

    part: RealRows
    rows: Integers
    column: RealRows
    first: int


@compiled(nogil=True)
def gather_bytes(block, step, first, last):
    """Copy some rows of a column."""
    g = unpack(block, GatherArrays)
    for i in range(g.rows.shape[0]):
        for k in range(g.column.shape[1]):
            g.part[i, k] = g.column[g.rows[i], k]
    return 0


@compiled(nogil=True)
def scatter_reals(block, step, first, last):
    """Copy rows back into a column."""
    s = unpack(block, ScatterArrays)
    for i in range(s.rows.shape[0]):
        for k in range(s.part.shape[1]):
            s.column[s.rows[i], s.first + k] = s.part[i, k]
    return 0


def gather_rows(column: np.ndarray, rows: np.ndarray, part: np.ndarray) -> Kernel:
    """Return the kernel that copies rows of a column, of any type, into an array."""
    block = Block(GatherArrays(_as_bytes(column), np.array(rows), _as_bytes(part)))
    return Kernel(gather_bytes, block.numbers, (block, column, part))


def scatter_rows(part: np.ndarray, rows: np.ndarray, column: np.ndarray, first: int) -> Kernel:
    """Return the kernel that copies an array into rows of a column, from a place in each on."""
    block = Block(ScatterArrays(part, np.array(rows), column, first))
    return Kernel(scatter_reals, block.numbers, (block, part, column))


def _as_bytes(array: np.ndarray) -> np.ndarray:
    """Return the bytes of an array, a row for each of its rows, that can be written to."""
    row_bytes = array.nbytes // max(len(array), 1)
    return writable_view(array).view(np.uint8).reshape(len(array), row_bytes)


class Reader:
    """A sensor, the rows of the robots that have it, and its place in its column."""

    def __init__(self, swarm: Swarm, sensor: Sensor, first: int, rows: np.ndarray) -> None:
        self.sensor, self.rows = sensor, rows
        column = self._column = swarm.columns[sensor.name]
        self._first = first
        width = int(sensor.width)
        self._call = Call(swarm, sensor, "read", rows)
        self._place = column[:, first : first + width]
        self._whole = len(rows) == len(swarm) and column.shape[1] == width
        self._out = column if self._whole else np.empty((len(rows), width))

    def kernel(self, model: Any) -> Kernel | None:
        """Return the kernel that writes the readings, if the class of the sensor has one that does what it does."""
        place = model, self.rows, self._column, self._first
        of_class = kernel_of(self.sensor, "read", *place) and kernel_of(self.sensor, "arguments", *place)
        return of_class or self._kernel_of_function(model)

    def places(self, model: Any) -> Any:
        """Return where the arrays of other parts are that its function takes: they may be replaced."""
        arrays = [value for value in self._call.values(model) or () if isinstance(value, np.ndarray)]
        return [array.ctypes.data for array in arrays]

    def _kernel_of_function(self, model: Any) -> Kernel | None:
        """Return the kernel of its own function, None where that takes something that is Python, or is not compiled."""
        values = self._call.values(model)
        if values is None:
            return None
        names = self._call.compiled.takes
        given = {name: value for name, value in zip(names, values, strict=True) if name != OUT}
        before, after = [], []
        if not self._call.of_all:
            for name in self._call.of_robots:
                part = given[name] = np.empty((len(self.rows), *given[name].shape[1:]), given[name].dtype)
                before.append(gather_rows(values[names.index(name)], self.rows, part))
        if not self._whole:
            before.append(_clearing(self._out))
            after.append(scatter_rows(self._out, self.rows, self._column, self._first))
        made = kernel_of_function(self._call.compiled.function, names, {**given, OUT: self._out})
        if made.code is None:
            return None
        block = Block(made.arrays(*given.values(), self._out, Stream(0, 0)))
        kernel = Kernel(made.code, block.numbers, block, partial(self._fail, model))
        return sequence_of([*before, kernel, *after])

    def _fail(self, model: Any, code: int) -> None:
        """Raise the error of its function, which is called once more for it."""
        _call_device(self.read, self.sensor, model, model.parts.bodies.scene())
        raise BehaviourError(f"sensor {self.sensor.name} failed in step {model.steps}: it raised an error")

    def read(self, model: Any, scene: Surroundings) -> None:
        """Write the readings."""
        self._out.fill(np.nan)
        self._call(model, scene, {"out": self._out})
        if not self._whole:
            self._place[self.rows] = self._out


class Doer:
    """An actuator and the rows of the robots that have it."""

    def __init__(self, swarm: Swarm, actuator: Actuator, rows: np.ndarray) -> None:
        self.actuator, self.rows = actuator, rows
        self._column = swarm.columns[f"{ACT}{actuator.name}"]
        self._call = None if own_function(actuator, "act") is None else Call(swarm, actuator, "act", rows)

    def kernel(self, model: Any) -> Kernel | None:
        """Return the kernel that does what the robots have set, if the class of the actuator has one."""
        if self._call is not None:
            return None
        return kernel_of(self.actuator, "apply", model, self.rows)

    def act(self, model: Any, scene: Surroundings) -> None:
        """Do what the robots in these rows have set."""
        if self._call is not None:
            self._call(model, scene, {"value": locked_view(self._column[self.rows])})
        self.actuator.apply(model, self.rows)


class Call:
    """A device's function of arrays, and where the values come from that its parameters name."""

    def __init__(self, swarm: Swarm, device: Device, function: str, rows: np.ndarray) -> None:
        self.compiled: DeviceFunction = device_function_of(own_function(device, function))
        self._device, self._swarm, self._rows = device, swarm, rows
        # Columns of the swarm that it takes, of which it gets the rows of its robots.
        self.of_robots = [name for name in self.compiled.takes if self._is_of_robots(name)]
        self._asks = type(device).arguments is not Device.arguments
        self.of_all = len(rows) == len(swarm)
        self._sources: list[Callable] | None = None

    def __call__(self, model: Any, scene: Surroundings, arguments: dict) -> None:
        """Call the function for the present state."""
        if self._asks:
            arguments = {**self._arguments(model), **arguments}
        if self._sources is None:
            known_names = *arguments, *OF_SCENE, "rows", *names_of_parts(model)
            self._swarm.check_takes(self._device, self.compiled.function, known_names)
            self._sources = [self._source(name, arguments, model) for name in self.compiled.takes]
        self.compiled(*[source(arguments, scene) for source in self._sources])

    def _is_of_robots(self, name: str) -> bool:
        return name in self._swarm.columns and name not in (OUT, "rows", *OF_SCENE) and not hasattr(self._device, name)

    def values(self, model: Any) -> list[Any] | None:
        """Return what a kernel of it takes: columns whole, None for `out`; None where something is Python."""
        if self._asks:
            return None
        found: list[Any] = []
        for name in self.compiled.takes:
            if name in OF_SCENE:
                return None
            try:
                value = self._value(model, name)
            except KeyError:  # which the first reading refuses in words
                return None
            if name != OUT and not isinstance(value, (np.ndarray, float, int, bool)):
                return None
            if isinstance(value, np.ndarray) and not value.flags.c_contiguous:
                return None
            found.append(value)
        return found

    def _value(self, model: Any, name: str) -> Any:
        if name == OUT:
            return None
        if name == "rows":
            return self._rows
        if hasattr(self._device, name):
            return getattr(self._device, name)
        column = self._swarm.columns.get(name)
        return locked_view(array_of_parts(model, name) if column is None else column)

    def _arguments(self, model: Any) -> Mapping[str, Any]:
        more = self._device.arguments(model)
        if not isinstance(more, Mapping):
            raise InvalidValueError(
                f"{type(self._device).__name__}.arguments returned {shortened(more)}; expected a dict by name"
            )
        return more

    def _source(self, name: str, arguments: Mapping, model: Any) -> Callable:
        """Return a function that finds the value of a parameter in what is given at each call and the surroundings."""
        if name in arguments:
            return lambda arguments, scene: arguments[name]
        if name in OF_SCENE:
            return lambda arguments, scene: OF_SCENE[name](scene)
        if self.of_all or not self._is_of_robots(name):
            return lambda arguments, scene: self._value(model, name)
        return lambda arguments, scene: locked_view(self._swarm.columns[name][self._rows])


def names_of_parts(model: Any) -> Iterator[str]:
    """Iterate over the names by which functions take arrays of parts and of processes, see `array_of_parts`."""
    for part_name, part in model.parts.items():
        if part_name != "robots":
            yield from (f"{part_name}_{name}".replace(".", "_") for name in part.columns())
    yield from (f"{OF_LAYERS}{name}" for name in columns_of_layers(model))
    for process in model.parts.processes.numbered.values():
        name = getattr(process, "__name__", "")
        yield from (f"{name}_{remembered}" for remembered in getattr(process, "memory", ()) if name)


def columns_of_layers(model: Any) -> dict[str, np.ndarray]:
    """Return the columns of layers that only one layer has, by their names without its."""
    found: dict[str, list[np.ndarray]] = {}
    for name, column in model.parts["control"].columns().items():
        _, is_of_layer, own = name.rpartition(".")
        if is_of_layer:
            found.setdefault(own, []).append(column.array)
    return {name: arrays[0] for name, arrays in found.items() if len(arrays) == 1}


def array_of_parts(model: Any, name: str) -> np.ndarray:
    """Return the column of another part, ``boards_read``, or what a process remembers, ``task_stimulus``.

    Of a column that only one layer has its own name is enough, ``control_temperature``.

    Raises
    ------
    KeyError
        If there is none of this name.
    """
    for part_name, part in model.parts.items():
        for column_name, column in part.columns().items() if name.startswith(f"{part_name}_") else ():
            if f"{part_name}_{column_name}".replace(".", "_") == name:
                return column.array
    if name.startswith(OF_LAYERS) and (array := columns_of_layers(model).get(name.removeprefix(OF_LAYERS))) is not None:
        return array
    for process in model.parts.processes.numbered.values():
        for remembered, array in getattr(process, "memory", {}).items():
            if f"{getattr(process, '__name__', '')}_{remembered}" == name:
                return array
    raise KeyError(name)


def _rows_with(swarm: Swarm, has: list[bool]) -> np.ndarray:
    """Return the rows of the robots whose designs have something, in ascending order."""
    return locked_view(np.flatnonzero(np.array(has, np.bool_)[swarm.columns["design"]]))


def _sensors_by_rows(swarm: Swarm) -> Iterator[tuple[Sensor, int, np.ndarray]]:
    """Yield each sensor and where in its column it writes, with the rows of the robots that have it there."""
    places = [places_of_custom_sensors(design) for design in swarm.designs]
    for place in dict.fromkeys(place for of_design in places for place in of_design):
        rows = _rows_with(swarm, [place in of_design for of_design in places])
        if len(rows):
            yield *place, rows


def _actuators_by_rows(swarm: Swarm) -> Iterator[tuple[Actuator, np.ndarray]]:
    for actuator in dict.fromkeys(actuator for design in swarm.designs for actuator in design.actuators):
        rows = _rows_with(swarm, [actuator in design.actuators for design in swarm.designs])
        if len(rows):
            yield actuator, rows


def _call_device(do: Callable, device: Device, model: Any, scene: Surroundings) -> None:
    """Call a function of the user's; an error of it becomes one line that names the device."""
    try:
        do(model, scene)
    except (SwarmError, UncompiledBehaviourWarning):
        raise
    except Exception as error:
        problem = " ".join(f"{type(error).__name__}: {error}".split())
        kind = "sensor" if isinstance(device, Sensor) else "actuator"
        raise BehaviourError(f"{kind} {device.name} failed in step {model.steps}: it raised {problem}") from error
