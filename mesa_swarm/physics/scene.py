"""What the engines need to know of the world around the robots."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.physics.room import Room
from mesa_swarm.world.form import Pose
from mesa_swarm.world.load import Load
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import Marks, Statics

# How far loads may move before they are listed anew, in radii of the largest robot; and how far in one step.
SLACK = 4.0
STEP = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The world without its robots.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
    shapes : list of Shape
        The obstacles, loads and marks, as they are now.
    fires : ndarray, shape (f, 3)
        x, y, radius of the fires.
    temperature : ndarray, shape (f,)
        Of the fires, as they are now; 0 once out.
    statics : Statics
    marks : Marks
    loads : tuple of Load
    rows : tuple of int
        Index in `shapes` of each load.
    listed : tuple of Pose
        Where each load was when it was listed.
    slack : float
        How far from there loads may move, map units.
    room : Room or None
        What loads may not overlap; None where there are none.
    """

    bounds: tuple[float, float, float, float]
    shapes: list[Shape]
    fires: np.ndarray
    temperature: np.ndarray
    statics: Statics
    marks: Marks
    loads: tuple[Load, ...] = ()
    rows: tuple[int, ...] = ()
    listed: tuple[Pose, ...] = ()
    slack: float = 0.0
    room: Room | None = None

    @classmethod
    def of(
        cls,
        bounds: tuple[float, float, float, float],
        shapes: Sequence[Shape],
        fires: np.ndarray,
        temperature: np.ndarray,
        *,
        sight: float,
        touch: float,
        loads: Sequence[tuple[int, Load]] = (),
    ) -> "Scene":
        """Collect what stands still; `sight` and `touch` as `Statics.of` takes them, loads with their indices."""
        rows, bodies = tuple(row for row, _ in loads), tuple(load for _, load in loads)
        slack, solid = SLACK * touch, list(shapes)
        for row, load in loads:
            solid[row] = load.form.body_at(load.pose)
        statics = Statics.of(bounds, solid, fires, temperature > 0, sight=sight, touch=touch, loads=rows, slack=slack)
        return cls(
            bounds,
            list(shapes),
            fires,
            temperature,
            statics,
            Marks.of(shapes),
            bodies,
            rows,
            tuple(load.pose for load in bodies),
            slack - STEP * touch,
            Room.of(statics, bodies) if loads else None,
        )

    @property
    def is_worn(self) -> bool:
        """Whether a load has moved so far that the scene has to be made anew before the next step."""
        moved = zip(self.loads, self.listed, strict=True)
        return any(load.farthest_from(pose) > self.slack for load, pose in moved)

    def follow(self, k: int) -> None:
        """Take note that load k lies elsewhere now."""
        row, load = self.rows[k], self.loads[k]
        self.shapes[row] = load.shape
        self.statics.follow(row, load.form.body_at(load.pose))
