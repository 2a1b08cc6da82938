"""Checkpoints: everything a model needs to continue."""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from mesa.agent import Agent

from mesa_swarm.control.arbiter import MOST_LAYERS
from mesa_swarm.errors import RecordingError, SwarmError, shortened
from mesa_swarm.fire.model import FireModel
from mesa_swarm.recording.collected import (
    Path,
    collected_to_json,
    has_own_events,
    joined,
    lay_collected,
    reporters_of,
    set_clock,
)
from mesa_swarm.recording.container import Checkpoint, Packed
from mesa_swarm.recording.parts import (
    control_from_json,
    control_to_json,
    lay_things,
    part_from_json,
    part_to_json,
    things_to_json,
)
from mesa_swarm.robots.design import LARGEST_RADIUS


def lay_columns(columns: dict[str, np.ndarray], told: dict, packed: Packed) -> None:
    """Write stored columns into those of a model, which must have the same form."""
    if told.keys() != columns.keys():
        odd = sorted(told.keys() ^ columns.keys())
        raise RecordingError(f"column {shortened(odd[0])} is only in one of the two")
    values = {name: packed.unpack(column) for name, column in told.items()}
    for name, column in columns.items():
        value = values[name]
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != column.shape:
            raise RecordingError(f"column {name} has another form")
    for name, column in columns.items():
        column[...] = values[name]


def check_columns(model: FireModel) -> None:
    """Refuse what compiled functions, which check nothing, would take for a row of an array or a place."""
    robots, fires, designs = model.swarm.columns, model.fires.columns, model.swarm.designs
    for name, count in (("design", len(designs)), ("fire", len(model.fires)), ("layer", MOST_LAYERS)):
        if not ((robots[name] >= (0 if name == "design" else -1)) & (robots[name] < count)).all():
            raise RecordingError(f"column {name} names one that there is not")
    radius, fastest = (np.array([getattr(d, name) for d in designs]) for name in ("radius", "max_speed"))
    low, high = np.reshape(model.map.bounds, (2, 2))
    own = robots["design"]
    sound = {
        "position": all(((c["position"] >= low) & (c["position"] <= high)).all() for c in (robots, fires)),
        "heading": np.isfinite(robots["heading"]).all(),
        "number": len(np.unique(robots["number"])) == len(model.swarm),
        "command": np.isfinite(robots["command"]).all(),
        "radius": not len(own) or (robots["radius"] == radius[own]).all(),
        "max_speed": not len(own) or ((robots["max_speed"] >= 0) & (robots["max_speed"] <= fastest[own])).all(),
        "radius of fires": ((fires["radius"] > 0) & (fires["radius"] <= LARGEST_RADIUS)).all(),
    }
    wrong = [name for name, fits in sound.items() if not fits]
    if wrong:
        raise RecordingError(f"column {wrong[0]} holds what cannot be")


def lay_history(model: FireModel, told: list) -> None:
    """Give the history of fires its rhythm and its places; its rows are collected."""
    history = model.fires.history
    every, places, fires = told
    numbers = all(type(number) is int and number >= 0 for number in (every, fires, *places))
    if not numbers or len(places) != len(model.fires) or any(place >= fires for place in places) or fires > 1e7:
        raise RecordingError("the history of fires is none")
    history.every, history._places, history._fires = every, list(places), fires


