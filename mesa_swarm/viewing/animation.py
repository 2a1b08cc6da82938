"""Animated SVG of a recording."""

from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from math import ceil, floor, log10
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import shapely
from PIL import Image

from mesa_swarm.base.errors import ExportError, InvalidValueError
from mesa_swarm.base.files import write_whole
from mesa_swarm.base.progress import Progress, progress_bar
from mesa_swarm.recording.frames import Frame, field_levels
from mesa_swarm.viewing.legend import LegendEntry
from mesa_swarm.viewing.packing import MOST_PIXELS
from mesa_swarm.viewing.palette import LIGHT, fire_colour, kind_colour, scalar_pixels, value_colours, value_steps
from mesa_swarm.viewing.pictures import PART_OPACITY, USUAL, peaks_of, scaled, step_text
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.scene import looks_in
from mesa_swarm.world.fields import average_blocks
from mesa_swarm.world.shapes import Shape

# The caption is so high, as a share of the map's longer side.
CAPTION = 0.045
# Height of the texts above robots, pixels at the usual size.
LABEL = 11


@dataclass(frozen=True, kw_only=True, slots=True)
class Clock:
    """When the values of an animation are shown: the first at the beginning, the last at the end, then again."""

    moments: int  # number of values, at least 2
    seconds: float

    @property
    def _repeat(self) -> str:
        return f'dur="{self.seconds:.6g}s" repeatCount="indefinite"'

    def moving(self, kind: str, rows: np.ndarray, digits: int, added: bool = False) -> str:
        """Return what moves or turns an element evenly through rows of numbers; one value if they are all the same.

        The first animation of an element replaces its transform, so that all have to be there.
        """
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
        times = ";".join(f"{floor(1e5 * i / (self.moments - 1)) / 1e5:.5g}" for i in changes)
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
    found = list(moments)
    places: dict[int, list[tuple[int, int]]] = {}
    for moment, (ids, _) in enumerate(found):
        for row, number in enumerate(ids.tolist()):
            places.setdefault(number, []).append((moment, row))
    for number in sorted(places):
        values = np.array([found[moment][1][row] for moment, row in places[number]])
        present = np.zeros(len(found), bool)
        present[[moment for moment, _ in places[number]]] = True
        latest = np.maximum(np.cumsum(present) - 1, 0)
        yield ObjectTrack(number=number, values=values[latest], present=present)


def export_animation(drawn: PicturedSteps, path: Path, steps: Sequence[int], *, fps: float, progress: bool) -> None:
    """Write steps as an animated SVG that repeats, whole or not at all.

    Step i is shown i / fps seconds after the beginning, and between two steps robots move evenly.
    """
    if len(steps) < 2:
        raise InvalidValueError(f"an animation of step {steps[0]} alone does not move; choose two steps or more")
    with progress_bar(len(steps), "frames", progress) as bar:
        frames = [_noted(drawn.frame(step), bar) for step in steps]
    write_whole(path, Animation(drawn, frames, fps).text(), ExportError)


def _png_of(levels: np.ndarray, place: int) -> str:
    """Return a picture of a field as a PNG in base 64, its first row that of the field, at most `MOST_PIXELS`."""
    file = BytesIO()
    small = np.rint(average_blocks(levels, MOST_PIXELS)).astype(np.uint8)
    Image.fromarray(scalar_pixels(small, place), "RGBA").save(file, "PNG")
    return b64encode(file.getvalue()).decode()


def _noted(frame: Frame, bar: Progress) -> Frame:
    bar.update(1)
    return frame


