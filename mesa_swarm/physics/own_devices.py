"""Custom sensors and actuators: their functions, called with the columns and numbers that they name."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import BehaviourError, InvalidValueError, SwarmError, UncompiledBehaviourWarning, shortened
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel, Prepared, kernel_of
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import RealRows
from mesa_swarm.physics.broadcasts import obstacles_of
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.actuators import ACT, Actuator
from mesa_swarm.robots.design import places_of_custom_sensors
from mesa_swarm.robots.devices import Device, DeviceFunction, device_function_of, own_function
from mesa_swarm.robots.sensors import Sensor
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.read_only import locked_view

# What functions may take of the surroundings.
OF_SCENE: dict[str, Callable] = {"obstacles": obstacles_of, "owners": lambda scene: scene.statics.owner}


class OwnDevices:
    """The sensors and actuators of a swarm with functions of their own, bound to the rows of their robots."""

    def __init__(self) -> None:
        self._version, self._prepared = -1, Prepared()
        self._readers: list[Reader] = []
        self._doers: list[Doer] = []

    def __getstate__(self) -> dict:
        """Leave out what is bound: a copied or unpickled model binds its devices again."""
        return vars(OwnDevices())

    def sense(self, model: Any, scene: Surroundings) -> None:
        """Read all custom sensors; robots without them read NaN."""
        swarm = model.swarm
        self._bind(model)
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
        state = swarm.version, scene
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
        self._bind(model)
        self._check_set(model)
        for doer in self._doers:
            _call_device(doer.act, doer.actuator, model, scene)

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

    def _bind(self, model: Any) -> None:
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
    """What `clear_column` takes: a column of readings."""

    column: RealRows


@compiled(nogil=True)
def clear_column(block, step, first, last):
    """Let all robots read nothing, NaN."""
    unpack(block, ColumnArray).column[:] = np.nan
    return 0


def _clearing(column: np.ndarray) -> Kernel:
    block = Block(ColumnArray(column))
    return Kernel(clear_column, block.numbers, block)


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
        of_function = kernel_of(self.sensor, "read", *place)
        return of_function and kernel_of(self.sensor, "arguments", *place)

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
        self._asks = type(device).arguments is not Device.arguments
        self._all = len(rows) == len(swarm)
        self._sources: list[Callable] | None = None

    def __call__(self, model: Any, scene: Surroundings, arguments: dict) -> None:
        """Call the function for the present state."""
        if self._asks:
            arguments = {**self._arguments(model), **arguments}
        if self._sources is None:
            known_names = *arguments, *OF_SCENE, "rows"
            self._swarm.check_takes(self._device, self.compiled.function, known_names)
            self._sources = [self._source(name, arguments) for name in self.compiled.takes]
        self.compiled(*[source(arguments, scene) for source in self._sources])

    def _arguments(self, model: Any) -> Mapping[str, Any]:
        more = self._device.arguments(model)
        if not isinstance(more, Mapping):
            raise InvalidValueError(
                f"{type(self._device).__name__}.arguments returned {shortened(more)}; expected a dict by name"
            )
        return more

    def _source(self, name: str, arguments: Mapping) -> Callable:
        """Return a function that finds the value of a parameter in what is given at each call and the surroundings."""
        if name in arguments:
            return lambda arguments, scene: arguments[name]
        if name == "rows":
            return lambda arguments, scene: self._rows
        if name in OF_SCENE:
            return lambda arguments, scene: OF_SCENE[name](scene)
        if hasattr(self._device, name):
            value = getattr(self._device, name)
            return lambda arguments, scene: value
        column = locked_view(self._swarm.columns[name])
        if self._all:
            return lambda arguments, scene: column
        return lambda arguments, scene: locked_view(column[self._rows])


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
