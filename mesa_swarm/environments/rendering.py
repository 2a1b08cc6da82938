"""Pictures of a scene as arrays of pixels, with NumPy alone, and a window that shows them, with pygame."""

from typing import Any

import numpy as np
import shapely

from mesa_swarm.base.errors import check_choice
from mesa_swarm.environments.registration import need_learning_package
from mesa_swarm.maps.map import Map
from mesa_swarm.recording.frames import Frame, field_levels, frame_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.palette import LIGHT, rgb, scalar_pixels
from mesa_swarm.viewing.scene import PART_OPACITY, Scene, scene_of
from mesa_swarm.world.shapes import Shape

METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 50}
LONGEST_SIDE = 640
MOST_CAMERAS = 32

Pair = tuple[float, float]
Coloured = tuple[Shape, str]
GROUND, FRONT, RIM = map(rgb, (LIGHT.ground, LIGHT.robot_front, LIGHT.robot_outline))
# None of readings: sensors would be read once more.
DRAWN = ("position", "heading", "hot", "command", "fires", "loads", "fields", "shown")


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
    """Takes pictures of worlds on one map, as every other view shows them, to scale, y up.

    Kinds, values of robots, fields and discs of parts have the colours that the model declares; sectors and texts are
    left out. Where only some robots are commanded, these have a dark rim.

    Parameters
    ----------
    map : Map
    longest_side : int
        Of the picture, pixels.
    """

    def __init__(self, map: Map, longest_side: int = LONGEST_SIDE) -> None:
        self.map = map
        self._scale = longest_side / max(map.width, map.height)
        self._size = tuple(max(round(side * self._scale), 1) for side in (map.height, map.width))
        self._ground = np.empty((0, 0, 3), np.float32)
        self._drawn: list[Coloured] | None = None

    def picture(self, world: SwarmModel) -> np.ndarray:
        """Return the world as it is, uint8, shape (height, width, 3)."""
        frame, scene = frame_of(world, DRAWN), scene_of(world)
        standing = scene.standing(frame.step)
        if standing != self._drawn:
            self._ground, self._drawn = self._drawn_ground(standing), standing
        pixels = self._on_fields(frame, scene) if scene.fields else self._ground.copy()
        self._loads(pixels, frame, scene, small=False)
        for place, x, y, radius in scene.discs(frame).tolist():
            self._disc(pixels, (x, y), radius, rgb(scene.parts[int(place)][1]), cover=PART_OPACITY)
        fires = scene.fires(frame)
        for (x, y, _), radius, colour in zip(fires.poses, fires.radii, fires.colours[:, 0], strict=True):
            self._disc(pixels, (x, y), radius, rgb(colour))
        robots = scene.robots(frame)
        for i, (pose, radius, colour) in enumerate(zip(robots.poses, robots.radii, robots.colours[:, 0], strict=True)):
            self._robot(pixels, pose, radius, rgb(colour), rim=i < _commanded(world) < len(robots.ids))
        self._loads(pixels, frame, scene, small=True)
        return np.rint(pixels[::-1], out=pixels[::-1]).astype(np.uint8)

    def _loads(self, pixels: np.ndarray, frame: Frame, scene: Scene, *, small: bool) -> None:
        """Draw loads: those that a robot which carries one would hide, or the others."""
        loads = scene.loads(frame)
        for load, pose, colour in zip(loads.ids.tolist(), loads.poses.tolist(), loads.colours[:, 0], strict=True):
            if (load in scene.small) is small:
                self._fill(pixels, scene.forms[load].shape_at(tuple(pose)), rgb(colour))

    def _robot(self, pixels: np.ndarray, pose: np.ndarray, radius: float, colour: np.ndarray, *, rim: bool) -> None:
        x, y, facing = pose
        if rim:
            self._disc(pixels, (x, y), 1.5 * radius, RIM)
        self._disc(pixels, (x, y), radius, colour)
        self._disc(pixels, (x, y), radius, FRONT, ahead=(np.cos(facing), np.sin(facing)))

    def _disc(
        self,
        pixels: np.ndarray,
        centre: Pair,
        radius: float,
        colour: np.ndarray,
        *,
        ahead: Pair | None = None,
        cover: float = 1.0,
    ) -> None:
        """Blend a disc into the pixels, or the half of it that is ahead; edges are as soft as a pixel is wide."""
        x, y = (np.asarray(centre) - self.map.bounds[:2]) * self._scale
        size = radius * self._scale
        rows, columns = (_span(at, size, most) for at, most in zip((y, x), self._size, strict=True))
        dy, dx = np.arange(*rows)[:, None] + 0.5 - y, np.arange(*columns) + 0.5 - x
        shares = cover * np.clip(size + 0.5 - np.hypot(dx, dy), 0.0, 1.0)
        if ahead is not None:
            shares *= np.clip(dx * ahead[0] + dy * ahead[1] + 0.5, 0.0, 1.0)
        window = pixels[slice(*rows), slice(*columns)]
        window += shares[..., None] * (np.asarray(colour) - window)

    def _drawn_ground(self, standing: list[Coloured]) -> np.ndarray:
        pixels = np.full((*self._size, 3), GROUND, np.float32)
        for shape, colour in sorted(standing, key=lambda pair: pair[0].contact):  # ground marks below obstacles
            self._fill(pixels, shape, rgb(colour))
        return pixels

    def _on_fields(self, frame: Frame, scene: Scene) -> np.ndarray:
        """Return the ground with fields below all that stands on it."""
        pixels = np.full_like(self._ground, GROUND)
        for place, name in enumerate(scene.fields):
            coloured = scalar_pixels(field_levels(frame, name), place)
            if coloured.size:  # the field may have been removed
                cells = (np.arange(n) * of // n for n, of in zip(self._size, coloured.shape, strict=False))
                shown = coloured[np.ix_(*cells)].astype(np.float32)
                pixels += shown[..., 3:] / 255 * (shown[..., :3] - pixels)
        is_bare = (self._ground == GROUND).all(axis=2, keepdims=True)
        return np.where(is_bare, pixels, self._ground)

    def _fill(self, pixels: np.ndarray, shape: Shape, colour: np.ndarray) -> None:
        if shape.is_disc:
            x, y = shape.position
            self._disc(pixels, (x, y), shape.radius, colour)
            return
        x, y = ((np.arange(n) + 0.5) / self._scale for n in self._size[::-1])
        x_min, y_min = self.map.bounds[:2]
        shapely.prepare(shape.geometry)
        pixels[shapely.contains_xy(shape.geometry, *np.meshgrid(x + x_min, y + y_min))] = colour


def _commanded(world: SwarmModel) -> int:
    """Return how many robots of a world are commanded and still there, the first ones; 0 in other models."""
    roster = getattr(world, "roster", None)
    commanded = getattr(world, "commanded", 0)
    return commanded if roster is None else roster().remaining(commanded)


def _span(at: float, size: float, most: int) -> tuple[int, int]:
    """Return the first pixel that a disc may touch in one direction, and one past the last."""
    return max(int(at - size - 1), 0), max(min(int(at + size + 2), most), 0)
