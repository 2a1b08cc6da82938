"""Continuing a run from any step of its recording, unchanged or with other parameters."""

import os
from copy import deepcopy
from typing import Any

import numpy as np

from mesa_swarm.errors import InvalidValueError, RecordingError, UnknownNameError, check_count, shortened, unknown_name
from mesa_swarm.fire.model import FireModel
from mesa_swarm.gallery import FORMS, address_of, is_address, shipped_class
from mesa_swarm.progress import progress_bar
from mesa_swarm.recording.collected import reporters_of, set_clock
from mesa_swarm.recording.container import ATOMS
from mesa_swarm.recording.parts import family
from mesa_swarm.recording.provenance import is_of, rebuilt
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.verify import Rerun, Watch, last_same, restored, run_to, started_again, states_to

# Columns that follow from parameters; all others are the state of the run.
OF_PARAMETERS = frozenset({"number", "design", "radius", "max_speed"})
# Attributes that a run may change, in any model: plain values.
PLAIN = (*ATOMS, np.ndarray, np.generic)
# An address in a recording that is longer is not shown.
LONGEST_ADDRESS = 80
# Attributes that belong to the new model.
OWN = frozenset({"_senses_version", "given"})


def resume(
    base: type, path: str | os.PathLike[str], *, step: int | None = None, progress: bool = False, **changes: object
) -> FireModel:
    """Return the model as it was after a step of a recording, from which it continues with the same bits.

    The nearest checkpoint at or before the step is restored, and the model runs from there to the step, compared
    with the recording on the way; without a checkpoint it is run again from its parameters. With other parameters, a
    second model is made with these and takes over the first one's state: positions, readings, temperatures, the memory
    of layers (by the layer's name), random streams, counters. Attributes that were replaced by hand before, such as
    `control` or `fire_constants`, then follow from the parameters again.

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
        New values of the model's parameters, which must leave the same robots, fires, obstacles and loads.

    Raises
    ------
    RecordingError
        If running again does not match the recording, as with other code, or after a manual change without a stored
        state; the nearest steps that work are named.
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
        return resumed(recording, base, step, changes, lambda model: bar.update(model.completed - bar.n))


def resumed(
    recording: Recording, base: type, step: int, changes: dict[str, Any], watch: Watch = lambda _: None
) -> FireModel:
    """Return the same as `resume`, and call `watch` with the model after each step that is run again."""
    model_class = class_of(recording, base)
    unknown = sorted(set(changes) - {*recording.provenance["parameters"], "map"})
    if unknown:
        known = recording.provenance["parameters"]
        raise UnknownNameError(unknown_name(f"parameter of {model_class.__name__}", unknown[0], known))
    if "map" in changes:
        raise InvalidValueError("map cannot be changed during a run; resume with other parameters")
    model = state_at(recording, model_class, step, watch)
    if not changes:
        return model
    fresh = rebuilt(recording.provenance, model_class)
    changed = rebuilt(recording.provenance, model_class, **changes)
    take_over(changed, model, fresh)
    return changed


def state_at(recording: Recording, model_class: type, step: int, watch: Watch = lambda _: None) -> FireModel:
    """Return the model as it was after a step of a recording: from the last whole checkpoint, or its parameters.

    An error names the nearest steps that work.
    """
    rerun = _nearest(recording, model_class, step, watch)
    begin = rerun.model.completed
    try:
        run_to(rerun, step)
    except RecordingError as error:
        steps = [last_same(_nearest(recording, model_class, begin, watch), step)]
        steps = [*steps, *(one for one in recording.checkpoints if one > step)][:2]
        nearest = " and ".join(map(str, steps))
        raise RecordingError(f"{recording.path}: {error}; the nearest steps to resume from are {nearest}") from None
    return rerun.model


def _nearest(recording: Recording, model_class: type, step: int, watch: Watch) -> Rerun:
    """Return a model with the state of the last whole checkpoint at or before a step, or one started again."""
    usable = [place for place, one in enumerate(recording.checkpoints) if one <= step]
    for place in reversed(usable):
        try:
            states = states_to(recording, place)
        except RecordingError:  # damaged: an earlier one, or running again, gives the same state, but slower
            continue
        return Rerun(recording, restored(recording, model_class, states), place, watch)
    return started_again(recording, model_class, watch)


def take_over(new: FireModel, old: FireModel, fresh: FireModel) -> None:
    """Copy the state of a model to a `new` one that has taken no step yet and has the same objects.

    Values of `old` that differ from those in `fresh`, which is `old` before its first step, are state; the others
    follow from parameters.
    """
    _check_same_objects(new, old)
    set_clock(new, old.steps)
    new.obstacles_changed()
    for load, moved in zip(new.loads, old.loads, strict=True):
        load.move_to(moved.pose)
        load.moved, load.pushers = moved.moved, moved.pushers
    for column, source in zip(new.movers.poses, old.movers.poses, strict=True):
        column[:] = source
    new.movers.blocked[:], new.movers.fresh[:] = old.movers.blocked, old.movers.fresh
    new.obstacles_changed()
    _take_columns(new, old)
    _take_fires(new, old)
    _take_fields(new, old)
    _take_randomness(new, old)
    _take_plain_values(new, old, fresh)
    _take_collected(new, old)
    new.swarm.disturbed = old.swarm.disturbed


def _check_same_objects(new: FireModel, old: FireModel) -> None:
    for name in ("robots", "fires", "obstacles", "loads", "bodies"):
        ids, was = ([agent.unique_id for agent in getattr(model, name)] for model in (new, old))
        if ids != was:
            raise InvalidValueError(
                f"the change makes a world with {len(ids)} {name} instead of the {len(was)} recorded; "
                "change only parameters that leave them as they are"
            )


def _take_columns(new: FireModel, old: FireModel) -> None:
    known = {**{_without_place(name): name for name in old.swarm.columns}, **{name: name for name in old.swarm.columns}}
    for name, column in new.swarm.columns.items():
        source = known.get(name, known.get(_without_place(name)))
        if name in OF_PARAMETERS or source is None or old.swarm.columns[source].shape != column.shape:
            continue
        column[...] = old.swarm.columns[source]
    new.swarm.groups = old.swarm.groups
    new.swarm.regrouped += 1


def _without_place(name: str) -> str:
    """Return the name of a layer's column without the index of the layer, which may have changed."""
    place, dot, rest = name.partition(".")
    return rest if dot and place.isdigit() else name


