"""What a model contains, as stored in recordings: agents, also removed ones, and processes and parts that were added.

Objects that the model has stay, if they do not differ from the stored ones; others are made without constructors.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
from mesa import Model
from mesa.agent import Agent
from mesa.experimental.continuous_space import ContinuousSpaceAgent
from shapely import Point, Polygon

from mesa_swarm.base.errors import RecordingError, check_flag, check_name, read_attribute, shortened
from mesa_swarm.fire.fires import Fire
from mesa_swarm.fire.fires_part import BURNING
from mesa_swarm.kernels.part import list_attributes
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import Checkpointed, attributes_of
from mesa_swarm.recording.made_objects import (
    OF_PACKAGE,
    check_addable_class,
    check_made,
    classes_near,
    find_agent_class,
    is_class,
)
from mesa_swarm.recording.stored_values import (
    ModelPacker,
    apart_of_agent,
    attributes_to_json,
    make_stored,
    own_attributes_of_agent,
    part_from_json,
    part_to_json,
    restore_attributes,
)
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.robot import Robot, add_handles
from mesa_swarm.world.arena import get_next_id, set_next_id
from mesa_swarm.world.bodies import Body, BodyTable, Form, Pose, check_resistance, check_temperature, handle_classes
from mesa_swarm.world.movers import Driven
from mesa_swarm.world.shapes import Shape, disc, outline_to_json, shape_from_json
from mesa_swarm.world.statics import CARRIED, DRIVEN, FIXED, KINDS, MODES, MOST_KINDS, PUSHED

MOST_OBJECTS = 10_000_000
GONE = -1  # the row of a removed handle
# The names of outlines that are not those of modes.
OUTLINES = {"pushed": "load", "fixed": "shape"}


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
            carrier = robots_by_id[_id(facts["carrier"])].row if "carrier" in facts else -1
            body.table.mode[body.row], body.table.carrier[body.row] = DRIVEN if carrier < 0 else CARRIED, carrier
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
    """Return the agents that are neither robots nor bodies, by ascending unique_id; most models have none."""
    kinds = [kind for kind in model.agents_by_type if not issubclass(kind, (Robot, Body))]
    agents = (agent for kind in kinds for agent in model.agents_by_type[kind])
    return sorted(agents, key=lambda agent: agent.unique_id) if kinds else []


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
    kind = find_agent_class(module, name, before)
    agent = object.__new__(kind)
    if issubclass(kind, ContinuousSpaceAgent):
        ContinuousSpaceAgent.__init__(agent, model.space, model)
    else:
        Agent.__init__(agent, model)


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
    """Return the number of robots, obstacles and fires, and the last unique_id of each.

    Ids only grow and new objects are appended, so that one of the two differs after every addition and removal.
    """
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
    body_class, (shape, form) = handle_classes()[mode], _restore_form(body[name], mode == MODES[FIXED])
    kind = bodies.checked_kind(body.get("kind"), body_class.usual_kind)
    bodies.take(body_class, shape, kind, form, mode=MODES.index(mode))


def _restore_form(outline: Any, is_fixed: bool) -> tuple[Shape, Form | None]:
    """Return a stored shape, and its form if it can move; the shape is about the origin then."""
    if is_fixed:
        return restore_shape(outline), None
    form = Form.about_origin(*restore_outline(outline))
    return form.shape_at((0.0, 0.0, 0.0)), form


def _form_of(body: dict) -> tuple[str, str]:
    """Return the name under which the outline of a body is stored, and its mode."""
    names = {OUTLINES.get(mode, mode): mode for mode in handle_classes()}
    return next((name, mode) for name, mode in names.items() if name in body)


def _make_fire(model: EngineModel) -> None:
    model.parts.fires.begin_burning()
    model.parts.fires.take(disc(model.map.bounds[:2], 1.0), 1.0, 1.0)


def _check_same(model: EngineModel, things: dict, obstacles: dict) -> None:
    """Refuse objects that differ from those stored with their unique_ids, as another constructor would make them."""
    kinds = (model.swarm.agents, model.obstacle_list, model.fires.agents)
    ids = [[agent.unique_id for agent in agents] for agents in kinds]
    if ids != [things["robots"], list(obstacles), things["fires"]]:
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


# ---- processes and parts that were added


def added_to_json(model: EngineModel, packer: ModelPacker) -> dict:
    """Return the processes by their numbers, and the parts that were added by their names, if there are any.

    Of parts also all attributes are stored, with which one is made that no constructor adds.
    """
    processes = [[number, class_address(process)] for number, process in model.parts.processes.numbered.items()]
    parts = [
        [part.name, class_address(part), attributes_to_json(list_attributes(part), f"{part.name}'s ", packer)]
        for part in model.parts.added()
    ]
    return {name: content for name, content in (("processes", processes), ("added", parts)) if content}


def class_address(instance: Any) -> str:
    """Return the address of the class of a process or a part."""
    return f"{type(instance).__module__}.{type(instance).__qualname__}"


def restore_added(model: EngineModel, facts: dict, packer: ModelPacker) -> None:
    """Give a model the stored processes and parts: remove those that are not stored, make the others.

    They are made without their constructors, of classes in the module of the model's class; their state follows.
    """
    _restore_processes(model, {number: kind for number, kind in facts.get("processes", ())}, facts)
    parts = {check_name("name of a part", name): (kind, values) for name, kind, values in facts.get("added", ())}
    for part in model.parts.added():
        if part.name not in parts:
            model.remove_part(part.name)
    for name, (kind, values) in parts.items():
        if name not in model.parts:
            part = _make_addition(model, kind, "part", "stages")
            check_made(part, values)
            restore_attributes(part, values, packer)
            model.add_part(part)
        elif not _is_kind(type(model.parts[name]), kind):
            raise RecordingError(_odd(model, kind, "part"))


def _restore_processes(model: EngineModel, kinds: dict[int, str], facts: dict) -> None:
    part = model.parts.processes
    for number, process in list(part.numbered.items()):
        if number not in kinds:
            model.remove_process(process)
    if BURNING in kinds:
        model.parts.fires.begin_burning()
    for number, kind in kinds.items():
        if type(number) is not int or number < 0:
            raise RecordingError(f"invalid number of a process: {shortened(number)}")
        present_process = part.numbered.get(number)
        if present_process is None:
            present_process = _make_addition(model, kind, "process", "step")
            part.have({**part.numbered, number: present_process})
            names = _names_of(facts, "processes", f"{number} ")
            check_made(present_process, () if isinstance(present_process, Checkpointed) else names)
        elif not _is_kind(type(present_process), kind):
            raise RecordingError(_odd(model, kind, "process"))
    part.have({number: part.numbered[number] for number in sorted(part.numbered)})


def _names_of(facts: dict, part: str, begin: str) -> list[str]:
    """Return the names of the attributes that are stored of a part, or of a process, whose names begin so."""
    names = facts["parts"].get(part, {}).get("stored", {})
    return [name.removeprefix(begin) for name in names if name.startswith(begin)]


def check_addable(addition: Any, kind: str, model: EngineModel) -> None:
    """Refuse a process or a part, added since a recording began, that would not be made again."""
    check_addable_class(type(addition), kind)
    if type(addition) not in (*classes_near(model), *OF_PACKAGE):
        raise RecordingError(
            f"{kind} {type(addition).__name__} was added by hand, and its class is not in {type(model).__module__}; "
            f"define it there, or add the {kind} in the constructor"
        )
    check_made(addition, () if isinstance(addition, Checkpointed) else attributes_of(addition))


def _make_addition(model: EngineModel, kind: str, what: str, method: str) -> Any:
    """Make a process or a part of a class in the model's own module or the package, without its constructor."""
    classes = (*classes_near(model), *OF_PACKAGE)
    alike = (near for near in classes if _is_kind(near, kind) and callable(read_attribute(near, method)))
    near_class = next(alike, None)
    if near_class is None or issubclass(near_class, Agent | Model):
        raise RecordingError(_odd(model, kind, what))
    check_addable_class(near_class, what)
    return object.__new__(near_class)


