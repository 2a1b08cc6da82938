"""Robots, obstacles, loads, fires and other agents as stored in recordings."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
from mesa.agent import Agent
from mesa.experimental.continuous_space import ContinuousSpaceAgent
from shapely import Point, Polygon

from mesa_swarm.base.errors import RecordingError, check_flag, check_name, shortened
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.devices import make_stored, part_from_json, part_to_json
from mesa_swarm.recording.made_objects import check_agent_class, classes_near, family, is_class
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.robot import add_handles
from mesa_swarm.world.arena import ArenaAgent, get_next_id, set_next_id
from mesa_swarm.world.bodies import Body, BodyTable, Form, Pose, check_resistance, check_temperature, handle_classes
from mesa_swarm.world.movers import Driven
from mesa_swarm.world.shapes import Shape, disc, outline_to_json, shape_from_json
from mesa_swarm.world.statics import CARRIED, DRIVEN, FIXED, KINDS, MODES, MOST_KINDS

MOST_OBJECTS = 10_000_000


def store_shape(shape: Shape) -> dict:
    """Return a shape as stored states have it: `store_outline`, and whether bodies bump into it."""
    return {**store_outline(shape.geometry, shape.radius), "contact": shape.contact}


def store_outline(geometry: Point | Polygon, radius: float) -> dict:
    """Return the centre and radius of a disc, or the closed rings of a polygon."""
    outline = outline_to_json(geometry, radius)
    if "disc" in outline:
        *centre, radius = outline["disc"]
        return {"centre": centre, "radius": float(radius)}
    return {"rings": [[*ring, ring[0]] for ring in outline["rings"]]}


def restore_shape(value: Any) -> Shape:
    """Return the shape that `store_shape` wrote."""

    def make() -> Shape:
        outline = {"rings": value["rings"]} if "rings" in value else {"disc": [*value["centre"], value["radius"]]}
        return shape_from_json({**outline, "mark": not check_flag("contact", value.get("contact", True))})

    return make_stored("shape", make, {})


def restore_outline(value: Any) -> tuple[Point | Polygon, float]:
    """Return the geometry and radius that `store_outline` wrote, every bit of it, also of what is about the origin."""
    shape = restore_shape(value)
    if shape.is_disc:
        return Point(*value["centre"]), shape.radius
    outline, *holes = value["rings"]
    return Polygon(outline, holes), 0.0


def objects_to_json(model: EngineModel) -> dict:
    """Return the robots, obstacles, loads, fires and other agents of a model by unique_id."""
    swarm = model.swarm
    others = [[agent.unique_id, *class_of_agent(agent), _place_of(agent)] for agent in other_agents(model)]
    return {
        **({"others": others} if others else {}),
        "designs": [part_to_json(design) for design in swarm.designs],
        "created": swarm.robots_created,
        "robots": swarm.unique_ids.tolist(),
        "designs_of_robots": swarm.design.tolist(),
        "groups": list(swarm.groups),
        "obstacles": [body_to_json(body) for body in model.obstacle_list],
        "fires": [fire.unique_id for fire in model.fires.agents],
        "next_id": get_next_id(model),
        **({} if model.kinds == KINDS else {"kinds": list(model.kinds)}),
    }


def restore_objects(model: EngineModel, things: dict, *, from_file: bool = True) -> dict[Agent, Agent | None]:
    """Give a model the stored robots, obstacles, loads and fires: remove those that are not stored, add the others.

    An object with a stored unique_id stays, with all references to it, if it does not differ from the stored one.
    Returned are agents of other classes that were made, without their constructors, each with one of the same class
    that the model had before, if it had any. Where what is stored comes `from_file`, classes are checked.
    """
    before = {type(agent): agent for agent in other_agents(model)}
    obstacles = {_id(body["id"]): body for body in things["obstacles"]}
    others = {_id(item[0]): item[1:] for item in things.get("others", ())}
    _check_ids(things, obstacles, others)
    _remove_others(model, {*things["robots"], *obstacles, *things["fires"], *others})
    _set_kinds(model, _checked_kinds(things.get("kinds", list(KINDS))))
    designs = _designs(model, things["designs"])
    robots = dict(zip(things["robots"], things["designs_of_robots"], strict=True))
    for unique_id, design in robots.items():
        if not 0 <= _id(design) < len(designs):
            raise RecordingError(f"robot {unique_id} has design {design}; expected one of {len(designs)}")
    makers: dict[int, Callable]
    makers = {unique_id: partial(_make_body, model, body) for unique_id, body in obstacles.items()}
    makers |= {unique_id: partial(_make_fire, model) for unique_id in things["fires"]}
    makers |= {
        unique_id: partial(_make_other, model, before if from_file else None, *kind)
        for unique_id, (*kind, _) in others.items()
    }
    present = {agent.unique_id for agent in model.agents}
    for ids in _runs_of_alike(sorted((makers.keys() | robots.keys()) - present), robots):
        set_next_id(model, ids[0])
        if ids[0] in robots:
            _make_robots(model, designs[robots[ids[0]]], len(ids))
        else:
            makers[ids[0]]()
    set_next_id(model, _id(things["next_id"]))
    _check_same(model, things, obstacles)
    model.swarm.robots_created = _id(things["created"])
    model.swarm.groups = tuple(check_name("group", group) for group in things.get("groups", ()))
    model.swarm.set_designs(designs)
    _restore_others(model, others)
    robots_by_id = {robot.unique_id: robot for robot in model.swarm.agents}
    agents = {agent.unique_id: agent for agent in model.agents}
    for body in model.obstacle_list:
        facts = obstacles[body.unique_id]
        if isinstance(body, Driven):
            body.agent = _agent_of(model, _id(facts["agent"]), agents) if "agent" in facts else None
            body.carrier = robots_by_id[_id(facts["carrier"])] if "carrier" in facts else None
            body.table.mode[body.row] = DRIVEN if body.carrier is None else CARRIED
        restore_state(body, facts, model.map.bounds)  # earlier formats have it here
    model.parts.bodies.table.sort()
    model.parts.bodies.changed()
    new = [agent for agent in other_agents(model) if agent.unique_id not in present]
    return {agent: before.get(type(agent)) for agent in new}


def _agent_of(model: EngineModel, unique_id: int, agents: dict[int, Agent]) -> Agent:
    """Return the agent that a body follows; in the place of one that was removed since the last step a removed one.

    With the latter the body is removed when the next step begins.
    """
    if unique_id in agents:
        return agents[unique_id]
    agent = object.__new__(Agent)
    agent.model, agent.unique_id, agent.pos = model, unique_id, None
    return agent


def _runs_of_alike(ids: Sequence[int], designs: dict[int, int]) -> Iterator[list[int]]:
    """Iterate over runs of consecutive unique_ids of robots of the same design; all others come one by one."""

    def kind(pair: tuple[int, int]) -> tuple:
        place, unique_id = pair
        return (unique_id - place, designs[unique_id]) if unique_id in designs else (unique_id,)

    for _, run in groupby(enumerate(ids), kind):
        yield [unique_id for _, unique_id in run]


def other_agents(model: EngineModel) -> list[Agent]:
    """Return the agents of a model that are neither robots, obstacles, loads nor fires, in the model's order."""
    usual = {id(agent) for agents in (model.swarm.agents, model.obstacle_list, model.fires.agents) for agent in agents}
    return [agent for agent in model.agents if id(agent) not in usual] if len(model.agents) > len(usual) else []


