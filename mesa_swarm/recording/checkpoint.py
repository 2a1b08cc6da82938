"""Checkpoints: everything a model needs to continue."""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from mesa.agent import Agent

from mesa_swarm.control.arbiter import MOST_LAYERS
from mesa_swarm.errors import RecordingError, SwarmError, in_words, shortened
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.collected import (
    Path,
    collected_to_json,
    has_own_events,
    joined,
    reporters_of,
    restore_collected,
    set_clock,
)
from mesa_swarm.recording.container import Checkpoint, Packed
from mesa_swarm.recording.parts import (
    control_from_json,
    control_to_json,
    objects_to_json,
    part_from_json,
    part_to_json,
    restore_objects,
)
from mesa_swarm.robots.design import LARGEST_RADIUS

# Attributes that are stored separately, follow from what is stored, or only describe how the model is viewed.
# First Mesa's, then ours.
HANDLED = frozenset(
    (
        *("steps", "step", "rng", "_rng", "random", "_seed", "_user_step", "_agents", "_agents_by_type", "_all_agents"),
        *("subscribers", "_batch_context", "_suppress", "_time", "agent_id_counter", "_simulator", "_event_list"),
        *("_event_generators", "_scenario", "_default_schedule", "data_registry"),
        *("given", "_engine", "map", "streams", "space", "swarm", "fires", "_obstacles", "_loads", "_scene"),
        *("_scene_table", "observers", "_channel", "_fire_constants", "_senses", "_senses_version", "_sensed"),
        *("_noise", "_imperfect", "_own_parts", "datacollector", "_collect_every", "_control", "_snapshots"),
    )
)
HANDLED_OF_AGENTS = frozenset(
    (
        *("model", "unique_id", "space", "_mesa_index", "pos", "swarm", "row", "fires", "shape", "form", "pose"),
        *("_resistance", "moved", "pushers"),
    )
)
# Attributes that every model has and computes with.
OF_EVERY_MODEL = {
    **dict.fromkeys(("_burns", "running"), (bool, np.bool_)),
    **dict.fromkeys(("collisions", "total_collisions", "_completed"), (int,)),
    **dict.fromkeys(("_turn_angle", "extinguish_range"), (float, int, np.float64)),
}
LARGEST_NUMBER = 1e15
# Bit generators of which every state is valid.
GENERATORS = ("PCG64", "PCG64DXSM")
# Of the state of Python's generator.
WORDS = 625
OURS = ("mesa_swarm.control.", "mesa_swarm.fire.")


@runtime_checkable
class Checkpointed(Protocol):
    """An attribute of the model, or a layer of its control, with a state of its own: a learner for example.

    A layer whose whole memory is in columns of the swarm (`Swarm.remember`) needs neither method.
    """

    def checkpoint(self) -> dict:
        """Return all that a later step depends on: arrays and plain values (`container.Packed`) by name."""

    def restore(self, state: dict) -> None:
        """Restore what `checkpoint` returned."""


