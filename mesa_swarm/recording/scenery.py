"""What a recording says of what robots and things look like: designs, obstacles, loads, layers."""

import math
from collections.abc import Sequence

import numpy as np
from shapely import Point, Polygon

from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import mount_of
from mesa_swarm.world.load import Load
from mesa_swarm.world.shapes import Shape


def scenery_of(model: ObservedWorld) -> dict:
    """Return what one must know to draw a model, besides what changes from step to step, as JSON has it.

    Parameters
    ----------
    model : ObservedWorld
        Any `SwarmModel`.

    Returns
    -------
    dict
        ``designs``; ``robots``, rows [first id, last id, index of their design]; ``shapes`` of obstacles and
        ground marks on the map; ``loads``, shapes about their own centres; ``layers``, names in the order of
        the column `layer`; ``leave``, the temperature at which a robot is too hot, and ``join``, down to which it
        is until it has cooled.

    Examples
    --------
    >>> from mesa_swarm import AGENT3, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT3, 2)
    >>> scenery = scenery_of(model)
    >>> scenery["robots"], scenery["designs"][0]["radius"], scenery["shapes"][0]["rings"][0][0]
    ([[5, 6, 0]], 5.0, [0.0, 0.0])
    """
    layers = () if model.control is None else model.control.layers
    still = [obstacle.shape for obstacle in model.obstacle_list if not isinstance(obstacle, Load)]
    return {
        "designs": [_written_design(design) for design in model.swarm.designs],
        "robots": _runs([robot.unique_id for robot in model.swarm.agents], model.swarm.design.tolist()),
        "shapes": [written_shape(shape) for shape in still],
        "loads": [{"id": load.unique_id, **_written_form(load)} for load in model.loads],
        "layers": [layer.name for layer in layers],
        "leave": model.fire_constants.leave,
        "join": model.fire_constants.join,
    }


def shows(scenery: dict, other: dict) -> bool:
    """Tell whether a scenery says all that a later one of the same model does: robots may only have gone.

    Examples
    --------
    >>> shows({"robots": [[5, 7, 0]], "leave": 1.0}, {"robots": [[5, 5, 0], [7, 7, 0]], "leave": 1.0})
    True
    >>> shows({"robots": [[5, 7, 0]], "leave": 1.0}, {"robots": [[5, 8, 0]], "leave": 1.0})
    False
    """
    last, newest = (max((run[1] for run in one["robots"]), default=0) for one in (scenery, other))
    return newest <= last and {**scenery, "robots": ()} == {**other, "robots": ()}


def joined(sceneries: Sequence[tuple[int, dict]]) -> tuple[tuple[int, dict], ...]:
    """Return sceneries of one model, each of which knows all robots, designs and loads that any of them knows.

    Obstacles, layers and heat are each one's own.

    Parameters
    ----------
    sceneries : sequence of (step, dict)
        In the order of time: ids only grow.

    Examples
    --------
    >>> early = {"designs": ["a"], "robots": [[1, 2, 0]], "loads": [], "shapes": ["wall"]}
    >>> late = {"designs": ["b", "a"], "robots": [[2, 2, 1], [5, 6, 0]], "loads": [], "shapes": []}
    >>> (_, first), (_, second) = joined([(0, early), (9, late)])
    >>> first["designs"], first["robots"], second["shapes"]
    (['a', 'b'], [[1, 2, 0], [5, 6, 1]], [])
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
    same = {"designs": designs, "robots": robots, "loads": list(loads.values())}
    return tuple((step, {**scenery, **same}) for step, scenery in sceneries)


def written_shape(shape: Shape) -> dict:
    """Return a disc as x, y and radius, a polygon as its rings.

    Examples
    --------
    >>> from mesa_swarm.world.shapes import disc
    >>> written_shape(disc((1, 2), 3, contact=False))
    {'disc': [1.0, 2.0, 3.0], 'mark': True}
    """
    return {**_written_geometry(shape.geometry, shape.radius), **({} if shape.contact else {"mark": True})}


def _written_form(load: Load) -> dict:
    return _written_geometry(load.form.outline, load.form.radius)


def _written_geometry(geometry: Point | Polygon, radius: float) -> dict:
    """Return a Shapely point with its radius, or a polygon, as JSON has it."""
    if geometry.geom_type == "Point":
        return {"disc": [geometry.x, geometry.y, radius]}
    rings = (geometry.exterior, *geometry.interiors)
    return {"rings": [np.asarray(ring.coords)[:-1].tolist() for ring in rings]}


def _written_design(design: RobotDesign) -> dict:
    return {
        "name": design.name,
        "radius": design.radius,
        "max_speed": design.max_speed,
        "holonomic": not design.turns,
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
    """Return stretches of robots of one design: [first id, last id, design]."""
    runs: list[list[int]] = []
    for one, design in zip(ids, designs, strict=True):
        if runs and runs[-1][2] == design:
            runs[-1][1] = one
        else:
            runs.append([one, one, design])
    return runs
