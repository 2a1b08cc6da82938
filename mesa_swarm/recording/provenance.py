"""Where a recording comes from, and the scenery around its robots."""

import inspect
import json
import math
import os
import platform
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from mesa_swarm.base.errors import RecordingError, SwarmError, error_line, shortened
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.maps.map import Map
from mesa_swarm.model.common import whole_signature
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.looks import looks_of
from mesa_swarm.model.state_hash import ENGINE_BITS, written_state_hash
from mesa_swarm.recording.layout import with_discs
from mesa_swarm.recording.made_objects import is_class
from mesa_swarm.recording.schema import checked_provenance, read_json
from mesa_swarm.recording.stored_values import part_from_json, part_to_json
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.robots.sensors import mount_of
from mesa_swarm.world.bodies import Body
from mesa_swarm.world.shapes import outline_to_json, shape_to_json
from mesa_swarm.world.statics import FIRE, KINDS, LOAD, OBSTACLE

# Since format 2 readings are those of the row's own poses, and interventions and changes of scenery are stored; since
# format 5 states are of parts, and state hashes include bodies at rest and what steps only read. Formats 3 and 4 were
# never published.
FORMAT = 5
READABLE = (1, 2, FORMAT)
LAST_OF_EARLIER_HASHES = 2
LONGEST_VERSION = 30
# Of recordings that store none.
FIRST_BITS = 1
# Modules of classes that older versions had elsewhere.
MOVED = {("mesa_swarm.model", "SwarmModel"): "mesa_swarm.swarm_model"}
PACKAGES = ("mesa-swarm", "mesa", "numpy", "numba", "shapely", "pyarrow")
# Temperatures that differ by this part of the hottest have different colours.
HEAT_STEPS = 64
# Classes of parameters, besides plain values: written as {name: fields}.
PARTS = (FireConstants, Radio, Scale)
CURE = "record a subclass of SwarmModel that makes it in its constructor from numbers and names, or use rerun=False"


def scenery_of(model: EngineModel) -> dict:
    """Return what is needed to draw a model, besides what changes from step to step, as JSON.

    Returns
    -------
    dict
        ``designs``; ``robots``, rows [first id, last id, index of their design]; ``shapes`` of obstacles and
        ground marks on the map; ``loads``, shapes of loads and driven bodies about their own centres; each with the
        name of its ``kind`` if it is not the usual one, and its ``temperature`` if it radiates, to the next of 65
        colours; ``kinds``, the names of all kinds if there are own ones; ``layers``, names in the order of the column
        `layer`; ``leave``, the temperature above which a robot is too hot, and ``join``, below which it has cooled;
        ``looks``, from `Looks.as_json`, if the model declares any; ``scale``, map units of a metre and seconds of a
        step, if the model has one; ``parts``, name and colour of each added part that shows discs.
    """
    layers, looks = () if model.control is None else model.control.names, looks_of(model)
    still = [body for body in model.obstacle_list if body.mode == "fixed"]
    kinds = {} if len(model.kinds) == len(KINDS) else {"kinds": list(model.kinds)}
    return {
        "designs": [_design_to_json(design) for design in model.swarm.designs],
        "robots": _runs(model.swarm.unique_ids.tolist(), model.swarm.design.tolist()),
        "shapes": [{**shape_to_json(body.shape), **_own_looks(body, OBSTACLE)} for body in still],
        "loads": [
            {"id": body.unique_id, **outline_to_json(body.form.outline, body.form.radius), **_own_looks(body, LOAD)}
            for body in model.displaced
        ],
        **kinds,
        "layers": list(layers),
        "leave": model.fire_constants.leave,
        "join": model.fire_constants.join,
        **({"looks": looks.as_json()} if looks is not None and looks.as_json() else {}),
        **({"scale": [model.scale.units_per_metre, model.scale.seconds_per_step]} if model.scale else {}),
        **({"parts": drawn} if (drawn := drawn_parts(model)) else {}),
    }


def drawn_parts(model: EngineModel) -> list[list[str]]:
    """Return the name and the colour of each added part that shows discs."""
    return [[part.name, part.colour] for part in with_discs(model)]


def drawn_heat(model: EngineModel) -> bytes:
    """Return what changes with the colour of a body that radiates, fires left out."""
    table = model.parts.bodies.table
    return np.floor(table.temperature[table.kind != FIRE] * HEAT_STEPS + 0.5).tobytes()


def _own_looks(body: Body, usual: int) -> dict:
    """Return the name of the kind of a body, if it is not the usual one, and its temperature, if it radiates."""
    kind = {} if body.kind == KINDS[usual] else {"kind": body.kind}
    return (
        kind if body.temperature is None else {**kind, "temperature": round(body.temperature * HEAT_STEPS) / HEAT_STEPS}
    )


