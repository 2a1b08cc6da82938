"""Which robots, obstacles, loads and fires a model has, told exactly, and a model that is made to have the same."""

from collections.abc import Callable, Iterator

import numpy as np
from mesa.agent import Agent

from mesa_swarm.errors import RecordingError
from mesa_swarm.fire.fires import Fire
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.parts import (
    outline_from_json,
    outline_to_json,
    part_from_json,
    part_to_json,
    shape_from_json,
    shape_to_json,
)
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.table import DesignTable
from mesa_swarm.world.form import Form
from mesa_swarm.world.load import Load
from mesa_swarm.world.obstacle import Obstacle

MOST_THINGS = 10_000_000


def things_to_json(model: ObservedWorld) -> dict:
    """Return what there is in a world, in the order of unique_ids.

    Raises
    ------
    RecordingError
        If there is anything that is none of these, or a design that cannot be told.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, disc
    >>> model = SwarmModel(rng=1)
    >>> mark = model.add_obstacle(disc((100, 100), 20, contact=False))
    >>> things_to_json(model)["obstacles"][-1]["shape"]
    {'centre': [100.0, 100.0], 'radius': 20.0, 'contact': False}
    """
    swarm = model.swarm
    known = len(swarm) + len(model.obstacle_list) + len(model.fires)
    if len(model.agents) != known:
        raise RecordingError(f"{len(model.agents) - known} agents are neither robots, obstacles, loads nor fires")
    return {
        "designs": [part_to_json(design) for design in swarm.designs],
        "created": swarm._created,
        "robots": [robot.unique_id for robot in swarm.agents],
        "designs_of_robots": swarm.design.tolist(),
        "obstacles": [_obstacle_to_json(obstacle) for obstacle in model.obstacle_list],
        "fires": [fire.unique_id for fire in model.fires.agents],
        "next_id": next_id(model),
    }


def lay_things(model: ObservedWorld, told: dict) -> None:
    """Make a model have the robots, obstacles, loads and fires that were told: take out what is gone, add what came.

    What has the same unique_id is the same thing and stays, with all that refers to it.

    Raises
    ------
    RecordingError
        If a thing is another than the one of the same unique_id.
    """
    obstacles = {_id(body["id"]): body for body in told["obstacles"]}
    _check_ids(told, obstacles)
    _take_out(model, {*told["robots"], *obstacles, *told["fires"]})
    designs = _designs(model, told["designs"])
    makers = {row: _robot_maker(model, designs[d]) for row, d in _rows(told, len(designs))}
    makers |= {row: _obstacle_maker(model, body) for row, body in obstacles.items()}
    makers |= {row: _fire_maker(model) for row in told["fires"]}
    there = {agent.unique_id for agent in model.agents}
    for unique_id in sorted(makers.keys() - there):
        set_next_id(model, unique_id)
        makers[unique_id]()
    set_next_id(model, _id(told["next_id"]))
    _check_same(model, told, obstacles)
    model.swarm.table = DesignTable.of(designs)
    model.swarm._created = _id(told["created"])
    model.swarm._resize(np.arange(len(model.swarm)), 0)
    for obstacle in model.obstacle_list:
        if isinstance(obstacle, Load):
            _lay_load(obstacle, obstacles[obstacle.unique_id], model.map.bounds)
    model.obstacles_changed()


def next_id(model: ObservedWorld) -> int:
    """Return the unique_id that the next agent gets: Mesa 3.5 counts in the model, 3.3 with a counter beside it."""
    if hasattr(model, "agent_id_counter"):
        return model.agent_id_counter
    return int(repr(Agent._ids[model]).removeprefix("count(").removesuffix(")"))


def set_next_id(model: ObservedWorld, unique_id: int) -> None:
    """Let the next agent have this unique_id."""
    if hasattr(model, "agent_id_counter"):
        model.agent_id_counter = unique_id
        return
    counter = type(Agent._ids[model])
    Agent._ids[model] = counter(unique_id)


def summary(model: ObservedWorld) -> list[list[int]]:
    """Return what differs once anything came or went: how many there are of each, and the last unique_id."""
    kinds = (model.swarm.agents, model.obstacle_list, model.fires.agents)
    return [[len(things), things[-1].unique_id if things else 0] for things in kinds]


def _obstacle_to_json(obstacle: Obstacle) -> dict:
    if isinstance(obstacle, Load):
        lies = {"pose": list(obstacle.pose), "resistance": float(obstacle.resistance)}
        felt = {"moved": bool(obstacle.moved), "pushers": int(obstacle.pushers)}
        outline = outline_to_json(obstacle.form.outline, obstacle.form.radius)
        return {"id": obstacle.unique_id, "load": outline, **lies, **felt}
    return {"id": obstacle.unique_id, "shape": shape_to_json(obstacle.shape)}


