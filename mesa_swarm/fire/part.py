"""The part `fires`: fires as discs that radiate heat, what burns of them, and the heat in robots."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.fire.burning import Burning
from mesa_swarm.fire.constants import FireConstants
from mesa_swarm.fire.fires import Fire, Fires
from mesa_swarm.kernels.part import Column, Context, Itself, Part, Phase, Role, Stage
from mesa_swarm.model.robots import check_stored
from mesa_swarm.trigger import Trigger
from mesa_swarm.world.map import RADIUS_OF_UNIT_AREA
from mesa_swarm.world.shapes import disc
from mesa_swarm.world.statics import FIRE

# The number under which recordings store this process.
BURNING = 0
# Columns that follow from parameters.
OF_PARAMETERS = frozenset({"position", "radius", "area"})
# The swarm's columns of the heat in robots.
OF_ROBOTS = ("temperature", "heat", "hot", "fire")


def role_of(name: str) -> Role:
    """Return the role of a column of fires."""
    return "parameter" if name in OF_PARAMETERS else "state"


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
        self.model = model
        self.set_constants(constants)
        self.extinguish_range = check_number("extinguish_range", extinguish_range, minimum=0, maximum=1e9)
        self.fires = Fires(history_every)
        model.space.attach(self.fires)

    def bind(self, context: Context) -> None:
        """Let sensors and robots find the fires among the bodies."""
        context.parts["bodies"].heat = self.fires  # type: ignore[attr-defined]

    def columns(self) -> Mapping[str, Column]:
        """Return the columns of fires, and of the heat in robots."""
        robots, fires = self.model.swarm.columns, self.fires.columns
        return {
            **{name: Column(column, None, role_of(name)) for name, column in fires.items()},
            **{f"robots.{name}": Column(robots[name], "robots") for name in OF_ROBOTS},
        }

    def stages(self) -> Iterator[Stage]:
        """Store a row of the history, if one is due."""
        yield Stage(Phase.COLLECT, self.store_history, "temperatures of fires are stored")

    def parameters(self) -> list | None:
        """Return the constants of what burns, None where nothing does."""
        burns = BURNING in self.model.parts.processes.numbered
        return [self.constants, self.extinguish_range] if burns else None

    def mark(self) -> dict[str, Any]:
        """Return temperatures, which fires are out, and the constants, which may be set by hand."""
        columns = self.fires.columns
        return {
            "temperature of fires": columns["temperature"].tobytes(),
            "out of fires": columns["out"].tobytes(),
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
            check_stored("extinguish_range", stored["extinguish_range"], (float, int, np.float64))
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

    def add_fire(self, position: Sequence[float], radius: float | None, area: float | None, temperature: float) -> Fire:
        """Add a fire and return its agent; see `SwarmModel.add_fire`."""
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
        bodies.check_clear_of_loads("fire", disc(point, radius))
        if not self.fires.history.width:
            self.begin_burning()
        row = self.fires.add(point, radius, area, temperature)
        fire = Fire(self.model.space, self.model, self.fires, row)
        self.fires.agents.append(fire)
        self.model.parts.add_rows("bodies", 1)
        bodies.scene_changed()
        return fire

    def begin_burning(self) -> None:
        """Add the process with which fires burn, before all others."""
        self.model.parts.processes.put_first(Burning(), BURNING)

    def release_robots(self, index: int) -> None:
        """Release all robots from fires after one was put out by hand or removed."""
        swarm = self.model.swarm
        swarm.forget_contact(FIRE, index)
        swarm.columns["fire"].fill(-1)
        self.model.parts.bodies.changed()

    def store_history(self) -> None:
        """Store a row of the history of all fires, if one is due."""
        fires, history = self.fires, self.fires.history
        if history.width and history.trigger.is_due(self.model.completed):
            history.append(self.model.steps, fires.temperature, fires.robots, fires.out)
