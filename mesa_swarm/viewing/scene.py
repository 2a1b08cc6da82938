"""Scenes: what stands behind the frames of a model or a recording."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.base.wording import time_text
from mesa_swarm.geometry import Bounds
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.looks import LABEL, LABEL_BYTES, VALUE, label_text
from mesa_swarm.recording.frames import NO_ROWS, Frame, field_levels, field_names, field_peaks
from mesa_swarm.recording.layout import PIXELS, pictures_of
from mesa_swarm.recording.provenance import recorded_map, scenery_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.robots.sensors import ProximitySensor
from mesa_swarm.viewing.legend import (
    STANDARD,
    LegendEntry,
    body_entries,
    field_entry,
    heat_entry,
    part_entry,
    value_entry,
)
from mesa_swarm.viewing.palette import LIGHT, PALETTES, fire_colour, kind_colour, value_colours, value_steps
from mesa_swarm.world.bodies import Form
from mesa_swarm.world.shapes import Shape, shape_from_json, shape_to_json

# name: (table, values a row, type). Wider types first: in a packed frame each array is then aligned.
COLUMNS: dict[str, tuple[str, int | str, str]] = {
    "ids": ("robots", 1, "i4"),
    "pose": ("robots", 3, "f4"),
    "distance": ("robots", "sensors", "f4"),
    "command": ("robots", 2, "f4"),
    "heat": ("robots", 1, "f4"),
    "heard": ("robots", 2, "f4"),
    "fires": ("fires", 6, "f4"),
    "loads": ("loads", 4, "f4"),
    "contacts": ("contacts", 2, "f4"),
    "kind": ("robots", "sensors", "i1"),
    "layer": ("robots", 1, "i1"),
    "design": ("robots", 1, "i1"),
    "hot": ("robots", 1, "i1"),
    "value": ("robots", 1, "i1"),
    "label": ("robots", LABEL_BYTES, "i1"),
}
# Only where a model's looks declare them.
OF_LOOKS = {"value": "column", "label": "label"}
# Which recorded column a drawn one is made from, where the names differ; those that are always there are not named.
MADE_FROM = {"heat": "temperature", "heard": "heard_from"}
ALWAYS = frozenset({"ids", "pose", "design", "fires", "loads", "contacts"})
# What may change within a scene, beside the temperature of loads: robots, designs and loads that were added later are
# known from its beginning.
OWN = ("shapes", "layers", "leave")
# Of robots and loads in recordings without scenery, which version 0.1.0 wrote.
USUAL_DESIGN = {"name": "robot", "radius": 5.0, "max_speed": 1.0, "holonomic": False, "sensors": []}
USUAL_RADIUS = 10.0
USUAL_LEAVE = 100.0
THEMES = tuple(enumerate(PALETTES))
# Commanded speed below which a robot stands, map units a step.
STANDS = 1e-3
# The longer side of the world in films and moving drawings, pixels.
USUAL = 800
# Of discs of parts; canvas.js has the same number.
PART_OPACITY = 0.6
# Of discs of parts that name no colour.
USUAL_COLOUR = LIGHT.scalars[0][:7]
UNKNOWN = RobotDesign(name="unknown", radius=5.0)


class Painted(NamedTuple):
    """What is drawn of the bodies of one sort in a step, with a row for each of them."""

    ids: np.ndarray  # (k,)
    poses: np.ndarray  # (k, 3): x, y, and the azimuth of its front
    radii: np.ndarray  # (k,)
    colours: np.ndarray  # (k, c): of its parts


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """What stands behind frames; nothing in it changes, and shapes and designs are built when first needed."""

    name: str
    map: str
    bounds: Bounds
    # What is true from each of these steps on, from `scenery_of`; robots, designs and loads are the same in all.
    changes: tuple[tuple[int, dict], ...]
    # Which of `COLUMNS` frames in front of it can be packed with.
    columns: tuple[str, ...] = tuple(name for name in COLUMNS if name not in OF_LOOKS)
    # The names of scalar fields, in the order of their colours.
    fields: tuple[str, ...] = ()

    def world(self, step: int = 0) -> dict:
        """Return what a browser needs to draw frames of a step, as JSON: see the top of ``canvas.js``.

        The same object is returned for all steps between two changes.
        """
        return self._worlds[self._place(step)]

    @property
    def later(self) -> list[dict]:
        """How the world of the first step changes: the step of each change, and what is true from then on."""
        warmer = any(scenery["loads"] != self.changes[0][1]["loads"] for _, scenery in self.changes)
        names = (*OWN, "loads") if warmer else OWN
        return [{"step": step, **{name: scenery[name] for name in names}} for step, scenery in self.changes[1:]]

    @property
    def looks(self) -> dict:
        """What the model declares about its drawing, from `Looks.as_json`; empty without."""
        return self.changes[0][1].get("looks", {})

    @property
    def scale(self) -> Scale | None:
        """How long a metre and a step are, None if that is not known."""
        return scale_in(self.changes[0][1])

    def legend(self, frame: Frame) -> list[LegendEntry]:
        """Return the entries of a frame: kinds of bodies in it, fields with their ranges, values of robots."""
        scenery, there = self.changes[self._place(frame.step)][1], self.loads(frame).ids
        bodies = self._bodies_in({**scenery, "loads": [load for load in scenery["loads"] if load["id"] in there]})
        return [*bodies, *self._parts_in_legend, *self._fields_in(frame), *self._values_in_legend]

    def own_legend(self, frame: Frame) -> list[LegendEntry]:
        """Return the entries of what the model has of its own; the usual colours of bodies explain themselves."""
        return [
            *self._own_bodies(self.changes[self._place(frame.step)][1]),
            *self._parts_in_legend,
            *self._fields_in(frame),
            *self._values_in_legend,
        ]

    def _fields_in(self, frame: Frame) -> list[LegendEntry]:
        """Return the entries of the fields that the model has in a frame."""
        entries = zip(self._fields_in_legend, field_peaks(frame, self.fields), strict=True)
        there = [(entry, peak) for entry, peak in entries if field_levels(frame, entry.label).size]
        return [replace(entry, high=max(peak, 0.0)) for entry, peak in there]

    @property
    def _fields_in_legend(self) -> list[LegendEntry]:
        return [field_entry(name, place) for place, name in enumerate(self.fields)]

    @property
    def _parts_in_legend(self) -> list[LegendEntry]:
        return [part_entry(name, colour) for name, colour in self.parts]

    @property
    def _values_in_legend(self) -> list[LegendEntry]:
        return [value_entry(self.looks)] if "value" in self.columns else []

    def _own_bodies(self, scenery: dict) -> list[LegendEntry]:
        """Return the entries of bodies if there are kinds of the model's own, or colours of its own for bodies."""
        kinds = {*map(_kind_of, scenery["shapes"]), *map(_kind_of_load, scenery["loads"])}
        own = kinds - set(STANDARD) or kinds & self.looks.get("kinds", {}).keys()
        return self._bodies_in(scenery) if own else []

    def _bodies_in(self, scenery: dict) -> list[LegendEntry]:
        """Return the entries of the bodies of a scenery, those in the colour of their temperature last."""
        bodies = [(shape, _kind_of(shape)) for shape in scenery["shapes"]]
        loads = [(load, _kind_of_load(load)) for load in scenery["loads"]]
        declared = self.looks.get("kinds", {})
        warm = {kind for body, kind in (*bodies, *loads) if "temperature" in body and kind not in declared}
        cold = (
            [kind for body, kind in group if "temperature" not in body or kind in declared] for group in (bodies, loads)
        )
        return [*body_entries(self.looks, *cold), *map(heat_entry, sorted(warm))]

    @cached_property
    def parts(self) -> tuple[tuple[str, str], ...]:
        """Name and colour of each part that shows discs at any step."""
        listed = (part for _, scenery in self.changes for part in scenery.get("parts", ()))
        return tuple(dict.fromkeys((name, colour or USUAL_COLOUR) for name, colour in listed))

    def discs(self, frame: Frame) -> np.ndarray:
        """Return the discs of parts in a frame, shape (k, 4): the place among `parts`, x, y and radius."""
        rows, scenery = frame.columns.get("shown", NO_ROWS["shown"]), self.changes[self._place(frame.step)][1]
        places = np.array(
            [self.parts.index((name, colour or USUAL_COLOUR)) for name, colour in scenery.get("parts", ())], int
        )
        rows = rows[(rows["part"] >= 0) & (rows["part"] < len(places))]
        return np.column_stack([places[rows["part"]], *(rows[name].astype(float) for name in ("x", "y", "radius"))])

    def build(self) -> None:
        """Build all shapes and designs now; an error if one of them is described wrongly."""
        _ = self._obstacles, self.forms, self.designs

    def obstacles(self, step: int) -> tuple[Shape, ...]:
        """Return obstacles and ground marks; one object for all steps between two changes of them."""
        return self._obstacles[self._place(step)]

    def standing(self, step: int, theme: str = "light") -> list[tuple[Shape, str]]:
        """Return each of `obstacles` with its colour."""
        shapes = self.changes[self._place(step)][1]["shapes"]
        usual = (self._colour(shape, "mark" if shape.get("mark") else "obstacle", theme) for shape in shapes)
        return list(zip(self.obstacles(step), usual, strict=True))

    def _colour(self, body: dict, usual: str, theme: str) -> str:
        """Return the colour of a body: of its kind if the model declares one, else of its temperature if it has one."""
        palette, heat = PALETTES[theme], body.get("temperature")
        as_usual = getattr(palette, usual) if heat is None else fire_colour(heat, palette)
        return kind_colour(self.looks, body.get("kind", usual), as_usual, theme)

    def robots(self, frame: Frame, theme: str = "light", marked: str = "hot") -> "Painted":
        """Return the robots of a frame, each with the colour of its back.

        It is that of its value if looks have one, else it shows whether the column `marked` is above 0.
        """
        palette = PALETTES[theme]
        usual = kind_colour(self.looks, "robot", palette.robot, theme)
        colours = np.where(frame[marked].reshape(-1) > 0, palette.robot_hot, usual)
        if "value" in self.columns:
            column, values = self.looks["column"], looks_in(frame, self)[0]
            steps = value_steps(values, column["low"], column["high"])
            colours = np.where(steps < 0, colours, np.array(value_colours(self.looks, theme))[steps])
        poses = np.column_stack([frame["position"].astype(float), self.facing(frame)])
        return Painted(frame.robots, poses, self.radius_of(frame.robots), colours[:, None])

    def fires(self, frame: Frame, theme: str = "light") -> "Painted":
        """Return the fires of a frame, each with the colours of its disc, of its rim and of its number."""
        palette, fires = PALETTES[theme], frame.columns.get("fires", NO_ROWS["fires"])
        colours = [
            (palette.ashes, palette.border, palette.on_ashes)
            if out
            else (fire_colour(heat, palette), palette.fire_rim, palette.on_fire)
            for out, heat in zip(fires["out"].tolist(), fires["temperature"].tolist(), strict=True)
        ]
        poses = np.column_stack([fires["x"], fires["y"], np.zeros(len(fires))]).astype(float)
        return Painted(fires["fire"], poses, fires["radius"].astype(float), np.array(colours, object).reshape(-1, 3))

    def loads(self, frame: Frame, theme: str = "light") -> "Painted":
        """Return the loads of a frame, but for those that `forms` does not have; radii are their reach."""
        table = frame.columns.get("loads", NO_ROWS["loads"])
        rows = table[np.isin(table["load"], list(self.forms))]
        ids = rows["load"].tolist()
        loads = {load["id"]: load for load in self.changes[self._place(frame.step)][1]["loads"]}
        colours = [[self._colour(loads[load], "load", theme)] for load in ids]
        poses = np.column_stack([rows["x"], rows["y"], rows["heading"]]).astype(float)
        reach = np.array([self.forms[load].reach for load in ids])
        return Painted(rows["load"], poses, reach, np.array(colours, object).reshape(-1, 1))

    def limits(self, step: int) -> tuple[float, float]:
        """Return the temperature from which on a robot is too hot to fight, and the one down to which it then is."""
        scenery = self.changes[self._place(step)][1]
        return float(scenery["leave"]), float(scenery.get("join", scenery["leave"]))

    def design_of(self, ids: np.ndarray) -> np.ndarray:
        """Return the index of each robot's design, -1 for robots that the scene does not know."""
        if not self._runs.size:
            return np.full(len(ids), -1)
        first, last, design = self._runs
        run = np.maximum(first.searchsorted(ids, side="right") - 1, 0)
        return np.where((ids >= first[run]) & (ids <= last[run]), design[run], -1)

    def radius_of(self, ids: np.ndarray) -> np.ndarray:
        """Return the radius of each robot; of those that the scene does not know, 5 map units."""
        return np.array([design.radius for design in self.designs])[self.design_of(ids)]

    def facing(self, frame: Frame) -> np.ndarray:
        """Return the azimuth towards which each robot's front is drawn.

        It is the heading, and of a robot that moves in any direction without turning (a holonomic drive) the direction
        of its commanded velocity, if that is known and not 0.
        """
        heading, command = frame["heading"].astype(float), frame.columns.get("command")
        if command is None or not self._holonomic.any():
            return heading
        ahead, left = command[:, :2].astype(float).T
        moves = self._holonomic[self.design_of(frame.robots)] & (np.hypot(ahead, left) >= STANDS)
        return np.where(moves, heading + np.arctan2(left, ahead), heading)

    @cached_property
    def _holonomic(self) -> np.ndarray:
        """Whether robots of each design move without turning, that of unknown robots last."""
        return np.array([*(bool(one.get("holonomic")) for one in self.changes[0][1]["designs"]), False])

    @cached_property
    def designs(self) -> tuple[RobotDesign, ...]:
        """The robots' designs as far as one sees them; the last one is that of unknown robots."""
        return *map(_design, self.changes[0][1]["designs"]), UNKNOWN

    @cached_property
    def forms(self) -> dict[int, Form]:
        """The loads' forms by unique_id."""
        return {load["id"]: Form.of(shape_from_json(load)) for load in self.changes[0][1]["loads"]}

    @cached_property
    def small(self) -> frozenset[int]:
        """The loads smaller than every robot, which a robot that carries one would hide: drawn above robots."""
        least = min((design.radius for design in self.designs[:-1]), default=0.0)
        return frozenset(load for load, form in self.forms.items() if form.reach < least)

    @cached_property
    def load_places(self) -> dict[int, int]:
        """The index of each load among the world's, by unique_id."""
        return {load["id"]: place for place, load in enumerate(self.changes[0][1]["loads"])}

    @cached_property
    def _obstacles(self) -> list[tuple[Shape, ...]]:
        shapes: list[tuple[Shape, ...]] = []
        for place, (_, scenery) in enumerate(self.changes):
            same = place > 0 and scenery["shapes"] == self.changes[place - 1][1]["shapes"]
            shapes.append(shapes[-1] if same else tuple(map(shape_from_json, scenery["shapes"])))
        return shapes

    @cached_property
    def _runs(self) -> np.ndarray:
        """First ids, last ids and designs of robots in a row, shape (3, k)."""
        return np.ascontiguousarray(np.array(self.changes[0][1]["robots"], int).reshape(-1, 3).T)

    @cached_property
    def _worlds(self) -> list[dict]:
        return [self._world(scenery) for _, scenery in self.changes]

    def _place(self, step: int) -> int:
        return max(bisect_right(self.changes, step, key=itemgetter(0)) - 1, 0) if len(self.changes) > 1 else 0

    def _world(self, scenery: dict) -> dict:
        designs, last = scenery["designs"] or [USUAL_DESIGN], self.changes[-1][1]  # kinds are only added
        ranges = [sensor[4] for design in designs for sensor in design["sensors"]]
        return {
            "model": self.name,
            "map": self.map,
            "bounds": list(map(float, self.bounds)),
            "shapes": scenery["shapes"],
            "loads": scenery["loads"],
            "designs": designs,
            "robots": scenery["robots"],
            "layers": scenery["layers"],
            **({"kinds": last["kinds"]} if "kinds" in last else {}),
            "leave": scenery["leave"],
            **({"scale": scenery["scale"]} if "scale" in scenery else {}),
            "reach": max(ranges, default=0.0) or 1.0,
            "fastest": max(design["max_speed"] for design in designs) or 1.0,
            **({"looks": _themed_looks(self.looks)} if self.looks else {}),
            "columns": [
                dict(zip(("name", "table", "width", "type"), (name, *COLUMNS[name]), strict=True))
                for name in self.columns
            ],
            **({"fields": list(self.fields)} if self.fields else {}),
            **({"parts": list(map(list, self.parts))} if self.parts else {}),
            "legend": [
                entry.as_json()
                for entry in (*self._bodies_in(scenery), *self._parts_in_legend, *self._fields_in_legend)
            ],
        }