def shows(scenery: dict, other: dict) -> bool:
    """Return whether a scenery includes a later one of the same model, from which only robots may be missing."""
    last, newest = (max((run[1] for run in robots_of["robots"]), default=0) for robots_of in (scenery, other))
    return newest <= last and {**scenery, "robots": ()} == {**other, "robots": ()}


def join_sceneries(sceneries: Sequence[tuple[int, dict]]) -> tuple[tuple[int, dict], ...]:
    """Return sceneries of one model, in the order of time, each with the robots, designs and loads of all of them.

    Obstacles, layers and temperatures remain those of each.
    """
    designs: list = []
    robots: list[list[int]] = []
    loads: dict[int, dict] = {}
    for _, scenery in sceneries:
        designs += [design for design in scenery["designs"] if design not in designs]
        newest = robots[-1][1] if robots else -1
        for first, last, which in scenery["robots"]:
            if last > newest:
                robots.append([max(first, newest + 1), last, designs.index(scenery["designs"][which])])
        loads |= {load["id"]: load for load in scenery["loads"]}
    same = {"designs": designs, "robots": robots}
    return tuple(
        (step, {**scenery, **same, "loads": _with_own(loads, scenery["loads"])}) for step, scenery in sceneries
    )


def _with_own(loads: dict[int, dict], there: Sequence[dict]) -> list[dict]:
    """Return all loads, those that are there at the temperature that they have there."""
    return list((loads | {load["id"]: load for load in there}).values())


def _design_to_json(design: RobotDesign) -> dict:
    return {
        "name": design.name,
        "radius": design.radius,
        "max_speed": design.max_speed,
        "holonomic": not design.turns and design.numbers == 2,
        "sensors": [
            [
                *mount_of(sensor, design.radius),
                math.radians(sensor.bearing_degrees),
                math.radians(sensor.field_of_view_degrees) / 2,
                sensor.range,
            ]
            for sensor in design.proximity
        ],
    }


def _runs(ids: list[int], designs: list[int]) -> list[list[int]]:
    """Return ranges of robots of one design: [first id, last id, design]."""
    runs: list[list[int]] = []
    for number, design in zip(ids, designs, strict=True):
        if runs and runs[-1][2] == design:
            runs[-1][1] = number
        else:
            runs.append([number, number, design])
    return runs


@cache
def versions_of_packages() -> dict[str, str]:
    """Return the versions of the packages that decide bits; they are looked up in files once."""
    return {name: version(name) for name in PACKAGES}


def provenance_of(model: EngineModel, rerun: bool) -> dict:
    """Return the origin of a recording as JSON, sufficient to run the model again if `rerun` requires it."""
    parameters = parameters_of_run(model)
    seed = parameters.pop("rng", None)
    has_map = parameters.pop("map", None) is not None
    return {
        "format": FORMAT,
        "engine_bits": ENGINE_BITS,
        "model": {"module": type(model).__module__, "name": type(model).__qualname__},
        "parameters": {name: _parameter_to_json(name, value, rerun) for name, value in parameters.items()},
        "takes_map": has_map,
        "map": model.map.to_toml(),
        "scenery": scenery_of(model),
        "seed": _seed_to_json(model, seed, rerun),
        "versions": {"python": platform.python_version(), **versions_of_packages()},
        "platform": platform.platform(),
        "rerun": rerun,
    }


def parameters_of_run(model: EngineModel) -> dict:
    """Return the arguments of the model's constructor, defaults included."""
    arguments, keywords = model.given
    call = whole_signature(type(model)).bind(*arguments, **keywords)
    unshown = call.signature.parameters.keys() - inspect.signature(type(model)).parameters.keys() - {*call.arguments}
    call.apply_defaults()
    parameters = {name: value for name, value in call.arguments.items() if name not in unshown}
    for parameter in call.signature.parameters.values():
        if parameter.kind is parameter.VAR_KEYWORD:
            parameters.update(parameters.pop(parameter.name))
    return parameters


def rebuild_model(provenance: dict, model_class: type, /, **changes: object) -> EngineModel:
    """Return the model as its constructor made it, perhaps with other parameters.

    Parameters that did not exist yet have the values with which the model behaves as it did then: those in
    `earlier_defaults` of its class, or else its defaults.
    """
    check_class(provenance, model_class)
    if not provenance["rerun"]:
        raise RecordingError("the recording was made with rerun=False: its model cannot be run again")
    arguments = {
        **getattr(model_class, "earlier_defaults", {}),
        **{name: _parameter_from_json(value) for name, value in provenance["parameters"].items()},
    }
    if provenance["takes_map"]:
        arguments["map"] = recorded_map(provenance)
    arguments["rng"] = _seed_from_json(provenance["seed"])
    try:
        return model_class(**{**arguments, **changes})
    except Exception as error:  # anything that a constructor may raise on unexpected arguments
        if changes and isinstance(error, SwarmError):  # about the user's own arguments
            raise
        raise RecordingError(
            f"{model_class.__name__} cannot be made from the recording's parameters: {error_line(error)}"
        ) from error


