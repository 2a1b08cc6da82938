"""Reporters for Mesa's DataCollector: of what changes slowly, and of events."""

from functools import partial
from typing import Any

from mesa import Model

from mesa_swarm.base.errors import check_name
from mesa_swarm.base.trigger import Trigger


class Held:
    """A reporter that reads an attribute of the model after some steps and repeats that value in between.

    Measures of the whole swarm cost more than a step of 50 robots. Mesa collects in every step, and some of
    its versions need it so; the value in between is the last one measured.
    """

    def __init__(self, name: str, every: int | Trigger = 10) -> None:
        self.name = name
        self.trigger = Trigger.of(every, minimum=1)
        self._step = -1
        self._value: object = None

    def __call__(self, model: Model) -> object:
        """Return the value that was measured last, measured now if it is due."""
        step = self.trigger.last_due(model.steps)
        if step != self._step:
            self._step, self._value = step, getattr(model, self.name)
        return self._value

    @property
    def measured(self) -> int:
        """The step after which the value was due when it was measured, -1 before the first."""
        return self._step

    @property
    def value(self) -> object:
        """The value that was measured last."""
        return self._value

    def hold(self, step: int, value: object) -> None:
        """Take over what compiled code has measured, and after which step that was due."""
        self._step, self._value = step, value

    def checkpoint(self) -> dict:
        """Return what was measured last, and when."""
        return {"due": self._step, "value": self._value}

    def restore(self, state: dict) -> None:
        """Take back what `checkpoint` returned."""
        self._step, self._value = state["due"], state["value"]


def held(*names: str, every: int | Trigger = 10) -> dict[str, partial]:
    """Return reporters of these properties by name, for `model_reporters`.

    Examples
    --------
    >>> sorted(held("groups", "chained"))
    ['chained', 'groups']
    """
    # Mesa hands the model to functions and partials only; a partial can be pickled with the model.
    return {name: partial(Held(name, every)) for name in names}


def copy_held(reporter: Any) -> Any:
    """Return a reporter that holds values as another one, with none yet; any other as it is.

    Each model has its own: one that is shared would give a model the values of another.
    """
    held = getattr(reporter, "func", None)
    if isinstance(reporter, partial) and isinstance(held, Held):
        return partial(Held(held.name, held.trigger), *reporter.args, **reporter.keywords)
    return reporter


def event_count(name: str) -> partial:
    """Return a reporter of the number of events of a name so far, for `model_reporters`; 0 before the first.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> model = SwarmModel(rng=1, model_reporters={"delivered": event_count("delivered")})
    >>> model.event("delivered")
    >>> model.run(2).datacollector.model_vars["delivered"]
    [1, 1]
    """
    return partial(_event_count, check_name("name of an event", name))


def event_total(name: str) -> partial:
    """Return a reporter of the sum of the values of events of a name so far, for `model_reporters`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> model = SwarmModel(rng=1, model_reporters={"food": event_total("delivered")})
    >>> model.event("delivered", value=2.5)
    >>> model.run(1).datacollector.model_vars["food"]
    [2.5]
    """
    return partial(_event_total, check_name("name of an event", name))


# Of a name and a model, in this order: Mesa gives the model to a partial last.
def _event_count(name: str, model: Model) -> int:
    return model.events.count(name)


def _event_total(name: str, model: Model) -> float:
    return model.events.total(name)