def scale_in(scenery: dict) -> Scale | None:
    """Return the scale of a scenery, None if it has none."""
    if "scale" not in scenery:
        return None
    units, seconds = scenery["scale"]
    return Scale(units_per_metre=units, seconds_per_step=seconds)


def _kind_of(shape: dict) -> str:
    return shape.get("kind", "mark" if shape.get("mark") else "obstacle")


def _kind_of_load(load: dict) -> str:
    return load.get("kind", "load")


def scene_of(model: EngineModel) -> Scene:
    """Return the scene of a model; make it anew when robots, obstacles or loads were added or removed."""
    scenery = scenery_of(model)
    declared = scenery.get("looks", {})
    columns = tuple(name for name in COLUMNS if name not in OF_LOOKS or OF_LOOKS[name] in declared)
    return Scene(
        name=type(model).__name__,
        map=model.map.name,
        bounds=model.map.bounds,
        changes=((model.completed, scenery),),
        columns=columns,
        fields=tuple(pictures_of(model)),
    )


def scene_of_recording(recording: Recording, sceneries: Sequence[tuple[int, dict]] = ()) -> Scene:
    """Return the scene of a recording, with these sceneries in the place of its own.

    If there are none, it shows its map, and robots and loads of the usual size.
    """
    if "position" not in recording.columns:
        raise RecordingError(f"{recording.path} has no positions to draw; record the column 'position' as well")
    its_map = recorded_map(recording.provenance)
    known = [name for name in COLUMNS if name not in OF_LOOKS]
    columns = [name for name in known if name in ALWAYS or MADE_FROM.get(name, name) in recording.columns]
    if "kind" not in columns or "distance" not in columns:
        columns = [name for name in columns if name not in ("kind", "distance")]
    changes = tuple(sceneries or recording.sceneries or ((0, usual_scenery(recording)),))
    made_from = recorded_looks(changes[0][1].get("looks", {}))
    columns += [name for name in OF_LOOKS if made_from.get(name) in recording.columns]
    return Scene(
        name=recording.provenance["model"]["name"],
        map=its_map.name,
        bounds=its_map.bounds,
        changes=changes,
        columns=tuple(columns),
        fields=field_names(recording.columns),
    )