def recorded_map(provenance: dict) -> Map:
    """Return the map of a recording."""
    try:
        return Map.from_toml(provenance["map"], "the recording's map")
    except SwarmError as error:
        raise RecordingError(str(error)) from None


def check_class(provenance: dict, model_class: type) -> None:
    """Refuse another class than the one that was recorded."""
    recorded_class = provenance["model"]
    if not is_of(provenance, model_class):
        raise RecordingError(
            f"the recording is of {recorded_class['module']}.{recorded_class['name']}, "
            f"not of {model_class.__module__}.{model_class.__qualname__}; give its class"
        )


def is_of(provenance: dict, model_class: type) -> bool:
    """Return whether a class may be the recorded one, see `is_class`."""
    return is_class(model_class, provenance["model"]["module"], provenance["model"]["name"])


def hash_in_format(model: EngineModel, number: int) -> str:
    """Return the state hash of a model as recordings of a format have it."""
    return written_state_hash(model) if number <= LAST_OF_EARLIER_HASHES else model.state_hash()


def is_of_other_bits(provenance: dict) -> bool:
    """Return whether the same seed gave other bits in the version that recorded, so that steps cannot be run again."""
    return provenance.get("engine_bits", FIRST_BITS) != ENGINE_BITS


def describe_bits(provenance: dict) -> str:
    """Return that a recording is of other bits, and what to do about it."""
    recorded_bits = provenance.get("engine_bits", FIRST_BITS)
    recorded_by = f"mesa-swarm {provenance['versions'].get('mesa-swarm', 'of an earlier version'):.{LONGEST_VERSION}}"
    return (
        f"steps of {recorded_by} have other bits ({recorded_bits}) than those of this version ({ENGINE_BITS}); "
        f"to run them again, use {recorded_by}"
    )


def as_metadata(facts: dict) -> dict[str, str]:
    """Return facts as the metadata of an Arrow schema: names and JSON texts."""
    return {name: json.dumps(value) for name, value in facts.items()}


def from_metadata(metadata: dict[bytes, bytes] | None, source: str | os.PathLike[str]) -> dict:
    """Return what `as_metadata` wrote, checked."""
    facts, name = {}, ""
    try:
        for key, text in (metadata or {}).items():
            name = key.decode()
            facts[name] = read_json(text)
    except ValueError:
        if facts.get("format") in READABLE:
            raise RecordingError(f"{source}: {shortened(name)} cannot be decoded, or is too long") from None
        facts = {}
    if facts.get("format") not in READABLE:
        shown, formats = shortened(facts.get("format")), ", ".join(map(str, READABLE))
        raise RecordingError(f"{source} has format {shown}, which this version cannot read; expected one of {formats}")
    facts = checked_provenance(facts, source)
    model = facts["model"]
    model["module"] = MOVED.get((model["module"], model["name"]), model["module"])
    return facts


def _parameter_to_json(name: str, value: object, rerun: bool) -> object:
    """Return a parameter as JSON."""
    if isinstance(value, np.generic):
        value = value.item()
    if type(value) in PARTS:
        return part_to_json(value)
    try:
        return json.loads(json.dumps(value))
    except (TypeError, ValueError):
        if not rerun:
            return {"not recorded": shortened(value)}
        raise RecordingError(f"{name} is {shortened(value)}, which cannot be recorded; {CURE}") from None


def _parameter_from_json(value: object) -> object:
    """Return a value that `_parameter_to_json` wrote."""
    names = {part.__name__ for part in PARTS}
    return part_from_json(value) if isinstance(value, dict) and len(value) == 1 and names >= value.keys() else value


def _seed_from_json(seed: Any) -> int | np.random.SeedSequence:
    """Return a seed that `_seed_to_json` wrote."""
    return np.random.SeedSequence(seed["entropy"], spawn_key=seed["spawn_key"]) if isinstance(seed, dict) else seed


def _seed_to_json(model: EngineModel, seed: object, rerun: bool) -> object:
    if isinstance(seed, (int, np.integer)):
        return int(seed)
    if isinstance(seed, (np.random.Generator, np.random.BitGenerator)) and rerun:
        raise RecordingError(f"rng is {shortened(seed)}, which cannot be recorded; expected a whole number")
    sequence = model.streams.seed
    seed_entropy: Any = sequence.entropy  # never None: a SeedSequence without entropy draws some
    entropy = seed_entropy if isinstance(seed_entropy, int) else [int(word) for word in seed_entropy]
    return {"entropy": entropy, "spawn_key": [int(word) for word in sequence.spawn_key]}
