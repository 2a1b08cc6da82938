"""What is drawn: pictures of worlds and runs, and what browsers draw: frames as bytes, and the script that plays them.

Names are imported when they are first used.
"""

from importlib.resources import files
from typing import TYPE_CHECKING

from mesa_swarm.base.lazy import lazy_names

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.recording.frames import frame_of
    from mesa_swarm.viewing.figures import literal, make_plain, plain_figure, png, svg
    from mesa_swarm.viewing.palette import LIGHT
    from mesa_swarm.viewing.pictures import draw_world, legend_of, world_figure
    from mesa_swarm.viewing.run_pictures import trace
    from mesa_swarm.viewing.scene import scene_of

# Module: the public names that live in it.
_MODULES = {
    "recording.frames": "frame_of",
    "viewing.figures": "literal make_plain plain_figure png svg",
    "viewing.palette": "LIGHT",
    "viewing.pictures": "draw_world legend_of world_figure",
    "viewing.run_pictures": "trace",
    "viewing.scene": "scene_of",
}

__all__ = [
    "LIGHT",
    "draw_world",
    "frame_of",
    "legend_of",
    "literal",
    "make_plain",
    "plain_figure",
    "png",
    "scene_of",
    "svg",
    "trace",
    "world_figure",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)


def text_of(*names: str) -> str:
    """Return files of the package, one after the other: a widget is one module."""
    here = files("mesa_swarm")
    return "".join((here / name).read_text(encoding="utf-8") for name in names)
