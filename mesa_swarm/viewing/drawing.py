"""Drawings of worlds as SVG: one step at rest or many that move, as part of a page or alone with caption and legend.

Coordinates are relative to the map's lower left corner, y up, in one group that turns y round. Bodies that move are
groups with transforms, and all robots of a size use one drawing of a robot, whose back has the `fill` from where it is
used, its front the `color`, and its lines the `stroke`.

On a page that has two themes, what is painted is there twice, of the classes "day" and "night", of which the style
sheet ``gallery.css`` hides one; it also gives ground, trails, fronts and lines the colours of the page.
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from io import BytesIO
from itertools import product
from math import ceil, log10
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import shapely
from numpy.typing import ArrayLike
from PIL import Image

from mesa_swarm.base.errors import ExportError, InvalidValueError
from mesa_swarm.base.files import write_whole
from mesa_swarm.base.progress import Progress, progress_bar
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.frames import Frame, field_levels, frame_of
from mesa_swarm.recording.provenance import join_sceneries
from mesa_swarm.viewing.frame_bytes import MOST_PIXELS
from mesa_swarm.viewing.legend import LegendEntry
from mesa_swarm.viewing.palette import LIGHT, PALETTES, scalar_pixels
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.scene import (
    PART_OPACITY,
    USUAL,
    Painted,
    Scene,
    looks_in,
    peaks_of,
    scaled,
    scene_of,
    step_text,
)
from mesa_swarm.world.fields import average_blocks
from mesa_swarm.world.shapes import Shape

# The caption of a drawing that stands alone is so high, as a share of the map's longer side.
CAPTION = 0.045
# Width of a letter in the mean, as a share of its size.
LETTER = 0.62
# Height of the texts above robots, pixels at the usual size.
LABEL = 11
# Width of trails as a share of the width of a picture.
TRAIL_WIDTH = 0.005
# Share of the time at the end of a moving drawing on a page in which all that moves fades, since it then begins again.
FADING = 0.06
# The class of what is painted for a theme of a page, and what hides it until a style sheet shows it.
CLASSES = {"light": (" day", ""), "dark": (" night", ' display="none"')}
# Left, bottom, width and height of the part of a map that is drawn, from the map's lower left corner.
Window = tuple[float, float, float, float]
# The colours of something in the steps, by theme.
Fills = Mapping[str, Sequence[str]]
# Makes an element of its attributes, what changes its colour, and the theme.
Element = Callable[[str, str, str], str]


@dataclass(frozen=True, kw_only=True, slots=True)
class Clock:
    """When the values of an animation are shown: the first at the beginning, the last at the end, then again."""

    moments: int  # number of values; with one of them nothing moves
    seconds: float

    @property
    def _repeat(self) -> str:
        return f'dur="{self.seconds:.6g}s" repeatCount="indefinite"'

    def moving(self, kind: str, rows: np.ndarray, digits: int, added: bool = False) -> str:
        """Return what moves or turns an element evenly through rows of numbers; one value if they are all the same.

        The first animation of an element replaces its transform, so that all have to be there.
        """
        if self.moments == 1:
            return ""
        texts = [number_row(row, digits) for row in rows.tolist()]
        texts = texts if len(set(texts)) > 1 else texts[:1]
        more = ' additive="sum"' if added else ""
        shown = ";".join(texts)
        return f'<animateTransform attributeName="transform"{more} type="{kind}" values="{shown}" {self._repeat}/>'

    def jumping(self, name: str, values: Sequence[str], tag: str = "animate", more: str = "") -> str:
        """Return what changes an attribute at once wherever the value differs from the one before."""
        changes = [i for i in range(len(values)) if i == 0 or values[i] != values[i - 1]]
        if len(changes) == 1:
            return ""
        # Rounded down: a value is shown from its own time on, as moving elements are.
        times = ";".join(f"{int(1e5 * i / (self.moments - 1)) / 1e5:.5g}" for i in changes)
        shown = ";".join(values[i] for i in changes)
        return (
            f'<{tag} attributeName="{name}"{more} calcMode="discrete" values="{shown}" keyTimes="{times}" '
            f"{self._repeat}/>"
        )


def number_row(numbers: Iterable[float], digits: int) -> str:
    """Return numbers rounded to some digits, separated by blanks, without trailing zeros."""
    return " ".join(f"{round(number, digits) + 0.0:.10g}" for number in numbers)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ObjectTrack:
    """One object over time."""

    number: int  # unique_id
    # Shape (k, m): where it was not there, what it had next before that, or first after.
    values: np.ndarray
    present: np.ndarray  # bool, shape (k,)


def tracks(moments: Iterable[tuple[np.ndarray, np.ndarray]]) -> Iterator[ObjectTrack]:
    """Yield the track of every object, by unique_id, from the ids (n,) and values (n, m) at each step."""
    rows = list(moments)
    places: dict[int, list[tuple[int, int]]] = {}
    for moment, (ids, _) in enumerate(rows):
        for row, number in enumerate(ids.tolist()):
            places.setdefault(number, []).append((moment, row))
    for number in sorted(places):
        values = np.array([rows[moment][1][row] for moment, row in places[number]])
        present = np.zeros(len(rows), bool)
        present[[moment for moment, _ in places[number]]] = True
        latest = np.maximum(np.cumsum(present) - 1, 0)
        yield ObjectTrack(number=number, values=values[latest], present=present)


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


@dataclass(frozen=True, kw_only=True, eq=False)
class WorldDrawing:
    """The drawing of a step, or of several that follow each other.

    Parameters
    ----------
    frames : sequence of Frame
        Of the same model, with the columns `PICTURED`.
    scene : Scene
        What stands behind all of them.
    seconds : float
        How long they last together.
    alone : bool
        Whether it stands by itself: in the light theme, with texts, and with fields as they are in each step, while on
        a page those of the first step stay.
    name : str
        With which its parts are named, since drawings on one page share their names.
    window : Window, optional
        Which part of the map is drawn; by default all.
    marked : str
        The column of robots of which those above 0 are drawn in a second colour, that of robots too hot to fight.
    larger : float
        How many times larger than to scale robots are drawn.
    before : sequence of Frame
        Steps before the first one, through which trails lead.
    trail : float
        Length of the trail of each robot, map units, 0 for none.
    """

    frames: Sequence[Frame]
    scene: Scene
    seconds: float = 0.0
    alone: bool = False
    name: str = ""
    window: Window | None = None
    marked: str = "hot"
    larger: float = 1.0
    before: Sequence[Frame] = ()
    trail: float = 0.0

    @property
    def corner(self) -> np.ndarray:
        """The lower left corner of the map."""
        return np.array(self.scene.bounds[:2], float)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the map."""
        x_min, y_min, x_max, y_max = self.scene.bounds
        return x_max - x_min, y_max - y_min

    def first(self) -> "WorldDrawing":
        """Return the drawing of the first step alone, at rest."""
        return replace(self, frames=self.frames[:1])

    def text(self) -> str:
        """Return the drawing."""
        (width, height), (left, bottom, across, up) = self.size, self._window
        box = self.numbers(left, height - bottom - up, across, up)
        ground = f'<rect width="{width:.6g}" height="{height:.6g}" fill="{LIGHT.ground}"/>'
        look = f'viewBox="{box}" role="img" aria-label="the world"'
        return f'<svg xmlns="http://www.w3.org/2000/svg" {look}>{ground}{self.world()}</svg>'

    def world(self) -> str:
        """Return all that is on the ground, where the upper left corner of the map is the origin."""
        robots = f'<g class="robots" color="{LIGHT.robot_front}" stroke="{LIGHT.robot_outline}">'
        moving = [
            *self._trails(),
            *self._loads(small=False),
            *self._fires(),
            "".join([robots, *self._robots(), "</g>"]),
            *self._loads(small=True),
            *(self._labels() if self.alone else ()),
        ]
        behind = [f"<defs>{''.join(self._bodies())}</defs>", *self._fields(), *self._standing(), *self._discs()]
        turned = f'<g transform="translate(0 {self.size[1]:.6g}) scale(1 -1)">'
        return "\n".join([turned, *behind, f"<g>{self._fade()}", *moving, "</g></g>"])

    def numbers(self, *numbers: float) -> str:
        """Return lengths, rounded to a tenth of a pixel at the usual size."""
        return number_row(numbers, self._digits)

    @cached_property
    def clock(self) -> Clock:
        """When each step is shown."""
        return Clock(moments=len(self.frames), seconds=self.seconds)

    @property
    def _window(self) -> Window:
        return self.window or (0.0, 0.0, *self.size)

    @cached_property
    def _digits(self) -> int:
        return max(0, ceil(log10(10 * USUAL / max(self._window[2:]))))

    @property
    def _themes(self) -> tuple[str, ...]:
        return ("light",) if self.alone else tuple(PALETTES)

    def _fade(self) -> str:
        if self.alone or len(self.frames) == 1:
            return ""
        times = f'values="1;1;0.1" keyTimes="0;{1 - FADING};1" dur="{self.seconds:.6g}s"'
        return f'<animate attributeName="opacity" {times} repeatCount="indefinite"/>'

    def _classes(self, kind: str, theme: str) -> str:
        name, hidden = ("", "") if self.alone else CLASSES[theme]
        return f'class="{kind}{name}"{hidden}'

    def _painted(self, kind: str, fills: Fills, element: Element) -> str:
        """Return an element in the colours that it has in the steps, once for each theme."""
        return "".join(
            element(
                f'{self._classes(kind, theme)} fill="{fills[theme][0]}"',
                self.clock.jumping("fill", fills[theme]),
                theme,
            )
            for theme in self._themes
        )

    def _visible(self, when: Sequence[bool] | np.ndarray) -> str:
        return self.clock.jumping("visibility", ["visible" if there else "hidden" for there in when])

    def _fields(self) -> Iterator[str]:
        """Yield each picture of a field once; the group is turned upside down, as the rows of fields are."""
        width, height = map(self.numbers, self.size)
        box = f'x="0" y="0" width="{width}" height="{height}" preserveAspectRatio="none"'
        frames = self.frames if self.alone else self.frames[:1]
        for (place, name), theme in product(enumerate(self.scene.fields), self._themes):
            shown = [_png_of(field_levels(frame, name), place, theme) for frame in frames]
            for picture in filter(None, dict.fromkeys(shown)):
                when = self._visible([other == picture for other in shown])
                address = f'href="data:image/png;base64,{picture}"'
                yield f"<image {self._classes('field', theme)} {box} {address}>{when}</image>"

    def _standing(self) -> Iterator[str]:
        """Yield marks and obstacles, a path for all of one colour, for as long as they stand."""
        steps: dict[int, list[int]] = {}
        for frame in self.frames:
            steps.setdefault(id(self.scene.obstacles(frame.step)), []).append(frame.step)
        for those in steps.values():
            when = self._visible([frame.step in those for frame in self.frames])
            pairs = zip(*(self.scene.standing(those[0], theme) for theme in PALETTES), strict=True)
            paths: dict[tuple[str, str, str], str] = {}
            for (shape, light), (_, dark) in sorted(pairs, key=lambda pair: pair[0][0].contact):
                kind = "obstacles" if shape.contact else "marks", light, dark
                paths[kind] = paths.get(kind, "") + self._outline(shape, self.corner)
            for (name, light, dark), outline in paths.items():
                yield self._shape(name, {"light": [light], "dark": [dark]}, outline, when)

    def _shape(self, kind: str, fills: Fills, outline: str, when: str = "") -> str:
        return self._painted(kind, fills, lambda look, change, _: f'<path {look} d="{outline}">{change}{when}</path>')

    def _outline(self, shape: Shape, corner: ArrayLike = (0.0, 0.0)) -> str:
        if shape.is_disc:
            (x, y), r = (shape.position - corner).tolist(), shape.radius
            # Clockwise as Shapely's outlines are: where two overlap, both must stay filled.
            left, right, radii = self.numbers(x - r, y), self.numbers(x + r, y), self.numbers(r, r)
            return f"M{left}A{radii} 0 0 0 {right}A{radii} 0 0 0 {left}Z"
        rings = [shape.geometry.exterior, *shape.geometry.interiors]
        points = [(shapely.get_coordinates(ring)[:-1] - corner).tolist() for ring in rings]
        return "".join("M" + " ".join(self.numbers(*point) for point in ring) + "Z" for ring in points)

    def _discs(self) -> Iterator[str]:
        """Yield the discs of parts, each place of the table as a circle that is there where a step has it."""
        tables = [self.scene.discs(frame) if self.scene.parts else np.empty((0, 4)) for frame in self.frames]
        for place in range(max(map(len, tables))):
            there = [len(table) > place for table in tables]
            rows = [table[place] if is_there else np.zeros(4) for table, is_there in zip(tables, there, strict=True)]
            values = {"fill": [self.scene.parts[int(row[0])][1] for row in rows]}
            for name, k, shift in (("cx", 1, self.corner[0]), ("cy", 2, self.corner[1]), ("r", 3, 0.0)):
                values[name] = [self.numbers(row[k] - shift) for row in rows]
            values["visibility"] = ["visible" if is_there else "hidden" for is_there in there]
            look = " ".join(f'{name}="{states[0]}"' for name, states in values.items())
            changes = "".join(self.clock.jumping(name, states) for name, states in values.items())
            yield f'<circle class="part" fill-opacity="{PART_OPACITY}" {look}>{changes}</circle>'

    def _tracks(self, drawn_in: Callable[[Frame, str], Painted]) -> Iterator[tuple[ObjectTrack, list[Fills]]]:
        """Yield the track of each body, its radius last, and the colours of its parts in the steps by theme."""
        moments = []
        for frame in self.frames:
            themes = [drawn_in(frame, theme) for theme in self._themes]
            ids, poses, radii, _ = themes[0]
            moments.append((ids, poses - (*self.corner, 0.0), radii, [drawn.colours for drawn in themes]))
        places = tracks((ids, np.column_stack([poses, radii])) for ids, poses, radii, _ in moments)
        painted = tracks((ids, np.hstack(colours)) for ids, _, _, colours in moments)
        for track, colours in zip(places, painted, strict=True):
            by_theme = np.split(colours.values, len(self._themes), axis=1)
            parts = zip(*(of_theme.T.tolist() for of_theme in by_theme), strict=True)
            if self._is_near(track.values[:, :2], track.values[0, 3]):
                yield track, [dict(zip(self._themes, fills, strict=True)) for fills in parts]

    def _is_near(self, places: np.ndarray, reach: float) -> bool:
        """Return whether a body is ever within the window."""
        left, bottom, width, height = self._window
        inside = (places + reach > (left, bottom)) & (places - reach < (left + width, bottom + height))
        return self.window is None or bool(inside.all(axis=1).any())

    def _loads(self, small: bool) -> Iterator[str]:
        for track, (fills,) in self._tracks(self.scene.loads):
            if (track.number in self.scene.small) is small:
                outline = self._outline(self.scene.forms[track.number].shape_at((0.0, 0.0, 0.0)))
                yield self._moving(track, 'class="load"', self._shape("body", fills, outline))

    def _fires(self) -> Iterator[str]:
        """Yield fires; those of a drawing that stands alone are numbered."""
        for place, (track, (fills, rims, inks)) in enumerate(self._tracks(self.scene.fires), start=1):
            x, y, _, radius = track.values[0]
            at, disc = self.numbers(x, y), f'r="{self.numbers(radius)}" stroke-width="{radius / 20:.3g}"'
            circle = self._painted("disc", fills, partial(self._fire, disc, rims))
            size, jump = min(0.9 * radius, self.size[0] / 36), self.clock.jumping("fill", inks["light"])
            look = f'font-size="{size:.3g}" text-anchor="middle" dy=".35em" fill="{inks["light"][0]}"'
            text = f"<text {look}>{jump}{place}</text>" if self.alone else ""
            seen = self._visible(track.present)
            yield f'<g class="fire" transform="translate({at}) scale(1 -1)">{seen}{circle}{text}</g>'

    def _fire(self, disc: str, rims: Fills, look: str, change: str, theme: str) -> str:
        jump = self.clock.jumping("stroke", rims[theme])
        return f'<circle {look} {disc} stroke="{rims[theme][0]}">{change}{jump}</circle>'

    def _robots(self) -> Iterator[str]:
        for track, (fills,) in self._tracks(partial(self.scene.robots, marked=self.marked)):
            drawn = f'href="#{self._prefix}body{self._radii.index(track.values[0, 3])}"'
            used = self._painted("back", fills, partial(_use, drawn))
            yield self._moving(track, f'class="robot" data-robot="{track.number}"', used)

    @property
    def _prefix(self) -> str:
        return f"{self.name}-" if self.name else ""

    @cached_property
    def _radii(self) -> list[float]:
        """The radii of all robots, each once."""
        robots = np.unique(np.concatenate([frame.robots for frame in self.frames]))
        return np.unique(self.scene.radius_of(robots)).tolist()

    def _bodies(self) -> Iterator[str]:
        """Yield a robot of each radius, about its own centre."""
        for place, radius in enumerate(self._radii):
            r = self.larger * radius
            front = f"M0 {-0.92 * r:.5g}A{0.92 * r:.5g} {0.92 * r:.5g} 0 0 1 0 {0.92 * r:.5g}Z"
            yield (
                f'<g id="{self._prefix}body{place}"><circle r="{r:.5g}" stroke-width="{r / 14:.3g}"/>'
                f'<path d="{front}" fill="currentColor" stroke="none"/>'
                f'<path d="M0 0H{r:.5g}" stroke-width="{r / 8:.3g}"/></g>'
            )

    def _moving(self, track: ObjectTrack, look: str, drawn: str) -> str:
        """Return something that moves and turns."""
        places, degrees = track.values[:, :2], np.degrees(np.unwrap(track.values[:, 2]))[:, None]
        start = f"translate({self.numbers(*places[0])}) rotate({number_row(degrees[0], 0)})"
        moves = self.clock.moving("translate", places, self._digits)
        turns = self.clock.moving("rotate", degrees, 0, added=True)
        return f'<g {look} transform="{start}">{moves}{turns}{self._visible(track.present)}{drawn}</g>'

    def lines(self) -> Iterator[np.ndarray]:
        """Yield the places (k, 2) of each robot that was there from the first to the last step, if it has a trail."""
        frames = [*self.before, *self.frames] if self.trail else []
        for track in tracks((frame.robots, frame["position"] - self.corner) for frame in frames):
            if track.present.all() and self._is_near(track.values, self.trail):
                yield track.values

    def _trails(self) -> Iterator[str]:
        """Yield the way of each robot, of which the part behind the robot is seen: a dash that moves along it."""
        look = f'fill="none" stroke="{LIGHT.trail}" stroke-width="{TRAIL_WIDTH * self._window[2]:.4g}" '
        look += 'stroke-linejoin="round"'
        for line in self.lines():
            dash, slides = self._dash(line) if len(self.frames) > 1 else ("", "")
            seen = line if dash else last_part(line, self.trail)
            points = " ".join(map(self.numbers, *seen.T))
            yield f'<polyline class="trail" {look}{dash} points="{points}">{slides}</polyline>'

    def _dash(self, line: np.ndarray) -> tuple[str, str]:
        """Return what shows a part of a line, and what moves that part."""
        way = np.cumsum(
            np.hypot(*np.diff(np.round(line, self._digits), axis=0, prepend=line[:1].round(self._digits)).T)
        )
        shifts = [number_row([self.trail - passed], self._digits) for passed in way[-len(self.frames) :]]
        dash = f' stroke-dasharray="{self.trail:.5g} {way[-1] + self.trail:.5g}" stroke-dashoffset="{shifts[0]}"'
        times = f'values="{";".join(shifts)}" dur="{self.seconds:.6g}s" repeatCount="indefinite"'
        return dash, f'<animate attributeName="stroke-dashoffset" {times}/>'

    def _labels(self) -> Iterator[str]:
        """Yield the texts above robots, which stay upright; each is there while it is the robot's."""
        if "label" not in self.scene.columns:
            return
        pixel = max(self.size) / USUAL
        look = f'class="label" font-size="{LABEL * pixel:.3g}" text-anchor="middle" fill="{LIGHT.ink}" '
        look += f'stroke="{LIGHT.ground}" stroke-width="{3 * pixel:.3g}" paint-order="stroke"'
        texts = [looks_in(frame, self.scene)[1].astype(object) for frame in self.frames]
        written = tracks((frame.robots, shown[:, None]) for frame, shown in zip(self.frames, texts, strict=True))
        for (track, _), words in zip(self._tracks(self.scene.robots), written, strict=True):
            shown = np.where(track.present, words.values[:, 0], "").astype(str).tolist()
            seen = "".join(self._label(text, shown) for text in dict.fromkeys(shown) if text)
            if seen:
                places = track.values[:, :2] + (0.0, track.values[0, 3] + 3 * pixel)
                moves = self.clock.moving("translate", places, self._digits)
                yield f'<g {look} transform="translate({self.numbers(*places[0])})">{moves}{seen}</g>'

    def _label(self, text: str, shown: Sequence[str]) -> str:
        look = f'transform="scale(1 -1)" visibility="{"visible" if shown[0] == text else "hidden"}"'
        return f"<text {look}>{self._visible([other == text for other in shown])}{escape(text)}</text>"