class _ModelPacked(Packed):
    """Plain values of a model, which may refer to its agents by unique_id."""

    def __init__(self, model: FireModel, arrays: list[np.ndarray] | None = None) -> None:
        super().__init__(arrays)
        self.model = model
        self._agents: dict[int, Agent] | None = None

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON."""
        if isinstance(value, Agent):
            if value not in self.model.agents:
                raise RecordingError(f"{what} refers to an agent that is not in the model, which cannot be stored")
            return {"agent": value.unique_id}
        return super().pack(value, what, depth)

    def unpack(self, content: Any) -> Any:
        """Return the value for which `pack` returned this."""
        if isinstance(content, dict) and "agent" in content:
            if self._agents is None:
                self._agents = {agent.unique_id: agent for agent in self.model.agents}
            return self._agents[content["agent"]]
        return super().unpack(content)


def checkpoint_of(model: FireModel, since: dict[Path, int] | None = None, *, steps: int | None = None) -> Checkpoint:
    """Return the complete state of a model, between two steps; an error names what cannot be stored.

    Stored are the swarm, obstacles, loads, fires, radio, control, all random streams, Mesa's counters, collected data,
    and all other attributes of the model that are plain, or have `checkpoint` and `restore`. Snapshots of `watch` are
    not. `since` has the lengths of the collected series at the last checkpoint (`lengths_of`): only values added since
    then are stored. `steps` is what Mesa had counted, if it has already counted a step that has not begun.
    """
    state_hash = model.state_hash()  # reads the sensors, as their next use does
    if has_own_events(model):
        raise RecordingError("Mesa's schedule has events besides the step, which cannot be stored")
    packed = _ModelPacked(model)
    facts = {
        "steps": model.steps if steps is None else steps,
        "things": objects_to_json(model),
        "columns": {name: packed.pack(column) for name, column in sorted(model.swarm.columns.items())},
        "disturbed": model.swarm.disturbed,
        "fires": {name: packed.pack(column) for name, column in model.fires.columns.items()},
        "collect_every": model.collect_every,
        "history": [model.fires.history.every, list(model.fires.history._places), model.fires.history._fires],
        "constants": part_to_json(model.fire_constants),
        "radio": part_to_json(model.communication),
        "imperfect": model._imperfect and [part_to_json(model.imperfections), model._imperfect.key],
        "control": control_to_json(model.control),
        "control_state": _control_state(model, packed),
        "randomness": _randomness(model, packed),
        "collected": collected_to_json(model, packed, since or {}),
        "reporters": {
            name: packed.pack(reporter.checkpoint(), f"reporter {name}")
            for name, reporter in reporters_of(model).items()
        },
        "attributes": {n: _attribute(v, n, packed) for n, v in model.__dict__.items() if n not in HANDLED},
        "of_things": _agent_attributes(model, packed),
    }
    return Checkpoint(step=model.completed, state_hash=state_hash, facts=facts, arrays=packed.arrays)


def restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint] = ()) -> FireModel:
    """Restore the state of a checkpoint in a model that was just constructed, and return the model.

    It builds on the collected data of `earlier`, the checkpoints before it in the same recording. A result that is not
    the state that was stored is refused.
    """
    where = f"the checkpoint of step {checkpoint.step}"
    try:
        _restore(model, checkpoint, earlier)
        state_hash = model.state_hash()
    except (SwarmError, ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError,
            ValueError) as error:  # fmt: skip
        raise RecordingError(f"{where} cannot be restored: {in_words(error)}") from None
    if state_hash != checkpoint.state_hash or model.completed != checkpoint.step:
        raise RecordingError(f"{where} does not match its state hash: another version of mesa_swarm wrote it")
    return model


def _restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint]) -> None:
    facts, packed = checkpoint.facts, _ModelPacked(model, checkpoint.arrays)
    restore_objects(model, facts["things"])
    model.fire_constants = part_from_json(facts["constants"])
    _restore_control(model, facts, packed)
    set_clock(model, facts["steps"])
    model.collect_every = facts.get("collect_every", model.collect_every)  # absent from older checkpoints
    _restore_attributes(model, facts, packed)
    _restore_columns(model.swarm.columns, facts["columns"], packed)
    _restore_columns(model.fires.columns, facts["fires"], packed)
    _check_columns(model)
    _restore_history(model, facts["history"])
    parts = [(part.facts["collected"], _ModelPacked(model, part.arrays)) for part in earlier]
    restore_collected(model, joined([*parts, (facts["collected"], packed)]))
    for name, reporter in reporters_of(model).items():
        reporter.restore(packed.unpack(facts["reporters"][name]))
    model.obstacles_changed()
    model.swarm.version += 1
    model._sensed = None
    _restore_randomness(model, facts["randomness"], packed)
    model.swarm.disturbed = bool(facts["disturbed"])


def _restore_columns(columns: dict[str, np.ndarray], stored: dict, packed: Packed) -> None:
    """Write stored columns into those of a model, which must have the same types and shapes."""
    if "group" in columns and "group" not in stored:  # in older recordings
        columns = {name: column for name, column in columns.items() if name != "group"}
    if stored.keys() != columns.keys():
        odd = sorted(stored.keys() ^ columns.keys())
        raise RecordingError(f"column {shortened(odd[0])} is in the model or in the checkpoint, but not in both")
    values = {name: packed.unpack(column) for name, column in stored.items()}
    for name, column in columns.items():
        value = values[name]
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != column.shape:
            raise RecordingError(f"column {name} does not match the model; expected {column.dtype} {column.shape}")
    for name, column in columns.items():
        column[...] = values[name]


def _check_columns(model: FireModel) -> None:
    """Refuse values that compiled functions, which check nothing, would use as an index or a position."""
    robots, fires, designs = model.swarm.columns, model.fires.columns, model.swarm.designs
    ends = {"design": (0, len(designs)), "fire": (-1, len(model.fires)), "layer": (-1, MOST_LAYERS)}
    ends["group"] = (-1, len(model.swarm.groups))
    for name, (first, end) in ends.items():
        if not ((robots[name] >= first) & (robots[name] < end)).all():
            raise RecordingError(f"column {name} has out-of-range values")
    radius, fastest = (np.array([getattr(d, name) for d in designs]) for name in ("radius", "max_speed"))
    low, high = np.reshape(model.map.bounds, (2, 2))
    own = robots["design"]
    valid = {
        "position": all(((c["position"] >= low) & (c["position"] <= high)).all() for c in (robots, fires)),
        "heading": np.isfinite(robots["heading"]).all(),
        "number": len(np.unique(robots["number"])) == len(model.swarm),
        "command": np.isfinite(robots["command"]).all(),
        "radius": not len(own) or (robots["radius"] == radius[own]).all(),
        "max_speed": not len(own) or ((robots["max_speed"] >= 0) & (robots["max_speed"] <= fastest[own])).all(),
        "radius of fires": ((fires["radius"] > 0) & (fires["radius"] <= LARGEST_RADIUS)).all(),
    }
    for name, is_valid in valid.items():
        if not is_valid:
            raise RecordingError(f"column {name} has out-of-range values")


def _restore_history(model: FireModel, stored: list) -> None:
    """Restore the interval and the places of the history of fires; its rows are collected data."""
    history = model.fires.history
    every, places, fires = stored
    numbers = all(type(number) is int and number >= 0 for number in (every, fires, *places))
    if not numbers or len(places) != len(model.fires) or any(place >= fires for place in places) or fires > 1e7:
        raise RecordingError("invalid history of fires")
    history.every, history._places, history._fires = every, list(places), fires


def _control_state(model: FireModel, packed: _ModelPacked) -> list:
    if model.control is None:
        return []
    arbiters, layers = model.control.parts, model.control.layers
    return [*(_arbiter_state(one, packed) for one in arbiters), *(_layer_state(layer, packed) for layer in layers)]


def _arbiter_state(arbiter: Any, packed: _ModelPacked) -> object:
    values = {} if type(arbiter).__module__.startswith(OURS) else vars(arbiter)
    own = {name: value for name, value in values.items() if name not in ("layers", "weights", "others")}
    return _inner(own, type(arbiter).__name__, packed)


def _layer_state(layer: Any, packed: _ModelPacked) -> object:
    if isinstance(layer, Checkpointed):
        return {"own": packed.pack(layer.checkpoint(), f"layer {getattr(layer, 'name', '')}")}
    if type(layer).__module__.startswith(OURS):
        return None
    return _inner(getattr(layer, "__dict__", {}), f"layer {getattr(layer, 'name', '')}", packed)


def _inner(values: dict, what: str, packed: _ModelPacked) -> dict:
    swarm = packed.model.swarm
    return {n: _attribute(v, f"{what}'s {n}", packed) for n, v in values.items() if v is not swarm}


def _restore_imperfect(model: FireModel, stored: list | None) -> None:
    """Restore the imperfections, and the key of their random numbers."""
    if stored is None and model.imperfections is None:
        return
    part, key = stored or (None, 0)
    model.imperfections = part_from_json(part)
    if type(key) is not int or not 0 <= key < 2**64:
        raise RecordingError(f"invalid key of imperfections: {shortened(key)}")
    if model._imperfect is not None:
        model._imperfect.key = key


def _restore_control(model: FireModel, facts: dict, packed: _ModelPacked) -> None:
    """Restore the radio and the control, unless the model's constructor has made the same."""
    _restore_imperfect(model, facts.get("imperfect"))
    radio = part_from_json(facts["radio"])
    if model.communication != radio:
        model.communication = radio
    if control_to_json(model.control) != facts["control"]:
        model.control = control_from_json(facts["control"])
    if model.control is None:
        return
    arbiters, states = model.control.parts, facts["control_state"]
    for arbiter, state in zip(arbiters, states, strict=False):
        _restore_inner(arbiter, state, packed)
    for layer, state in zip(model.control.layers, states[len(arbiters) :], strict=True):
        if isinstance(layer, Checkpointed):
            layer.restore(packed.unpack(state["own"]))
        elif state is not None:
            _restore_inner(layer, state, packed)


