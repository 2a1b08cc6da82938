"""The swarm: one array per property of the robots, one row per robot."""

import math
import warnings
from collections.abc import Iterable, Sequence
from inspect import get_annotations
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, unknown_name
from mesa_swarm.robots.actuators import check_device_actions
from mesa_swarm.robots.design import DesignTable, RobotDesign
from mesa_swarm.robots.devices import RESERVED, Device, argument_names, check_identifier, own_function, reserve_names
from mesa_swarm.world.arena import Agents
from mesa_swarm.world.read_only import locked_view, read_only
from mesa_swarm.world.statics import BORDER, ROBOT

# Columns with names that begin so stay when those of layers are dropped: they belong to the robots' bodies.
LASTING = "body."
# The last fresh readings of custom sensors.
LAST_READ = f"{LASTING}read."
# Which sensors failed, in the order of the design's, and which wheels, as one of `WHEELS`.
FAILED_SENSORS, FAILED_WHEELS = f"{LASTING}failed_sensors", f"{LASTING}failed_wheels"
WHEELS = ("works", "stuck", "free")
# What copies and pickles make anew.
LEFT_OUT = ("listed", "_identified")
NOT_IDENTIFIED: tuple[None, NDArray[np.int64]] = (None, np.empty(0, np.int64))
# What robots send and hear.
MESSAGES = ("task", "goal", "sent_goal", "heard_layer", "heard_task", "heard_from", "heard_goal")


def _column(shape: tuple[int | str, ...], dtype: type, initial: object) -> Any:
    """Declare a column: its shape after the row, its type, and the value of a new robot.

    A string in the shape names a width that the designs decide. The declarations are removed from the class once
    `COLUMNS` has them: an attribute is an array or does not exist.
    """
    return shape, dtype, initial


# How often columns of any swarm of this process were made again.
RESIZED = [0]


