"""Models without results, of which only reports are measured, in a module of their own for worker processes."""

import math
from typing import Any

from mesa_swarm.robots.design import AGENT3
from mesa_swarm.swarm_model import SwarmModel


class Reporting(SwarmModel):
    """Collects listed values step by step, after them NaN, as `value`; and the seed times `gain` as `own`."""

    compares = ("gain", (1.0, 2.0))
    values: tuple[Any, ...] = (1.0, math.nan, 5.0, 2.0)

    def __init__(self, *, gain: float = 1.0, every: int = 1, seed: int = 0, rng=None) -> None:
        reporters = {"value": lambda model: model.value, "own": lambda model: model.gain * (model.seed or model.drawn)}
        super().__init__(rng=rng, collect_every=every, model_reporters=reporters)
        self.gain, self.seed, self.drawn = gain, seed, int(rng or 0)
        self.add_robots(AGENT3, 1)

    @property
    def value(self) -> Any:
        """The value of this step, NaN before the first and after the last."""
        k = self.steps - 1
        return self.values[k] if 0 <= k < len(self.values) else math.nan


class Infinite(Reporting):
    """Infinity is among the values."""

    values = (1.0, math.inf, 5.0, -3.0)


class InWords(Reporting):
    """The values are texts."""

    values = ("few", "many")


class Gone(Reporting):
    """Nothing is measured after the second step."""

    values = (4.0, 6.0)


class Blowing(Reporting):
    """Grows beyond all limits where `gain` is large."""

    @property
    def value(self) -> float:
        """Infinity for a large gain."""
        return math.inf if self.gain > 1.5 else self.gain
