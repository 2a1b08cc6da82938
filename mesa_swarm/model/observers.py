"""What a model calls around each step and each run."""

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, Protocol, SupportsIndex, runtime_checkable

from mesa_swarm.base.errors import InvalidValueError, read_attribute, shortened
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.kernels.part import Kernel

# Methods of a list that change it.
MUTATORS = (
    *("append", "extend", "insert", "remove", "pop", "clear", "sort", "reverse"),
    *("__setitem__", "__delitem__", "__iadd__", "__imul__"),
)


@runtime_checkable
class Observer(Protocol):
    """What a model calls around each step and each run; add one with ``model.observers.append(observer)``.

    Derive from it and override what is needed: every method does nothing by default, but `break_off` closes.
    An object of another class serves as well, with any of these methods.

    An observer may have `every`, a whole number: the first three methods are called around the steps that it divides
    only, and `run` hands those in between to a compiled call. With an observer of each step it takes steps one by one.

    | method | called |
    | --- | --- |
    | `before_step` | before anything of a step; Mesa has counted the step already |
    | `after_step` | at the end of the model's own step, to which a derived class may add more |
    | `between_steps` | at the end of all of the step; differences at the next `before_step` were made by hand |
    | `after_failure` | after a step that raised an error |
    | `after_run` | when `run` has taken its steps without an error |
    | `replaced` | when `continued` has moved it to the model that continues the run with other parameters |
    | `break_off` | when an error or Ctrl-C ends `run` |

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> class Printer(Observer):
    ...     def after_step(self, model, step):
    ...         print(step, model.collisions)
    >>> model = SwarmModel(rng=1)
    >>> model.observers.append(Printer())
    >>> model.run(2).steps
    1 0
    2 0
    2
    >>> class Seldom(Printer):
    ...     every = 20
    >>> model.observers = [Seldom()]
    >>> model.run(50).steps
    20 0
    40 0
    52
    """

    every: int = 1

    # Each body ends with a return: a type checker takes methods of a Protocol without one for abstract.

    def before_step(self, model: Any) -> None:
        """Notice that a step begins."""
        return

    def after_step(self, model: Any, step: int) -> None:
        """Notice a step, counted from 1."""
        return

    def between_steps(self, model: Any) -> None:
        """Notice that a step is over."""
        return

    def after_failure(self, model: Any) -> None:
        """Notice that a step failed."""
        return

    def after_run(self, model: Any, steps: int) -> None:
        """Notice that a run of this many steps is over."""
        return

    def replaced(self, old: Any, new: Any, what: list[str]) -> None:
        """Notice that the run continues with another model, which differs in what is named."""
        return

    def break_off(self) -> None:
        """Notice that a run failed."""
        self.close()

    def close(self) -> None:
        """Release files and the like."""
        return


HOOKS = tuple(name for name, value in vars(Observer).items() if not name.startswith("_") and callable(value))


class DrivenObserver(Observer):
    """An observer that compiled calls of many steps take along, such as a recorder.

    It is called around each step that is taken by itself, whatever `every` it has, and around each compiled call. Of a
    step that fails within such a call it is notified by `after_failure`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> class Lengths(DrivenObserver):
    ...     def before_stretch(self, model, steps):
    ...         print(steps, "steps from step", model.completed)
    >>> model = SwarmModel(rng=1)
    >>> model.observers.append(Lengths())
    >>> model.run(1500).steps
    1000 steps from step 0
    500 steps from step 1000
    1500
    """

    def list_due(self, model: Any) -> Iterable[Any]:
        """Return in which steps Python is due, as objects of `driving.Due`."""
        return ()

    def before_stretch(self, model: Any, steps: int) -> None:
        """Notice that a compiled call of at most this many steps begins."""
        return

    def kernel(self, model: Any) -> Kernel | None:
        """Return what is to run in each step of a compiled call, as soon as robots have read their sensors."""
        return None

    def last_kernel(self, model: Any) -> Kernel | None:
        """Return what is to run at the end of each step of a compiled call; the same object where it is the same."""
        return None

    def after_stretch(self, model: Any) -> None:
        """Notice that a compiled call is over, which has completed all steps that it has begun."""
        return


class _Adapter(Observer):
    """An observer of a class of the user's, with every method: where it has none, that of `Observer`."""

    def __init__(self, observer: object) -> None:
        methods = {name: read_attribute(observer, name) for name in HOOKS}
        methods = {name: method for name, method in methods.items() if callable(method)}
        if not methods:
            raise InvalidValueError(
                f"observer is {shortened(observer)}; expected an object with after_step(model, step), see Observer"
            )
        self.__dict__.update(methods)


def interval_of_observer(observer: object) -> int:
    """Return every how many steps an observer is called.

    Raises
    ------
    InvalidValueError
        If its `every` is not a whole number of at least 1.
    """
    every = None if isinstance(observer, DrivenObserver) else read_attribute(observer, "every")
    return 1 if every is None else Trigger.of(every, f"every of observer {type(observer).__name__}", minimum=1).every


class Observers(list):
    """The observers of a model, in the order in which they are called; a copy of a model has none.

    The list holds the objects that were added. What is called is `complete`, their counterparts with all methods
    of `Observer`, made when the list changes: a method that an object gets later is not found, nor is an `every`.

    An observer that writes a file belongs to one model: a copy that also wrote there would damage it.

    Raises
    ------
    InvalidValueError
        If something is added that has no method of `Observer`, or of which `every` is not a whole number from 1.
    """

    complete: tuple[Observer, ...] = ()
    intervals: tuple[int, ...] = ()

    def __init__(self, *observers: Any) -> None:
        super().__init__(*observers)
        self._prepare()

    def _prepare(self) -> None:
        """Make what is called of the objects in the list."""
        intervals = tuple(map(interval_of_observer, self))
        self.complete, self.intervals = _complete_observers(self), intervals

    def due(self, step: int) -> tuple[Observer, ...]:
        """Return those that are called around a step, counted from 1."""
        if max(self.intervals, default=1) == 1:
            return self.complete
        pairs = zip(self.complete, self.intervals, strict=True)
        return tuple(observer for observer, every in pairs if step % every == 0)

    def driven(self) -> list[DrivenObserver]:
        """Return those that compiled calls take along."""
        return [observer for observer in self.complete if isinstance(observer, DrivenObserver)]

    def __reduce_ex__(self, protocol: SupportsIndex) -> tuple:
        return Observers, ()


def _complete_observers(observers: list) -> tuple[Observer, ...]:
    return tuple(observer if isinstance(observer, Observer) else _Adapter(observer) for observer in observers)


def _completing(name: str) -> Callable:
    """Return a method of a list that updates `complete` as well, and changes nothing if an object is refused."""
    change = getattr(list, name)

    @wraps(change)
    def method(self: Observers, *arguments: Any, **keywords: Any) -> Any:
        before = self[:]
        result = change(self, *arguments, **keywords)
        try:
            self._prepare()
        except InvalidValueError:
            list.__setitem__(self, slice(None), before)
            raise
        return result

    return method


for _name in MUTATORS:
    setattr(Observers, _name, _completing(_name))
