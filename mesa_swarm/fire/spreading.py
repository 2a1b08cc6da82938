"""Spreading: the process by which burning fires ignite new ones nearby."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesa_swarm.base.errors import check_count, check_number
from mesa_swarm.kernels.elementary import direction_of, vector_lengths
from mesa_swarm.maps.map import RADIUS_OF_UNIT_AREA
from mesa_swarm.world.movers import find_occupied_room
from mesa_swarm.world.shapes import disc

MOST_FIRES = 10_000


@dataclass(frozen=True, kw_only=True, slots=True)
class Spreading:
    """The process by which fires throw sparks, which ignite new fires where they fall on free ground.

    In each step each fire throws a spark with probability `rate` times its temperature: in any direction, to a gap
    between the two fires that is drawn uniformly from 0 to `reach`. A spark that falls on a body, fixed, pushed or
    driven, on the way that a driven one has been sent, on a fire, a burnt place, a robot or beyond the map goes out.
    Bodies that robots carry stop no sparks. What has burnt out never burns again. Fires do not spread in the thesis.

    Parameters
    ----------
    rate : float
        Probability of a spark of a fire at T = 1 in a step, 0 to 1.
    reach : float
        Largest gap between the edges of a fire and the one that it ignites, map units, 0 to 1,000,000.
    area, temperature : float
        Of new fires; above 0, the temperature at most 1.
    most : int
        Fires that may burn at once: no more are ignited, 0 to 10,000.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm.fire import Spreading
    >>> model = SwarmModel(rng=1)
    >>> fire = model.add_fire((400, 300), radius=20)
    >>> spreading = model.add_process(Spreading(rate=0.01))
    >>> len(model.run(500).fires) > 1
    True
    """

    rate: float = 0.0005
    reach: float = 60.0
    area: float = 1.0
    temperature: float = 0.1
    most: int = 30

    def __post_init__(self) -> None:
        """Check every value."""
        check_number("rate", self.rate, minimum=0, maximum=1)
        check_number("reach", self.reach, minimum=0, maximum=1e6)
        check_number("area", self.area, above=0, maximum=1e6)
        check_number("temperature", self.temperature, above=0, maximum=1)
        check_count("most", self.most, maximum=MOST_FIRES)

    @property
    def radius(self) -> float:
        """Radius of new fires, map units."""
        return RADIUS_OF_UNIT_AREA * math.sqrt(self.area)

    def step(self, model: Any) -> None:
        """Let sparks fall, and ignite those fires that find room."""
        fires = model.fires
        whether, how_far, direction = model.streams["spread of fires"].random((3, len(fires)))
        for row in np.flatnonzero(whether < self.rate * np.where(fires.out, 0.0, fires.temperature)).tolist():
            away = fires.radius[row] + how_far[row] * self.reach + self.radius
            azimuth = 2.0 * math.pi * direction[row]
            place = fires.position[row] + away * np.array(direction_of(azimuth))
            if np.count_nonzero(~fires.out) < self.most and self._is_free(model, place):
                model.add_fire(place, area=self.area, temperature=self.temperature)

    def _is_free(self, model: Any, place: np.ndarray) -> bool:
        """Return whether a new fire there overlaps nothing."""
        x_min, y_min, x_max, y_max = model.map.bounds
        if not (x_min <= place[0] - self.radius and place[0] + self.radius <= x_max):
            return False
        if not (y_min <= place[1] - self.radius and place[1] + self.radius <= y_max):
            return False
        round_ones = ((model.fires.position, model.fires.radius), (model.swarm.position, model.swarm.radius))
        for centres, radii in round_ones:
            if (vector_lengths(*(centres - place).T) < radii + self.radius).any():
                return False
        centre = disc(place, self.radius).geometry
        solids = find_occupied_room(model.obstacle_list)
        return not any(geometry.distance(centre) < radius + self.radius for geometry, radius in solids)