def _use(drawn: str, look: str, change: str, theme: str) -> str:
    return f"<use {look} {drawn}>{change}</use>"


def drawing_of_model(model: EngineModel, larger: float = 1.0, name: str = "own") -> str:
    """Return a drawing of the whole map of a model as it is now, its robots so much larger than to scale."""
    return WorldDrawing(frames=[frame_of(model)], scene=scene_of(model), larger=larger, name=name).text()


def scene_of_all(scenes: Sequence[Scene]) -> Scene:
    """Return one scene of a model for all of its steps, from those of the steps, in the order of time."""
    return replace(scenes[-1], changes=join_sceneries([change for scene in scenes for change in scene.changes]))


def export_animation(drawn: PicturedSteps, path: Path, steps: Sequence[int], *, fps: float, progress: bool) -> None:
    """Write steps as an animated SVG that repeats, whole or not at all.

    Step i is shown i / fps seconds after the beginning, and between two steps robots move evenly.
    """
    if len(steps) < 2:
        raise InvalidValueError(f"an animation of step {steps[0]} alone does not move; choose two steps or more")
    with progress_bar(len(steps), "frames", progress) as bar:
        frames = [_noted(drawn.frame(step), bar) for step in steps]
    largest = peaks_of(frames[-1], drawn.scene)
    frames = [scaled(frame, drawn.scene, largest) for frame in frames]
    seconds = (len(frames) - 1) / fps
    write_whole(
        path, page_of_drawing(WorldDrawing(frames=frames, scene=drawn.scene, seconds=seconds, alone=True)), ExportError
    )


