"""Pictures of the models of the gallery, one at rest and one moving, which come with the package.

``python -m mesa_swarm.dashboard.gallery.gallery_pictures`` makes them anew, the models named after it only.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

from mesa_swarm.base.errors import check_choice
from mesa_swarm.base.files import write_whole
from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording.frames import PICTURED, frame_of
from mesa_swarm.viewing.drawing import Window, WorldDrawing, scene_of_all
from mesa_swarm.viewing.scene import scene_of

FOLDER = Path(__file__).parent / "pictures"
KIND = "image/svg+xml"
# Of the paths at which the server has moving pictures.
PREFIX = "/gallery/"
# A moving picture has this many moments, the first and the last included, and lasts this long.
MOMENTS = 31
SECONDS = 5.0
# Moments before the first one, through which trails lead.
EARLIER = 12
# Height of a picture as a share of its width.
HEIGHT = 0.75
# Bytes of one picture, and of all.
LARGEST_STILL, LARGEST_MOVING, LARGEST_ALL = 40_000, 150_000, 3_000_000


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """The moment and the part of its world in which a model shows best what it is.

    Parameters
    ----------
    start : int
        The step of the picture at rest, with which the moving one begins.
    steps : int
        That the moving picture covers, a multiple of 30.
    window : tuple of 3 float
        Left, bottom and width of what is drawn, map units; it is three quarters as high.
    settings : dict
        Parameters of the model that are not its defaults.
    seed : int
    marked : str
        The column of robots of which those above 0 are drawn in a second colour.
    larger : float
        How many times larger than to scale robots are drawn.
    trail : float
        Length of the trail behind each robot, map units.
    """

    start: int
    steps: int
    window: tuple[float, float, float]
    settings: dict[str, Any] = field(default_factory=dict)
    seed: int = 1
    marked: str = "hot"
    larger: float = 1.0
    trail: float = 0.0

    @property
    def part(self) -> Window:
        """The part of the map that is drawn."""
        left, bottom, width = self.window
        return left, bottom, width, HEIGHT * width


SHOTS = {
    "agglomeration": Shot(start=150, steps=240, window=(240, 10, 320), settings={"n_robots": 120}, trail=60),
    "ant_trails": Shot(start=3000, steps=300, window=(255, 165, 420), larger=1.3),
    "best_of_n": Shot(start=1500, steps=300, window=(100, 0, 400), marked="act.opinion", trail=40),
    "boids": Shot(start=900, steps=150, window=(340, 10, 320), trail=40),
    "chain_formation": Shot(start=900, steps=150, window=(190, 150, 320), trail=30),
    "collision_avoidance": Shot(start=500, steps=300, window=(130, 30, 400), settings={"n_robots": 50}, trail=60),
    "cooperative_transport": Shot(
        start=690, steps=150, window=(420, 230, 320), settings={"n_robots": 20, "load": "box"}, seed=2, trail=40
    ),
    "fire_fighting": Shot(start=480, steps=300, window=(325, 252, 345), settings={"n_robots": 20}, trail=40),
    "flocking": Shot(start=1000, steps=300, window=(60, 40, 320), settings={"n_robots": 100}, trail=60),
    "foraging": Shot(start=300, steps=300, window=(60, 60, 300), larger=1.2, trail=60),
    "learning_fires": Shot(start=3000, steps=300, window=(220, 190, 340), settings={"n_robots": 12}, trail=40),
    "perimeter": Shot(start=220, steps=180, window=(90, 90, 460), settings={"n_robots": 30}, larger=1.3, trail=80),
    "puck_clustering": Shot(start=600, steps=150, window=(0, 0, 120)),
    "q_learning": Shot(start=9000, steps=300, window=(380, 120, 400), settings={"n_robots": 40}, trail=60),
    "shepherding": Shot(start=115, steps=90, window=(590, 745, 290), larger=1.3, trail=60),
    "signposts": Shot(start=900, steps=300, window=(200, 100, 420), trail=60),
    "task_allocation": Shot(
        start=600, steps=300, window=(200, 150, 320), settings={"n_robots": 120}, marked="act.work", trail=60
    ),
}


def still_of(name: str) -> tuple[bytes, str]:
    """Return the picture at rest of a model of the gallery, and its content type.

    Parameters
    ----------
    name : str
        Of a model of the gallery.

    Examples
    --------
    >>> content, kind = still_of("boids")
    >>> content[:4], kind
    (b'<svg', 'image/svg+xml')
    """
    return _file_of(name, "").read_bytes(), KIND


def moving_of(name: str) -> tuple[bytes, str]:
    """Return the moving picture of a model of the gallery, and its content type; it begins with the one at rest.

    Parameters
    ----------
    name : str
        Of a model of the gallery.

    Examples
    --------
    >>> content, _ = moving_of("boids")
    >>> b"animateTransform" in content
    True
    """
    return _file_of(name, "_moving").read_bytes(), KIND


@cache
def picture_address(name: str) -> str:
    """Return the address of a model's moving picture relative to the page; it changes with the picture."""
    return f"{PREFIX[1:]}{name}.svg?v={blake2b(moving_of(name)[0], digest_size=6).hexdigest()}"


def picture_at(path: str) -> tuple[bytes, str] | None:
    """Return the moving picture that the server has at a path, and its content type; None if there is none."""
    names = [name for name in SHOTS if path == f"{PREFIX}{name}.svg"]
    return moving_of(names[0]) if names else None


def _file_of(name: str, kind: str) -> Path:
    return FOLDER / f"{check_choice('model', name, SHOTS)}{kind}.svg"


def draw_both(name: str) -> tuple[str, str]:
    """Return the picture at rest and the moving one, drawn anew."""
    drawing = drawing_of(name, moments=MOMENTS)
    return drawing.first().text(), drawing.text()


def drawing_of(name: str, moments: int) -> WorldDrawing:
    """Run a model, and return the drawing of its moments; a model that ends before stands still."""
    shot = SHOTS[name]
    model, every = find_model(name)(**shot.settings, rng=shot.seed), shot.steps // (MOMENTS - 1)
    earlier = min(EARLIER, shot.start // every) if shot.trail else 0
    model.run(shot.start - earlier * every)
    columns = list(dict.fromkeys((*PICTURED, shot.marked)))
    frames, scenes = [], []
    for place in range(earlier + moments):
        model.run(every if place else 0)
        frames.append(frame_of(model, columns))
        scenes.append(scene_of(model))
    return WorldDrawing(
        frames=frames[earlier:],
        before=frames[:earlier],
        scene=scene_of_all(scenes),
        seconds=SECONDS,
        name=name,
        window=shot.part,
        marked=shot.marked,
        larger=shot.larger,
        trail=shot.trail,
    )


def main(names: Sequence[str]) -> None:
    """Make the pictures of these models, of all if none is named."""
    FOLDER.mkdir(exist_ok=True)
    for name in names or SHOTS:
        for kind, text in zip(("", "_moving"), draw_both(name), strict=True):
            path = _file_of(name, kind)
            write_whole(path, text)
            print(f"{path.name}: {len(text):,} bytes")


if __name__ == "__main__":
    main(sys.argv[1:])