class Animation:
    """The drawing of some frames."""

    def __init__(self, drawn: PicturedSteps, frames: list[Frame], fps: float) -> None:
        largest = peaks_of(frames[-1], drawn.scene)
        self._drawn, self._frames = drawn, [scaled(frame, drawn.scene, largest) for frame in frames]
        self._clock = Clock(moments=len(frames), seconds=(len(frames) - 1) / fps)
        x_min, y_min, x_max, y_max = drawn.scene.bounds
        self._size = x_max - x_min, y_max - y_min
        # A tenth of a pixel, at the usual size.
        self._digits = max(0, ceil(log10(10 * USUAL / max(self._size))))

    def text(self) -> str:
        """Return the whole drawing."""
        (width, height), caption = self._size, CAPTION * max(self._size)
        legend = self._legend(caption)
        total = height + caption + legend.height
        scale = USUAL / max(self._size)
        x_min, _, _, y_max = self._drawn.scene.bounds
        edge = 2 / scale
        box = self._numbers(-edge, -edge, width + 2 * edge, total + 2 * edge)
        pixels = round(width * scale) + 4, round(total * scale) + 4
        look = f'width="{pixels[0]}" height="{pixels[1]}" font-family="sans-serif"'
        turned = f"translate({self._numbers(-x_min, y_max + caption)}) scale(1 -1)"
        frame = f'<rect y="{caption:.6g}" width="{width:.6g}" height="{height:.6g}"'
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" {look}>',
            f"<title>{escape(self._title())}</title>",
            f'<rect x="{-edge:.6g}" y="{-edge:.6g}" width="100%" height="100%" fill="{LIGHT.field}"/>',
            f"<defs>{''.join(self._bodies())}</defs>",
            f'{frame} fill="{LIGHT.ground}"/>',
            f'<clipPath id="world">{frame}/></clipPath><g clip-path="url(#world)"><g transform="{turned}">',
            *self._fields(),
            *self._standing(),
            *self._discs(),
            *self._loads(small=False),
            *self._fires(),
            *self._robots(),
            *self._loads(small=True),
            *self._labels(scale),
            "</g></g>",
            *self._ruler(caption),
            f'{frame} fill="none" stroke="{LIGHT.border}" stroke-width="{width / USUAL:.3g}"/>',
            *self._caption(caption),
            f'<g transform="translate(0 {caption + height:.6g})">{legend.text}</g>' if legend.text else "",
            "</svg>",
        ]
        return "\n".join(part for part in parts if part) + "\n"

    def _title(self) -> str:
        return f"{self._drawn.scene.name}, steps {self._frames[0].step:,} to {self._frames[-1].step:,}"

    def _numbers(self, *numbers: float) -> str:
        return number_row(numbers, self._digits)

    def _ruler(self, caption: float) -> Iterator[str]:
        """Yield the scale bar, if the length of a metre is known."""
        scale = self._drawn.scene.scale
        if scale is None:
            return
        (width, height), size = self._size, 0.5 * caption
        length, text = scale.ruler(width)
        x, y, stroke = 0.04 * width, caption + 0.95 * height, f'stroke="{LIGHT.ink}" stroke-width="{size / 10:.3g}"'
        ends = f"M{x:.6g} {y - size / 4:.6g}v{size / 4:.6g}h{length:.6g}v{-size / 4:.6g}"
        words = f'<text x="{x + length / 2:.6g}" y="{y - size / 3:.6g}" font-size="{size:.4g}" text-anchor="middle"'
        yield f'<g class="ruler"><path fill="none" {stroke} d="{ends}"/>{words} fill="{LIGHT.ink}">{text}</text></g>'

    def _standing(self) -> Iterator[str]:
        scene = self._drawn.scene
        shown = [scene.obstacles(frame.step) for frame in self._frames]
        kinds_of = {id(scene.obstacles(frame.step)): scene.obstacle_kinds(frame.step) for frame in self._frames}
        for standing in {id(obstacles): obstacles for obstacles in shown}.values():
            when = self._clock.jumping("visibility", ["visible" if one is standing else "hidden" for one in shown])
            for label, colour, contact in (("marks", LIGHT.mark, False), ("obstacles", LIGHT.obstacle, True)):
                by_colour: dict[str, list[Shape]] = {}
                for shape, kind in zip(standing, kinds_of[id(standing)], strict=True):
                    if shape.contact is contact:
                        by_colour.setdefault(kind_colour(scene.looks, kind, colour), []).append(shape)
                for fill, shapes in by_colour.items():
                    outlines = "".join(self._outline(shape) for shape in shapes)
                    yield f'<path class="{label}" fill="{fill}" d="{outlines}">{when}</path>'

    def _fields(self) -> Iterator[str]:
        """Yield each picture of a field once; the group is turned upside down, as the rows of fields are."""
        x_min, y_min, _, _ = self._drawn.scene.bounds
        x, y, width, height = (self._numbers(length) for length in (x_min, y_min, *self._size))
        place_of = f'x="{x}" y="{y}" width="{width}" height="{height}" preserveAspectRatio="none"'
        for place, name in enumerate(self._drawn.scene.fields):
            levels = [field_levels(frame, name) for frame in self._frames]
            shown = [_png_of(one, place) if one.size else "" for one in levels]
            for picture in filter(None, dict.fromkeys(shown)):
                seen = ["visible" if one == picture else "hidden" for one in shown]
                when = self._clock.jumping("visibility", seen)
                yield f'<image class="field" {place_of} href="data:image/png;base64,{picture}">{when}</image>'

    def _discs(self) -> Iterator[str]:
        """Yield the discs of parts, each place of the table as a circle that is there where a step has it."""
        scene = self._drawn.scene
        tables = [scene.discs(frame) if scene.parts else np.empty((0, 4)) for frame in self._frames]
        for place in range(max(map(len, tables))):
            there = [len(table) > place for table in tables]
            rows = [table[place] if is_there else np.zeros(4) for table, is_there in zip(tables, there, strict=True)]
            values = {"visibility": ["visible" if is_there else "hidden" for is_there in there]}
            values["fill"] = [scene.parts[int(row[0])][1] for row in rows]
            values |= {name: [self._numbers(row[k]) for row in rows] for k, name in ((1, "cx"), (2, "cy"), (3, "r"))}
            look = " ".join(f'{name}="{states[0]}"' for name, states in values.items())
            changes = "".join(self._clock.jumping(name, states) for name, states in values.items())
            yield f'<circle class="part" fill-opacity="{PART_OPACITY}" {look}>{changes}</circle>'

    def _outline(self, shape: Shape) -> str:
        if shape.is_disc:
            (x, y), r = shape.position.tolist(), shape.radius
            # Clockwise as Shapely's outlines are: where two overlap, both must stay filled.
            left, right, radii = self._numbers(x - r, y), self._numbers(x + r, y), self._numbers(r, r)
            return f"M{left}A{radii} 0 0 0 {right}A{radii} 0 0 0 {left}Z"
        rings = [shape.geometry.exterior, *shape.geometry.interiors]
        points = [shapely.get_coordinates(ring)[:-1].tolist() for ring in rings]
        return "".join("M" + " ".join(self._numbers(*point) for point in ring) + "Z" for ring in points)

    def _loads(self, small: bool) -> Iterator[str]:
        scene = self._drawn.scene
        for track in self._tracks_of("loads", "load", ("x", "y", "heading")):
            if track.number in scene.forms and (track.number in scene.small) is small:
                shape = self._outline(scene.forms[track.number].shape_at((0.0, 0.0, 0.0)))
                colour = kind_colour(scene.looks, scene.kind_of_load[track.number], LIGHT.load)
                yield self._body(track, f'class="load" fill="{colour}"', "", f'<path d="{shape}"/>')

    def _fires(self) -> Iterator[str]:
        names = ("x", "y", "radius", "temperature", "out")
        for place, track in enumerate(self._tracks_of("fires", "fire", names), start=1):
            x, y, radius = track.values[0, :3]
            heat, out = np.clip(track.values[:, 3], 0, 1), track.values[:, 4] > 0
            colours = [LIGHT.ashes if dead else fire_colour(t) for t, dead in zip(heat, out, strict=True)]
            inks = [LIGHT.on_ashes if dead else LIGHT.on_fire for dead in out]
            rims = [LIGHT.border if dead else LIGHT.fire_rim for dead in out]
            at, r, size = self._numbers(x, y), self._numbers(radius), min(0.9 * radius, self._size[0] / 36)
            yield (
                f'<g class="fire" transform="translate({at}) scale(1 -1)">{self._shown(track)}'
                f'<circle r="{r}" fill="{colours[0]}" stroke="{rims[0]}" stroke-width="{radius / 20:.3g}">'
                f"{self._clock.jumping('fill', colours)}{self._clock.jumping('stroke', rims)}</circle>"
                f'<text font-size="{size:.3g}" text-anchor="middle" dy=".35em" fill="{inks[0]}">'
                f"{self._clock.jumping('fill', inks)}{place}</text></g>"
            )

    def _robots(self) -> Iterator[str]:
        facing = self._drawn.scene.facing
        rows = [np.column_stack([frame["position"], facing(frame), self._shades(frame)]) for frame in self._frames]
        radii = self._radii()
        for track in tracks(zip((frame.robots for frame in self._frames), rows, strict=True)):
            colours = [self._colours[int(shade)] for shade in track.values[:, 3]]
            radius = self._drawn.scene.radius_of(np.array([track.number]))[0]
            body = f'<use href="#body{radii.index(radius)}"/>'
            look = f'class="robot" data-robot="{track.number}" fill="{colours[0]}"'
            yield self._body(track, look, self._clock.jumping("fill", colours), body)

    @cached_property
    def _colours(self) -> tuple[str, ...]:
        """The colours of robots: the usual one, that of those too hot, and those of values."""
        looks = self._drawn.scene.looks
        values = value_colours(looks, "light") if "column" in looks else ()
        return kind_colour(looks, "robot", LIGHT.robot), LIGHT.robot_hot, *values

    def _shades(self, frame: Frame) -> np.ndarray:
        """Return the index of each robot's colour among `_colours`."""
        hot = frame["hot"].astype(int)
        if "value" not in self._drawn.scene.columns:
            return hot
        column, values = self._drawn.scene.looks["column"], looks_in(frame, self._drawn.scene)[0]
        steps = value_steps(values, column["low"], column["high"]).astype(int)
        return np.where(steps < 0, hot, steps + 2)

    def _labels(self, scale: float) -> Iterator[str]:
        """Yield the texts above robots, which stay upright; each is there while it is the robot's."""
        if "label" not in self._drawn.scene.columns:
            return
        texts: list[str] = [""]
        rows = [np.column_stack([frame["position"], self._places_of(frame, texts)]) for frame in self._frames]
        look = f'class="label" font-size="{LABEL / scale:.3g}" text-anchor="middle" fill="{LIGHT.ink}" '
        look += f'stroke="{LIGHT.ground}" stroke-width="{3 / scale:.3g}" paint-order="stroke"'
        for track in tracks(zip((frame.robots for frame in self._frames), rows, strict=True)):
            radius = self._drawn.scene.radius_of(np.array([track.number]))[0]
            numbers = np.where(track.present, track.values[:, 2], 0).astype(int).tolist()
            shown = [self._label(texts[number], numbers, number) for number in dict.fromkeys(numbers) if number]
            if shown:
                places = track.values[:, :2] + (0.0, radius + 3 / scale)
                moves = self._clock.moving("translate", places, self._digits)
                yield f'<g {look} transform="translate({self._numbers(*places[0])})">{moves}{"".join(shown)}</g>'

    def _places_of(self, frame: Frame, texts: list[str]) -> np.ndarray:
        """Return the place of each robot's text among all texts, to which new ones are added."""
        known = {text: place for place, text in enumerate(texts)}
        for text in map(str, looks_in(frame, self._drawn.scene)[1].tolist()):
            if known.setdefault(text, len(texts)) == len(texts):
                texts.append(text)
        return np.array([known[str(text)] for text in looks_in(frame, self._drawn.scene)[1].tolist()], float)

    def _label(self, text: str, numbers: Sequence[int], number: int) -> str:
        seen = ["visible" if one == number else "hidden" for one in numbers]
        return (
            f'<text transform="scale(1 -1)" visibility="{seen[0]}">{self._clock.jumping("visibility", seen)}'
            f"{escape(text)}</text>"
        )

    def _legend(self, caption: float) -> "_Strip":
        """Return what stands below the world, as on pages and in films."""
        return _Strip(self._drawn.scene.own_legend(self._frames[-1]), self._size[0], 0.36 * caption)

    def _body(self, track: ObjectTrack, look: str, changes: str, drawn: str) -> str:
        """Return something that moves and turns."""
        places, degrees = track.values[:, :2], np.degrees(np.unwrap(track.values[:, 2]))[:, None]
        start = f"translate({self._numbers(*places[0])}) rotate({number_row(degrees[0], 0)})"
        moves = self._clock.moving("translate", places, self._digits)
        turns = self._clock.moving("rotate", degrees, 0, added=True)
        return f'<g {look} transform="{start}">{moves}{turns}{changes}{self._shown(track)}{drawn}</g>'

    def _shown(self, track: ObjectTrack) -> str:
        return self._clock.jumping("visibility", ["visible" if there else "hidden" for there in track.present])

    def _tracks_of(self, table: str, number: str, names: Sequence[str]) -> Iterator[ObjectTrack]:
        if any(table not in frame.columns for frame in self._frames):
            return iter(())
        rows = (frame[table] for frame in self._frames)
        return tracks((row[number], np.column_stack([row[name] for name in names]).astype(float)) for row in rows)

    def _radii(self) -> list[float]:
        robots = np.unique(np.concatenate([frame.robots for frame in self._frames]))
        return np.unique(self._drawn.scene.radius_of(robots)).tolist()

    def _bodies(self) -> Iterator[str]:
        for place, r in enumerate(self._radii()):
            edge, line = f"{r / 14:.3g}", f"{r / 8:.3g}"
            front = f"M0 {-0.92 * r:.5g}A{0.92 * r:.5g} {0.92 * r:.5g} 0 0 1 0 {0.92 * r:.5g}Z"
            yield (
                f'<g id="body{place}"><circle r="{r:.5g}" stroke="{LIGHT.robot_outline}" stroke-width="{edge}"/>'
                f'<path d="{front}" fill="{LIGHT.robot_front}"/>'
                f'<path d="M0 0H{r:.5g}" stroke="{LIGHT.robot_outline}" stroke-width="{line}"/></g>'
            )

    def _caption(self, height: float) -> Iterator[str]:
        """Yield the name and the step, which is a strip of numbers that jumps up by one after the other."""
        width, size = self._size[0], 0.55 * height
        look = f'font-size="{size:.4g}" fill="{LIGHT.ink}"'
        yield f'<text x="{size / 2:.4g}" y="{0.7 * height:.4g}" {look}>{escape(self._drawn.scene.name)}</text>'
        jumps = [f"0 {-height * place:.6g}" for place in range(len(self._frames))]
        # Clipped by a group: a drawing within the drawing would have a clock of its own, which cannot be set.
        yield f'<clipPath id="line"><rect width="{width:.6g}" height="{height:.6g}"/></clipPath>'
        yield f'<g clip-path="url(#line)"><g {look} text-anchor="end">'
        yield self._clock.jumping("transform", jumps, "animateTransform", ' type="translate"')
        for place, frame in enumerate(self._frames):
            y, when = (place + 0.7) * height, step_text(frame.step, self._drawn.scene.scale)
            yield f'<text x="{width - size / 2:.6g}" y="{y:.6g}">{when}</text>'
        yield "</g></g>"