# What is stored in a way of its own, or follows from what is stored, or says only how the model is being looked at.
# First Mesa's, then ours.
HANDLED = frozenset(
    (
        *("steps", "step", "rng", "_rng", "random", "_seed", "_user_step", "_agents", "_agents_by_type", "_all_agents"),
        *("subscribers", "_batch_context", "_suppress", "_time", "agent_id_counter", "_simulator", "_event_list"),
        *("_event_generators", "_scenario", "_default_schedule", "data_registry"),
        *("given", "_engine", "map", "streams", "space", "swarm", "fires", "_obstacles", "_loads", "_scene"),
        *("_scene_table", "observers", "_channel", "_fire_constants", "_senses", "_senses_version", "_sensed"),
        *("_noise", "_imperfect", "datacollector", "_collect_every", "_control", "_snapshots"),
    )
)
OF_THINGS = frozenset(
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
# Bit generators whose state no number can break.
GENERATORS = ("PCG64", "PCG64DXSM")
# Of Python's generator.
WORDS = 625
OURS = ("mesa_swarm.control.", "mesa_swarm.fire.")


@runtime_checkable
class Checkpointed(Protocol):
    """What keeps a state of its own, a learner for example: an attribute of the model, or a layer of its control.

    A layer that remembers in columns of the swarm (`Swarm.remember`), and in nothing else, needs neither.

    Examples
    --------
    >>> class Counter:
    ...     seen = 0
    ...     def checkpoint(self):
    ...         return {"seen": self.seen}
    ...     def restore(self, state):
    ...         self.seen = state["seen"]
    >>> isinstance(Counter(), Checkpointed)
    True
    """

    def checkpoint(self) -> dict:
        """Return all that a later step depends on: arrays and plain values (`plain.Packed`) by name."""

    def restore(self, state: dict) -> None:
        """Take back what `checkpoint` returned."""


class _Told(Packed):
    """Plain values of a model, in which its agents may stand: told by their unique_ids."""

    def __init__(self, model: FireModel, arrays: list[np.ndarray] | None = None) -> None:
        super().__init__(arrays)
        self._model = model
        self._agents: dict[int, Agent] | None = None

    def pack(self, value: Any, what: str = "a value", depth: int = 0) -> object:
        """Return a value as JSON has it."""
        if isinstance(value, Agent):
            if value not in self._model.agents:
                raise RecordingError(f"{what} refers to an agent that is not in the model, which cannot be stored")
            return {"agent": value.unique_id}
        return super().pack(value, what, depth)

    def unpack(self, told: Any) -> Any:
        """Return the value that `pack` told."""
        if isinstance(told, dict) and "agent" in told:
            if self._agents is None:
                self._agents = {agent.unique_id: agent for agent in self._model.agents}
            return self._agents[told["agent"]]
        return super().unpack(told)


def checkpoint_of(model: FireModel, since: dict[Path, int] | None = None, *, steps: int | None = None) -> Checkpoint:
    """Return the complete state of a model, between two steps.

    Stored are the swarm, obstacles, loads, fires, radio, control, all random streams, Mesa's counters, what was
    collected, and all other attributes of the model that are plain, or have `checkpoint` and `restore`. What
    `watch` keeps is not.

    Parameters
    ----------
    model : FireModel
    since : dict, optional
        How much was collected at the last checkpoint (`lengths_of`): only what came since is stored. By
        default all.
    steps : int, optional
        What Mesa has counted, if it has already counted a step that has not begun.

    Raises
    ------
    RecordingError
        If something cannot be stored; it says what.

    Examples
    --------
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> model = FireFighting(rng=1).run(20)
    >>> again = restore(FireFighting(rng=2), checkpoint_of(model))
    >>> again.run(10).state_hash() == model.run(10).state_hash()
    True
    """
    state_hash = model.state_hash()  # reads the sensors, as their next use does
    if has_own_events(model):
        raise RecordingError("Mesa's schedule holds events besides the step, which cannot be stored")
    told = _Told(model)
    facts = {
        "steps": model.steps if steps is None else steps,
        "things": things_to_json(model),
        "columns": {name: told.pack(column) for name, column in sorted(model.swarm.columns.items())},
        "disturbed": model.swarm.disturbed,
        "fires": {name: told.pack(column) for name, column in model.fires.columns.items()},
        "collect_every": model.collect_every,
        "history": [model.fires.history.every, list(model.fires.history._places), model.fires.history._fires],
        "constants": part_to_json(model.fire_constants),
        "radio": part_to_json(model.communication),
        "imperfect": _imperfect_to_json(model),
        "control": control_to_json(model.control),
        "control_state": _control_state(model, told),
        "randomness": _randomness(model, told),
        "collected": collected_to_json(model, told, since or {}),
        "reporters": {
            name: told.pack(reporter.checkpoint(), f"reporter {name}") for name, reporter in reporters_of(model).items()
        },
        "attributes": {n: _attribute(v, n, told) for n, v in model.__dict__.items() if n not in HANDLED},
        "of_things": _of_things(model, told),
    }
    return Checkpoint(step=model.completed, state_hash=state_hash, facts=facts, arrays=told.arrays)


def restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint] = ()) -> FireModel:
    """Give a model that its constructor has just made the state of a checkpoint, and return it.

    Parameters
    ----------
    model : FireModel
        Of the class that was stored.
    checkpoint : Checkpoint
    earlier : sequence of Checkpoint
        Those before it in the same recording, whose collected rows it goes on from.

    Raises
    ------
    RecordingError
        If it cannot be taken over, or what comes out is not what was stored.
    """
    where = f"the checkpoint of step {checkpoint.step}"
    try:
        _restore(model, checkpoint, earlier)
        state_hash = model.state_hash()
    except (SwarmError, ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError,
            ValueError) as error:  # fmt: skip
        words = " ".join(str(error).split())
        raise RecordingError(f"{where} cannot be restored: {words[:200] or type(error).__name__}") from None
    if state_hash != checkpoint.state_hash or model.completed != checkpoint.step:
        raise RecordingError(f"{where} does not give the state that was stored: another version wrote it")
    return model