def class_of_agent(agent: Agent) -> tuple[str, str]:
    """Return the module and the name of the class of an agent."""
    return type(agent).__module__, type(agent).__qualname__


def _place_of(agent: Agent) -> list[float] | None:
    """Return the position of an agent that the model's space stores."""
    if not isinstance(agent, ContinuousSpaceAgent):
        return None
    if agent.space is not agent.model.space:
        raise RecordingError(f"{type(agent).__name__} {agent.unique_id} is in another space than model.space")
    return agent.position.tolist()


def _make_other(model: EngineModel, before: dict[type, Agent] | None, module: str, name: str) -> None:
    """Make an agent of a class that is loaded, without its constructor: its attributes are restored later."""
    kind = agent_class(module, name)
    if kind is None or issubclass(kind, ArenaAgent):
        raise RecordingError(f"agents of class {shortened(name)} cannot be made: import it from {shortened(module)}")
    if before is not None:
        check_agent_class(kind, kind in before)
    agent = object.__new__(kind)
    if issubclass(kind, ContinuousSpaceAgent):
        ContinuousSpaceAgent.__init__(agent, model.space, model)
    else:
        Agent.__init__(agent, model)


def agent_class(module: object, name: object) -> type[Agent] | None:
    """Return the class of agents of this name that is loaded, None without one."""
    alike = [kind for kind in family(Agent) if is_class(kind, str(module), str(name))]
    exact = [kind for kind in alike if kind.__module__ == module]
    return (exact or alike)[0] if exact or len(alike) == 1 else None


