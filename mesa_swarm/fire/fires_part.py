"""The part `fires`: fires as discs that radiate heat, what burns of them, and the heat in robots."""

from collections.abc import Container, Iterator, Mapping, Sequence
from functools import partial
from operator import is_not
from typing import Any

import numpy as np

from mesa_swarm.base.errors import BehaviourError, InvalidValueError, check_number, shortened
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.fire.burning import Burning, HeatArrays, LightArrays, burn_all, light_all
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.fire.fires import Fire, Fires
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.part import Column, Itself, Kernel, Part, Phase, Prepared, Stage
from mesa_swarm.kernels.sequence import sequence_of
from mesa_swarm.maps.map import RADIUS_OF_UNIT_AREA
from mesa_swarm.model.robots_part import check_stored_numbers
from mesa_swarm.world.shapes import Shape, disc
from mesa_swarm.world.statics import FIRE

# The number under which recordings store this process.
BURNING = 0
# The swarm's columns of the heat in robots.
OF_ROBOTS = ("temperature", "heat", "hot", "fire")


class FiresPart(Part):
    """The fires of a model; those that are in it burn by the process `Burning`.

    Attributes
    ----------
    fires : Fires
    constants : FireConstants
    extinguish_range : float
        A robot whose body is this near to a fire's edge can fight it and takes its heat, at least 0.
    """

    name = "fires"
    settings = ("constants", "extinguish_range")

    def __init__(
        self, model: Any, constants: FireConstants, extinguish_range: float, history_every: int | Trigger
    ) -> None:
        self.model, self.cache, self.row_cache = model, Prepared(), Prepared()
        self.set_constants(constants)
        self.extinguish_range = check_number("extinguish_range", extinguish_range, minimum=0, maximum=1e9)
        self.fires = Fires(history_every, model.parts.bodies.table)

    def columns(self) -> Mapping[str, Column]:
        """Return the columns of fires, and of the heat in robots."""
        robots, fires = self.model.swarm.columns, self.fires.own
        return {
            **{
                name: Column(column, None, "parameter" if name == "area" else "state") for name, column in fires.items()
            },
            **{f"robots.{name}": Column(robots[name], "robots") for name in OF_ROBOTS},
            "light": Column(self.fires.asked, None, "derived"),
        }

    def stages(self) -> Iterator[Stage]:
        """Store a row of the history, if one is due."""
        yield Stage(Phase.COLLECT, self.store_history, "temperatures of fires are stored", self.storing())

    def answer(self, asked: Container[str]) -> Iterator[Stage]:
        """Light fires again where processes have asked for it; `asked` are the columns that these write."""
        if "fires.light" in asked and len(self.fires):
            yield Stage(Phase.PROCESS, self.light, "fires are lit again", self.lighting())

    def begin_step(self) -> None:
        """Forget what processes have asked for in a step that failed."""
        self.fires.asked[:] = np.nan

    def light(self) -> None:
        """Light the fires again for which processes have asked."""
        self.lighting().run(self.model.steps, len(self.model.swarm))

    def lighting(self) -> Kernel:
        """Return what lights fires again, and lets layers note it that count fires which go out."""
        fires, control, arrays = self.fires, self.model.control, self.to_light()
        block = Block(arrays)
        layers = [] if control is None else control.layers
        noting = [layer.kernel_of_lighting(fires.asked) for layer in layers if hasattr(layer, "kernel_of_lighting")]
        return sequence_of([*noting, Kernel(light_all, block.numbers, block, partial(self._refuse_to_light, arrays))])

    def to_light(self) -> LightArrays:
        """Return what is written of fires that are put out or lit again."""
        fires, scene = self.fires, self.model.parts.bodies.scene()
        return LightArrays(
            asked=fires.asked,
            rows=scene.rows[len(scene.rows) - scene.apart :].copy(),
            heat_of=scene.bodies.temperature,
            out=fires.own["out"],
            out_step=fires.own["out_step"],
            fighters=fires.own["robots"],
            fire=self.model.swarm.columns["fire"],
            seen_as=scene.statics.seen_as,
        )

    def _refuse_to_light(self, arrays: LightArrays, code: int) -> None:
        """Raise an error for the first temperature at which no fire can be lit, and forget what was asked."""
        index = int(np.argmax(~np.isnan(arrays.asked) & ~((arrays.asked > 0) & (arrays.asked <= 1))))
        asked, arrays.asked[:] = arrays.asked[index], np.nan
        raise BehaviourError(
            f"a process asked for fire {self.fires[index].unique_id} to be lit at temperature {asked:g} in step "
            f"{self.model.steps}; expected above 0, at most 1"
        )

    def parameters(self) -> list | None:
        """Return the constants of what burns, None where nothing does."""
        burns = BURNING in self.model.parts.processes.numbered
        return [self.constants, self.extinguish_range] if burns else None

    def mark(self) -> dict[str, Any]:
        """Return temperatures, which fires are out, and the constants, which may be set by hand."""
        return {
            "temperature of fires": self.fires.temperature.tobytes(),
            "out of fires": self.fires.out.tobytes(),
            "fire_constants": Itself(self.constants),
            "extinguish_range": self.extinguish_range,
        }

    def store(self) -> dict[str, Any]:
        """Return constants, the range, and interval and places of the history, of which rows are collected data."""
        history = self.fires.history
        places = [history.every, *history.places]
        return {"constants": self.constants, "extinguish_range": self.extinguish_range, "history": places}

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned, checked."""
        if "constants" in stored:
            self.set_constants(stored["constants"])
        if "extinguish_range" in stored:
            check_stored_numbers("extinguish_range", stored["extinguish_range"], (float, int, np.float64))
            self.extinguish_range = stored["extinguish_range"]
        if "history" in stored:
            self.fires.history.restore(*stored["history"], present=len(self.fires))

    def set_constants(self, constants: FireConstants) -> None:
        """Replace the constants of the fires and of the heat in robots."""
        if not isinstance(constants, FireConstants):
            raise InvalidValueError(
                f"fire_constants is {shortened(constants)}; expected what design_constants() returns"
            )
        self.constants = constants
        self.model.parts.replan()  # of which what burns is a part

    @property
    def extinguish_range(self) -> float:
        """How near to a fire's edge the body of a robot that fights it is at most, and takes its heat."""
        return self._extinguish_range

    @extinguish_range.setter
    def extinguish_range(self, extinguish_range: float) -> None:
        self._extinguish_range = extinguish_range
        self.model.parts.replan()

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
        bodies = self.model.parts.bodies
        point = bodies.checked_point(position)
        if radius is None and area is None:
            raise InvalidValueError("add_fire got neither radius nor area; give one of them")
        if radius is None:
            radius = RADIUS_OF_UNIT_AREA * np.sqrt(check_number("area", area, above=0, maximum=1e12))  # type: ignore[arg-type]
        radius = check_number("radius", radius, above=0, maximum=1e6)
        area = (radius / RADIUS_OF_UNIT_AREA) ** 2 if area is None else area
        check_number("area", area, above=0, maximum=1e12)
        check_number("temperature", temperature, above=0, maximum=1)
        shape = disc(point, radius)
        bodies.check_clear_of_loads("fire", shape)
        if not self.fires.history.width:
            self.begin_burning()
        return self.take(shape, area, temperature)

    def take(self, shape: Shape, area: float, temperature: float) -> Fire:
        """Add a fire whose values are checked."""
        fire = Fire(self.model.space, self.model, self.fires, shape, area, temperature)
        self.model.parts.add_rows("bodies", 1)
        self.model.parts.bodies.scene_changed()
        return fire

    def begin_burning(self) -> None:
        """Add the process with which fires burn, before all others."""
        self.model.parts.processes.put_first(Burning(), BURNING)

    def burning(self) -> Kernel:
        """Return what lets fires burn for a step, made anew when arrays, bodies or constants have changed."""
        scene, swarm, prepared = self.model.parts.bodies.scene(), self.model.swarm, self.cache
        state = swarm.version, scene, self.constants, self.extinguish_range
        if prepared.state != state:
            robots, fires, bodies, c = swarm.columns, self.fires.own, scene.bodies, self.constants
            arrays = HeatArrays(
                position=robots["position"],
                radius=robots["radius"],
                rows=scene.rows[len(scene.rows) - scene.apart :].copy(),
                place=bodies.position,
                reach=bodies.radius,
                area=fires["area"],
                constants=(float(c.k1), float(c.k2), float(c.k3), float(c.k4), float(c.leave), float(c.join)),
                extinguish_range=float(self.extinguish_range),
                heat_of=bodies.temperature,
                out=fires["out"],
                out_step=fires["out_step"],
                fighters=fires["robots"],
                seen_as=scene.statics.seen_as,
                **{name: robots[name] for name in OF_ROBOTS},
            )
            block = Block(arrays)
            prepared.state, prepared.kernel = state, Kernel(burn_all, block.numbers, block)
        return prepared.kernel  # type: ignore[return-value]

    def release_robots(self, index: int) -> None:
        """Release all robots from fires after one was removed."""
        swarm = self.model.swarm
        swarm.forget_contacts(FIRE, np.array([index]))
        swarm.columns["fire"].fill(-1)
        self.model.parts.bodies.changed()

    def store_history(self) -> None:
        """Store a row of the history of all fires, if one is due."""
        self.storing().run(self.model.steps, len(self.model.swarm))

    def storing(self) -> Kernel:
        """Return what stores rows of the history, made anew when fires or bodies have come or gone."""
        fires, history, prepared = self.fires, self.fires.history, self.row_cache
        state = history, history.changes, fires.own["out"], fires.table.temperature
        if prepared.kernel is None or any(map(is_not, prepared.state, state)):
            prepared.state, prepared.kernel = state, history.kernel(fires)
        history.count_from(self.model.steps, self.model.completed)
        return prepared.kernel