def _noted(frame: Frame, bar: Progress) -> Frame:
    bar.update(1)
    return frame


def _png_of(levels: np.ndarray, place: int, theme: str) -> str:
    """Return a picture of a field as a PNG in base 64, its first row that of the field, at most `MOST_PIXELS`."""
    if not levels.size:  # the field was not there then
        return ""
    file = BytesIO()
    small = np.rint(average_blocks(levels, MOST_PIXELS)).astype(np.uint8)
    Image.fromarray(scalar_pixels(small, place, PALETTES[theme]), "RGBA").save(file, "PNG")
    return b64encode(file.getvalue()).decode()


def page_of_drawing(drawing: WorldDrawing) -> str:
    """Return a drawing that stands alone, with its name and step above it, and its legend below."""
    scene, frames, (width, height) = drawing.scene, drawing.frames, drawing.size
    caption, pixel = CAPTION * max(drawing.size), max(drawing.size) / USUAL
    legend, high = _legend_rows(scene.own_legend(frames[-1]), width, 0.36 * caption)
    total, edge = caption + height + high, 2 * pixel
    box = drawing.numbers(-edge, -edge, width + 2 * edge, total + 2 * edge)
    look = f'width="{round(width / pixel) + 4}" height="{round(total / pixel) + 4}" font-family="sans-serif"'
    frame = f'<rect y="{caption:.6g}" width="{width:.6g}" height="{height:.6g}"'
    title = f"{scene.name}, steps {frames[0].step:,} to {frames[-1].step:,}"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" {look}>',
        f"<title>{escape(title)}</title>",
        f'<rect x="{-edge:.6g}" y="{-edge:.6g}" width="100%" height="100%" fill="{LIGHT.field}"/>',
        f'{frame} fill="{LIGHT.ground}"/>',
        f'<clipPath id="world">{frame}/></clipPath><g clip-path="url(#world)">',
        f'<g transform="translate(0 {caption:.6g})">{drawing.world()}</g></g>',
        *_ruler(drawing, caption),
        f'{frame} fill="none" stroke="{LIGHT.border}" stroke-width="{width / USUAL:.3g}"/>',
        *_caption(drawing, caption),
        f'<g transform="translate(0 {caption + height:.6g})">{legend}</g>' if legend else "",
        "</svg>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _ruler(drawing: WorldDrawing, caption: float) -> Iterator[str]:
    """Yield the scale bar, if the length of a metre is known."""
    scale = drawing.scene.scale
    if scale is None:
        return
    (width, height), size = drawing.size, 0.5 * caption
    length, text = scale.ruler(width)
    x, y, stroke = 0.04 * width, caption + 0.95 * height, f'stroke="{LIGHT.ink}" stroke-width="{size / 10:.3g}"'
    ends = f"M{x:.6g} {y - size / 4:.6g}v{size / 4:.6g}h{length:.6g}v{-size / 4:.6g}"
    words = f'<text x="{x + length / 2:.6g}" y="{y - size / 3:.6g}" font-size="{size:.4g}" text-anchor="middle"'
    yield f'<g class="ruler"><path fill="none" {stroke} d="{ends}"/>{words} fill="{LIGHT.ink}">{text}</text></g>'