class _Strip:
    """The entries of a legend in rows, as SVG from (0, 0) on, and how high they are."""

    def __init__(self, entries: Sequence[LegendEntry], width: float, size: float) -> None:
        self._parts: list[str] = []
        x, y, row = size, size, 1.9 * size
        for entry in entries:
            sign = (1.2 if entry.form == "body" else 4.0) * size
            text = f"robot, {entry.text}" if entry.form == "value" else entry.text
            length = sign + (0.62 * len(text) + 2.0) * size
            if x > size and x + length > width:
                x, y = size, y + row
            self._parts.append(self._drawn(entry, x, y, sign, size))
            self._parts.append(
                f'<text x="{x + sign + 0.5 * size:.5g}" y="{y + 0.9 * size:.5g}" font-size="{size:.4g}" '
                f'fill="{LIGHT.ink}">{escape(text)}</text>'
            )
            x += length
        self.height = y + row - 0.4 * size if entries else 0.0
        self.text = "".join(self._parts)

    def _drawn(self, entry: LegendEntry, x: float, y: float, width: float, size: float) -> str:
        step = width / len(entry.light)
        return "".join(
            f'<rect x="{x + place * step:.5g}" y="{y:.5g}" width="{1.1 * step:.4g}" height="{size:.4g}" '
            f'fill="{colour}"/>'
            for place, colour in enumerate(entry.light)
        )
