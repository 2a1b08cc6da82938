"""Processes: what happens in each step besides robots."""

from typing import Any, Protocol, runtime_checkable

from mesa_swarm.errors import InvalidValueError, asked, shortened


@runtime_checkable
class Process(Protocol):
    """What happens in each step besides robots: growth, weather, a plan of moving doors; see `SwarmModel.add_process`.

    Any object with `step` serves. Its attributes are part of the model's state: plain values, arrays and random
    generators are hashed, stored and resumed. A class with other attributes has two more methods, `checkpoint`, which
    returns all on which a later step depends, as plain values and arrays by name, and `restore`, which takes it back.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> class Tide:
    ...     level = 0.0
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


def check_process(process: object) -> None:
    """Refuse an object without `step`."""
    if isinstance(process, type) or not callable(asked(process, "step")):
        raise InvalidValueError(f"process is {shortened(process)}; expected an object with step(model), see Process")
