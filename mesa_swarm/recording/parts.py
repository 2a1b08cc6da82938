"""Parts of a model as JSON, and back: designs, constants, radios, layers, shapes. Only these classes, never by name."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import shapely
from shapely import Point, Polygon

from mesa_swarm.control import (
    Align,
    Arbiter,
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Follow,
    Gather,
    HeadOn,
    MatchVelocity,
    Perimeter,
    Push,
    Respond,
    Separate,
    Subsumption,
    VectorSum,
)
from mesa_swarm.errors import RecordingError, SwarmError, shortened
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.fire.strategy import FightFire
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import DifferentialDrive, HolonomicDrive
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.sensors import LineSensor, ProximitySensor, RadiationSensor
from mesa_swarm.world.shapes import Shape, disc, polygon

LAYERS = (Align, Avoid, Cohere, Cruise, Explore, Follow, Gather, HeadOn, MatchVelocity, Perimeter, Push, Respond,
          Separate, FightFire)  # fmt: skip
SENSORS = (ProximitySensor, RadiationSensor, LineSensor)
IMPERFECT = (Imperfection, Imperfections)
DRIVES = (DifferentialDrive, HolonomicDrive)
PARTS = {part.__name__: part for part in (RobotDesign, *SENSORS, *DRIVES, FireConstants, Radio, *IMPERFECT, *LAYERS)}
OWN_CODE = "code of one's own"
ARBITERS = {"Subsumption": Subsumption, "VectorSum": VectorSum}
PLAIN = (bool, int, float, str, type(None))


def part_to_json(part: Any) -> object:
    """Return a part as ``{class: fields}``, its own parts likewise; plain values are what they are.

    Raises
    ------
    RecordingError
        If it is, or holds, an object of another class.

    Examples
    --------
    >>> part_to_json(LineSensor(mount=(5, 0)))
    {'LineSensor': {'mount': [5.0, 0.0]}}
    """
    if isinstance(part, np.generic):
        part = part.item()
    if type(part) in PLAIN:
        return part
    if type(part) in (tuple, list):
        return [part_to_json(item) for item in part]
    name = type(part).__name__
    if PARTS.get(name) is not type(part):
        raise RecordingError(f"{shortened(part)} is of class {name}, which a recording cannot tell")
    own = fields(part) if is_dataclass(part) else ()
    return {name: {field.name: part_to_json(getattr(part, field.name)) for field in own}}


def part_from_json(value: object) -> object:
    """Return the part that `part_to_json` wrote; lists become tuples.

    Raises
    ------
    RecordingError
        If it tells of no such part, or of one that cannot be.

    Examples
    --------
    >>> from mesa_swarm.robots.design import AGENT_FIRE
    >>> part_from_json(part_to_json(AGENT_FIRE)) == AGENT_FIRE
    True
    """
    if type(value) in PLAIN:
        return value
    if isinstance(value, list):
        return tuple(part_from_json(item) for item in value)
    name, given = _only_item(value)
    if name not in PARTS or not isinstance(given, dict):
        raise RecordingError(f"there is no part {shortened(name)} that a recording may tell of")
    arguments = {field: part_from_json(item) for field, item in given.items()}
    return _made(name, PARTS[name], arguments)


def shape_to_json(shape: Shape) -> dict:
    """Return a shape as JSON, its coordinates exactly.

    Examples
    --------
    >>> shape_to_json(disc((10, 20), 5))
    {'centre': [10.0, 20.0], 'radius': 5.0, 'contact': True}
    """
    return {**outline_to_json(shape.geometry, shape.radius), "contact": shape.contact}


def outline_to_json(geometry: Point | Polygon, radius: float) -> dict:
    """Return a centre and radius, or the rings of a polygon."""
    if isinstance(geometry, Point):
        return {"centre": [geometry.x, geometry.y], "radius": float(radius)}
    return {"rings": [shapely.get_coordinates(ring).tolist() for ring in (geometry.exterior, *geometry.interiors)]}


def shape_from_json(value: object) -> Shape:
    """Return the shape that `shape_to_json` wrote.

    Raises
    ------
    RecordingError
        If it is none.

    Examples
    --------
    >>> shape_from_json({"centre": [10, 20], "radius": 5, "contact": False}).contact
    False
    """
    given = _checked_shape(value)
    contact = given.get("contact", True)
    if "rings" in given:
        outline, *holes = [np.array(ring, dtype=float) for ring in given["rings"]] or [np.empty((0, 2))]
        return _made("polygon", polygon, {"outline": outline, "holes": holes, "contact": contact})
    return _made("disc", disc, {"centre": given["centre"], "radius": given["radius"], "contact": contact})


def outline_from_json(value: Any) -> tuple[Point | Polygon, float]:
    """Return the geometry and radius that `outline_to_json` wrote, every bit of it, also of what is about the origin.

    Raises
    ------
    RecordingError
    """
    shape = shape_from_json(value)
    if shape.is_disc:
        return Point(*value["centre"]), shape.radius
    outline, *holes = value["rings"]
    return Polygon(outline, holes), 0.0


def control_to_json(control: Arbiter | None) -> object:
    """Return what an arbiter is made of; of layers that are code of one's own only what they are called.

    Examples
    --------
    >>> control_to_json(Subsumption(Avoid(distance=9)))["Subsumption"]["layers"][0]["Avoid"]["distance"]
    9
    """
    if control is None:
        return None
    layers = [_layer_to_json(layer) for layer in control.layers]
    weights = getattr(control, "weights", None)
    return {type(control).__name__: {"layers": layers, "weights": None if weights is None else list(weights)}}


def control_from_json(value: object) -> object:
    """Return the arbiter that `control_to_json` wrote.

    Raises
    ------
    RecordingError
        If a layer, or the arbiter, is not one of mesa_swarm's.
    """
    if value is None:
        return None
    name, given = _only_item(value)
    if name not in ARBITERS or not isinstance(given, dict) or not isinstance(given.get("layers"), list):
        raise RecordingError(f"there is no arbiter {shortened(name)} that a recording may tell of")
    own = own_code(value)
    if own:
        raise RecordingError(f"the control has code of one's own in it ({shortened(own[0])}), which no recording holds")
    layers = [part_from_json(layer) for layer in given["layers"]]
    more = {} if given.get("weights") is None else {"weights": given["weights"]}
    return _made(name, lambda: ARBITERS[name](*layers, **more), {})


def own_code(control: Any) -> list[str]:
    """Return what is called of the layers that are code of one's own in what `control_to_json` returned.

    Examples
    --------
    >>> own_code(control_to_json(Subsumption(Avoid(distance=9))))
    []
    """
    layers = [layer for given in (control or {}).values() for layer in given["layers"]]
    return [str(layer[OWN_CODE]) for layer in layers if isinstance(layer, dict) and OWN_CODE in layer]


def _layer_to_json(layer: object) -> object:
    try:
        return part_to_json(layer)
    except RecordingError:
        values = [f"{name}={value!r}" for name, value in getattr(layer, "parameters", {}).items()]
        return {OWN_CODE: " ".join([type(layer).__name__, str(getattr(layer, "name", "")), *values])}


def _checked_shape(value: object) -> dict:
    if isinstance(value, dict) and isinstance(value.get("contact", True), bool):
        rings = value.get("rings")
        if isinstance(rings, list) and all(isinstance(ring, list) for ring in rings):
            return value
        if {"centre", "radius"} <= value.keys():
            return value
    raise RecordingError(f"{shortened(value)} is no shape")


def _only_item(value: object) -> tuple[object, object]:
    if not isinstance(value, dict) or len(value) != 1:
        raise RecordingError(f"{shortened(value)} is no part; expected a class and its fields")
    ((name, given),) = value.items()
    return name, given


def _made(name: str, maker: Callable, arguments: dict) -> Any:
    try:
        return maker(**arguments)
    except (SwarmError, TypeError, ValueError, AttributeError, OverflowError) as error:
        words = " ".join(str(error).split())
        raise RecordingError(f"{name} of the recording cannot be made: {words[:200]}") from None
