"""What a user changes by hand between two steps: edits, which links hold, and the run that is repeated with them."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from mesa_swarm.base.errors import InvalidValueError, SwarmError, check_choice, check_count, check_number, shortened
from mesa_swarm.fire.fires import Fire
from mesa_swarm.model.parameters import Parameter
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.container import from_bytes, to_bytes
from mesa_swarm.recording.continuing import continue_with, match_robots
from mesa_swarm.robots.robot import Robot
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.bodies import Body, Load
from mesa_swarm.world.movers import Driven
from mesa_swarm.world.shapes import Shape, disc, polygon

# Full pushes of robots that a body drawn on the page withstands.
RESISTANCE = 0.5
# Overlaps below this are rounding.
TOUCHING = 1e-9
NAMES = {"obstacle": "an obstacle", "load": "a load"}
MOST_ROBOTS = 10_000
MOST_EDITS = 200
BETWEEN, WITHIN = ";", ","
SET = "set"


@dataclass(frozen=True, slots=True)
class Edit:
    """One change by hand: after which step, what, and its numbers; of parameters (`SET`) names and values as text.

    Examples
    --------
    >>> Edit(120, "obstacle", (400.0, 300.0, 25.0)).text
    '120,obstacle,400,300,25'
    >>> edits_from("120,obstacle,400,300,25;130,set,noise,0.2")[1]
    Edit(step=130, do='set', values=('noise', '0.2'))
    """

    step: int
    do: str
    values: tuple

    @property
    def text(self) -> str:
        """The edit as part of a link."""
        words = [str(v) if isinstance(v, str) else repr(float(v)).removesuffix(".0") for v in self.values]
        return WITHIN.join([str(self.step), self.do, *words])


def link_value(value: object) -> str:
    """Return a value as links have it, from which the same value is read."""
    return repr(value) if isinstance(value, float) else str(value)


def edits_from(text: str) -> list[Edit]:
    """Return the edits in a link, in the order of their steps."""
    edits = [_edit_from(part) for part in text.split(BETWEEN) if part]
    if len(edits) > MOST_EDITS:
        raise InvalidValueError(f"edits are {len(edits)}; expected at most {MOST_EDITS}")
    if any(first.step > second.step for first, second in pairwise(edits)):
        raise InvalidValueError("edits are not in the order of their steps; copy the link again")
    return edits


def _edit_from(text: str) -> Edit:
    step, do, values = (*text.split(WITHIN, 2), "", "")[:3]
    check_choice("edit", do, (SET, *EDITS))
    if not step.isdecimal():
        raise InvalidValueError(f"edit {shortened(text)} has no step; expected a link copied from the page")
    if do == SET:
        parts = tuple(values.split(WITHIN))
        if "map" in parts[::2]:  # its value may name a file, which no link makes this machine read
            raise InvalidValueError("map cannot be changed during a run; expected another parameter in edits")
        return Edit(int(step), do, parts)
    try:
        numbers = tuple(float(number) for number in values.split(WITHIN) if number)
    except ValueError:
        raise InvalidValueError(f"edit {shortened(text)} has a value that is not a number") from None
    return Edit(int(step), do, tuple(check_number(do, number, minimum=-1e9, maximum=1e9) for number in numbers))


def as_text(edits: Iterable[Edit]) -> str:
    """Return edits as part of a link."""
    return BETWEEN.join(edit.text for edit in edits)


def apply_edit(model: SwarmModel, do: str, values: Sequence[float]) -> None:
    """Change a model as one of `EDITS` does, or refuse, with the reason, and change nothing."""
    act = EDITS[check_choice("edit", do, tuple(EDITS))]
    count = act.__code__.co_argcount - 1
    if len(values) != count:
        raise InvalidValueError(f"{do} has {len(values)} numbers; expected {count}")
    act(model, *(check_number(do, value, minimum=-1e9, maximum=1e9) for value in values))


def check_place(model: SwarmModel, shape: Shape, of: Robot | Body | None = None) -> None:
    """Refuse a place where something, `of` itself left out, would overlap another thing or the border of the map."""
    depth, what = find_deepest(model, shape, of)
    if depth > TOUCHING:
        x, y = shape.position.tolist()
        raise InvalidValueError(
            f"at ({x:.4g}, {y:.4g}) it would overlap {what} by {depth:.3g}; choose a place farther away"
        )


def find_deepest(model: SwarmModel, shape: Shape, of: Robot | Body | None = None) -> tuple[float, str]:
    """Return the largest overlap of a shape, and with what."""
    x_min, y_min, x_max, y_max = model.map.bounds
    left, low, right, high = shape.bounds
    depths = [(max(x_min - left, y_min - low, right - x_max, high - y_max), "the border of the map")]
    in_the_way = [body for body in model.obstacle_list if body.contact and getattr(body, "carrier", None) is None]
    things = [(body, NAMES.get(body.kind, f"a {body.kind}")) for body in in_the_way]
    things += [(fire, f"fire {number}") for number, fire in enumerate(model.fires.agents, start=1)]
    depths += [(-_gap(shape, thing.shape), name) for thing, name in things if thing is not of]
    swarm = model.swarm
    gaps = shapely.distance(shape.geometry, shapely.points(swarm.position)) - shape.radius - swarm.radius
    if isinstance(of, Robot):
        gaps[of.row] = np.inf
    if len(gaps):
        nearest = int(np.argmin(gaps))
        depths.append((-float(gaps[nearest]), f"robot {swarm.agents[nearest].unique_id}"))
    return max(depths, key=lambda pair: pair[0])


def outline_of(shape: Shape) -> BaseGeometry:
    """Return the area that a shape covers."""
    return shape.geometry.buffer(shape.radius) if shape.is_disc else shape.geometry


def _gap(first: Shape, second: Shape) -> float:
    """Return how far apart two shapes are; below 0 if they overlap, of polygons the side of a square of that area."""
    distance = float(shapely.distance(first.geometry, second.geometry))
    if distance > 0 or first.is_disc or second.is_disc:
        return distance - first.radius - second.radius
    return -float(np.sqrt(shapely.intersection(first.geometry, second.geometry).area))


def find_thing(model: SwarmModel, number: float) -> Robot | Body:
    """Return the robot, fire or body with this unique_id."""
    everything = (*model.swarm.agents, *model.fires.agents, *model.obstacle_list)
    match = next((body for body in everything if body.unique_id == number), None)
    if match is None:
        raise InvalidValueError(f"{number:g} is not a robot, fire or body of the model now; choose another one")
    return match


def find_thing_at(model: SwarmModel, x: float, y: float, near: float = 0.0) -> Robot | Body | None:
    """Return what is at a place: a robot, else a body that moves, a fire, an obstacle; None on free ground.

    Robots count as `near` larger than they are, so that small ones are found.
    """
    swarm = model.swarm
    gaps = np.hypot(*(swarm.position - (x, y)).T) - np.maximum(swarm.radius, near)
    if len(gaps) and gaps.min() <= 0:
        return swarm.agents[int(gaps.argmin())]
    point = shapely.Point(x, y)
    bodies = [*model.displaced, *model.fires.agents, *reversed(model.obstacle_list)]
    carried = (body for body in bodies if getattr(body, "carrier", None) is None)
    return next((body for body in carried if outline_of(body.shape).covers(point)), None)


def move(model: SwarmModel, number: float, x: float, y: float, heading: float) -> None:
    """Move a robot or a body that moves to a free place; others are replaced by the same ones there."""
    body = find_thing(model, number)
    if isinstance(body, Robot):
        check_place(model, disc((x, y), body.radius), body)
        body.position, body.heading = (x, y), heading
    elif isinstance(body, Load):
        check_place(model, body.form.shape_at((x, y, heading)), body)
        body.move_to((x, y, heading))
    elif isinstance(body, Driven):
        body.move_to((x, y, heading))
    elif isinstance(body, Fire):
        _move_fire(model, body, x, y)
    else:
        _move_obstacle(model, body, x, y)


def _move_fire(model: SwarmModel, fire: Fire, x: float, y: float) -> None:
    model.space.checked_point((x, y))
    area, radius, temperature, out = fire.area, fire.radius, fire.temperature, fire.out
    fire.remove()
    again = model.add_fire((x, y), radius=radius, area=area, temperature=temperature or 1.0)
    if out:
        again.put_out()


def _move_obstacle(model: SwarmModel, obstacle: Body, x: float, y: float) -> None:
    shape = obstacle.shape
    dx, dy = np.array([x, y]) - shape.position
    if shape.is_disc:
        new_shape = disc((x, y), shape.radius, contact=shape.contact)
    else:
        rings = [shape.geometry.exterior, *shape.geometry.interiors]
        outline, *holes = [[(px + dx, py + dy) for px, py in ring.coords[:-1]] for ring in rings]
        new_shape = polygon(outline, holes, contact=shape.contact)
    model.space.checked_point((x, y))
    model.add_body(new_shape, kind=obstacle.kind, mode="fixed", temperature=obstacle.temperature)
    obstacle.remove()


def robot(model: SwarmModel, x: float, y: float, heading: float, like: float) -> None:
    """Add a robot of the design and the group of another one, the last one if that is gone, at a free place."""
    check_count("robots", len(model.swarm) + 1, maximum=MOST_ROBOTS)
    robots = model.swarm.agents
    if not robots:
        raise InvalidValueError("the model has no robot whose design a new one could have; press Reset first")
    model_of = next((robot for robot in robots if robot.unique_id == like), robots[-1])
    check_place(model, disc((x, y), model_of.radius))
    model.add_robots(model_of.design, poses=[(x, y, heading)], group=model_of.group)


def wall(model: SwarmModel, x: float, y: float, to_x: float, to_y: float, width: float) -> None:
    """Add a straight wall of this width between two places."""
    length = math.hypot(to_x - x, to_y - y)
    if length < width:
        raise InvalidValueError("the wall is shorter than wide; drag from its one end to the other")
    side = 0.5 * width / length * np.array([y - to_y, to_x - x])
    ends = np.array([(x, y), (to_x, to_y)])
    model.add_obstacle(polygon([*(ends + side).tolist(), *(ends[::-1] - side).tolist()]))


def obstacle(model: SwarmModel, x: float, y: float, radius: float) -> None:
    """Add a round obstacle; robots there are moved to free space nearby in the next step."""
    model.space.checked_point((x, y))
    model.add_obstacle(disc((x, y), radius))


def load(model: SwarmModel, x: float, y: float, radius: float) -> None:
    """Add a round body that robots push."""
    check_place(model, disc((x, y), radius))
    model.add_body(disc((x, y), radius), mode="pushed", resistance=RESISTANCE)


def fire(model: SwarmModel, x: float, y: float, radius: float) -> None:
    """Add a fire."""
    check_place(model, disc((x, y), radius))
    model.add_fire((x, y), radius=radius)


def switch(model: SwarmModel, number: float) -> None:
    """Put a fire out, or light it again."""
    target = find_thing(model, number)
    if not isinstance(target, Fire):
        raise InvalidValueError(f"{number:g} is not a fire; click on one")
    if target.out:
        target.light()
    else:
        target.put_out()


def remove(model: SwarmModel, number: float) -> None:
    """Remove a robot, a fire or a body."""
    find_thing(model, number).remove()


def clear(model: SwarmModel) -> None:
    """Remove all obstacles and marks on the ground."""
    for body in [body for body in model.obstacle_list if body.mode == "fixed"]:
        body.remove()


# What can be changed by hand, and of which numbers: the parameters of the functions.
EDITS: dict[str, Callable[..., None]] = {
    act.__name__: act for act in (move, robot, wall, obstacle, load, fire, switch, remove, clear)
}


# The parameter that is met by adding or removing robots.
ROBOTS = "n_robots"
# Returns a model of these settings, "seed" among them.
Make = Callable[[Mapping[str, Any]], SwarmModel]


class LiveRun:
    """A run whose parameters, robots and bodies are changed between two steps; its model may be made elsewhere.

    Attributes
    ----------
    model : SwarmModel
        The present one: another object after a parameter was changed.
    at_start : dict
        Settings with which a model in the same place before its first step is made.
    edits : list of Edit
        What was changed, in the order of time; repeated on a model of `first`, they give the same run.
    first : dict
        The settings of the first model.
    """

    def __init__(
        self,
        make: Make,
        parameters: Mapping[str, Parameter],
        settings: Mapping[str, Any],
        model: SwarmModel | None = None,
    ) -> None:
        self._make, self._parameters = make, parameters
        self.first: dict[str, Any] = dict(settings)
        self.at_start: dict[str, Any] = self.first
        self.edits: list[Edit] = []
        self.model = make(self.first) if model is None else model

    def again(self) -> "LiveRun":
        """Return the run before its first step, without its changes."""
        return LiveRun(self._make, self._parameters, self.first)

    def set(self, values: Mapping[str, Any]) -> set[str]:
        """Change parameters; return the names of those that took effect, the others belong to the beginning of a run.

        Values with which no model can be made, or robots for which there is no room, raise an error, and nothing has
        changed.
        """
        applied: set[str] = set()
        others = {name: value for name, value in values.items() if name != ROBOTS}
        if ROBOTS in values:  # first: what is refused is refused here
            match_robots(self.model, self._make({**self.at_start, **values}))
            applied.add(ROBOTS)
        if others and self._continue(others):
            applied |= others.keys()
        elif len(others) > 1:
            applied |= {name for name, value in others.items() if self._continues_alone(name, value)}
        if applied:
            self._note(SET, [part for name in sorted(applied) for part in (name, link_value(values[name]))])
        return applied

    def _continue(self, values: Mapping[str, Any]) -> bool:
        """Continue with a model of other parameters; return False if these belong to the beginning of a run."""
        parameters = {**self.at_start, **values}
        new, fresh = self._make(parameters), self._make(self.at_start)
        try:
            continue_with(new, self.model, fresh, tuple(values))
        except SwarmError:
            return False
        self.model, self.at_start = new, parameters
        return True

    def _continues_alone(self, name: str, value: Any) -> bool:
        """Continue with one of several values, unless that is possible only with the others."""
        try:
            return self._continue({name: value})
        except SwarmError:
            return False

    def edit(self, do: str, values: Sequence[float], *, in_place: bool = False) -> None:
        """Change the model by hand; `in_place` if this goes on with the last edit, a robot that is dragged."""
        apply_edit(self.model, do, values)
        self._note(do, values, in_place=in_place)

    def repeat(self, edit: Edit) -> dict[str, Any]:
        """Apply an edit again, or one of a link; return the parameters that it sets."""
        if edit.do != SET:
            self.edit(edit.do, edit.values)
            return {}
        values: dict[str, Any] = {}
        for name, text in zip(edit.values[::2], edit.values[1::2], strict=False):
            parameter = self._parameters[check_choice("parameter", name, self._parameters)]
            values[name] = parameter.checked(parameter.parse(text))
        check_count(ROBOTS, values.get(ROBOTS, 0), maximum=MOST_ROBOTS)
        if self.set(values) != values.keys():
            raise InvalidValueError(f"{' and '.join(values)} cannot be changed during a run; reset with it")
        return values

    def store(self) -> bytes:
        """Return the present state, from which `restore_model` continues; an error names what cannot be stored."""
        return to_bytes(checkpoint_of(self.model))

    def restore_model(self, state: bytes, start: Mapping[str, Any]) -> SwarmModel:
        """Return a model in the state that was stored when a model before its first step was made with `start`."""
        return restore(self._make(start), from_bytes(state))

    def _note(self, do: str, values: Sequence, *, in_place: bool = False) -> None:
        edit, last = Edit(self.model.completed, do, tuple(values)), self.edits[-1] if self.edits else None
        same = last is not None and (last.step, last.do) == (edit.step, do)
        if same and last and (in_place or (do == SET and last.values[::2] == edit.values[::2])):
            self.edits.pop()
        self.edits.append(edit)


class Repetition:
    """A run that is taken again, step by step, with all that was changed by hand."""

    def __init__(self, run: LiveRun) -> None:
        self._run, self._edits_left = run.again(), list(run.edits)

    @property
    def model(self) -> SwarmModel:
        """The present model."""
        return self._run.model

    def step(self) -> None:
        """Apply what was changed before the next step, and take it."""
        self.finish()
        self.model.step()

    def finish(self) -> None:
        """Apply what was changed at the present step."""
        while self._edits_left and self._edits_left[0].step <= self.model.completed:
            self._run.repeat(self._edits_left.pop(0))


@dataclass(frozen=True, slots=True, eq=False)
class Before:
    """The state before a change by hand, to which one can go back."""

    do: str
    step: int
    state: bytes
    edits: tuple[Edit, ...]
    at_start: dict[str, Any]
    settings: dict[str, Any]
    built: dict[str, Any]