def _restore_inner(owner: object, state: dict, packed: _ModelPacked) -> None:
    if state and type(owner).__module__.startswith(OURS):
        raise RecordingError(f"{type(owner).__name__} has no state of its own")
    for name, content in state.items():
        object.__setattr__(owner, name, _value(getattr(owner, name, None), name, content, packed))


def _attribute(value: object, name: str, packed: _ModelPacked) -> object:
    """Return an attribute as JSON: plain, a random generator, or an object with a state of its own."""
    if isinstance(value, np.random.Generator):
        return {"generator": _generator(value, name, packed)}
    if isinstance(value, Checkpointed) and not isinstance(value, type):
        return {"own": packed.pack(value.checkpoint(), name)}
    for column, own in packed.model.swarm.columns.items():
        if value is own:
            return {"column": column}
    try:
        return {"plain": packed.pack(value, name)}
    except RecordingError as error:
        try:
            return {"part": part_to_json(value)}
        except RecordingError:
            raise RecordingError(f"{error}; give its class checkpoint() and restore(state)") from None


def _restore_attributes(model: FireModel, facts: dict, packed: _ModelPacked) -> None:
    attributes = facts["attributes"]
    _refuse(HANDLED & attributes.keys())
    for name in [name for name in model.__dict__ if name not in HANDLED and name not in attributes]:
        del model.__dict__[name]
    for name, content in attributes.items():
        model.__dict__[name] = _value(model.__dict__.get(name), name, content, packed)
    for name, kinds in OF_EVERY_MODEL.items():
        number: Any = getattr(model, name, None)
        if type(number) not in kinds or not 0 <= number < LARGEST_NUMBER:
            raise RecordingError(f"invalid {name}: {shortened(number)}")
    agents = {agent.unique_id: agent for agent in model.agents}
    for unique_id, values in facts["of_things"]:
        _refuse(HANDLED_OF_AGENTS & values.keys())
        for name, content in values.items():
            agents[unique_id].__dict__[name] = _value(None, name, content, packed)