def _restore_others(model: EngineModel, facts: dict[int, list]) -> None:
    """Move the other agents to their places; refuse agents of other classes than those stored."""
    for agent in other_agents(model):
        *kind, place = facts[agent.unique_id]
        if not is_class(type(agent), *map(str, kind)):
            raise RecordingError(
                f"agent {agent.unique_id} is of {type(agent).__name__} in the model, of {shortened(kind[1])} in the "
                "recording"
            )
        if place is not None and isinstance(agent, ContinuousSpaceAgent):
            agent.position = place


def summary(model: EngineModel) -> list[list[int]]:
    """Return the number of robots, obstacles and fires, and the last unique_id of each: any addition changes them."""
    kinds = (model.swarm.agents, model.obstacle_list, model.fires.agents)
    return [[len(agents), agents[-1].unique_id if agents else 0] for agents in kinds]


def body_to_json(body: Body) -> dict:
    """Return what a body is, as stored states have it: its outline, its kind, the robot or agent that it goes with."""
    form, outline_name = body.form, "shape" if body.form is None else OUTLINES.get(body.added_as, body.added_as)
    shape = body.table.shape_of(body.row)  # of a removed one as well
    outline = store_shape(shape) if form is None else store_outline(form.outline, form.radius)
    related = {name: getattr(body, name, None) for name in ("carrier", "agent")}
    return {
        "id": body.unique_id,
        outline_name: outline,
        **({} if body.kind == body.usual_kind else {"kind": body.kind}),
        **{name: agent.unique_id for name, agent in related.items() if agent is not None},
    }


def state_to_json(body: Body) -> dict:
    """Return the state of a body, as earlier formats have it, and as a removed one is stored."""
    table, row = body.table, body.row
    aim = [*table.aim[row].tolist(), float(table.aim_heading[row])]
    values = {name: getattr(table, name)[row] for name in STATE}
    unusual = {n: v.item() for n, v in values.items() if not np.array_equal(v, BodyTable.columns[n][0], equal_nan=True)}
    return {"pose": list(table.pose_of(row)), "aim": aim, **unusual}


def restore_state(body: Body, facts: dict, bounds: tuple[float, float, float, float]) -> None:
    """Take back what `state_to_json` has returned, or some of it, checked."""
    table, row, name = body.table, body.row, f"body {body.unique_id}"
    if "pose" in facts:
        table.put(row, read_pose(name, facts["pose"], bounds))
    if "aim" in facts:
        *table.aim[row], table.aim_heading[row] = read_pose(name, facts["aim"], bounds)
    for column, check in STATE.items():
        if column in facts:
            getattr(table, column)[row] = check(facts[column])


def _check_ids(things: dict, obstacles: dict, others: dict) -> None:
    kinds = (things["robots"], list(obstacles), things["fires"], sorted(others))
    ids = [number for kind in kinds for number in kind]
    first_free = _id(things["next_id"])
    if any(kind != sorted(kind) for kind in kinds) or len(set(ids)) != len(ids):
        raise RecordingError("unique_ids are not ascending, or not unique")
    if not all(0 < _id(number) < first_free for number in ids):
        raise RecordingError("invalid unique_id: not below that of the next agent")


def _checked_kinds(names: Any) -> tuple[str, ...]:
    valid = isinstance(names, list) and all(isinstance(name, str) and name.isidentifier() for name in names)
    if not valid or tuple(names[: len(KINDS)]) != KINDS or not len(set(names)) == len(names) <= MOST_KINDS + 1:
        raise RecordingError("invalid names of kinds")
    return tuple(names)


