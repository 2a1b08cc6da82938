"""The parts of a model in their order, and the loops over them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, check_choice, shortened, unknown_name
from mesa_swarm.kernels.part import ROLES, Column, Context, Part
from mesa_swarm.kernels.plan import Plan

if TYPE_CHECKING:
    from mesa_swarm.model.bodies_part import BodiesPart
    from mesa_swarm.model.control_part import ControlPart
    from mesa_swarm.model.events import EventsPart
    from mesa_swarm.model.fields_part import FieldsPart
    from mesa_swarm.model.imperfections_part import ImperfectionsPart
    from mesa_swarm.model.processes import ProcessesPart
    from mesa_swarm.model.radio_part import RadioPart
    from mesa_swarm.model.robots_part import RobotsPart
    from mesa_swarm.model.state import StatePart

MOST_STEPS = 10**15
AnyPart = TypeVar("AnyPart", bound=Part)
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
METHODS = ("bind", "columns", "stages", "store", "restore", "replace", "shown")


class Parts(Mapping[str, Part]):
    """The parts of a model by name; the order is that of their stages within a phase.

    Standing parts are attributes as well. To add one of another class, see `SwarmModel.add_part`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> list(SwarmModel(rng=1).parts)
    ['bodies', 'robots', 'imperfections', 'radio', 'control', 'fields', 'fires', 'processes', 'state', 'events']
    """

    bodies: "BodiesPart"
    robots: "RobotsPart"
    imperfections: "ImperfectionsPart"
    radio: "RadioPart"
    control: "ControlPart"
    fields: "FieldsPart"
    fires: Any  # that `SwarmModel` adds
    processes: "ProcessesPart"
    state: "StatePart"
    events: "EventsPart"

    def __init__(self, model: Any) -> None:
        self._model = model
        self._by_name: dict[str, Part] = {}
        self._standing: tuple[str, ...] = ()
        self._plan: Plan | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the plan, which a copy makes anew."""
        return {**self.__dict__, "_plan": None}

    def __getitem__(self, name: str) -> Part:
        """Return the part of a name."""
        if name not in self._by_name:
            raise UnknownNameError(unknown_name("part", name, self._by_name))
        return self._by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def get(self, name: str, default: Any = None) -> Any:
        """Return the part of a name, or the default."""
        return self._by_name.get(name, default)

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)

    def __repr__(self) -> str:
        return f"<Parts: {', '.join(self._by_name)}>"

    @property
    def plan(self) -> Plan:
        """The stages of the step, made anew when parts, robots' columns or bodies have changed."""
        version, scene = self._model.swarm.version, self.bodies.cache.scene
        if self._plan is None or scene is None or self._plan.version != (version, scene):
            version = version, self.bodies.scene()
            self._plan = Plan.of(self._by_name.values(), version, lambda: self._model.completed)
        return self._plan

    def set_completed(self, steps: int) -> None:
        """Set how many steps of the model were completed, without taking them; for states that are restored."""
        if type(steps) is not int or not 0 <= steps < MOST_STEPS:
            raise InvalidValueError(f"invalid completed: {shortened(steps)}")
        self._model._completed = steps

    def replan(self) -> None:
        """Let the list of stages be made anew before the next step."""
        self._plan = None

    def stand(self, part: Part, before: str | None = None) -> None:
        """Add a part that every model of a class has, before the one of a name or at the end."""
        names = list(self._by_name)
        names.insert(len(names) if before is None else names.index(before), part.name)
        self._by_name = {name: self._by_name.get(name, part) for name in names}
        self._standing = (*self._standing, part.name)
        setattr(self, part.name, part)
        part.bind(self.context())
        self.replan()

    def add(self, part: AnyPart) -> AnyPart:
        """Add a part of a user's; see `SwarmModel.add_part`."""
        name = getattr(part, "name", None)
        lacking = [method for method in METHODS if not callable(getattr(part, method, None))]
        if isinstance(part, type) or lacking or not isinstance(name, str) or not name.isidentifier():
            raise InvalidValueError(
                f"part is {shortened(part)}; expected an object of a class that derives from mesa_swarm.Part, with a "
                "name of one word"
            )
        if name in self._by_name:
            raise InvalidValueError(f"the model has a part {name} already; expected another name")
        if any(column.startswith(f"{name}.") for column in self._model.swarm.columns):
            raise InvalidValueError(f"columns of robots begin with {name}. already; expected another name of a part")
        part.bind(self.context())
        self._check_columns(part)
        self._by_name = {**self._by_name, name: part}
        self.replan()
        return part

    def _check_columns(self, part: Part) -> None:
        """Refuse columns that are no arrays, of an unknown role, or without a row for each robot or body."""
        counts = {"robots": len(self._model.swarm), "bodies": len(self.bodies.table)}
        for name, column in part.columns().items():
            what = f"column {name} of part {part.name}"
            if not isinstance(column, Column) or not isinstance(column.array, np.ndarray):
                raise InvalidValueError(f"{what} is {shortened(column)}; expected Column(array, rows, role)")
            check_choice(f"role of {what}", column.role, ROLES)
            if column.rows is not None:
                length = counts[check_choice(f"rows of {what}", column.rows, counts)]
                if column.array.shape[:1] != (length,):
                    raise InvalidValueError(
                        f"{what} has shape {column.array.shape}; expected {length} rows, one for each of the "
                        f"model's {column.rows}: make it in bind(context), of as many rows"
                    )

    def remove(self, name: str) -> Part:
        """Take a part that was added out of the model, and return it; see `SwarmModel.remove_part`."""
        part = self[name]
        if name in self._standing:
            raise InvalidValueError(f"part {name} is one that every model has; expected one that was added")
        self._by_name = {other: part for other, part in self._by_name.items() if other != name}
        self.replan()
        return part

    def standing(self) -> list[Part]:
        """Return the parts that every model of a class has, in their order."""
        return [part for name, part in self._by_name.items() if name in self._standing]

    def begin_step(self) -> None:
        """Let bodies and fires forget what is of the last step, before anything of the next one."""
        self.bodies.begin_step()
        if "fires" in self._by_name:
            self.fires.begin_step()

    def added(self) -> list[Part]:
        """Return the parts that were added, in their order."""
        return [part for name, part in self._by_name.items() if name not in self._standing]

    def bind(self) -> None:
        """Let all parts take what they need, after a copy or a restore; columns stay what they were."""
        context = self.context()
        for name, part in self._by_name.items():
            before: Mapping[str, Column] = {}
            if name not in self._standing:
                with suppress(AttributeError):  # one that leaves its columns out of a copy has none to keep
                    before = part.columns()
            part.bind(context)
            for column, (array, *_) in part.columns().items() if before else ():
                if column in before and array is not before[column].array:  # made anew
                    part.replace(column, before[column].array)
        self.replan()

    def context(self) -> Context:
        """Return what parts may use."""
        return Context(self._model, self, self._model.streams)

    def add_rows(self, rows: str, count: int) -> None:
        """Give columns of added parts rows of their initial values, at the end."""
        for part in self.added():
            for name, column in part.columns().items():
                if column.rows == rows and count:
                    new = np.full((count, *column.array.shape[1:]), column.initial, column.array.dtype)
                    part.replace(name, np.concatenate([column.array, new]))

    def drop_rows(self, rows: str, indices: Sequence[int]) -> None:
        """Drop rows of the columns of added parts."""
        for part in self.added():
            for name, column in part.columns().items():
                if column.rows == rows:
                    part.replace(name, np.delete(column.array, indices, axis=0))


def delegate(
    part: str, method: Callable[Concatenate[Any, Arguments], Result]
) -> Callable[Concatenate[Any, Arguments], Result]:
    """Return a method of a model that calls that of a standing part, with its name, parameters and docstring."""
    name = method.__name__

    @wraps(method)
    def call(model: Any, /, *arguments: Arguments.args, **keywords: Arguments.kwargs) -> Result:
        return getattr(getattr(model.parts, part), name)(*arguments, **keywords)

    return call