def _is_kind(kind: type, address: str) -> bool:
    """Return whether an object of this class may have been stored, see `is_class`."""
    module = address.removesuffix(f".{kind.__qualname__}")
    return module != address and is_class(kind, module, kind.__qualname__)


def _odd(model: EngineModel, kind: str, what: str) -> str:
    return (
        f"{what} {shortened(kind)} is not one that the constructor of {type(model).__name__} adds, and its class is "
        f"not in {type(model).__module__}; add the {what} in the constructor, or define its class there"
    )


# ---- agents that were removed, and to which the model still refers


def removed_to_json(packer: ModelPacker) -> list:
    """Return what is stored of removed agents to which values refer, and of those to which these refer."""
    entries: list[list] = []
    agents = packer.removed_agents or {}
    while len(entries) < len(agents):
        for unique_id in list(agents)[len(entries) :]:
            agent = agents[unique_id]
            what = f"removed {type(agent).__name__} {unique_id}'s "
            attributes = attributes_to_json(own_attributes_of_agent(agent), what, packer)
            entries.append([unique_id, [*class_of_agent(agent), _remains(agent)], attributes])
    return entries


def make_removed(packer: ModelPacker, entries: list) -> None:
    """Make the handles of removed agents, without their attributes; those of the same kind that are known stay."""
    present = packer.removed_agents or {}
    there = {agent.unique_id for agent in packer.model.agents}
    new = {unique_id: remains for unique_id, remains, _ in entries if unique_id not in present}
    if there & new.keys():
        raise RecordingError(f"agent {min(there & new.keys())} is stored as removed and as present")
    agents = {key: _remains_from_json(packer.model, key, remains, packer.present) for key, remains in new.items()}
    packer.removed_agents = {**present, **agents}


