"""A model that is changed while it runs, and what is needed to repeat it with the same changes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice, check_count
from mesa_swarm.dashboard.page.edits import MOST_ROBOTS, SET, Edit, apply_edit, link_value
from mesa_swarm.model.parameters import Parameter
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.container import from_bytes, to_bytes
from mesa_swarm.recording.continuing import continue_with, match_robots
from mesa_swarm.swarm_model import SwarmModel

# The parameter that is met by adding or removing robots.
ROBOTS = "n_robots"
# Returns a model of these settings, "seed" among them.
Make = Callable[[Mapping[str, Any]], SwarmModel]


class LiveRun:
    """A run whose parameters, robots and bodies are changed between two steps.

    Attributes
    ----------
    model : SwarmModel
        The present one: another object after a parameter was changed.
    at_start : dict
        Settings with which a model in the same place before its first step is made.
    edits : list of Edit
        What was changed, in the order of time; repeated on a model of `first`, they give the same run.
    first : dict
        The settings of the first model.
    """

    def __init__(self, make: Make, parameters: Mapping[str, Parameter], settings: Mapping[str, Any]) -> None:
        self._make, self._parameters = make, parameters
        self.first: dict[str, Any] = dict(settings)
        self.at_start: dict[str, Any] = self.first
        self.edits: list[Edit] = []
        self.model = make(self.first)

    @classmethod
    def around(cls, model: SwarmModel, make: Make, parameters: Mapping[str, Parameter], settings: dict) -> "LiveRun":
        """Return the run of a model that was made elsewhere, with these settings."""
        run = cls.__new__(cls)
        run._make, run._parameters, run.first, run.at_start, run.edits = make, parameters, settings, settings, []
        run.model = model
        return run

    def again(self) -> "LiveRun":
        """Return the run before its first step, without its changes."""
        return LiveRun(self._make, self._parameters, self.first)

    def set(self, values: Mapping[str, Any]) -> set[str]:
        """Change parameters; return the names of those that took effect, the others belong to the beginning of a run.

        Values with which no model can be made, or robots for which there is no room, raise an error, and nothing has
        changed.
        """
        applied: set[str] = set()
        others = {name: value for name, value in values.items() if name != ROBOTS}
        if ROBOTS in values:  # first: what is refused is refused here
            match_robots(self.model, self._make({**self.at_start, **values}))
            applied.add(ROBOTS)
        if others and self._continue(others):
            applied |= others.keys()
        elif len(others) > 1:
            applied |= {name for name, value in others.items() if self._continues_alone(name, value)}
        if applied:
            self._note(SET, [part for name in sorted(applied) for part in (name, link_value(values[name]))])
        return applied

    def _continue(self, values: Mapping[str, Any]) -> bool:
        """Continue with a model of other parameters; return False if these belong to the beginning of a run."""
        parameters = {**self.at_start, **values}
        new, fresh = self._make(parameters), self._make(self.at_start)
        try:
            continue_with(new, self.model, fresh, tuple(values))
        except SwarmError:
            return False
        self.model, self.at_start = new, parameters
        return True

    def _continues_alone(self, name: str, value: Any) -> bool:
        """Continue with one of several values, unless that is possible only with the others."""
        try:
            return self._continue({name: value})
        except SwarmError:
            return False

    def edit(self, do: str, values: Sequence[float], *, in_place: bool = False) -> None:
        """Change the model by hand; `in_place` if this goes on with the last edit, a robot that is dragged."""
        apply_edit(self.model, do, values)
        self._note(do, values, in_place=in_place)

    def repeat(self, edit: Edit) -> dict[str, Any]:
        """Apply an edit again, or one of a link; return the parameters that it sets."""
        if edit.do != SET:
            self.edit(edit.do, edit.values)
            return {}
        values: dict[str, Any] = {}
        for name, text in zip(edit.values[::2], edit.values[1::2], strict=False):
            parameter = self._parameters[check_choice("parameter", name, self._parameters)]
            values[name] = parameter.checked(parameter.parse(text))
        check_count(ROBOTS, values.get(ROBOTS, 0), maximum=MOST_ROBOTS)
        if self.set(values) != values.keys():
            raise InvalidValueError(f"{' and '.join(values)} cannot be changed during a run; reset with it")
        return values

    def store(self) -> bytes:
        """Return the present state, from which `restore_model` continues; an error names what cannot be stored."""
        return to_bytes(checkpoint_of(self.model))

    def restore_model(self, state: bytes, start: Mapping[str, Any]) -> SwarmModel:
        """Return a model in the state that was stored when a model before its first step was made with `start`."""
        return restore(self._make(start), from_bytes(state))

    def _note(self, do: str, values: Sequence, *, in_place: bool = False) -> None:
        edit, last = Edit(self.model.completed, do, tuple(values)), self.edits[-1] if self.edits else None
        same = last is not None and (last.step, last.do) == (edit.step, do)
        if same and last and (in_place or (do == SET and last.values[::2] == edit.values[::2])):
            self.edits.pop()
        self.edits.append(edit)


class Repetition:
    """A run that is taken again, step by step, with all that was changed by hand."""

    def __init__(self, run: LiveRun) -> None:
        self._run, self._edits_left = run.again(), list(run.edits)

    @property
    def model(self) -> SwarmModel:
        """The present model."""
        return self._run.model

    def step(self) -> None:
        """Apply what was changed before the next step, and take it."""
        self.finish()
        self.model.step()

    def finish(self) -> None:
        """Apply what was changed at the present step."""
        while self._edits_left and self._edits_left[0].step <= self.model.completed:
            self._run.repeat(self._edits_left.pop(0))


@dataclass(frozen=True, slots=True, eq=False)
class Before:
    """The state before a change by hand, to which one can go back."""

    do: str
    step: int
    state: bytes
    edits: tuple[Edit, ...]
    at_start: dict[str, Any]
    settings: dict[str, Any]
    built: dict[str, Any]
