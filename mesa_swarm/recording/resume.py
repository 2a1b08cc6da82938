"""Continuing a run from any step of its recording, unchanged or with other parameters."""

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from itertools import zip_longest
from typing import Any

from mesa_swarm.control.team import Team
from mesa_swarm.errors import InvalidValueError, RecordingError, UnknownNameError, check_count, shortened, unknown_name
from mesa_swarm.fire.model import FireModel
from mesa_swarm.gallery import FORMS, address_of, is_address, shipped_class
from mesa_swarm.progress import progress_bar
from mesa_swarm.recording.attributes import (
    ModelPacked,
    attribute_from_json,
    attribute_to_json,
    own_attributes,
    own_attributes_of_agent,
)
from mesa_swarm.recording.collected import reporters_of, set_clock
from mesa_swarm.recording.parts import family, objects_to_json, other_agents, restore_objects
from mesa_swarm.recording.provenance import is_of, rebuilt
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.removed import make_removed, removed_to_json, restore_removed
from mesa_swarm.recording.verify import Rerun, Watch, last_same, restored, run_to, started_again, states_to
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.state import attributes_of, fingerprint

# Columns that follow from parameters; all others are the state of the run.
OF_PARAMETERS = frozenset({"number", "design", "radius", "max_speed"})
# Those of them that are the run's where it has added or removed robots.
MADE = frozenset({"number", "design"})
# An address in a recording that is longer is not shown.
LONGEST_ADDRESS = 80


