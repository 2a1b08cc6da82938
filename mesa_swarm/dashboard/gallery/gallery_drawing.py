"""Drawings of worlds as SVG, at rest and moving, whose colours follow the page around them.

Coordinates are relative to the map's lower left corner, y up, in one group that turns y round. At rest all robots
share one path per colour, so that a browser draws a dozen elements, not a thousand; in motion each has its own.
Attributes have the colours of the light theme; the style sheet ``gallery.css`` replaces them by class.
"""

from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO

import numpy as np
from PIL import Image

from mesa_swarm.recording.frames import NO_ROWS, PICTURED, Frame, field_levels, frame_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.animation import Clock, ObjectTrack, number_row, tracks
from mesa_swarm.viewing.packing import MOST_PIXELS
from mesa_swarm.viewing.palette import DARK, LIGHT, Palette, fire_colour
from mesa_swarm.viewing.scene import Scene, scene_of
from mesa_swarm.world.bodies import Form
from mesa_swarm.world.fields import average_blocks
from mesa_swarm.world.shapes import Shape

HALF_DISC = "M%.5g %.5gA%.5g %.5g 0 0 1 %.5g %.5gZ"
STROKE = "M%.5g %.5gL%.5g %.5g"
LINE = 'stroke-width="0.6" vector-effect="non-scaling-stroke"'
# Width of trails as a share of the width of a picture.
TRAIL_WIDTH = 0.005
# Fill and stroke of the parts of a robot. One that is drawn once and used many times is out of reach of style sheets
# that name what is around it, but custom properties are inherited.
PARTS = {
    "rear": ("robot", "robot"),
    "hot": ("robot_hot", "robot_hot"),
    "front": ("robot_front", "robot"),
    "heading": ("", "robot_outline"),
}
# Share of the time at the end of a moving drawing in which all that moves fades, since it then begins again.
FADING = 0.06
# Decimals of places in a moving drawing whose window is wider than 100 map units.
DIGITS = 1
# Left, bottom, width and height of the part of a map that is drawn, from the map's lower left corner.
Window = tuple[float, float, float, float]


def drawing(size: tuple[float, float], layers: Iterable[str], window: Window | None = None) -> str:
    """Return a drawing of a map of this width and height, or of a window on it; layers have y up, lowest first."""
    width, height = (f"{length:.5g}" for length in size)
    left, bottom, across, up = window or (0.0, 0.0, *size)
    box = " ".join(f"{number + 0.0:.5g}" for number in (left, size[1] - bottom - up, across, up))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" role="img" '
        f'aria-label="the world"><rect width="{width}" height="{height}" fill="{LIGHT.ground}"/>'
        f'<g transform="translate(0 {height}) scale(1 -1)">{"".join(layers)}</g></svg>'
    )


def draw_shapes(shapes: Iterable[Shape], corner: np.ndarray) -> str:
    """Return obstacles and ground marks in their colours, relative to the map's corner."""
    solid = "".join(_outline(shape, corner) for shape in shapes if shape.contact)
    marks = "".join(_outline(shape, corner) for shape in shapes if not shape.contact)
    return _path("mark", marks, f'fill="{LIGHT.mark}"') + _path("obstacle", solid, f'fill="{LIGHT.obstacle}"')


def draw_loads(shapes: Iterable[Shape], corner: np.ndarray) -> str:
    """Return loads in their colour, at their present positions, relative to the map's corner."""
    return _path("load", "".join(_outline(shape, corner) for shape in shapes), f'fill="{LIGHT.load}"')


def draw_fires(position: np.ndarray, radius: np.ndarray, temperature: np.ndarray, out: np.ndarray) -> str:
    """Return fires as discs in the colour of their temperature; a style sheet may take the dark theme's, ``--dark``."""
    rows = zip(position.tolist(), radius.tolist(), temperature.tolist(), out.tolist(), strict=True)
    return "".join(
        f'<circle class="fire" cx="{x:.5g}" cy="{y:.5g}" r="{r:.5g}" fill="{_fire_fill(t, dead, LIGHT)}" '
        f'style="--dark: {_fire_fill(t, dead, DARK)}"/>'
        for (x, y), r, t, dead in rows
    )