def restore_removed(packer: ModelPacker, entries: list) -> None:
    """Restore the attributes of removed agents."""
    for unique_id, _, values in entries:
        agent = (packer.removed_agents or {})[unique_id]
        restore_attributes(agent, values, packer, apart_of_agent(agent))


def _remains(agent: Agent) -> dict:
    """Return what the handle of a removed agent still has."""
    if not isinstance(agent, Body):
        return {}
    return {**body_to_json(agent), "kind": agent.kind, **state_to_json(agent)}


def _remains_from_json(model: EngineModel, unique_id: int, content: Any, present: frozenset[type] | None) -> Agent:
    """Return a removed agent of a class that is loaded, made without its constructor."""
    module, name, remains = content
    agent: Any = object.__new__(find_agent_class(module, name, present, handles=True))
    agent.model, agent.unique_id = model, unique_id
    if isinstance(agent, ContinuousSpaceAgent):
        agent.space = agent._mesa_index = None  # type: ignore[assignment]
    if isinstance(agent, Robot):
        agent.swarm, agent.row = model.swarm, GONE
    elif isinstance(agent, Body):
        _restore_body(model, agent, remains)
    return agent


def _restore_body(model: EngineModel, body: Any, remains: dict) -> None:
    """Give a removed body the table of its own, which has what it was."""
    kind, form, mode = str(remains.get("kind", "")), None, FIXED
    if isinstance(body, Fire):
        body.fires, body.index = model.fires, GONE
    if "shape" in remains or isinstance(body, Fire):  # without a shape in recordings of version 0.2.0
        shape = restore_shape(remains["shape"]) if "shape" in remains else disc(model.map.bounds[:2], 1.0)
        remains = {name: value for name, value in remains.items() if name not in ("pose", "aim")}
    else:
        name, mode = ("driven", DRIVEN) if isinstance(body, Driven) else ("load", PUSHED)
        shape, form = _restore_form(remains[name], is_fixed=False)
    if isinstance(body, Driven):
        body.agent = None
    kinds = model.kinds if kind in model.kinds else (*model.kinds, kind)
    BodyTable(kinds).add(body, shape, form, mode=mode, kind=kinds.index(kind))
    restore_state(body, remains, model.map.bounds)


# Columns of a body's state besides poses, and what checks a stored value.
STATE: dict[str, Callable[[Any], Any]] = {
    "resistance": check_resistance,
    "temperature": check_temperature,
    "pushers": _id,
    **dict.fromkeys(("moved", "blocked", "fresh"), bool),
}