def _caption(drawing: WorldDrawing, height: float) -> Iterator[str]:
    """Yield the name and the step, which is a strip of numbers that jumps up by one after the other."""
    width, size = drawing.size[0], 0.55 * height
    look = f'font-size="{size:.4g}" fill="{LIGHT.ink}"'
    yield f'<text x="{size / 2:.4g}" y="{0.7 * height:.4g}" {look}>{escape(drawing.scene.name)}</text>'
    jumps = [f"0 {-height * place:.6g}" for place in range(len(drawing.frames))]
    # Clipped by a group: a drawing within the drawing would have a clock of its own, which cannot be set.
    yield f'<clipPath id="line"><rect width="{width:.6g}" height="{height:.6g}"/></clipPath>'
    yield f'<g clip-path="url(#line)"><g {look} text-anchor="end">'
    yield drawing.clock.jumping("transform", jumps, "animateTransform", ' type="translate"')
    for place, frame in enumerate(drawing.frames):
        y, when = (place + 0.7) * height, step_text(frame.step, drawing.scene.scale)
        yield f'<text x="{width - size / 2:.6g}" y="{y:.6g}">{when}</text>'
    yield "</g></g>"


def _legend_rows(entries: Sequence[LegendEntry], width: float, size: float) -> tuple[str, float]:
    """Return the entries of a legend in rows, from (0, 0) on, and how high they are."""
    parts, x, y = [], size, size
    for entry in entries:
        swatch = (1.2 if entry.form == "body" else 4.0) * size
        text = entry.text
        length = swatch + (LETTER * len(text) + 2.0) * size
        if x > size and x + length > width:
            x, y = size, y + 1.9 * size
        step = swatch / len(entry.light)
        # Wider than a step: between colours that only touch, a browser shows gaps.
        look = f'y="{y:.5g}" width="{1.1 * step:.4g}" height="{size:.4g}"'
        parts += [f'<rect x="{x + k * step:.5g}" {look} fill="{colour}"/>' for k, colour in enumerate(entry.light)]
        place = f'x="{x + swatch + 0.5 * size:.5g}" y="{y + 0.9 * size:.5g}" font-size="{size:.4g}"'
        parts.append(f'<text {place} fill="{LIGHT.ink}">{escape(text)}</text>')
        x += length
    return "".join(parts), y + 1.5 * size if entries else 0.0