def _restore(model: FireModel, checkpoint: Checkpoint, earlier: Sequence[Checkpoint]) -> None:
    facts, told = checkpoint.facts, _Told(model, checkpoint.arrays)
    lay_things(model, facts["things"])
    model.fire_constants = part_from_json(facts["constants"])
    _lay_control(model, facts, told)
    set_clock(model, facts["steps"])
    model.collect_every = facts.get("collect_every", model.collect_every)  # older checkpoints have none
    _lay_attributes(model, facts, told)
    lay_columns(model.swarm.columns, facts["columns"], told)
    lay_columns(model.fires.columns, facts["fires"], told)
    check_columns(model)
    lay_history(model, facts["history"])
    parts = [(part.facts["collected"], _Told(model, part.arrays)) for part in earlier]
    lay_collected(model, joined([*parts, (facts["collected"], told)]))
    for name, reporter in reporters_of(model).items():
        reporter.restore(told.unpack(facts["reporters"][name]))
    model.obstacles_changed()
    model.swarm.version += 1
    model._sensed = None
    _lay_randomness(model, facts["randomness"], told)
    model.swarm.disturbed = bool(facts["disturbed"])


# ---- control


def _control_state(model: FireModel, told: _Told) -> list:
    if model.control is None:
        return []
    arbiter = model.control
    keeps = {} if type(arbiter).__module__.startswith(OURS) else vars(arbiter)
    own = {name: value for name, value in keeps.items() if name not in ("layers", "weights")}
    return [_inner(own, type(arbiter).__name__, told), *(_layer_state(layer, told) for layer in arbiter.layers)]


def _layer_state(layer: Any, told: _Told) -> object:
    if isinstance(layer, Checkpointed):
        return {"own": told.pack(layer.checkpoint(), f"layer {getattr(layer, 'name', '')}")}
    if type(layer).__module__.startswith(OURS):
        return None
    return _inner(getattr(layer, "__dict__", {}), f"layer {getattr(layer, 'name', '')}", told)


def _inner(values: dict, what: str, told: _Told) -> dict:
    swarm = told._model.swarm
    return {n: _attribute(v, f"{what}'s {n}", told) for n, v in values.items() if v is not swarm}


def _imperfect_to_json(model: FireModel) -> list | None:
    return None if model._imperfect is None else [part_to_json(model.imperfections), model._imperfect.key]


def _lay_imperfect(model: FireModel, told: list | None) -> None:
    """Give the model the imperfections that it had, and the key of their chance."""
    if told is None and model.imperfections is None:
        return
    part, key = told or (None, 0)
    model.imperfections = part_from_json(part)
    if type(key) is not int or not 0 <= key < 2**64:
        raise RecordingError(f"the key of its chance is {shortened(key)}")
    if model._imperfect is not None:
        model._imperfect.key = key


def _lay_control(model: FireModel, facts: dict, told: _Told) -> None:
    """Give the model the radio and the control that it had, unless its constructor has made the same."""
    _lay_imperfect(model, facts.get("imperfect"))
    radio = part_from_json(facts["radio"])
    if model.communication != radio:
        model.communication = radio
    if control_to_json(model.control) != facts["control"]:
        model.control = control_from_json(facts["control"])
    states = facts["control_state"]
    if model.control is None:
        return
    arbiter, *layers = states
    _lay_inner(model.control, arbiter, told)
    for layer, state in zip(model.control.layers, layers, strict=True):
        _lay_layer(layer, state, told)


def _lay_layer(layer: object, state: Any, told: _Told) -> None:
    if isinstance(layer, Checkpointed):
        layer.restore(told.unpack(state["own"]))
    elif state is not None:
        _lay_inner(layer, state, told)


def _lay_inner(owner: object, state: dict, told: _Told) -> None:
    if state and type(owner).__module__.startswith(OURS):
        raise RecordingError(f"{type(owner).__name__} has no state of its own")
    for name, value in state.items():
        object.__setattr__(owner, name, _value(getattr(owner, name, None), name, value, told))


# ---- attributes