def recorded_looks(looks: dict) -> dict[str, str]:
    """Return the columns of a recording from which "value" and "label" are drawn, as far as looks name any."""
    return {"value": looks.get("column", {}).get("name", ""), "label": looks.get("label", "")}


def looks_in(frame: Frame, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return by what robots of a frame are coloured, and their texts: NaN and empty where the frame has none."""
    columns, names, n = frame.columns, recorded_looks(scene.looks), len(frame.robots)
    values, texts = columns.get(VALUE, columns.get(names["value"])), columns.get(LABEL)
    if texts is None and names["label"] in columns and columns[names["label"]].size == n:
        texts = np.array([label_text(value) for value in columns[names["label"]].ravel().tolist()], object)
    if values is None or values.size != n or values.dtype.kind not in "biuf":
        values = np.full(n, np.nan)
    return values.reshape(n).astype(float), np.full(n, "", object) if texts is None else texts


def _themed_looks(looks: dict) -> dict:
    """Return looks as a browser draws them: by theme."""
    themed: dict = {"kinds": {t: {k: pair[place] for k, pair in looks.get("kinds", {}).items()} for place, t in THEMES}}
    if "column" in looks:
        about = {name: looks["column"][name] for name in ("label", "low", "high")}
        themed["column"] = {**about, **{theme: value_colours(looks, theme) for _, theme in THEMES}}
    return themed


def usual_scenery(recording: Recording) -> dict:
    """Return what is drawn of a recording that describes neither robots nor loads."""
    first = recording[0] if recording.intact else None
    loads = first["loads"]["load"].tolist() if first and "loads" in first.columns else []
    return {
        "designs": [USUAL_DESIGN],
        "robots": [],
        "shapes": [shape_to_json(shape) for shape in recorded_map(recording.provenance).obstacles],
        "loads": [{"id": load, "disc": [0.0, 0.0, USUAL_RADIUS]} for load in loads],
        "layers": [],
        "leave": recording.provenance["parameters"].get("leave", USUAL_LEAVE),
    }


def _design(written: dict) -> RobotDesign:
    sensors = tuple(
        ProximitySensor(
            bearing_degrees=math.degrees(bearing),
            range=reach,
            field_of_view_degrees=min(2 * math.degrees(half), 360.0),
            mount=(x, y),
        )
        for x, y, bearing, half, reach in written["sensors"]
    )
    return RobotDesign(name=written["name"], radius=written["radius"], max_speed=written["max_speed"], sensors=sensors)


def in_one_scale(worlds: dict[str, tuple[Frame, Scene]]) -> dict[str, tuple[Frame, Scene]]:
    """Return worlds whose fields of one name are drawn alike: the largest value of all of them has the full colour."""
    largest: dict[str, float] = {}
    for frame, scene in worlds.values():
        for name, peak in peaks_of(frame, scene).items():
            largest[name] = max(peak, largest.get(name, 0.0))
    return {title: (scaled(frame, scene, largest), scene) for title, (frame, scene) in worlds.items()}


def peaks_of(frame: Frame, scene: Scene) -> dict[str, float]:
    """Return the largest value so far of each field by name, 0 where it is not known."""
    return dict(zip(scene.fields, field_peaks(frame, scene.fields), strict=True))


def scaled(frame: Frame, scene: Scene, largest: dict[str, float]) -> Frame:
    """Return a frame in which these values of its fields have the full colour, if they are known and no smaller."""
    columns, peaks = frame.columns, peaks_of(frame, scene)
    if "fields" not in columns or len(columns["fields"]) != len(scene.fields) or peaks == largest:
        return frame
    for name, peak in peaks.items():
        if 0.0 < peak < largest[name]:
            levels = np.rint(field_levels(frame, name) * np.sqrt(peak / largest[name])).astype(np.uint8)
            columns = {**columns, PIXELS + name: levels}
    table = columns["fields"].copy()
    table["peak"] = [largest[name] for name in scene.fields]
    return replace(frame, columns={**columns, "fields": table})


def step_text(step: int, scale: Scale | None) -> str:
    """Return the caption of a step, with its time if that is known."""
    return f"step {step:,}" if scale is None else f"step {step:,}, {time_text(scale.seconds(step))}"
