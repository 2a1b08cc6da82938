"""Portraits: all that pictures show of a model, as plain arrays that travel between processes."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.control.layer import Senses
from mesa_swarm.control.perception import centroids
from mesa_swarm.model import SwarmModel
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.world.load import Load
from mesa_swarm.world.map_parts import Bounds
from mesa_swarm.world.shapes import Shape


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Portrait:
    """The world at one moment, and what was recorded until then.

    Parameters
    ----------
    steps : int
    bounds : (x_min, y_min, x_max, y_max)
    obstacles, loads : tuples of Shape
        Loads as they lie now; they are not among the obstacles.
    designs : tuple of RobotDesign
    robots : dict of ndarrays
        position, heading, radius, design and hot, a row a robot; perceived (n, 2), if it was asked for, is where
        a robot perceives the centroid of those that it sees, nan where it sees none.
    fires : dict of ndarrays
        position, radius, temperature and out, a row a fire.
    history : dict of ndarrays
        steps (k,), temperature and robots (k, f) of the fires; the last row is the present.
    series : dict of ndarrays
        What the DataCollector collected of the model in every step, by name; numbers only.
    """

    steps: int
    bounds: Bounds
    obstacles: tuple[Shape, ...]
    loads: tuple[Shape, ...]
    designs: tuple[RobotDesign, ...]
    robots: dict[str, np.ndarray]
    fires: dict[str, np.ndarray]
    history: dict[str, np.ndarray]
    series: dict[str, np.ndarray]
    collect_every: int = 1


def portrait_of(model: SwarmModel, *, perceived: bool = False) -> Portrait:
    """Return the portrait of a model as it is now.

    Parameters
    ----------
    model : SwarmModel
    perceived : bool
        Whether to show where robots perceive the centroid of those that they see; all sensors are then read.

    Examples
    --------
    >>> from mesa_swarm.model import SwarmModel
    >>> portrait_of(SwarmModel(map="openspace_fire", rng=1)).fires["out"].sum()
    np.int64(0)
    """
    robots = ("position", "heading", "radius", "design", "hot")
    fires = ("position", "radius", "temperature", "out")
    columns = {name: model.swarm.columns[name].copy() for name in robots}
    return Portrait(
        steps=model.steps,
        bounds=model.map.bounds,
        obstacles=tuple(obstacle.shape for obstacle in model.obstacles if not isinstance(obstacle, Load)),
        loads=tuple(load.shape for load in model.loads),
        designs=model.swarm.designs,
        robots={**columns, **({"perceived": _perceived(model)} if perceived else {})},
        fires={name: model.fires.columns[name].copy() for name in fires},
        history=_history(model),
        series=_series(model),
        collect_every=model.collect_every,
    )


def _perceived(model: SwarmModel) -> np.ndarray:
    """Return where on the map each robot perceives the centroid of the robots that it sees, nan for none."""
    model.sense()
    centroid, seen = centroids(Senses.of(model.swarm))
    cosine, sine = np.cos(model.swarm.heading), np.sin(model.swarm.heading)
    x, y = centroid.T
    place = model.swarm.position + np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
    return np.where(seen[:, None] > 0, place, np.nan)


def _history(model: SwarmModel) -> dict[str, np.ndarray]:
    """Return the fires' history with the present as its last row, which is else missing between two rows."""
    fires, history = model.fires, model.fires.history
    tables = {name: getattr(history, name) for name in ("steps", "temperature", "robots")}
    if len(tables["steps"]) and tables["steps"][-1] < model.steps:
        now = {"steps": model.steps, "temperature": fires.temperature, "robots": np.where(fires.out, -1, fires.robots)}
        tables = {name: np.concatenate([table, [now[name]]]) for name, table in tables.items()}
    return tables


def _series(model: SwarmModel) -> dict[str, np.ndarray]:
    collected = {name: np.array(values) for name, values in model.datacollector.model_vars.items()}
    return {name: values for name, values in collected.items() if values.dtype.kind in "biuf" and values.ndim == 1}
