"""The part `imperfections`: what makes robots imperfect."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.kernels.part import Column, Itself, Part
from mesa_swarm.physics.disturbances import Imperfect
from mesa_swarm.robots.imperfections import MEASURED, Imperfection, Imperfections, combine_imperfections
from mesa_swarm.robots.swarm import FAILED_SENSORS, LASTING

# Half of its speed is what a slipping wheel loses.
SLIP_MAGNITUDE = 0.5


def imperfections_of(noise: float, slip: float, dial: float) -> Imperfections | None:
    """Return what the common parameters `noise`, `slip` and `imperfections` make of robots, None if they are ideal."""
    for name, value in {"noise": noise, "slip": slip, "imperfections": dial}.items():
        if name == "imperfections" and isinstance(value, Imperfections):
            raise InvalidValueError(
                f"imperfections is {shortened(value)}; expected a number from 0, ideal robots, to 1, MEASURED; "
                "give an object to the model that was made: model.imperfections = Imperfections(...)"
            )
        check_number(name, value, minimum=0, maximum=1)
    disturbed = Imperfections(sensing=Imperfection(error=noise), slip_probability=slip, slip_magnitude=SLIP_MAGNITUDE)
    return combine_imperfections(MEASURED.at(dial), disturbed)


class ImperfectionsPart(Part):
    """How robots differ from ideal ones.

    It acts where robots sense and move.

    Attributes
    ----------
    effect : Imperfect or None
        None for ideal robots.
    """

    name = "imperfections"
    first = ("imperfections", "failing", "key")
    settings = ("imperfections",)

    def __init__(self, model: Any) -> None:
        self.model = model
        self.effect: Imperfect | None = None

    @property
    def imperfections(self) -> Imperfections | None:
        """What makes robots imperfect, None for ideal ones."""
        return None if self.effect is None else self.effect.imperfections

    def set_imperfections(self, imperfections: Imperfections | None) -> None:
        """Replace what makes robots imperfect; wear and failures begin anew."""
        if imperfections is not None and not isinstance(imperfections, Imperfections):
            raise InvalidValueError(f"imperfections is {shortened(imperfections)}; expected Imperfections(...) or None")
        swarm, self.effect = self.model.swarm, None
        self.model.parts.replan()
        self.model.parts.robots.forget_readings()
        swarm.drop_body_columns()
        swarm.battery_life = 0.0 if imperfections is None else float(imperfections.battery)
        if imperfections is not None:
            key = self.model.streams["imperfections"].integers(2**64, dtype=np.uint64)
            self.effect = Imperfect(imperfections, swarm, int(key))

    def columns(self) -> Mapping[str, Column]:
        """Return the last fresh readings and commands, wear and failures of each robot."""
        columns = self.model.swarm.columns
        return {
            name.removeprefix(LASTING): Column(column, "robots")
            for name, column in columns.items()
            if name.startswith(LASTING)
        }

    def mark(self) -> dict[str, Any]:
        """Return what makes robots imperfect, which may be replaced by hand."""
        return {"imperfect": Itself(self.effect)}

    def store(self) -> dict[str, Any]:
        """Return what makes robots imperfect, whether single robots may fail, and the key of their random numbers."""
        key = None if self.effect is None else self.effect.key
        failing = FAILED_SENSORS in self.model.swarm.columns
        return {"imperfections": self.imperfections, "failing": failing, "key": key}

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned, in this order."""
        if "imperfections" in stored and (stored["imperfections"], self.effect) != (None, None):
            self.set_imperfections(stored["imperfections"])
        if stored.get("failing"):
            self.prepare_failures()
        if stored.get("key") is not None:
            if type(stored["key"]) is not int or not 0 <= stored["key"] < 2**64:
                raise InvalidValueError(f"invalid key of imperfections: {shortened(stored['key'])}")
            self.prepare_wear()
            self.effect.key = stored["key"]  # type: ignore[union-attr]

    def prepare_wear(self) -> None:
        """Make what batteries and failures of single robots need."""
        if self.effect is None:
            self.set_imperfections(Imperfections())

    def prepare_failures(self) -> None:
        """Make what failures of single robots need, see `Robot.fail`."""
        self.prepare_wear()
        self.model.swarm.add_failures()

    def parameters(self) -> list[Any] | None:
        """Return what makes robots imperfect, and the key of their random numbers."""
        return None if self.effect is None else [self.effect.imperfections, self.effect.key]