def _take_fires(new: FireModel, old: FireModel) -> None:
    for name in ("temperature", "out", "out_step", "robots"):
        new.fires.columns[name][:] = old.fires.columns[name]
    every = new.fires.history.every
    new.fires.history = deepcopy(old.fires.history)
    new.fires.history.every = every


def _take_fields(new: FireModel, old: FireModel) -> None:
    """Copy the values of fields of the same name and grid."""
    for name, field in new.fields.items():
        if name in old.fields and old.fields[name].values.shape == field.values.shape:
            field.restore(old.fields[name].checkpoint())


def _take_randomness(new: FireModel, old: FireModel) -> None:
    for name, state in old.streams.state().items():
        new.streams[name].bit_generator.state = state
    new.rng.bit_generator.state = old.rng.bit_generator.state
    new.random.setstate(old.random.getstate())
    new.__dict__["_noise"] = old.__dict__["_noise"]  # this step's sensor errors, which may have been drawn already


def _take_plain_values(new: FireModel, old: FireModel, fresh: FireModel) -> None:
    values: dict[str, Any] = {n: v for n, v in old.__dict__.items() if isinstance(v, PLAIN) and n not in OWN}
    for name, value in values.items():
        if not np.array_equal(value, fresh.__dict__.get(name, new)):
            new.__dict__[name] = deepcopy(value)


def _take_collected(new: FireModel, old: FireModel) -> None:
    """Copy collected data, unless the new parameters collect other data."""
    if new.datacollector.model_vars.keys() == old.datacollector.model_vars.keys():
        for name, values in old.datacollector.model_vars.items():
            new.datacollector.model_vars[name] = list(values)
        reporters = reporters_of(old)
        for name, reporter in reporters_of(new).items():
            if name in reporters:
                reporter.restore(reporters[name].checkpoint())


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
    loaded = family(base)
    for model_class in loaded:
        if (model_class.__module__, model_class.__qualname__) == (module, name):
            return model_class
    alike = [model_class for model_class in loaded if is_of(recording.provenance, model_class)]
    if len(alike) == 1:
        return alike[0]
    shown = address_of(base) if base.__qualname__ == name else base.__name__
    raise RecordingError(
        f"{recording.path} is of {shortened(name)}, which is neither {shown} nor a loaded subclass of it; "
        f"import its class ({address_in(recording)}) and call its resume"
    )


def shipped_class_of(recording: Recording) -> type:
    """Return the recorded class, which must be part of mesa_swarm: importing any other would run its code."""
    recorded = recording.provenance["model"]
    model_class = shipped_class(recorded["module"], recorded["name"])
    if model_class is None:
        raise RecordingError(
            f"{recording.path} is of {shortened(recorded['name'])}, which is not part of mesa_swarm; "
            f"name it: mesa-swarm verify FILE --model {address_in(recording)}, or call its class's verify"
        )
    return model_class


def address_in(recording: Recording) -> str:
    """Return the address of the recorded class, or its form if it is that of a program or is odd."""
    recorded = recording.provenance["model"]
    address = f"{recorded['module']}:{recorded['name']}"
    is_plain = is_address(address) and len(address) <= LONGEST_ADDRESS and recorded["module"] != "__main__"
    return address if is_plain and "<" not in address else FORMS