def _attribute(value: object, name: str, told: _Told) -> object:
    """Return an attribute as JSON has it: plain, a random generator, or what keeps a state of its own."""
    if isinstance(value, np.random.Generator):
        return {"generator": _generator(value, name, told)}
    if isinstance(value, Checkpointed) and not isinstance(value, type):
        return {"own": told.pack(value.checkpoint(), name)}
    for column, own in told._model.swarm.columns.items():
        if value is own:
            return {"column": column}
    try:
        return {"plain": told.pack(value, name)}
    except RecordingError as error:
        try:
            return {"part": part_to_json(value)}
        except RecordingError:
            raise RecordingError(f"{error}; give its class checkpoint() and restore(state)") from None


def _lay_attributes(model: FireModel, facts: dict, told: _Told) -> None:
    attributes = facts["attributes"]
    if HANDLED & attributes.keys():
        raise RecordingError("it has attributes that are no state")
    for name in [name for name in model.__dict__ if name not in HANDLED and name not in attributes]:
        del model.__dict__[name]
    for name, value in attributes.items():
        model.__dict__[name] = _value(model.__dict__.get(name), name, value, told)
    for name, kinds in OF_EVERY_MODEL.items():
        number: Any = getattr(model, name, None)
        if type(number) not in kinds or not 0 <= number < LARGEST_NUMBER:
            raise RecordingError(f"{name} is {shortened(number)}")
    agents = {agent.unique_id: agent for agent in model.agents}
    for unique_id, values in facts["of_things"]:
        for name, value in values.items():
            if name in OF_THINGS:
                raise RecordingError("it has attributes that are no state")
            agents[unique_id].__dict__[name] = _value(None, name, value, told)


def _value(now: object, name: str, told_value: dict, told: _Told) -> object:
    ((kind, value),) = told_value.items()
    if kind == "generator":
        if not isinstance(now, np.random.Generator):
            raise RecordingError(f"{name} is no random generator")
        now.bit_generator.state = _checked_state(told.unpack(value))
        return now
    if kind == "own":
        if not isinstance(now, Checkpointed):
            raise RecordingError(f"{name} has no checkpoint() and restore(state)")
        now.restore(told.unpack(value))
        return now
    if kind == "column":
        return told._model.swarm.columns[value]
    return part_from_json(value) if kind == "part" else told.unpack(value)


def _of_things(model: FireModel, told: Packed) -> list:
    """Return what people have written onto robots and other agents."""
    extra = []
    for agent in model.agents:
        names = [name for name in agent.__dict__ if name not in OF_THINGS]
        if names:
            what = f"{type(agent).__name__} {agent.unique_id}'s "
            own = {name: {"plain": told.pack(agent.__dict__[name], what + name)} for name in names}
            extra.append([agent.unique_id, own])
    return extra


# ---- randomness


def _randomness(model: FireModel, told: Packed) -> dict:
    version, words, gauss = model.random.getstate()
    noise = model._noise
    return {
        "streams": {name: told.pack(state) for name, state in model.streams.state().items()},
        "rng": _generator(model.rng, "rng", told),
        "random": [version, told.pack(np.array(words, np.uint32)), gauss],
        "noise": None if noise is None else told.pack(noise),
    }


def _lay_randomness(model: FireModel, facts: dict, told: Packed) -> None:
    for name, state in facts["streams"].items():
        model.streams[name].bit_generator.state = _checked_state(told.unpack(state))
    model.rng.bit_generator.state = _checked_state(told.unpack(facts["rng"]))
    version, packed, gauss = facts["random"]
    words = told.unpack(packed)
    if not isinstance(words, np.ndarray) or words.shape != (WORDS,):
        raise RecordingError("the state of Python's random numbers is none")
    model.random.setstate((version, tuple(words.tolist()), gauss))
    noise = told.unpack(facts["noise"])
    if noise is not None:
        _, before, draws = noise
        _checked_state(before)
        if not isinstance(draws, np.ndarray) or draws.dtype != float:
            raise RecordingError("the noise of sensors is none")
    model._noise = noise


def _generator(generator: np.random.Generator, name: str, told: Packed) -> object:
    state = generator.bit_generator.state
    if state["bit_generator"] not in GENERATORS:
        raise RecordingError(f"{name} is a {state['bit_generator']}, which cannot be stored; take PCG64")
    return told.pack(state)


def _checked_state(state: object) -> dict:
    if not isinstance(state, dict) or state.get("bit_generator") not in GENERATORS:
        raise RecordingError("a random stream has no state that is one")
    return state