def resume(
    base: type, path: str | os.PathLike[str], *, step: int | None = None, progress: bool = False, **changes: object
) -> FireModel:
    """Return the model as it was after a step of a recording, from which it continues with the same bits.

    The nearest checkpoint at or before the step is restored, and the model runs from there to the step, compared
    with the recording on the way; without a checkpoint it is run again from its parameters. With other parameters, a
    second model is made with these and takes over the first one's state: its robots and other objects as they are now,
    positions, readings, temperatures, the memory of layers (by their group or design, name and place), random streams,
    counters, the declared state, events. Attributes that were replaced by hand before, such as `control` or
    `fire_constants`, then follow from the parameters again.

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
        rerun.move_by_hand()
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
    """Copy the state of a model to a `new` one that has taken no step yet.

    Values of `old` that differ from those in `fresh`, which is `old` before its first step, are state; the others
    follow from parameters. So do its robots and other objects: what was added or removed during the run is.
    """
    remade = _take_objects(new, old, fresh)
    set_clock(new, old.steps)
    new.obstacles_changed()
    for load, moved in zip(new.loads, old.loads, strict=True):
        load.move_to(moved.pose)
        load.moved, load.pushers = moved.moved, moved.pushers
    for column, source in zip(new.movers.poses, old.movers.poses, strict=True):
        column[:] = source
    for flags in ("blocked", "fresh", "carried"):
        getattr(new.movers, flags)[:] = getattr(old.movers, flags)
    for body, was in zip(new.movers.agents, old.movers.agents, strict=True):
        body.carrier = None if was.carrier is None else new.swarm.agents[was.carrier.row]
    new.obstacles_changed()
    _take_columns(new, old, OF_PARAMETERS - MADE if remade else OF_PARAMETERS)
    _take_fires(new, old, fresh)
    _take_fields(new, old, fresh)
    _take_randomness(new, old)
    _take_values(new, old, fresh)
    _take_collected(new, old)
    new.swarm.disturbed = old.swarm.disturbed


def _take_objects(new: FireModel, old: FireModel, fresh: FireModel) -> bool:
    """Add and remove what was added and removed during the run; return whether anything was.

    The change itself has to make the same objects as without it.
    """
    if _objects_of(new) == _objects_of(old):
        return False
    for name, ids in _objects_of(new).items():
        was = _objects_of(fresh)[name]
        if ids != was:
            raise InvalidValueError(
                f"the change makes a world with {len(ids)} {name} instead of the {len(was)} recorded; "
                "change only parameters that leave them as they are"
            )
    restore_objects(new, _changed_objects(*map(objects_to_json, (new, old, fresh))))
    return True


def _objects_of(model: FireModel) -> dict[str, list[int]]:
    """Return the unique_ids of all agents by kind."""
    kinds = {name: getattr(model, name) for name in ("robots", "fires", "obstacles", "loads", "bodies")}
    kinds["agents"] = other_agents(model)
    return {name: [agent.unique_id for agent in agents] for name, agents in kinds.items()}


def _changed_objects(new: dict, old: dict, fresh: dict) -> dict:
    """Return the stored objects of `old`, but with those designs and shapes of `new` that the run did not change."""
    designs = [_unless_changed(*three) for three in zip_longest(new["designs"], old["designs"], fresh["designs"])]
    mine, first = ({body["id"]: body for body in one["obstacles"]} for one in (new, fresh))
    bodies = [_merged(mine.get(body["id"], {}), body, first.get(body["id"], {})) for body in old["obstacles"]]
    return {**old, "designs": designs[: len(old["designs"])], "obstacles": bodies}


def _merged(new: dict, old: dict, fresh: dict) -> dict:
    return {name: _unless_changed(new.get(name), value, fresh.get(name)) for name, value in old.items()}


def _unless_changed(new: Any, old: Any, fresh: Any) -> Any:
    """Return the value that follows from the new parameters, unless the run has changed it since its beginning."""
    return new if old == fresh and new is not None else old


def _take_columns(new: FireModel, old: FireModel, of_parameters: frozenset[str]) -> None:
    renamed = {_prefix(new, index): _prefix(old, other) for index, other in _same_layers(new, old).items()}
    for name, column in new.swarm.columns.items():
        source = _renamed(name, renamed)
        if name in of_parameters or source not in old.swarm.columns:
            continue
        if old.swarm.columns[source].shape == column.shape:
            column[...] = old.swarm.columns[source]
    new.swarm.groups = old.swarm.groups
    new.swarm.regrouped += 1


def _same_layers(new: FireModel, old: FireModel) -> dict[int, int]:
    """Return by the indices of the layers of one model those of another that are the same.

    They have the same name and place among those of this name, in the arbiter of the same design or group.
    """
    teams = isinstance(new.control, Team) and isinstance(old.control, Team)
    mine, others = (_places_of_layers(model, teams) for model in (new, old))
    return {index: others[place] for place, index in mine.items() if place in others}


def _places_of_layers(model: FireModel, by_label: bool) -> dict[tuple[str, str, int], int]:
    """Return the indices of layers by the label of their arbiter, their name, and how often that came before."""
    count = Counter[tuple[str, str]]()
    places = {}
    for index, (label, name) in enumerate(_named_layers(model)):
        key = (label if by_label else "", name)
        places[*key, count[key]] = index
        count[key] += 1
    return places


def _named_layers(model: FireModel) -> list[tuple[str, str]]:
    """Return the label of its arbiter and the name of each layer."""
    parts = getattr(model.control, "parts", () if model.control is None else (model.control,))
    labels = getattr(model.control, "labels", ("",))
    return [
        (label, layer.name) for label, part in zip(labels, parts, strict=False) for layer in getattr(part, "layers", ())
    ]


def _prefix(model: FireModel, index: int) -> str:
    """Return how the names of the columns of a layer begin."""
    return ".".join([str(index), *filter(None, _named_layers(model)[index])])


def _renamed(name: str, renamed: dict[str, str]) -> str:
    """Return the name that a column has in the other model; none has an empty name."""
    place, dot, _ = name.partition(".")
    if not dot or not place.isdigit():
        return name
    found = next((one for one in renamed if name.startswith(f"{one}.")), None)
    return "" if found is None else renamed[found] + name[len(found) :]


def _take_fires(new: FireModel, old: FireModel, fresh: FireModel) -> None:
    first = {fire.unique_id for fire in fresh.fires}
    added = [row for row, fire in enumerate(old.fires.agents) if fire.unique_id not in first]
    for name, column in old.fires.columns.items():
        rows = slice(None) if name in ("temperature", "out", "out_step", "robots") else added
        new.fires.columns[name][rows] = column[rows]
    every = new.fires.history.every
    new.fires.history = deepcopy(old.fires.history)
    new.fires.history.every = every


def _take_fields(new: FireModel, old: FireModel, fresh: FireModel) -> None:
    """Remove and add the fields that the run did, and copy the values of those of the same name and grid."""
    for name in [name for name in fresh.fields if name in new.fields and name not in old.fields]:
        new.remove_field(name)
    for name, field in old.fields.items():
        if name not in fresh.fields and name not in new.fields:
            new.add_field(field.declared)
    for name, field in new.fields.items():
        if name in old.fields and old.fields[name].values.shape == field.values.shape:
            field.restore(old.fields[name].checkpoint())


def _take_randomness(new: FireModel, old: FireModel) -> None:
    for name, state in old.streams.state().items():
        new.streams[name].bit_generator.state = state
    new.rng.bit_generator.state = old.rng.bit_generator.state
    new.random.setstate(old.random.getstate())
    new.__dict__["_noise"] = old.__dict__["_noise"]  # this step's sensor errors, which may have been drawn already


def _take_values(new: FireModel, old: FireModel, fresh: FireModel) -> None:
    """Copy what the run has changed in attributes, the declared state, processes, custom layers and other agents."""
    there = ModelPacked(old)
    here, there.removed = ModelPacked(new, there.arrays), {}
    for number in old._processes.keys() - fresh._processes.keys() - new._processes.keys():
        kind: Any = type(old._processes[number])
        new._processes[number] = kind.__new__(kind)  # the run has added it: its attributes follow
    if new._processes.keys() < old._processes.keys():
        raise InvalidValueError("the change makes a model with fewer processes; change parameters that leave them")
    for number in new._processes.keys() - old._processes.keys():
        new.remove_process(new._processes[number])
    renamed = {_prefix(old, other): _prefix(new, index) for index, other in _same_layers(new, old).items()}
    for mine, values, first in _owners_of_values(new, old, fresh):
        for name in first.keys() - values.keys():
            mine.pop(name, None)
        for name, value in values.items():
            if name not in first or fingerprint(value) != fingerprint(first[name]):
                with suppress(RecordingError):  # follows from the parameters
                    content = _of_columns(attribute_to_json(value, name, there), renamed, new)
                    make_removed(here, removed_to_json(there))
                    mine[name] = attribute_from_json(mine.get(name), name, content, here)
    restore_removed(here, removed_to_json(there))
    new.events.replace({name: list(series) for name, series in old.events.series().items()})
    new.obstacles_changed()


def _of_columns(content: Any, renamed: dict[str, str], new: FireModel) -> Any:
    """Return a value as stored, but a column of a layer by the name that it has in the new model."""
    if "column" not in content:
        return content
    name = _renamed(content["column"], renamed)
    if name not in new.swarm.columns:
        raise RecordingError(f"the change makes a model without the column {shortened(content['column'])}")
    return {"column": name}


def _owners_of_values(new: FireModel, old: FireModel, fresh: FireModel) -> Iterator[tuple[Any, dict, dict]]:
    """Iterate over what has values: where those of the new model are, those of the old one, and the first ones."""
    yield new.__dict__, own_attributes(old), own_attributes(fresh)
    yield new.state, dict(old.state), dict(fresh.state)
    for number, process in new._processes.items():
        before = attributes_of(fresh._processes[number]) if number in fresh._processes else {}
        yield _Attributes(process), attributes_of(old._processes[number]), before
    yield from _owners_of_layers(new, old, fresh)
    agents, firsts = ({agent.unique_id: agent for agent in other_agents(model)} for model in (old, fresh))
    for agent in other_agents(new):
        before = own_attributes_of_agent(firsts[agent.unique_id]) if agent.unique_id in firsts else {}
        yield _Attributes(agent), own_attributes_of_agent(agents[agent.unique_id]), before


def _owners_of_layers(new: FireModel, old: FireModel, fresh: FireModel) -> Iterator[tuple[Any, dict, dict]]:
    mine, others, firsts = (getattr(model.control, "layers", ()) for model in (new, old, fresh))
    of_fresh = _same_layers(new, fresh)
    for index, other in _same_layers(new, old).items():
        if not type(mine[index]).__module__.startswith("mesa_swarm."):
            first = attributes_of(firsts[of_fresh[index]]) if index in of_fresh else {}
            yield _Attributes(mine[index]), _without_swarm(attributes_of(others[other])), _without_swarm(first)


def _without_swarm(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if not isinstance(value, Swarm)}


class _Attributes:
    """The attributes of an object, written like the values of a dict."""

    def __init__(self, owner: object) -> None:
        self.owner = owner

    def get(self, name: str) -> Any:
        return getattr(self.owner, name, None)

    def pop(self, name: str, default: None) -> None:
        self.owner.__dict__.pop(name, default)

    def __setitem__(self, name: str, value: Any) -> None:
        object.__setattr__(self.owner, name, value)


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