def _set_kinds(model: EngineModel, kinds: tuple[str, ...]) -> None:
    for body in model.obstacle_list:
        if body.kind not in kinds:
            raise RecordingError(f"obstacle {body.unique_id} does not match the recording: it is a {body.kind}")
    model.parts.bodies.table.set_kinds(kinds)


def _remove_others(model: EngineModel, ids: set[int]) -> None:
    model.remove_robots([robot for robot in model.swarm.agents if robot.unique_id not in ids])
    for agent in [*model.obstacle_list, *model.fires.agents, *other_agents(model)]:
        if agent.unique_id not in ids:
            agent.remove()


def _designs(model: EngineModel, stored: list) -> list[RobotDesign]:
    """Return the designs; those that the model has already unchanged, since a drive may be custom."""
    present = [(part_to_json(design), design) for design in model.swarm.designs]
    near = classes_near(model)
    designs = [next((d for f, d in present if f == facts), None) or part_from_json(facts, near) for facts in stored]
    if not all(isinstance(design, RobotDesign) for design in designs):
        raise RecordingError("invalid stored designs")
    return designs


def _make_robots(model: EngineModel, design: RobotDesign, number: int) -> None:
    corner = np.tile(model.map.bounds[:2], (number, 1))
    model.swarm.add(design, corner, np.zeros(number), np.ones(number))
    add_handles(model.space, model, model.swarm)
    model.parts.add_rows("robots", number)


def _make_body(model: EngineModel, body: dict) -> None:
    bodies, (name, mode) = model.parts.bodies, _form_of(body)
    body_class, form = handle_classes()[mode], None
    if mode == MODES[FIXED]:
        shape = restore_shape(body[name])
    else:
        form = Form.about_origin(*restore_outline(body[name]))
        shape = form.shape_at((0.0, 0.0, 0.0))
    kind = bodies.checked_kind(body.get("kind"), body_class.usual_kind)
    bodies.take(body_class, shape, kind, form, mode=MODES.index(mode))


def _form_of(body: dict) -> tuple[str, str]:
    """Return the name under which the outline of a body is stored, and its mode."""
    names = {OUTLINES.get(mode, mode): mode for mode in handle_classes()}
    return next((name, mode) for name, mode in names.items() if name in body)


def _make_fire(model: EngineModel) -> None:
    model.parts.fires.begin_burning()
    model.parts.fires.take(disc(model.map.bounds[:2], 1.0), 1.0, 1.0)


def _check_same(model: EngineModel, things: dict, obstacles: dict) -> None:
    """Refuse objects that differ from those stored with their unique_ids, as another constructor would make them."""
    present = {
        "robots": model.swarm.unique_ids.tolist(),
        "obstacles": [obstacle.unique_id for obstacle in model.obstacle_list],
        "fires": [fire.unique_id for fire in model.fires.agents],
    }
    if present != {"robots": things["robots"], "obstacles": list(obstacles), "fires": things["fires"]}:
        raise RecordingError("the objects that the model's constructor makes do not match the recording")
    for obstacle in model.obstacle_list:
        now, stored = body_to_json(obstacle), obstacles[obstacle.unique_id]
        form, _ = _form_of(now)
        if now[form] != stored.get(form) or now.get("kind") != stored.get("kind"):
            raise RecordingError(f"obstacle {obstacle.unique_id} does not match the recording")


def read_pose(name: str, numbers: Any, bounds: tuple[float, float, float, float]) -> Pose:
    """Return a stored pose, which has to be on the map."""
    x, y, heading = map(float, numbers)
    x_min, y_min, x_max, y_max = bounds
    if not (x_min <= x <= x_max and y_min <= y <= y_max and abs(heading) <= np.pi):
        raise RecordingError(f"{name} has out-of-range values: its pose is outside the map")
    return x, y, heading


def _id(value: object) -> int:
    if type(value) is not int or not 0 <= value <= MOST_OBJECTS * 1000:
        raise RecordingError(f"invalid unique_id: {value!r:.40}")
    return value


# The names of outlines that are not those of modes.
OUTLINES = {"pushed": "load", "fixed": "shape"}
# Columns of a body's state besides poses, and what checks a stored value.
STATE: dict[str, Callable[[Any], Any]] = {
    "resistance": check_resistance,
    "temperature": check_temperature,
    "pushers": _id,
    **dict.fromkeys(("moved", "blocked", "fresh"), bool),
}