def _check_ids(told: dict, obstacles: dict) -> None:
    ids = [*told["robots"], *obstacles, *told["fires"]]
    orderly = all(list(kind) == sorted(kind) for kind in (told["robots"], obstacles, told["fires"]))
    first_free = _id(told["next_id"])
    if not orderly or len(set(ids)) != len(ids) or not all(0 < _id(one) < first_free for one in ids):
        raise RecordingError("its unique_ids are in no order, or stand for two things")


def _take_out(model: ObservedWorld, kept: set[int]) -> None:
    model.remove_robots([robot for robot in model.swarm.agents if robot.unique_id not in kept])
    for thing in [*model.obstacle_list, *model.fires.agents]:
        if thing.unique_id not in kept:
            thing.remove()


def _designs(model: ObservedWorld, told: list) -> list[RobotDesign]:
    """Return the designs, those that the model has already as they are: a drive may be of one's own."""
    there = [(part_to_json(design), design) for design in model.swarm.designs]
    parts = [
        next((d for words, d in there if words == told_one), None) or part_from_json(told_one) for told_one in told
    ]
    designs = [part for part in parts if isinstance(part, RobotDesign)]
    if len(designs) < len(parts):
        raise RecordingError("its designs are none")
    return designs


def _rows(told: dict, designs: int) -> Iterator[tuple[int, int]]:
    for unique_id, design in zip(told["robots"], told["designs_of_robots"], strict=True):
        if not 0 <= _id(design) < designs:
            raise RecordingError(f"robot {unique_id} is of design {design}, of {designs}")
        yield unique_id, design


def _robot_maker(model: ObservedWorld, design: RobotDesign) -> Callable:
    def make() -> None:
        x_min, y_min, *_ = model.map.bounds
        row = int(model.swarm.add(design, np.array([[x_min, y_min]]), np.zeros(1), np.ones(1))[0])
        model.swarm.agents.append(Robot(model.space, model, model.swarm, row))

    return make


def _obstacle_maker(model: ObservedWorld, body: dict) -> Callable:
    def make() -> None:
        if "load" not in body:
            model._obstacles.append(Obstacle(model.space, model, shape_from_json(body["shape"])))
            return
        outline, radius = outline_from_json(body["load"])
        form = Form.about_origin(outline, radius)
        load = Load(model.space, model, form.shape_at((0.0, 0.0, 0.0)), body["resistance"])
        load.form = form
        model._obstacles.append(load)
        model._loads.append(load)

    return make


def _fire_maker(model: ObservedWorld) -> Callable:
    def make() -> None:
        row = model.fires.add(np.array(model.map.bounds[:2]), 1.0, 1.0, 1.0)
        model.fires.agents.append(Fire(model.space, model, model.fires, row))
        model._burns = True

    return make


def _check_same(model: ObservedWorld, told: dict, obstacles: dict) -> None:
    """Refuse things that are others than those of the same unique_id, as another constructor would make them."""
    there = {
        "robots": [robot.unique_id for robot in model.swarm.agents],
        "obstacles": [obstacle.unique_id for obstacle in model.obstacle_list],
        "fires": [fire.unique_id for fire in model.fires.agents],
    }
    if there != {"robots": told["robots"], "obstacles": list(obstacles), "fires": told["fires"]}:
        raise RecordingError("the model's constructor makes other things than it did")
    for obstacle in model.obstacle_list:
        now, then = _obstacle_to_json(obstacle), obstacles[obstacle.unique_id]
        form = "load" if "load" in now else "shape"
        if now[form] != then.get(form):
            raise RecordingError(f"obstacle {obstacle.unique_id} is another than it was")


def _lay_load(load: Load, told: dict, bounds: tuple[float, float, float, float]) -> None:
    load.resistance = told["resistance"]
    x, y, heading = map(float, told["pose"])
    x_min, y_min, x_max, y_max = bounds
    if not (x_min <= x <= x_max and y_min <= y <= y_max and abs(heading) <= np.pi):
        raise RecordingError(f"load {load.unique_id} lies outside the map")
    load.lay((x, y, heading))
    load.moved, load.pushers = bool(told["moved"]), _id(told["pushers"])


def _id(value: object) -> int:
    if type(value) is not int or not 0 <= value <= MOST_THINGS * 1000:
        raise RecordingError(f"{value!r:.40} is no number of a thing")
    return value
