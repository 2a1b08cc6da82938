"""Actuators: numbers besides the wheels that a rule sets and a model acts on."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from mesa_swarm.base.errors import BehaviourError, InvalidValueError, check_flag, check_number, shortened
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.kernels.type_names import Integers, RealRows, Reals
from mesa_swarm.robots.devices import Device, check_device, check_identifier, own_function
from mesa_swarm.robots.sensors import Mount, check_mount
from mesa_swarm.world.fields import LARGEST_AMOUNT, DepositArrays, deposit_at

# Columns of what actuators are set to begin so.
ACT = "act."


class Actuator(Device):
    """Base of all actuators; a custom class has a `name`, and `apply` or a function `act`.

    A rule sets ``me.act.<name> = x``, or ``me.act.<name>[k] = x`` where `width` is more than 1; a layer that is a
    class writes ``senses.act["<name>"]``. Before robots decide it is 0 again. What is set is the column
    ``swarm.columns["act.<name>"]``, shape (n,) or (n, width). After all robots have decided and before they move, in
    the phase `act` of the step, it takes effect.

    ``apply(model, rows)`` is ordinary Python on arrays, called once a step for the robots in these rows; ``act`` is a
    static function that is compiled, and takes what its parameters name, as `Sensor.read` does: `value` is what the
    robots in `rows` have set.

    Attributes
    ----------
    name : str
        One word. Actuators of a design with the same name get the same numbers.
    width : int
        How many numbers it takes, 1 to 10,000.
    holds : bool
        Whether it stays as it was set, and is not 0 again before each decision.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from mesa_swarm import RobotDesign, SwarmModel
    >>> from mesa_swarm.control import Subsumption, behaviour
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Horn(Actuator):
    ...     name: str = "horn"
    ...
    ...     def apply(self, model, rows):
    ...         print("volume", model.swarm.columns["act.horn"][rows].sum())
    >>> @behaviour
    ... def honk(me):
    ...     me.act.horn = 2.0
    ...     return me.max_speed, me.max_speed
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(RobotDesign(actuators=(Horn(),)), 3)
    >>> model.control = Subsumption(honk)
    >>> model.step()
    volume 6.0
    """

    __slots__ = ()

    holds: ClassVar[Any] = False
    act: ClassVar[Any] = None

    def apply(self, model: Any, rows: np.ndarray) -> None:
        """Do what the robots in these rows have set; by default nothing."""

    def kernel_for(self, model: Any, rows: np.ndarray) -> Kernel | None:
        """Return a kernel that does what `apply` of the same class does, None without one."""
        return sequence_of([])


class EmitArrays(NamedTuple):
    """What `emit_all` takes.

    Columns of the swarm, with what the actuator is set to, and the rows of robots that have it; its rate and mount;
    the field; scratch for places (k, 2) and amounts.
    """

    position: RealRows
    heading: Reals
    setting: Reals
    rows: Integers
    rate: float
    mount: tuple[float, float]
    field: DepositArrays
    points: RealRows
    amounts: Reals


@compiled(nogil=True)
def emit_all(block, step, first, last):
    """Deposit what robots that have an emitter have set, all or nothing; return whether an amount is wrong."""
    e = unpack(block, EmitArrays)
    rows, setting, points, amounts, (x, y), count = e.rows, e.setting, e.points, e.amounts, e.mount, 0
    for i in rows:
        if not (0.0 <= e.rate * setting[i] <= LARGEST_AMOUNT):
            return 1
    for i in rows:
        if setting[i] * e.rate != 0.0:
            cosine, sine = direction_of(e.heading[i])
            points[count, 0] = e.position[i, 0] + (cosine * x - sine * y)
            points[count, 1] = e.position[i, 1] + (sine * x + cosine * y)
            amounts[count] = e.rate * setting[i]
            count += 1
    if count > 0:
        deposit_at(e.field, points[:count], amounts[:count])
    return 0


@dataclass(frozen=True, kw_only=True, slots=True)
class Emitter(Actuator):
    """An actuator that deposits into a scalar field: ``me.act.trail = 0.5`` deposits half of its rate in this step.

    The field receives it in the phase `act`, before robots move.

    Parameters
    ----------
    field : str
        The name of a field of the model, which has to be there before the robots.
    mount : (x, y)
        Where it deposits, in the robot's frame (x ahead, y left); beyond the border, at the nearest place on the map.
    rate : float
        What it deposits a step when it is set to 1, from 0 to 1e15.
    name : str
        What rules and columns call it; by default the name of the field.

    Examples
    --------
    >>> from mesa_swarm import Emitter, Field, RobotDesign, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> field = model.add_field(Field("trail"))
    >>> robots = model.add_robots(RobotDesign(actuators=(Emitter(field="trail", rate=2.0),)), 3)
    >>> model.swarm.columns["act.trail"][:] = 0.5
    >>> model.step()
    >>> field.total
    3.0
    """

    field: str
    mount: Mount = (0.0, 0.0)
    rate: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        """Check every value."""
        check_identifier("field of an Emitter", self.field)
        check_mount(self)
        check_number("rate", self.rate, minimum=0, maximum=LARGEST_AMOUNT)
        object.__setattr__(self, "name", self.name or self.field)

    def check_model(self, model: Any) -> None:
        """Refuse a model without the field."""
        _ = model.fields[self.field]

    def apply(self, model: Any, rows: np.ndarray) -> None:
        """Deposit what the robots in these rows have set."""
        self.kernel_for(model, rows).run(model.completed + 1, len(model.swarm))

    def kernel_for(self, model: Any, rows: np.ndarray) -> Kernel:
        """Return what deposits for the robots in these rows, see `Actuator`."""
        columns = model.swarm.columns
        arrays = EmitArrays(
            position=columns["position"],
            heading=columns["heading"],
            setting=columns[f"{ACT}{self.name}"],
            rows=np.array(rows),
            rate=float(self.rate),
            mount=self.mount,
            field=model.fields[self.field].arrays(),
            points=np.empty((len(rows), 2)),
            amounts=np.empty(len(rows)),
        )
        block = Block(arrays)
        return Kernel(emit_all, block.numbers, block, partial(self._refuse, model, arrays))

    def _refuse(self, model: Any, arrays: EmitArrays, code: int) -> None:
        """Raise an error for the first robot that would deposit too much or too little."""
        amounts = arrays.rate * arrays.setting[arrays.rows]
        wrong = int(np.argmin((amounts >= 0) & (amounts <= LARGEST_AMOUNT)))
        robot = model.swarm.agents[arrays.rows[wrong]].unique_id
        raise BehaviourError(
            f"act.{self.name} of robot {robot} would deposit {amounts[wrong]:g}; "
            f"expected 0 to {LARGEST_AMOUNT:g}: fields hold no less than nothing"
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Lamp(Actuator):
    """A light that others see: a number, which `NeighbourSensor(lamp=True)` reads.

    It stays as it was set; 0 at first, which may stand for dark.

    Examples
    --------
    >>> Lamp().name, Lamp().holds
    ('lamp', True)
    """

    name: str = "lamp"
    holds = True


def check_actuator(actuator: object) -> None:
    """Refuse what is not an actuator that can be used.

    Raises
    ------
    InvalidValueError
    """
    if not isinstance(actuator, Actuator):
        raise InvalidValueError(f"actuators holds {shortened(actuator)}; expected actuators such as Lamp()")
    check_device("actuator", actuator, "act")
    kind = type(actuator).__name__
    check_flag(f"holds of actuator {kind}", actuator.holds)
    if not callable(actuator.apply):
        raise InvalidValueError(f"apply of actuator {kind} is {shortened(actuator.apply)}; expected a method")
    own_function(actuator, "act")


def check_device_actions(actuators: Iterable[Actuator]) -> dict[str, tuple[int, bool]]:
    """Return what actuators of each name take: a width, and whether it holds; refuse names with two meanings.

    Raises
    ------
    InvalidValueError
    """
    actions: dict[str, tuple[int, bool]] = {}
    for actuator in actuators:
        action = int(actuator.width), bool(actuator.holds)
        if actions.setdefault(actuator.name, action) != action:
            raise InvalidValueError(
                f"actuators named {actuator.name} differ in width or holds: {actions[actuator.name]} and {action}; "
                "give one of them another name"
            )
    return actions
