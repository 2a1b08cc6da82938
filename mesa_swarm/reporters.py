"""Reporters for Mesa's DataCollector that measure only after some steps."""

from functools import partial

from mesa import Model

from mesa_swarm.trigger import Trigger


class Held:
    """A reporter that reads an attribute of the model after some steps and repeats that value in between.

    Measures of the whole swarm cost more than a step of 50 robots. Mesa collects in every step, and some of
    its versions need it so; the value in between is the last one measured.
    """

    def __init__(self, name: str, every: int | Trigger = 10) -> None:
        self.name = name
        self.trigger = Trigger.of(every, minimum=1)
        self._due = -1
        self._value: object = None

    def __call__(self, model: Model) -> object:
        """Return the value that was measured last, measured now if it is due."""
        due = self.trigger.last_due(model.steps)
        if due != self._due:
            self._due, self._value = due, getattr(model, self.name)
        return self._value

    def checkpoint(self) -> dict:
        """Return what was measured last, and when."""
        return {"due": self._due, "value": self._value}

    def restore(self, state: dict) -> None:
        """Take back what `checkpoint` returned."""
        self._due, self._value = state["due"], state["value"]


def held(*names: str, every: int | Trigger = 10) -> dict[str, partial]:
    """Return reporters of these properties by name, for `model_reporters`.

    Examples
    --------
    >>> sorted(held("groups", "chained"))
    ['chained', 'groups']
    """
    # Mesa hands the model to functions and partials only; a partial can be pickled with the model.
    return {name: partial(Held(name, every)) for name in names}