def _refuse(names: frozenset[str]) -> None:
    if names:
        raise RecordingError(f"attribute {min(names)} is not part of a state")


def _value(now: object, name: str, content: dict, packed: _ModelPacked) -> object:
    ((kind, value),) = content.items()
    if kind == "generator":
        if not isinstance(now, np.random.Generator):
            raise RecordingError(f"{name} is not a random generator in this model")
        now.bit_generator.state = _checked_state(packed.unpack(value))
        return now
    if kind == "own":
        if not isinstance(now, Checkpointed):
            raise RecordingError(f"{name} has no checkpoint() and restore(state) in this model")
        now.restore(packed.unpack(value))
        return now
    if kind == "column":
        return packed.model.swarm.columns[value]
    return part_from_json(value) if kind == "part" else packed.unpack(value)


def _agent_attributes(model: FireModel, packed: Packed) -> list:
    """Return the attributes that users have added to robots and other agents."""
    extra = []
    for agent in model.agents:
        names = [name for name in agent.__dict__ if name not in HANDLED_OF_AGENTS]
        if names:
            what = f"{type(agent).__name__} {agent.unique_id}'s "
            own = {name: {"plain": packed.pack(agent.__dict__[name], what + name)} for name in names}
            extra.append([agent.unique_id, own])
    return extra


def _randomness(model: FireModel, packed: Packed) -> dict:
    version, words, gauss = model.random.getstate()
    return {
        "streams": {name: packed.pack(state) for name, state in model.streams.state().items()},
        "rng": _generator(model.rng, "rng", packed),
        "random": [version, packed.pack(np.array(words, np.uint32)), gauss],
        "noise": packed.pack(model._noise),
    }


def _restore_randomness(model: FireModel, facts: dict, packed: Packed) -> None:
    for name, state in facts["streams"].items():
        model.streams[name].bit_generator.state = _checked_state(packed.unpack(state))
    model.rng.bit_generator.state = _checked_state(packed.unpack(facts["rng"]))
    version, content, gauss = facts["random"]
    words = packed.unpack(content)
    if not isinstance(words, np.ndarray) or words.shape != (WORDS,):
        raise RecordingError("invalid state of Python's random numbers")
    model.random.setstate((version, tuple(words.tolist()), gauss))
    noise = packed.unpack(facts["noise"])
    if noise is not None:
        _, before, draws = noise
        _checked_state(before)
        if not isinstance(draws, np.ndarray) or draws.dtype != float:
            raise RecordingError("invalid sensor noise")
    model._noise = noise


def _generator(generator: np.random.Generator, name: str, packed: Packed) -> object:
    state = generator.bit_generator.state
    if state["bit_generator"] not in GENERATORS:
        raise RecordingError(f"{name} is a {state['bit_generator']}, which cannot be stored; use PCG64")
    return packed.pack(state)


def _checked_state(state: object) -> dict:
    if not isinstance(state, dict) or state.get("bit_generator") not in GENERATORS:
        raise RecordingError("invalid state of a random stream")
    return state
