"""Where a recording comes from: model, parameters, map, seed, versions; enough to run it again."""

import inspect
import json
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, cast

import numpy as np

from mesa_swarm.errors import InvalidValueError, RecordingError, SwarmError, shortened
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.scenery import scenery_of
from mesa_swarm.recording.schema import checked_provenance, read_json
from mesa_swarm.robots.radio import Radio
from mesa_swarm.world.map import Map

# Since 2 readings are of the row's own poses, interventions are told, and scenery wherever it changes.
FORMAT = 2
READABLE = (1, FORMAT)
PACKAGES = ("mesa-swarm", "mesa", "numpy", "numba", "shapely", "pyarrow")
# Objects that parameters may be, besides plain values: written as {name: fields}.
PARTS = {"FireConstants": FireConstants, "Radio": Radio}
LONGEST_REASON = 120
WHAT_TO_DO = (
    "record a subclass of SwarmModel that makes it in its constructor from numbers and names, or give rerun=False"
)


def provenance_of(model: ObservedWorld, rerun: bool) -> dict:
    """Return all that a recording says of its origin, as JSON has it.

    Parameters
    ----------
    model : ObservedWorld
    rerun : bool
        Whether it must suffice to run the model again.

    Raises
    ------
    RecordingError
        If a parameter cannot be written down.

    Examples
    --------
    >>> from mesa_swarm.model import SwarmModel
    >>> provenance_of(SwarmModel(map="sparse", rng=1), rerun=True)["seed"]
    1
    """
    parameters = parameters_of_run(model)
    seed = parameters.pop("rng", None)
    has_map = parameters.pop("map", None) is not None
    return {
        "format": FORMAT,
        "model": {"module": type(model).__module__, "name": type(model).__qualname__},
        "parameters": {name: _written(name, value, rerun) for name, value in parameters.items()},
        "takes_map": has_map,
        "map": model.map.to_toml(),
        "scenery": scenery_of(model),
        "seed": _written_seed(model, seed, rerun),
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "platform": platform.platform(),
        "rerun": rerun,
    }


def parameters_of_run(model: ObservedWorld) -> dict:
    """Return what the model's constructor was given, and the defaults of what it was not given."""
    given, named = model.given
    bound = inspect.signature(type(model)).bind(*given, **named)
    bound.apply_defaults()
    parameters = dict(bound.arguments)
    for parameter in bound.signature.parameters.values():
        if parameter.kind is parameter.VAR_KEYWORD:
            parameters.update(parameters.pop(parameter.name))
    return parameters


def rebuilt(provenance: dict, model_class: type, **changes: object) -> ObservedWorld:
    """Return the model as its constructor made it, perhaps with other parameters.

    Raises
    ------
    RecordingError
        If the recording is of another model, or does not say enough.
    """
    check_class(provenance, model_class)
    if not provenance["rerun"]:
        raise RecordingError("the recording was made with rerun=False and does not tell how to run its model again")
    arguments = {name: _read(value) for name, value in provenance["parameters"].items()}
    if provenance["takes_map"]:
        arguments["map"] = map_of(provenance)
    seed = provenance["seed"]
    arguments["rng"] = (
        np.random.SeedSequence(seed["entropy"], spawn_key=seed["spawn_key"]) if isinstance(seed, dict) else seed
    )
    try:
        return model_class(**{**arguments, **changes})
    except Exception as error:  # whatever a constructor raises that is given what it never was
        if changes and isinstance(error, SwarmError):  # about what the user asks for
            raise
        words = f"{type(error).__name__}: {' '.join(str(error).split()):.{LONGEST_REASON}}"
        raise RecordingError(
            f"{model_class.__name__} cannot be made from the recording's parameters: {words}"
        ) from error


def reason_of(error: Exception) -> str:
    """Return what went wrong in a recorded model, in a few words."""
    return f"{type(error).__name__}: {' '.join(str(error).split()):.{LONGEST_REASON}}"


def map_of(provenance: dict) -> Map:
    """Return the map of a recording.

    Raises
    ------
    RecordingError
        If its text is none.
    """
    try:
        return Map.from_toml(provenance["map"], "the recording's map")
    except SwarmError as error:
        raise RecordingError(str(error)) from None


def check_class(provenance: dict, model_class: type) -> None:
    """Refuse another class than the one that was recorded."""
    recorded = provenance["model"]
    if (model_class.__module__, model_class.__qualname__) != (recorded["module"], recorded["name"]):
        raise RecordingError(
            f"the recording is of {recorded['module']}.{recorded['name']}, "
            f"not of {model_class.__module__}.{model_class.__qualname__}; give its class"
        )


def as_metadata(facts: dict) -> dict[str, str]:
    """Return facts as the metadata of an Arrow schema: names and JSON texts."""
    return {name: json.dumps(value) for name, value in facts.items()}


def from_metadata(metadata: dict[bytes, bytes] | None, source: object) -> dict:
    """Return what `as_metadata` wrote, or say that this is no recording.

    Raises
    ------
    RecordingError
    """
    facts, wrong = {}, ""
    try:
        for name, text in (metadata or {}).items():
            wrong = name.decode()
            facts[wrong] = read_json(text)
    except ValueError:
        if facts.get("format") in READABLE:
            raise RecordingError(f"{source} has {shortened(wrong)} that cannot be read, or are too long") from None
        facts = {}
    if facts.get("format") not in READABLE:
        shown, known = shortened(facts.get("format")), " or ".join(map(str, READABLE))
        raise RecordingError(f"{source} has format {shown}, which this version cannot read; expected {known}")
    return checked_provenance(facts, source)


def _written(name: str, value: object, rerun: bool) -> object:
    """Return a value as JSON has it."""
    if isinstance(value, np.generic):
        value = value.item()
    for title, part in PARTS.items():
        if type(value) is part:
            return {title: asdict(cast(Any, value))}
    try:
        return json.loads(json.dumps(value))
    except (TypeError, ValueError):
        if not rerun:
            return {"not recorded": shortened(value)}
        raise RecordingError(f"{name} is {shortened(value)}, which a recording cannot tell; {WHAT_TO_DO}") from None


def _read(value: object) -> object:
    """Return a value that `_written` wrote."""
    if isinstance(value, dict) and len(value) == 1:
        ((title, fields),) = value.items()
        if title in PARTS and isinstance(fields, dict):
            try:
                return PARTS[title](**fields)
            except (TypeError, ValueError) as error:
                raise InvalidValueError(
                    f"{title} of the recording cannot be made: {error!s:.{LONGEST_REASON}}"
                ) from None
    return value


def _read_seed(seed: Any) -> int | np.random.SeedSequence:
    """Return a seed that `_written_seed` wrote."""
    return np.random.SeedSequence(seed["entropy"], spawn_key=seed["spawn_key"]) if isinstance(seed, dict) else seed


def _written_seed(model: ObservedWorld, seed: object, rerun: bool) -> object:
    if isinstance(seed, (int, np.integer)):
        return int(seed)
    if isinstance(seed, (np.random.Generator, np.random.BitGenerator)) and rerun:
        raise RecordingError(f"rng is {shortened(seed)}, which a recording cannot tell; give rng a whole number")
    grown = model.streams.seed
    given: Any = grown.entropy  # never None: a SeedSequence that is given none draws some
    entropy = given if isinstance(given, int) else [int(word) for word in given]
    return {"entropy": entropy, "spawn_key": [int(word) for word in grown.spawn_key]}
