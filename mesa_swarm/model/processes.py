"""The part `processes`: what happens in each step besides robots."""

from collections.abc import Iterator
from functools import partial
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, read_attribute, shortened
from mesa_swarm.kernels.part import Itself, Part, Phase, Stage, kernel_of
from mesa_swarm.model.state import Checkpointed, attributes_of, quick_fingerprint, refuse_attributes, stored_state
from mesa_swarm.model.state_hash import describe_process


@runtime_checkable
class Process(Protocol):
    """What happens in each step besides robots: growth, weather, a plan of moving doors; see `SwarmModel.add_process`.

    Any object with `step` serves; `fire.Burning` is one. Its attributes are part of the model's state: plain values,
    arrays and random generators are hashed, stored and resumed. A class with other attributes has two more methods,
    `checkpoint`, which returns all on which a later step depends, as plain values and arrays by name, and `restore`,
    which takes it back. A class may have a method ``check_model(model)``, which raises an error if a model lacks what
    the process needs; it is called before the process is added. One whose `step` only runs a compiled function may
    return it by ``kernel_for(model)``, a `mesa_swarm.kernels.part.Kernel`.

    `resume` makes a process that no constructor adds without the constructor of its class, which has to be in the
    module of the model's class, to derive from `Process` or declare ``resumable = True``, and to declare its attributes
    by annotations or values in the class.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> class Tide(Process):
    ...     level: float = 0.0
    ...
    ...     def step(self, model):
    ...         self.level += 0.5
    >>> model = SwarmModel(rng=1)
    >>> tide = model.add_process(Tide())
    >>> model.run(3).processes[0].level
    1.5
    """

    def step(self, model: Any) -> None:
        """Advance by one step; called after contacts are resolved, in the order in which processes were added."""
        return


ProcessT = TypeVar("ProcessT", bound=Process)


class ProcessesPart(Part):
    """The processes of a model.

    Attributes
    ----------
    numbered : dict of int to Process
        In the order in which they take place, by the numbers under which they are stored; replaced when one is added
        or removed.
    """

    name = "processes"

    def __init__(self, model: Any) -> None:
        self.model = model
        self.numbered: dict[int, Process] = {}

    def stages(self) -> Iterator[Stage]:
        """Advance all processes, one after the other."""
        for process in self.numbered.values():
            kernel = kernel_of(process, "step", self.model)
            name = getattr(process, "__name__", type(process).__name__)
            call, python = partial(process.step, self.model), "" if kernel else "its step is a method or function"
            every = getattr(process, "takes_place_every", 1)
            yield Stage(Phase.PROCESS, call, f"{name} takes place", kernel, every, python=python)
        asked = {name for process in self.numbered.values() for name in getattr(process, "asks", ())}
        for part in self.model.parts.standing() if asked else ():
            if hasattr(part, "answer"):
                yield from part.answer(asked)

    def parameters(self) -> list:
        """Return the state of processes, and what they are besides."""
        return [*self.states(), *(describe_process(process) for process in self.numbered.values())]

    def mark(self) -> dict[str, Any]:
        """Return which processes there are, and a fingerprint of the state of each."""
        return {
            "set of processes": Itself(self.numbered),
            **{name: quick_fingerprint(state) for name, state in self.states()},
        }

    def store(self) -> dict[str, Any]:
        """Return what processes hold, by their number; one that stores itself whole."""
        content: dict[str, Any] = {}
        for number, process in self.numbered.items():
            if isinstance(process, Checkpointed):
                content[f"{number}"] = process
            else:
                content |= {f"{number} {name}": value for name, value in attributes_of(process).items()}
        return content

    def word_of(self, name: str) -> str:
        """Return whose attribute a stored value is."""
        number, _, attribute = name.partition(" ")
        return f"process {type(self.numbered[int(number)]).__name__}" + (f"'s {attribute}" if attribute else "")

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned: attributes, checked; what a process has besides is dropped."""
        for number, process in self.numbered.items():
            begin = f"{number} "
            values = {name.removeprefix(begin): value for name, value in stored.items() if name.startswith(begin)}
            if isinstance(process, Checkpointed):
                continue
            for name in [name for name in getattr(process, "__dict__", {}) if name not in values]:
                delattr(process, name)
            refuse_attributes(process, values)
            for name, value in values.items():
                object.__setattr__(process, name, value)

    def add_process(self, process: ProcessT) -> ProcessT:
        """Add what happens in each step besides robots, after contacts are resolved, and return it.

        Parameters
        ----------
        process : Process
            Any object with ``step(model)``. Its attributes are part of the model's state. Of a function with `process`
            the model gets a copy with a memory of its own.

        Raises
        ------
        InvalidValueError
            If it has no `step`, was added before, or refuses this model.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> class Rain:
        ...     amount = 0
        ...
        ...     def step(self, model):
        ...         self.amount += 2
        >>> model = SwarmModel(rng=1)
        >>> rain = model.add_process(Rain())
        >>> model.run(3).processes[0].amount
        6
        """
        if isinstance(process, type) or not callable(read_attribute(process, "step")):
            raise InvalidValueError(
                f"process is {shortened(process)}; expected an object with step(model), see Process"
            )
        of_model = read_attribute(process, "for_model")
        if callable(of_model):
            process = of_model()
        if any(process is other for other in self.numbered.values()):
            raise InvalidValueError(f"process {shortened(process)} was added before; expected another one")
        check = read_attribute(process, "check_model")
        if callable(check):
            check(self.model)
        self.have({**self.numbered, max(self.numbered, default=0) + 1: process})
        return process

    def put_first(self, process: Process, number: int) -> None:
        """Add a process before all others, unless there is one of this number: below 1, where those of users begin."""
        if number not in self.numbered:
            self.have({number: process, **self.numbered})

    def remove_process(self, process: Process) -> None:
        """Remove a process; what it has changed stays.

        Raises
        ------
        InvalidValueError
            If it is not one of `processes`.
        """
        others = {number: other for number, other in self.numbered.items() if other is not process}
        if len(others) == len(self.numbered):
            raise InvalidValueError(f"process is {shortened(process)}; expected one of model.processes")
        self.have(others)

    def have(self, numbered: dict[int, Process]) -> None:
        """Have these processes, in this order."""
        self.numbered = numbered
        self.model.parts.replan()

    def memory_of(self, process_name: str, name: str) -> np.ndarray | None:
        """Return what a process of this name remembers under a name, None if there is no such process."""
        for process in self.numbered.values():
            if getattr(process, "__name__", "") == process_name:
                return getattr(process, "memory", {}).get(name)
        return None

    def states(self) -> Iterator[tuple[str, Any]]:
        """Iterate over the state of processes, by name."""
        for number, process in self.numbered.items():
            if state := stored_state(process):
                yield f"process {number} ({type(process).__name__})", state
