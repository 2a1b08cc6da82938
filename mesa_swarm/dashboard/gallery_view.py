# ruff: noqa: N802 - Solara's components are named like classes
"""The gallery: every model with a picture of it and one line."""

import threading
from collections.abc import Callable
from functools import cache

import numpy as np
import reacton.ipyvuetify as rv
import solara

from mesa_swarm.dashboard.drawing import draw_fires, draw_loads, draw_robots, draw_shapes, drawing
from mesa_swarm.gallery import description, find_model, model_names
from mesa_swarm.model import SwarmModel
from mesa_swarm.world.load import Load

# Pictures show models after so many steps, when something can be seen of what they do.
STEPS = 800
# In so small a picture robots to scale are specks.
LARGER = 1.4
_DRAWING = threading.Lock()


@cache
def thumbnail(name: str) -> str:
    """Return a picture of a model as SVG, drawn once in the life of the program.

    Examples
    --------
    >>> thumbnail("fire_fighting").startswith("<svg")
    True
    """
    return drawn(find_model(name)(rng=1).run(STEPS))


def drawn(model: SwarmModel) -> str:
    """Return a drawing of a model as SVG: shapes, loads, fires, robots."""
    x_min, y_min, x_max, y_max = model.map.bounds
    corner, swarm, fires = np.array([x_min, y_min]), model.swarm, model.fires
    layers = [
        draw_shapes([body.shape for body in model.obstacle_list if not isinstance(body, Load)], corner),
        draw_loads([load.shape for load in model.loads], corner),
        draw_fires(fires.position - corner, fires.radius, fires.temperature, fires.out),
        draw_robots(swarm.position - corner, swarm.heading, LARGER * swarm.radius),
    ]
    return drawing((x_max - x_min, y_max - y_min), layers)


def title(name: str) -> str:
    """Return a model's name as people write it.

    Examples
    --------
    >>> title("fire_fighting")
    'Fire fighting'
    """
    return name.replace("_", " ").capitalize()


@solara.component
def Gallery(chosen: str, on_choose: Callable[[str], None]) -> None:
    """Show all models; one that is pressed is chosen.

    Parameters
    ----------
    chosen : str
        The model that is marked.
    on_choose : function
        Called with the name of a model.
    """
    none_yet: dict[str, str] = {}
    pictures, set_pictures = solara.use_state(none_yet)
    solara.use_effect(lambda: _drawing_thread(set_pictures), [])
    with solara.Div(classes=["swarm-gallery"]):
        for name in model_names():
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
    """Draw what is not yet drawn, and hand each picture over; return what stops it."""
    stop = threading.Event()

    def draw() -> None:
        pictures: dict[str, str] = {}
        for name in model_names():
            with _DRAWING:
                if stop.is_set():
                    return
                pictures = {**pictures, name: thumbnail(name)}
            set_pictures(pictures)

    threading.Thread(target=draw, name="gallery", daemon=True).start()
    return stop.set