class Swarm:
    """All robots of a model as columns; row order is ascending unique_id.

    Every column can be read as an attribute (`swarm.position`, `swarm.heading` ...) and is read-only: to
    change a robot, set the property of its handle (`model.robots[0].position = ...`). Rows move only when
    robots are added or removed, between two steps; a view that was taken earlier then shows the past.

    Attributes
    ----------
    number : int64 ndarray, shape (n,)
        Counts the robots from 0 in the order in which they were added; robots that are removed leave gaps.
    design : int64 ndarray, shape (n,)
        Index in `designs`.
    group : int64 ndarray, shape (n,)
        Index in `groups`, -1 for none.
    position : ndarray, shape (n, 2), map units
    heading : ndarray, shape (n,), rad in [-pi, pi)
    command, last_command : ndarrays, shape (n, w)
        Commanded rim speeds left and right, map units a step; those of the step before. As many numbers as the widest
        drive has; those that a robot's drive does not have are 0.
    layer : int64 ndarray, shape (n,)
        Index of the layer that won, -1 if none was active.
    task : int64 ndarray, shape (n,)
        The robot's task, as its layers number it, -1 for nothing.
    goal : ndarray, shape (n, 2)
        The position of that task, in its own frame when it decided (x ahead, y left), NaN for none.
    sent_goal : ndarray, shape (n, 2)
        Where that is on the map; NaN without communication.
    heard_layer, heard_task : int64 ndarrays, shape (n,)
        Of the nearest robot heard that has a task, -1 for none.
    heard_from, heard_goal : ndarrays, shape (n, 2)
        Where that robot is, and the nearest goal heard, both in the hearer's frame, NaN for none.
    distance, kind : ndarrays, shape (n, s)
        What the proximity sensors read: distance, -1 for nothing; 0 obstacle, 1 robot, 2 fire, 3 load,
        -1 nothing.
    error : ndarray, shape (n, s)
        The relative error of each proximity sensor that is held at present.
    radiation : ndarray, shape (n, q)
        The highest temperature of a fire in the sector of each radiation sensor, 0 to 1, 0 for none.
    line : bool ndarray, shape (n, l)
        Whether each line sensor is over a mark on the ground.
    slip : ndarray, shape (n, w)
        (m - v) / m of each wheel, 0 where m = 0 (A.5). The truth; robots do not know it.
    collided : bool ndarray, shape (n,)
        Whether the robot overlapped anything during the step.
    contact_kind, contact_index : int64 ndarrays, shape (n,)
        Of its deepest contact: 0 obstacle or border, 1 robot, 2 fire, 3 load, -1 for none; and the row of that body.
    contact_normal, contact_depth : ndarrays, shapes (n, 2), (n,)
        The unit vector from that body to the robot, and how far they overlapped, map units.
    temperature, heat : ndarrays, shape (n,)
        Of the robot, and what it took from a fire in this step.
    hot : bool ndarray, shape (n,)
        Too hot to fight.
    fire : int64 ndarray, shape (n,)
        Index of the fire that it fights, -1 for none.
    radius, max_speed, tendency : ndarrays, shape (n,)
        In map units, and map units a step; the tendency is +1 for left, -1 for right.

    Custom sensors, actuators and messages have columns as well: ``swarm.compass``, ``swarm.columns["act.grip"]``,
    ``swarm.columns["heard.count"]``.

    Examples
    --------
    >>> Swarm().position.shape
    (0, 2)
    """

    number: NDArray[np.int64] = _column((), np.int64, 0)
    design: NDArray[np.int64] = _column((), np.int64, 0)
    group: NDArray[np.int64] = _column((), np.int64, -1)
    position: NDArray[np.float64] = _column((2,), np.float64, 0.0)
    heading: NDArray[np.float64] = _column((), np.float64, 0.0)
    radius: NDArray[np.float64] = _column((), np.float64, 0.0)
    max_speed: NDArray[np.float64] = _column((), np.float64, 0.0)
    tendency: NDArray[np.float64] = _column((), np.float64, 1.0)
    distance: NDArray[np.float64] = _column(("proximity",), np.float64, -1.0)
    kind: NDArray[np.int8] = _column(("proximity",), np.int8, -1)
    error: NDArray[np.float64] = _column(("proximity",), np.float64, 0.0)
    radiation: NDArray[np.float64] = _column(("radiation",), np.float64, 0.0)
    line: NDArray[np.bool] = _column(("line",), np.bool_, False)
    command: NDArray[np.float64] = _column(("wheels",), np.float64, 0.0)
    last_command: NDArray[np.float64] = _column(("wheels",), np.float64, 0.0)
    layer: NDArray[np.int64] = _column((), np.int64, -1)
    task: NDArray[np.int64] = _column((), np.int64, -1)
    goal: NDArray[np.float64] = _column((2,), np.float64, math.nan)
    sent_goal: NDArray[np.float64] = _column((2,), np.float64, math.nan)
    heard_layer: NDArray[np.int64] = _column((), np.int64, -1)
    heard_task: NDArray[np.int64] = _column((), np.int64, -1)
    heard_from: NDArray[np.float64] = _column((2,), np.float64, math.nan)
    heard_goal: NDArray[np.float64] = _column((2,), np.float64, math.nan)
    slip: NDArray[np.float64] = _column(("wheels",), np.float64, 0.0)
    collided: NDArray[np.bool] = _column((), np.bool_, False)
    contact_kind: NDArray[np.int64] = _column((), np.int64, -1)
    contact_index: NDArray[np.int64] = _column((), np.int64, -1)
    contact_normal: NDArray[np.float64] = _column((2,), np.float64, 0.0)
    contact_depth: NDArray[np.float64] = _column((), np.float64, 0.0)
    temperature: NDArray[np.float64] = _column((), np.float64, 0.0)
    heat: NDArray[np.float64] = _column((), np.float64, 0.0)
    hot: NDArray[np.bool] = _column((), np.bool_, False)
    fire: NDArray[np.int64] = _column((), np.int64, -1)

    def __init__(self) -> None:
        self.table = DesignTable.of(())
        self.agents: list = []  # replaced, never changed in place
        self._identified: tuple[list | None, NDArray[np.int64]] = NOT_IDENTIFIED
        self.listed: WeakValueDictionary[int, Agents] = WeakValueDictionary()  # sets that refer to this list
        self.disturbances = np.zeros(1, np.bool_)  # also for compiled functions
        self.version = 0
        self.groups: tuple[str, ...] = ()
        self.regrouped = 0
        self.battery_life = 0.0  # of robots whose design does not state it, steps at full speed, 0 for without end
        self.robots_created = 0
        self._memory: dict[str, tuple[tuple, type, object]] = {}
        self._messages: dict[str, tuple[tuple, type, object]] = {}
        self.columns: dict[str, np.ndarray] = {}
        self._resize(np.empty(0, np.int64), 0)

    def __getstate__(self) -> dict:
        """Leave out the views of columns, which would be stored as copies, and what looks at the robots."""
        left_out = {*self.columns, *LEFT_OUT}
        return {name: value for name, value in self.__dict__.items() if name not in left_out}

    def __setstate__(self, state: dict) -> None:
        """Give a copied or unpickled swarm views of its own columns."""
        self.__dict__.update(state, listed=WeakValueDictionary(), _identified=NOT_IDENTIFIED)
        for name, column in self.columns.items():
            self._publish(name, column)

    def __repr__(self) -> str:
        names = ", ".join(design.name for design in self.designs)
        return f"<Swarm of {len(self)} robots{f' ({names})' if names else ''}>"

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse to replace a column: another array in the place of a view would change no robot."""
        if name in COLUMNS:
            raise InvalidValueError(
                f"swarm.{name} cannot be replaced; change a robot by its handle, as in model.robots[0].heading = 0.5"
            )
        super().__setattr__(name, value)

    @property
    def disturbed(self) -> bool:
        """Whether robots may overlap anything since the last step: by hand, or as bodies have changed."""
        return bool(self.disturbances[0])

    @disturbed.setter
    def disturbed(self, is_so: bool) -> None:
        self.disturbances[0] = is_so

    def __len__(self) -> int:
        """How many robots there are."""
        return len(self.agents)

    @property
    def designs(self) -> tuple[RobotDesign, ...]:
        """The designs present; the column `design` holds indices into them."""
        return self.table.designs

    @property
    def unique_ids(self) -> NDArray[np.int64]:
        """The unique_id of each robot, shape (n,), read-only."""
        agents, ids = self._identified
        if agents is not self.agents:
            ids = np.array([robot.unique_id for robot in self.agents], np.int64)
            ids.flags.writeable = False
            self._identified = self.agents, ids
        return ids

    @property
    def battery(self) -> NDArray[np.float64]:
        """How full each robot's battery is, shape (n,), from 1 down to 0; 1 for robots without one.

        Examples
        --------
        >>> from dataclasses import replace
        >>> from mesa_swarm import AGENT3, SwarmModel
        >>> from mesa_swarm.control import Explore, Subsumption
        >>> model = SwarmModel(rng=1)
        >>> robots = model.add_robots(replace(AGENT3, battery=1000), poses=[(100, 300, 0.0)])
        >>> model.control = Subsumption(Explore())
        >>> model.run(250).swarm.battery
        array([0.75])
        """
        life = self.table.battery[self.columns["design"]]
        life = np.where(life > 0.0, life, self.battery_life)
        consumption = self.columns.get(f"{LASTING}used", np.zeros(len(life)))
        share = np.divide(consumption, life, out=np.zeros(len(life)), where=life > 0.0)
        return read_only(np.clip(1.0 - share, 0.0, 1.0))

    def add_failures(self) -> None:
        """Make the columns of sensors and wheels that failed."""
        self.remember(FAILED_SENSORS, ("sensors",), np.bool_, False)
        self.remember(FAILED_WHEELS, ("wheels",), np.int8, 0)

    def add(
        self, design: RobotDesign, position: np.ndarray, heading: np.ndarray, tendency: np.ndarray, group: str = ""
    ) -> np.ndarray:
        """Append robots of one design and group and return their rows; their handles are set by the caller."""
        if design not in self.designs:
            self.check_devices(design)
            self.table = DesignTable.of((*self.designs, design))
        old, new = len(self.columns["position"]), len(position)
        self._resize(np.arange(old), new)
        rows = slice(old, old + new)
        for name, values in {
            "number": np.arange(self.robots_created, self.robots_created + new),
            "design": self.designs.index(design),
            "group": self._index_of(group),
            "position": position,
            "heading": heading,
            "radius": design.radius,
            "max_speed": design.max_speed,
            "tendency": tendency,
        }.items():
            self.columns[name][rows] = values
        self.robots_created += new
        return np.arange(old, old + new)

    def check_devices(self, design: RobotDesign) -> None:
        """Refuse a design whose sensors or actuators do not fit those of the other robots.

        Raises
        ------
        InvalidValueError
            If a sensor has the name of a layer's memory, takes what does not exist, or an actuator takes other numbers
            than that of the same name of another design.
        """
        check_device_actions(actuator for other in (*self.designs, design) for actuator in other.actuators)
        for sensor in design.own:
            check_identifier(f"name of sensor {type(sensor).__name__}", sensor.name, RESERVED)
            if sensor.name not in self.table.readings and hasattr(self, sensor.name):
                raise InvalidValueError(f"sensor {sensor.name} has the name of something else of the swarm; rename it")
            if type(sensor).arguments is Device.arguments:
                self.check_takes(sensor, own_function(sensor, "read"), ("out", *names_that_may_come(sensor)))

    def check_takes(self, device: Device, function: Any, known_names: Iterable[str]) -> None:
        """Refuse a function of arrays that takes something unknown; `known_names` are more names that there are.

        Raises
        ------
        UnknownNameError
        """
        own = [name for name in dir(device) if not name.startswith("_") and not callable(getattr(device, name))]
        columns = (name for name in self.columns if name.isidentifier())
        names = sorted({*own, *columns, *known_names, "rows", "obstacles", "owners"})
        for name in argument_names(function):
            if name not in names:
                of = f"{type(device).__name__}.{function.__name__}"
                raise UnknownNameError(unknown_name(f"parameter of {of}", name, names))

    def remove(self, rows: Sequence[int]) -> None:
        """Drop rows; the handles of the other robots get their new rows."""
        removed_rows = np.unique(np.array(rows, np.int64))
        others = np.delete(np.arange(len(self.agents)), removed_rows)
        self.forget_contacts(ROBOT, removed_rows)
        for agent_set in list(self.listed.values()):
            agent_set.settle()
        for row in removed_rows.tolist():
            self.agents[row].row = -1
        self.agents = [self.agents[row] for row in others.tolist()]
        for row, agent in enumerate(self.agents):
            agent.row = row
        self._resize(others, 0)

    def forget_contacts(self, kind: int, removed: np.ndarray) -> None:
        """Adapt the indices of what robots met in the last step: bodies of a kind, indices ascending, were removed."""
        index = self.columns["contact_index"]
        rows = np.flatnonzero((self.columns["contact_kind"] == kind) & (index >= removed[0]))
        before = index[rows]
        index[rows] = np.where(np.isin(before, removed), BORDER, before - np.searchsorted(removed, before))

    def set_group(self, row: int, group: str) -> None:
        """Move a robot to a group, "" for none."""
        self.columns["group"][row] = self._index_of(group)
        self.regrouped += 1

    def _index_of(self, group: str) -> int:
        """Return the index of a group, which is made if it is new, -1 for none."""
        if group and group not in self.groups:
            self.groups = (*self.groups, group)
        return self.groups.index(group) if group else -1

    def remember(self, name: str, shape: tuple[int | str, ...], dtype: type, initial: object) -> np.ndarray:
        """Return the column of a layer's memory of each robot, made if it is new."""
        if name not in self.columns:
            self._memory[name] = (shape, dtype, initial)
            self._resize(np.arange(len(self.columns["position"])), 0)
        return self.columns[name]

    @property
    def memory_columns(self) -> dict[str, tuple[tuple, type, object]]:
        """The columns that layers and others remember in: shape, type and first value of each by name."""
        return dict(self._memory)

    def set_designs(self, designs: Iterable[RobotDesign]) -> None:
        """Have these designs in this order, to which the column `design` refers; columns get their widths."""
        self.table = DesignTable.of(tuple(designs))
        self._resize(np.arange(len(self)), 0)

    def forget(self) -> None:
        """Drop the columns of all layers."""
        for name in [name for name in self._memory if not name.startswith(LASTING)]:
            self._drop(name)
        self.version += 1

    def drop_body_columns(self) -> None:
        """Drop the columns that belong to the robots' bodies."""
        for name in [name for name in self._memory if name.startswith(LASTING)]:
            self._drop(name)
        self._resize(np.arange(len(self.columns["position"])), 0)

    def _drop(self, name: str) -> None:
        del self.columns[name], self._memory[name], self.__dict__[name]

    def set_messages(self, columns: dict[str, tuple[tuple, type, object]]) -> None:
        """Replace the columns of custom messages: shape, type and first value of each by name."""
        if columns != self._messages:
            self._messages = columns
            self._resize(np.arange(len(self.columns["position"])), 0)

    def clear_messages(self) -> None:
        """Clear all that robots have sent and heard."""
        for name in MESSAGES:
            self.columns[name].fill(COLUMNS[name][2])
        for name, (_, _, initial) in self._messages.items():
            self.columns[name].fill(initial)

    def shed(self) -> None:
        """Drop the columns of bodies; deprecated, see `drop_body_columns`."""
        warnings.warn("Swarm.shed is called drop_body_columns now", DeprecationWarning, stacklevel=2)
        self.drop_body_columns()

    def hush(self) -> None:
        """Clear all messages; deprecated, see `clear_messages`."""
        warnings.warn("Swarm.hush is called clear_messages now", DeprecationWarning, stacklevel=2)
        self.clear_messages()

    def _resize(self, rows: np.ndarray, new: int) -> None:
        """Make columns again: these rows, all or some of them in order, then `new` rows of initial values.

        Columns that would be the same are left as they are.
        """
        widths = {
            "proximity": self.table.proximity.shape[1],
            "radiation": self.table.radiation.shape[1],
            "line": self.table.line.shape[1],
            "wheels": self.table.wheels,
            "sensors": max((len(design.sensors) for design in self.designs), default=0),
            **self.table.readings,
        }
        declarations = {**COLUMNS, **self.table.columns(), **self._messages, **self._memory}
        if any(name.startswith(LASTING) for name in self._memory):
            # Imperfect robots remember their last fresh readings.
            declarations |= {f"{LAST_READ}{name}": ((name,), np.float64, math.nan) for name in self.table.readings}
        is_shorter = len(rows) != len(self.columns.get("position", rows))
        for name in [name for name in self.columns if name not in declarations]:
            del self.columns[name], self.__dict__[name]
        for name, (shape, dtype, initial) in declarations.items():
            full = (len(rows) + new, *(widths.get(width, width) for width in shape))
            old = self.columns.get(name)
            if old is not None and old.shape == full and old.dtype == dtype and not (new or is_shorter):
                continue
            column = _make_column(full, initial, dtype)
            if old is not None and len(rows):
                shared = tuple(slice(0, width) for width in old.shape[1:])
                column[(slice(0, len(rows)), *shared)] = old[rows] if is_shorter else old
            self._publish(name, column)
        self.version += 1
        RESIZED[0] += 1

    def _publish(self, name: str, column: np.ndarray) -> None:
        self.columns[name] = column
        self.__dict__[name] = locked_view(column)


def _make_column(shape: tuple[int, ...], initial: object, dtype: type) -> np.ndarray:
    """Return a new column; one of zeros takes no memory until it is written to."""
    if isinstance(initial, int | float) and initial == 0:
        return np.zeros(shape, dtype)
    return np.full(shape, initial, dtype)


COLUMNS: dict[str, tuple[tuple, type, object]] = {name: vars(Swarm)[name] for name in get_annotations(Swarm)}
for _name in COLUMNS:
    delattr(Swarm, _name)
reserve_names((*COLUMNS, *dir(Swarm), *vars(Swarm())))


def names_that_may_come(device: Device) -> tuple[str, ...]:
    """Return what a sensor's function takes that parts or processes may have, ``task_stimulus``: they may come later.

    The first reading refuses those that have not.
    """
    return tuple(name for name in argument_names(own_function(device, "read")) if "_" in name.strip("_"))
