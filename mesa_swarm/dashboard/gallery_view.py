"""All models, each with a picture and one line.

Coordinates are relative to the map's lower left corner, y up, in one group that turns y round. All robots
share one path per colour, so that a browser draws a dozen elements, not a thousand.
"""

import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache

import numpy as np
import reacton.ipyvuetify as rv
import solara

from mesa_swarm.dashboard import page_models
from mesa_swarm.gallery import description, find_model, short_name
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.palette import DARK, LIGHT, Palette, fire_colour
from mesa_swarm.world.shapes import Shape

HALF_DISC = "M%.5g %.5gA%.5g %.5g 0 0 1 %.5g %.5gZ"
STROKE = "M%.5g %.5gL%.5g %.5g"
LINE = 'stroke-width="1" vector-effect="non-scaling-stroke"'


def drawing(size: tuple[float, float], layers: Iterable[str]) -> str:
    """Return a whole drawing of a map of this width and height; layers have y up, and the lowest is the first."""
    width, height = (f"{length:.5g}" for length in size)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
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


def draw_robots(position: np.ndarray, heading: np.ndarray, radius: np.ndarray) -> str:
    """Return robots as discs to scale, the front half light, with a line towards the heading."""
    ahead = radius[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    radii = np.column_stack([radius, radius])
    halves = [np.hstack([position + side, radii, position - side]) for side in (left, -left)]
    edge = f'stroke="{LIGHT.robot_outline}" {LINE}'
    return (
        _path("rear", _outlines(HALF_DISC, halves[0]), f'fill="{LIGHT.robot}" {edge}')
        + _path("front", _outlines(HALF_DISC, halves[1]), f'fill="{LIGHT.robot_front}" {edge}')
        + _path("heading", _outlines(STROKE, np.hstack([position, position + ahead])), f'fill="none" {edge}')
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


# Steps before the picture of a model, so that its behaviour is visible.
STEPS = 800
# Robots are larger than to scale, so that they are visible in so small a picture.
LARGER = 1.4
_DRAWING = threading.Lock()


@cache
def thumbnail(name: str) -> str:
    """Return a picture of a model as SVG, drawn once in the life of the program; of one that fails its world."""
    try:
        model = find_model(name)(rng=1)
    except Exception:  # a model of a user's may raise anything
        return ""
    with suppress(Exception):
        model.run(STEPS)
    return drawn(model)


def drawn(model: SwarmModel) -> str:
    """Return a drawing of a model as SVG: shapes, loads, fires, robots."""
    x_min, y_min, x_max, y_max = model.map.bounds
    corner, swarm, fires = np.array([x_min, y_min]), model.swarm, model.fires
    layers = [
        draw_shapes([body.shape for body in model.obstacle_list if body.mode == "fixed"], corner),
        draw_loads([body.shape for body in model.displaced], corner),
        draw_fires(fires.position - corner, fires.radius, fires.temperature, fires.out),
        draw_robots(swarm.position - corner, swarm.heading, LARGER * swarm.radius),
    ]
    return drawing((x_max - x_min, y_max - y_min), layers)


def title(name: str) -> str:
    """Return a model's name as a title."""
    return short_name(name).replace("_", " ").capitalize()


@solara.component
def Gallery(chosen: str, on_choose: Callable[[str], None]) -> None:
    """Show all models as buttons."""
    none_yet: dict[str, str] = {}
    pictures, set_pictures = solara.use_state(none_yet)
    solara.use_effect(lambda: _drawing_thread(set_pictures), [])
    with solara.Div(classes=["swarm-gallery"]):
        for name in page_models():
            Card(name, pictures.get(name, ""), name == chosen, on_choose).key(name)


@solara.component
def Card(name: str, picture: str, chosen: bool, on_choose: Callable[[str], None]) -> None:
    """Show one model as a button."""
    with rv.Html(
        tag="button", class_="swarm-card swarm-chosen" if chosen else "swarm-card", attributes={"type": "button"}
    ) as card:
        solara.HTML(classes=["swarm-picture"], unsafe_innerHTML=picture)
        rv.Html(tag="strong", children=[title(name)])
        rv.Html(tag="span", children=[description(find_model(name))])
    rv.use_event(card, "click", lambda *_: on_choose(name))


def _drawing_thread(set_pictures: Callable[[dict], None]) -> Callable[[], None]:
    """Draw the missing pictures in a thread, and pass on each; return a function that stops it."""
    stop = threading.Event()

    def draw() -> None:
        pictures: dict[str, str] = {}
        for name in page_models():
            with _DRAWING:
                if stop.is_set():
                    return
                pictures = {**pictures, name: thumbnail(name)}
            set_pictures(pictures)

    threading.Thread(target=draw, name="gallery", daemon=True).start()
    return stop.set
