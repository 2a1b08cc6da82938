"""FireModel: the engine's model with fires, which burn, heat robots and are put out by them."""

import os
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.constants import FireConstants, design_constants
from mesa_swarm.fire.fires import Fire, Fires
from mesa_swarm.model import EngineModel
from mesa_swarm.parameters import Dial, Noise, Slip
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.streams import Seed
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.map import RADIUS_OF_UNIT_AREA, Map
from mesa_swarm.world.shapes import disc
from mesa_swarm.world.statics import FIRE

# The number under which recordings store this process.
BURNING = 0


class FireModel(EngineModel):
    """A world of robots, obstacles, loads and fires; the parameters are those of `SwarmModel`, which records too."""

    _stored_apart: ClassVar[tuple[str, ...]] = ("fires", "_fire_constants")
    _numbers: ClassVar[dict[str, tuple[type, ...]]] = {"extinguish_range": (float, int, np.float64)}

    def __init__(
        self,
        *,
        map: str | os.PathLike | Map = "openspace",
        rng: Seed = None,
        engine: str = "compiled",
        threads: int | None = None,
        turn_angle_degrees: float = 60.0,
        fire_constants: FireConstants | None = None,
        extinguish_range: float = 10.0,
        history_every: int | Trigger = 1,
        collect_every: int | Trigger = 1,
        communication: Radio | None = None,
        noise: Noise = 0.0,
        slip: Slip = 0.0,
        imperfections: Dial = 0.0,
        model_reporters: dict | None = None,
        agent_reporters: dict | None = None,
        scale: Scale | None = None,
    ) -> None:
        self.extinguish_range = check_number("extinguish_range", extinguish_range, minimum=0, maximum=1e9)
        self.fires = Fires(history_every)
        super().__init__(
            map=map,
            rng=rng,
            engine=engine,
            threads=threads,
            turn_angle_degrees=turn_angle_degrees,
            collect_every=collect_every,
            communication=communication,
            noise=noise,
            slip=slip,
            imperfections=imperfections,
            model_reporters=model_reporters,
            agent_reporters=agent_reporters,
            scale=scale,
        )
        self.space.attach(self.fires)
        for spot in self.map.fires:
            self.add_fire(spot.position, radius=spot.radius, temperature=spot.temperature)
        self.fire_constants = design_constants() if fire_constants is None else fire_constants

    def __repr__(self) -> str:
        counts = f"{len(self.swarm)} robots, {len(self.fires)} fires"
        return f"<{type(self).__name__} on map {self.map.name}, step {self.steps}: {counts}>"

    @property
    def fire_constants(self) -> FireConstants:
        """The constants of the fires and of the heat in robots; may be changed between steps."""
        return self._fire_constants

    @fire_constants.setter
    def fire_constants(self, constants: FireConstants) -> None:
        if not isinstance(constants, FireConstants):
            raise InvalidValueError(
                f"fire_constants is {shortened(constants)}; expected what design_constants() returns"
            )
        self._fire_constants = constants

    def add_fire(
        self,
        position: Sequence[float],
        *,
        radius: float | None = None,
        area: float | None = None,
        temperature: float = 1.0,
    ) -> Fire:
        """Add a fire and return its agent.

        Parameters
        ----------
        position : (x, y)
            Within the map.
        radius, area : float
            Either or both; area = (radius / 10) ** 2 unless both are given.
        temperature : float
            Above 0, at most 1.
        """
        point = self._checked_point(position)
        if radius is None and area is None:
            raise InvalidValueError("add_fire got neither radius nor area; give one of them")
        if radius is None:
            radius = RADIUS_OF_UNIT_AREA * np.sqrt(check_number("area", area, above=0, maximum=1e12))
        radius = check_number("radius", radius, above=0, maximum=1e6)
        area = (radius / RADIUS_OF_UNIT_AREA) ** 2 if area is None else area
        check_number("area", area, above=0, maximum=1e12)
        check_number("temperature", temperature, above=0, maximum=1)
        self._check_clear_of_loads("fire", disc(point, radius))
        if not self.fires.history.width:
            self._begin_burning()
        row = self.fires.add(point, radius, area, temperature)
        fire = Fire(self.space, self, self.fires, row)
        self.fires.agents.append(fire)
        self._scene_changed()
        return fire

    def fires_changed(self, index: int) -> None:
        """Release all robots from fires after one was removed."""
        self.swarm.forget_contact(FIRE, index)
        self.swarm.columns["fire"].fill(-1)
        self.obstacles_changed()

    def _begin_burning(self) -> None:
        """Add the process with which fires burn, before all others: recordings count these from 1."""
        if BURNING not in self._processes:
            self._processes = {BURNING: Burning(), **self._processes}

    def _collect(self) -> None:
        history = self.fires.history
        if history.width and history.trigger.is_due(self._completed):
            fires = self.fires
            history.append(self.steps, fires.temperature, fires.robots, fires.out)
        super()._collect()

    def _heat_bodies(self) -> Sequence[Fire]:
        return self.fires.agents

    def _heat_sources(self) -> tuple[np.ndarray, np.ndarray]:
        return self.fires.discs, self.fires.columns["temperature"]

    def _hashed_parameters(self) -> Iterator[tuple[str, Any]]:
        yield from super()._hashed_parameters()
        if BURNING in self._processes:
            yield "fires", [self.fire_constants, self.extinguish_range]

    def _hashed_columns(self) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
        yield from super()._hashed_columns()
        yield "fires", self.fires.columns