def _fire_fill(temperature: float, is_out: bool, palette: Palette) -> str:
    return palette.ashes if is_out else fire_colour(temperature, palette)


def draw_robots(position: np.ndarray, heading: np.ndarray, radius: np.ndarray, marked: np.ndarray | None = None) -> str:
    """Return robots as discs to scale, the front half light, with a line towards the heading; some of a second colour.

    ``marked``, bool of shape (n,), states which; on pages it is the colour of robots that are too hot.
    """
    ahead = radius[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    radii = np.column_stack([radius, radius])
    rears, fronts = (np.hstack([position + side, radii, position - side]) for side in (left, -left))
    is_marked = np.zeros(len(position), bool) if marked is None else marked
    edge = f'stroke="{LIGHT.robot_outline}" {LINE}'
    return (
        _path("rear", _outlines(HALF_DISC, rears[~is_marked]), f'fill="{LIGHT.robot}" {edge}')
        + _path("hot", _outlines(HALF_DISC, rears[is_marked]), f'fill="{LIGHT.robot_hot}" {edge}')
        + _path("front", _outlines(HALF_DISC, fronts), f'fill="{LIGHT.robot_front}" {edge}')
        + _path("heading", _outlines(STROKE, np.hstack([position, position + ahead])), f'fill="none" {edge}')
    )


def draw_field(levels: np.ndarray, size: tuple[float, float], place: int, name: str) -> str:
    """Return a field, uint8 of 0 to 255 with row 0 at the bottom, in the colour of its place; names are of one use.

    The picture is how opaque the colour is, so that the colour can follow the page.
    """
    small = np.rint(average_blocks(levels, MOST_PIXELS)).astype(np.uint8)
    file = BytesIO()
    Image.fromarray(small, "L").save(file, "PNG", optimize=True)
    light, dark = (palette.scalars[place % len(palette.scalars)][:7] for palette in (LIGHT, DARK))
    box = f'width="{size[0]:.5g}" height="{size[1]:.5g}"'
    return (
        f'<mask id="{name}"><image {box} preserveAspectRatio="none" '
        f'href="data:image/png;base64,{b64encode(file.getvalue()).decode()}"/></mask>'
        f'<rect class="field" {box} mask="url(#{name})" fill="{light}" style="--dark: {dark}"/>'
    )


def _outlines(template: str, rows: np.ndarray) -> str:
    """Return the template filled with each row in turn; formatting all at once takes half the time."""
    return (template * len(rows)) % tuple(rows.ravel().tolist())


def _outline(shape: Shape, corner: np.ndarray) -> str:
    if shape.is_disc:
        (x, y), r = (shape.position - corner).tolist(), f"{shape.radius:.5g}"
        left, right = f"{x - shape.radius:.5g} {y:.5g}", f"{x + shape.radius:.5g} {y:.5g}"
        # Clockwise like Shapely's outlines (holes run the other way): where two overlap, both must stay filled.
        return f"M{left}A{r} {r} 0 0 0 {right}A{r} {r} 0 0 0 {left}Z"
    rings = [shape.geometry.exterior, *shape.geometry.interiors]
    points = [(np.array(ring.coords[:-1]) - corner).tolist() for ring in rings]
    return "".join("M" + " ".join(f"{x:.5g} {y:.5g}" for x, y in ring) + "Z" for ring in points)


def _path(name: str, outline: str, look: str) -> str:
    return f'<path class="{name}" {look} d="{outline}"/>' if outline else ""


def _inheriting(robot: str) -> str:
    """Return a robot in the colours of the custom properties where it is used."""
    for part, colours in PARTS.items():
        fill, stroke = (f"var({_property(name)}, {getattr(LIGHT, name)})" if name else "none" for name in colours)
        robot = robot.replace(f'class="{part}"', f'class="{part}" style="fill: {fill}; stroke: {stroke}"')
    return robot


def _property(name: str) -> str:
    return f"--swarm-{name.replace('_', '-')}"


def last_part(line: np.ndarray, length: float) -> np.ndarray:
    """Return the last part of a line (k, 2) of points, of this length, or all of a shorter one.

    Examples
    --------
    >>> last_part(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]), 5.0).tolist()
    [[2.0, 0.0], [4.0, 0.0], [4.0, 3.0]]
    """
    from_end = np.concatenate([np.cumsum(np.hypot(*np.diff(line[::-1], axis=0).T))[::-1], [0.0]])
    inside = int(np.argmax(from_end <= length))
    if inside == 0:
        return line
    share = (length - from_end[inside]) / (from_end[inside - 1] - from_end[inside])
    start = line[inside] + share * (line[inside - 1] - line[inside])
    return np.vstack([start, line[inside:]])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Sight:
    """A step of a model as it is drawn.

    Parameters
    ----------
    frame : Frame
    scene : Scene
        What stands behind it.
    """

    frame: Frame
    scene: Scene

    @property
    def corner(self) -> np.ndarray:
        """The lower left corner of the map."""
        return np.array(self.scene.bounds[:2])

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the map."""
        x_min, y_min, x_max, y_max = self.scene.bounds
        return x_max - x_min, y_max - y_min


def sight_of(model: SwarmModel, marked: str = "hot") -> Sight:
    """Return what is drawn of a model as it is now, with the column of robots that states which are marked."""
    return Sight(frame=frame_of(model, tuple(dict.fromkeys((*PICTURED, marked)))), scene=scene_of(model))


def drawn(model: SwarmModel, larger: float = 1.0, name: str = "own") -> str:
    """Return a drawing of the whole map of a model, its robots so much larger than to scale."""
    return WorldDrawing([sight_of(model)], larger=larger, name=name).still()


class WorldDrawing:
    """The drawing of a step, or of several that follow each other.

    Parameters
    ----------
    sights : sequence of Sight
        Of the same model.
    name : str
        With which its parts are named, since drawings on one page share their names.
    window : Window, optional
        Which part of the map is drawn; by default all.
    marked : str
        The column of robots of which those above 0 are drawn in the second colour.
    larger : float
        How many times larger than to scale robots are drawn.
    before : sequence of Sight
        Steps before the first one, through which trails lead.
    trail : float
        Length of the trail of each robot, map units, 0 for none.
    """

    def __init__(
        self,
        sights: Sequence[Sight],
        *,
        before: Sequence[Sight] = (),
        trail: float = 0.0,
        name: str = "own",
        window: Window | None = None,
        marked: str = "hot",
        larger: float = 1.0,
    ) -> None:
        self.sights, self._name, self._window, self._marked, self._larger = sights, name, window, marked, larger
        self._first, self._corner, self._size = sights[0], sights[0].corner, sights[0].size
        self._before, self._trail = before, trail

    def still(self) -> str:
        """Return the first step at rest."""
        first, scene = self._first.frame, self._first.scene
        fires = first.columns.get("fires", NO_ROWS["fires"])
        loads = [(number, scene.forms[number].shape_at(tuple(pose))) for number, *pose in first["loads"].tolist()]
        layers = [
            *self._behind(),
            "".join(self._drawn_trail(line, "") for line in self._lines_at_first()),
            draw_loads([shape for number, shape in loads if number not in scene.small], self._corner),
            draw_fires(
                np.column_stack([fires["x"], fires["y"]]) - self._corner,
                fires["radius"],
                fires["temperature"],
                fires["out"] > 0,
            ),
            draw_robots(
                first["position"] - self._corner, scene.facing(first), self._radii(first.robots), self._is_marked(first)
            ),
            draw_loads([shape for number, shape in loads if number in scene.small], self._corner),
        ]
        return drawing(self._size, layers, self._window)

    def moving(self, seconds: float) -> str:
        """Return all steps as a drawing that begins with the first, lasts this long, and is repeated."""
        clock = Clock(moments=len(self.sights), seconds=seconds)
        moving = [
            *self._moving_trails(clock),
            *self._moving_loads(clock, small=False),
            *self._moving_fires(clock),
            *self._moving_robots(clock),
            *self._moving_loads(clock, small=True),
        ]
        fade = (
            f'<animate attributeName="opacity" values="1;1;0.1" keyTimes="0;{1 - FADING};1" dur="{seconds:.6g}s" '
            'repeatCount="indefinite"/>'
        )
        layers = [*self._behind(), f"<defs>{''.join(self._bodies())}</defs>", f"<g>{fade}{''.join(moving)}</g>"]
        return drawing(self._size, layers, self._window)

    def _behind(self) -> Iterator[str]:
        """Yield fields and what stands, which do not move."""
        frame, scene = self._first.frame, self._first.scene
        for place, name in enumerate(scene.fields):
            levels = field_levels(frame, name)
            if levels.size:
                yield draw_field(levels, self._size, place, f"{self._name}-field{place}")
        yield draw_shapes(scene.obstacles(frame.step), self._corner)

    def _radii(self, robots: np.ndarray) -> np.ndarray:
        return self._larger * self._first.scene.radius_of(robots)

    def _is_marked(self, frame: Frame) -> np.ndarray:
        return frame[self._marked] > 0

    @cached_property
    def _digits(self) -> int:
        return DIGITS if (self._window or (0, 0, *self._size))[2] > 100 else DIGITS + 1

    @cached_property
    def _forms(self) -> dict[int, Form]:
        """The forms of all bodies that move, also of those that are there for a while."""
        return {number: form for sight in self.sights for number, form in sight.scene.forms.items()}

    def _moving_robots(self, clock: Clock) -> Iterator[str]:
        pairs = [(sight.frame, sight.scene.facing(sight.frame)) for sight in self.sights]
        frames = [frame for frame, _ in pairs]
        rows = [np.column_stack([one["position"], facing, self._is_marked(one)]) for one, facing in pairs]
        radii = self._all_radii
        for track in tracks(zip((frame.robots for frame in frames), rows, strict=True)):
            radius = float(self._radii(np.array([track.number]))[0])
            body = f"#{self._name}-body{radii.index(radius)}"
            seen = track.values[:, 3] > 0
            bodies = [
                f'<use href="{body}{kind}">{self._when(clock, shown & track.present)}</use>'
                for kind, shown in (("", ~seen), ("hot", seen))
                if shown.any()
            ]
            yield from self._body(clock, track, "robot", "".join(bodies), radius)

    @cached_property
    def _all_radii(self) -> list[float]:
        found = [self._radii(sight.frame.robots) for sight in self.sights]
        return np.unique(np.concatenate(found)).tolist()

    def _bodies(self) -> Iterator[str]:
        """Yield robots of each radius and colour, about their own centre."""
        origin, ahead = np.zeros((1, 2)), np.zeros(1)
        for place, radius in enumerate(self._all_radii):
            for kind, marked in (("", False), ("hot", True)):
                robot = draw_robots(origin, ahead, np.array([radius]), np.array([marked]))
                yield f'<g id="{self._name}-body{place}{kind}">{_inheriting(robot)}</g>'

    def lines(self) -> Iterator[np.ndarray]:
        """Yield the places (k, 2) of each robot that was there from the first to the last step."""
        frames = [sight.frame for sight in (*self._before, *self.sights)]
        if self._trail:
            for track in tracks((frame.robots, frame["position"] - self._corner) for frame in frames):
                if track.present.all() and self._in_window(track.values, self._trail).any():
                    yield track.values

    def _drawn_trail(self, line: np.ndarray, dash: str, slides: str = "") -> str:
        points = " ".join(number_row(point, self._digits) for point in line.tolist())
        width = TRAIL_WIDTH * (self._window or (0.0, 0.0, *self._size))[2]
        look = f'fill="none" stroke="{LIGHT.trail}" stroke-width="{width:.4g}" stroke-linejoin="round"'
        return f'<polyline class="trail" {look}{dash} points="{points}">{slides}</polyline>'

    def _lines_at_first(self) -> Iterator[np.ndarray]:
        """Yield the trail of each robot in the first step."""
        for line in self.lines():
            past = line[: len(self._before) + 1]
            yield last_part(past, self._trail)

    def _moving_trails(self, clock: Clock) -> Iterator[str]:
        """Yield the way of each robot, of which the part behind the robot is visible: a dash that moves along it."""
        for line in self.lines():
            begin = len(line) - len(self.sights)
            passed = np.cumsum(np.hypot(*np.diff(np.round(line, self._digits), axis=0).T))
            passed = np.concatenate([[0.0], passed])
            shifts = ";".join(number_row([self._trail - at], self._digits) for at in passed[begin:])
            dash = (
                f' stroke-dasharray="{self._trail:.5g} {passed[-1] + self._trail:.5g}" '
                f'stroke-dashoffset="{self._trail - passed[begin]:.5g}"'
            )
            slides = f'<animate attributeName="stroke-dashoffset" values="{shifts}" dur="{clock.seconds:.6g}s" '
            yield self._drawn_trail(line, dash, slides + 'repeatCount="indefinite"/>')

    def _moving_loads(self, clock: Clock, small: bool) -> Iterator[str]:
        little = frozenset().union(*(sight.scene.small for sight in self.sights))
        tables = [sight.frame["loads"] for sight in self.sights]
        rows = ((table["load"], np.column_stack([table[axis] for axis in ("x", "y", "heading")])) for table in tables)
        for track in tracks(rows):
            if track.number in self._forms and (track.number in little) is small:
                form = self._forms[track.number]
                body = _path("load", _outline(form.shape_at((0.0, 0.0, 0.0)), np.zeros(2)), f'fill="{LIGHT.load}"')
                yield from self._body(clock, track, "body", body, form.reach)

    def _moving_fires(self, clock: Clock) -> Iterator[str]:
        tables = [sight.frame.columns.get("fires", NO_ROWS["fires"]) for sight in self.sights]
        names = ("x", "y", "radius", "temperature", "out")
        rows = ((table["fire"], np.column_stack([table[one] for one in names]).astype(float)) for table in tables)
        for track in tracks(rows):
            at, r = number_row(track.values[0, :2] - self._corner, self._digits), f"{track.values[0, 2]:.5g}"
            circles = []
            for theme, palette in (("day", LIGHT), ("night", DARK)):
                fills = [_fire_fill(heat, out > 0, palette) for *_, heat, out in track.values.tolist()]
                hidden = ' display="none"' if theme == "night" else ""
                look = f'class="fire {theme}" r="{r}" fill="{fills[0]}"{hidden}'
                circles.append(f"<circle {look}>{clock.jumping('fill', fills)}</circle>")
            yield f'<g transform="translate({at})">{self._when(clock, track.present)}{"".join(circles)}</g>'

    def _body(self, clock: Clock, track: ObjectTrack, kind: str, body: str, reach: float) -> Iterator[str]:
        """Yield something that moves and turns, if it is ever within the window."""
        places = track.values[:, :2] - self._corner
        if not self._in_window(places, reach).any():
            return
        degrees = np.degrees(np.unwrap(track.values[:, 2]))[:, None]
        start = f"translate({number_row(places[0], self._digits)}) rotate({number_row(degrees[0], 0)})"
        moves = clock.moving("translate", places, self._digits)
        turns = clock.moving("rotate", degrees, 0, added=True)
        yield f'<g class="{kind}" transform="{start}">{moves}{turns}{self._when(clock, track.present)}{body}</g>'

    def _in_window(self, places: np.ndarray, reach: float) -> np.ndarray:
        left, bottom, width, height = self._window or (0.0, 0.0, *self._size)
        inner = (places + reach > (left, bottom)) & (places - reach < (left + width, bottom + height))
        return np.asarray(inner.all(axis=1))

    @staticmethod
    def _when(clock: Clock, shown: np.ndarray) -> str:
        return clock.jumping("visibility", ["visible" if there else "hidden" for there in shown])
