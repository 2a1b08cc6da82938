"""What the engines need to know of the world around the robots."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import Marks, Statics


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The world without its robots.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
    shapes : sequence of Shape
        The obstacles and marks.
    fires : ndarray, shape (f, 3)
        x, y, radius of the fires.
    temperature : ndarray, shape (f,)
        Of the fires, as they are now; 0 once out.
    statics : Statics
    marks : Marks
    """

    bounds: tuple[float, float, float, float]
    shapes: Sequence[Shape]
    fires: np.ndarray
    temperature: np.ndarray
    statics: Statics
    marks: Marks

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
    ) -> "Scene":
        """Collect what stands still; `sight` and `touch` as `Statics.of` takes them."""
        statics = Statics.of(bounds, shapes, fires, temperature > 0, sight=sight, touch=touch)
        return cls(bounds, shapes, fires, temperature, statics, Marks.of(shapes))
