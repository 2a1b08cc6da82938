"""Continuing a run from any step of its recording, unchanged or with other parameters."""

import os
from typing import Any

from mesa_swarm.base.errors import (
    InvalidValueError,
    RecordingError,
    UnknownNameError,
    check_count,
    shortened,
    unknown_name,
)
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.gallery import FORMS, is_address, model_address, shipped_class
from mesa_swarm.recording.continuing import take_over
from mesa_swarm.recording.made_objects import find_loaded_class
from mesa_swarm.recording.provenance import is_of_other_bits, rebuild_model
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.verify import (
    Rerun,
    Watch,
    check_row,
    has_row,
    last_same,
    restore_last,
    run_to,
    start_again,
    states_to,
)

# An address in a recording that is longer is not shown.
LONGEST_ADDRESS = 80


def resume(
    base: type, path: str | os.PathLike[str], /, *, step: int | None = None, progress: bool = False, **changes: object
) -> EngineModel:
    """Return the model as it was after a step of a recording, from which it continues with the same bits.

    The nearest checkpoint at or before the step is restored, and the model runs from there to the step, compared
    with the recording on the way; without a checkpoint it is run again from its parameters. With other parameters, a
    second model is made with these and takes over the first one's state: its robots and other objects as they are now,
    positions, readings, temperatures, failures, the memory of layers (by their group or design, name and place), states
    of machines (by name), random streams, counters, collected rows, the declared state, events. What was replaced by
    hand before, such as `control` or `fire_constants`, stays, unless the change is about it.

    If the model was changed by hand after that very step, it is returned with the change, provided that the state after
    it was stored (`Recording.interventions`).

    Parameters
    ----------
    base : type
        The class that was recorded, or one that it is derived from.
    path : str or Path
    step : int, optional
        At least the step at which the recording began; by default the last one recorded.
    progress : bool
        Whether to show a bar of the steps that are run again.
    **changes
        New values of the model's parameters, which must leave the robots, fires, obstacles and loads that the
        constructor makes. What the run has added or removed since is as it was.

    Raises
    ------
    RecordingError
        If running again does not match the recording, as with other code, or would be needed of a recording of a
        version whose steps have other bits, or after a manual change without a stored state; the nearest steps that
        work are named.
    InvalidValueError, UnknownNameError
        If there is no such step or parameter, or a change makes another world.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = FireFighting(strategy="A", rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(40)
    ...     again = resume(SwarmModel, f"{folder}/run.arrow", step=30)
    ...     again.run(10).state_hash() == model.state_hash()
    True
    """
    recording = Recording(path)
    step = _checked_step(recording, step)
    with progress_bar(step, "steps", progress) as bar:
        return resume_watched(recording, base, step, changes, lambda model: bar.update(model.completed - bar.n))


def resume_watched(
    recording: Recording, base: type, step: int, changes: dict[str, Any], watch: Watch = lambda _: None
) -> EngineModel:
    """Return the same as `resume`, and call `watch` with the model after each step that is run again."""
    model_class = class_of(recording, base)
    odd = sorted(set(changes) - {*recording.provenance["parameters"], "map"})
    if odd:
        parameters = recording.provenance["parameters"]
        raise UnknownNameError(unknown_name(f"parameter of {model_class.__name__}", odd[0], parameters))
    if "map" in changes:
        raise InvalidValueError("map cannot be changed during a run; resume with other parameters")
    model = state_at(recording, model_class, step, watch)
    if not changes:
        return model
    fresh = rebuild_model(recording.provenance, model_class)
    continued_model = rebuild_model(recording.provenance, model_class, **changes)
    take_over(continued_model, model, fresh)
    return continued_model


def state_at(recording: Recording, model_class: type, step: int, watch: Watch = lambda _: None) -> EngineModel:
    """Return the model as it was after a step of a recording: from the last whole checkpoint, or its parameters.

    An error names the nearest steps that work.
    """
    try:
        rerun = _nearest(recording, model_class, step, watch)
    except RecordingError as error:
        if not is_of_other_bits(recording.provenance):
            raise
        stored = ", ".join(map(str, recording.checkpoints)) or "none"
        raise RecordingError(f"{recording.path}: {error}; steps with stored states: {stored}") from None
    begin = rerun.model.completed
    try:
        run_to(rerun, step)
        rerun.move_by_hand()
    except RecordingError as error:
        steps = [last_same(_nearest(recording, model_class, begin, watch), step)]
        steps = [*steps, *(place for place in recording.checkpoints if place > step)][:2]
        nearest = " and ".join(map(str, steps))
        raise RecordingError(f"{recording.path}: {error}; the nearest steps to resume from are {nearest}") from None
    return rerun.model


def _nearest(recording: Recording, model_class: type, step: int, watch: Watch) -> Rerun:
    """Return a model with the state of the last whole checkpoint at or before a step, or one started again.

    A state that is not that of its row, or of the recording's start, is refused; one of a step without a row is not
    used. States after a change by hand have no row.
    """
    by_hand = {change.checkpoint for change in recording.interventions}
    usable = [place for place, stored_step in enumerate(recording.checkpoints) if stored_step <= step]
    for place in reversed(usable):
        try:
            states = states_to(recording, place)
        except RecordingError:  # damaged: an earlier one, or running again, gives the same state, but slower
            continue
        if place not in by_hand and not has_row(recording, recording.checkpoints[place]):
            continue  # nothing proves that it is the state of its step
        rerun = Rerun(recording, restore_last(recording, model_class, states), place, watch)
        if place not in by_hand:
            check_row(rerun)
        return rerun
    return start_again(recording, model_class, watch)


def _checked_step(recording: Recording, step: int | None) -> int:
    start = recording.provenance["start"]["step"]
    last = recording[-1].step if len(recording) else start
    if step is None:
        return last
    try:
        return check_count("step", step, minimum=start, maximum=last)
    except InvalidValueError as error:
        raise InvalidValueError(f"{error}{recording.why_short}") from None


def class_of(recording: Recording, base: type) -> type:
    """Return the recorded class: `base`, a loaded class derived from it, or one that is part of mesa_swarm."""
    module, name = recording.provenance["model"]["module"], recording.provenance["model"]["name"]
    shipped_class(module, name)  # imports it
    model_class = find_loaded_class(base, module, name)
    if model_class is not None:
        return model_class
    class_text = model_address(base) if base.__qualname__ == name else base.__name__
    raise RecordingError(
        f"{recording.path} is of {shortened(name)}, which is neither {class_text} nor a loaded subclass of it; "
        f"import its class ({address_in(recording)}) and call its resume"
    )


def shipped_class_of(recording: Recording) -> type:
    """Return the recorded class, which must be part of mesa_swarm: importing any other would run its code."""
    recorded_class = recording.provenance["model"]
    model_class = shipped_class(recorded_class["module"], recorded_class["name"])
    if model_class is None:
        raise RecordingError(
            f"{recording.path} is of {shortened(recorded_class['name'])}, which is not part of mesa_swarm; "
            f"name it: mesa-swarm verify FILE --model {address_in(recording)}, or call its class's verify"
        )
    return model_class


def address_in(recording: Recording) -> str:
    """Return the address of the recorded class, or its form if it is that of a program or is odd."""
    recorded_class = recording.provenance["model"]
    address = f"{recorded_class['module']}:{recorded_class['name']}"
    is_plain = is_address(address) and len(address) <= LONGEST_ADDRESS and recorded_class["module"] != "__main__"
    return address if is_plain and "<" not in address else FORMS
