"""Pictures of a world as arrays of pixels, with NumPy alone, and a window that shows them, with pygame."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from mesa_swarm.base.errors import check_choice
from mesa_swarm.environments.registration import need_learning_package
from mesa_swarm.maps.map import Map
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.palette import LIGHT, fire_steps, rgb
from mesa_swarm.world.shapes import Shape

METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 50}
LONGEST_SIDE = 640
MOST_CAMERAS = 32

Pair = tuple[float, float]
GROUND, SOLID, MARK, MOVED = map(rgb, (LIGHT.ground, LIGHT.obstacle, LIGHT.mark, LIGHT.load))
ASHES = rgb(LIGHT.ashes)
COOL, HOT, FRONT, RIM = map(rgb, (LIGHT.robot, LIGHT.robot_hot, LIGHT.robot_front, LIGHT.robot_outline))
# Fires go from black to red with their temperature.
FIRE = np.array([rgb(colour) for colour in LIGHT.fire])


def checked_mode(render_mode: str | None) -> str | None:
    """Return a valid render mode: "rgb_array", "human" or None."""
    return None if render_mode is None else check_choice("render_mode", render_mode, METADATA["render_modes"])


class Display:
    """What `render` of an environment does: returns pictures, or shows them in a window.

    Parameters
    ----------
    render_mode : "rgb_array", "human" or None

    Examples
    --------
    >>> Display("rgb_array").render(SwarmModel(map="sparse", rng=1)).shape
    (480, 640, 3)
    """

    def __init__(self, render_mode: str | None) -> None:
        self._human = render_mode == "human"
        if self._human:
            need_learning_package("pygame")
        self._cameras: list[Camera] = []
        self._window: Any = None
        self._clock: Any = None

    def show(self, world: SwarmModel) -> None:
        """Show the world, 50 steps a second, if the mode is "human"."""
        if self._human:
            self._draw(self._camera(world.map).picture(world))

    def render(self, world: SwarmModel) -> np.ndarray | None:
        """Return a picture of the world, uint8, shape (height, width, 3), or show it."""
        picture = self._camera(world.map).picture(world)
        if not self._human:
            return picture
        self._draw(picture)
        return None

    def close(self) -> None:
        """Close the window; what is shown next opens another one."""
        if self._window is not None:
            import pygame  # noqa: PLC0415 - optional

            pygame.display.quit()
            self._window = None

    def _draw(self, picture: np.ndarray) -> None:
        import pygame  # noqa: PLC0415 - optional

        height, width, _ = picture.shape
        if self._window is None or self._window.get_size() != (width, height):
            pygame.display.init()
            self._window, self._clock = pygame.display.set_mode((width, height)), pygame.time.Clock()
            pygame.display.set_caption("mesa_swarm")
        pygame.event.pump()  # or the window would count as frozen
        pygame.surfarray.blit_array(self._window, picture.swapaxes(0, 1))
        pygame.display.flip()
        self._clock.tick(METADATA["render_fps"])

    def _camera(self, map: Map) -> "Camera":
        """Return the camera for a map; those of the last maps are kept, whose grounds are drawn."""
        for camera in self._cameras:
            if camera.map is map:
                return camera
        self._cameras = [*self._cameras[1 - MOST_CAMERAS :], Camera(map)]
        return self._cameras[-1]


class Camera:
    """Takes pictures of worlds on one map, everything to scale, y up; the longest side is given in pixels.

    The front half of a robot is pale, its back blue, or orange while it is too hot to fight; where only some robots are
    commanded, these have a dark rim. Fires go from black to red with their temperature and are pale once they are out.
    So does what else radiates. Other bodies that a task adds have the colour of loads, or of marks if they are marks on
    the ground.
    """

    def __init__(self, map: Map, longest_side: int = LONGEST_SIDE) -> None:
        self.map = map
        self._scale = longest_side / max(map.width, map.height)
        self._size = tuple(max(round(side * self._scale), 1) for side in (map.height, map.width))
        self._ground: np.ndarray | None = None
        self._drawn: Sequence[Shape] = ()

    def picture(self, world: SwarmModel) -> np.ndarray:
        """Return the world as it is, uint8, shape (height, width, 3)."""
        bodies = world.obstacle_list
        shapes = [body.shape for body in bodies]
        of_map, added = self._divided(shapes)
        if self._ground is None or of_map != self._drawn:
            self._ground, self._drawn = self._drawn_ground(of_map), of_map
        pixels = self._ground.copy()
        for shape in sorted(added, key=lambda shape: shape.contact):  # ground marks below what is moved
            self._fill(pixels, shape, MOVED if shape.contact else MARK)
        for body in bodies:
            if (heat := body.temperature) is not None:
                self._fill(pixels, body.shape, FIRE[fire_steps(heat)])
        fires, robots = world.fires.columns, world.swarm.columns
        colours = np.where(fires["out"][:, None], ASHES, FIRE[fire_steps(fires["temperature"])])
        for centre, radius, colour in zip(fires["position"], fires["radius"], colours, strict=True):
            self._disc(pixels, centre, radius, colour)
        commanded, roster = getattr(world, "commanded", 0), getattr(world, "roster", None)
        if roster is not None:
            commanded = roster().remaining(commanded)
        for i in range(len(world.swarm)):
            self._robot(pixels, robots, i, rim=i < commanded < len(world.swarm))
        return pixels[::-1].round().astype(np.uint8)

    def _divided(self, shapes: Sequence[Shape]) -> tuple[Sequence[Shape], Sequence[Shape]]:
        """Return the shapes of the map's own obstacles that are still there, and the others."""
        own = self.map.obstacles
        if all(shape is first for shape, first in zip(own, shapes, strict=False)) and len(shapes) >= len(own):
            return own, shapes[len(own) :]
        still = tuple(shape for shape in own if shape in shapes)
        return still, [shape for shape in shapes if shape not in still]

    def _robot(self, pixels: np.ndarray, robots: dict[str, np.ndarray], i: int, *, rim: bool) -> None:
        centre, radius, heading = robots["position"][i], robots["radius"][i], robots["heading"][i]
        if rim:
            self._disc(pixels, centre, 1.5 * radius, RIM)
        self._disc(pixels, centre, radius, HOT if robots["hot"][i] else COOL)
        self._disc(pixels, centre, radius, FRONT, ahead=(np.cos(heading), np.sin(heading)))

    def _disc(
        self, pixels: np.ndarray, centre: np.ndarray, radius: float, colour: np.ndarray, ahead: Pair | None = None
    ) -> None:
        """Blend a disc into the pixels, or the half of it that is ahead; edges are as soft as a pixel is wide."""
        x, y = (np.asarray(centre) - self.map.bounds[:2]) * self._scale
        size = radius * self._scale
        rows, columns = (_span(at, size, most) for at, most in zip((y, x), self._size, strict=True))
        dy, dx = np.arange(*rows)[:, None] + 0.5 - y, np.arange(*columns) + 0.5 - x
        cover = np.clip(size + 0.5 - np.hypot(dx, dy), 0.0, 1.0)
        if ahead is not None:
            cover *= np.clip(dx * ahead[0] + dy * ahead[1] + 0.5, 0.0, 1.0)
        window = pixels[slice(*rows), slice(*columns)]
        window += cover[..., None] * (np.asarray(colour) - window)

    def _drawn_ground(self, obstacles: Sequence[Shape]) -> np.ndarray:
        pixels = np.full((*self._size, 3), GROUND, np.float32)
        for shape in sorted(obstacles, key=lambda shape: shape.contact):  # ground marks below obstacles
            self._fill(pixels, shape, SOLID if shape.contact else MARK)
        return pixels

    def _fill(self, pixels: np.ndarray, shape: Shape, colour: np.ndarray) -> None:
        if shape.is_disc:
            self._disc(pixels, shape.position, shape.radius, colour)
            return
        x, y = ((np.arange(n) + 0.5) / self._scale for n in self._size[::-1])
        x_min, y_min = self.map.bounds[:2]
        shapely.prepare(shape.geometry)
        pixels[shapely.contains_xy(shape.geometry, *np.meshgrid(x + x_min, y + y_min))] = colour


def _span(at: float, size: float, most: int) -> tuple[int, int]:
    """Return the first pixel that a disc may touch in one direction, and one past the last."""
    return max(int(at - size - 1), 0), max(min(int(at + size + 2), most), 0)
