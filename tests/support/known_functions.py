"""Models without robots whose result is a function of their parameters with known indices of sensitivity."""

import math
from pathlib import Path

import numpy as np

from mesa_swarm.swarm_model import SwarmModel

# Ishigami's function with a = 7, b = 0.1 on (-pi, pi): its variance and indices in closed form.
A, B = 7.0, 0.1
V1, V2, V13 = (1 + B * math.pi**4 / 5) ** 2 / 2, A**2 / 8, B**2 * math.pi**8 * (1 / 18 - 1 / 50)
VARIANCE = V1 + V2 + V13
ISHIGAMI = {
    "S1": {"x1": V1 / VARIANCE, "x2": V2 / VARIANCE, "x3": 0.0},
    "ST": {"x1": (V1 + V13) / VARIANCE, "x2": V2 / VARIANCE, "x3": V13 / VARIANCE},
}
# Sobol's g-function: the product of (|4 x - 2| + a) / (1 + a) on (0, 1).
WEIGHTS = {"x1": 0.0, "x2": 1.0, "x3": 9.0}


def g_indices() -> dict[str, dict[str, float]]:
    """Return S1 and ST of the g-function in closed form."""
    partial = {name: 1 / (3 * (1 + a) ** 2) for name, a in WEIGHTS.items()}
    whole = math.prod(1 + v for v in partial.values()) - 1
    total = {name: v * math.prod(1 + w for other, w in partial.items() if other != name) for name, v in partial.items()}
    return {
        "S1": {name: v / whole for name, v in partial.items()},
        "ST": {name: v / whole for name, v in total.items()},
    }


class Function(SwarmModel):
    """Base of the models; its seed adds noise to the result, a diary notes each run, and a bad value fails."""

    def __init__(
        self,
        *,
        x1: float = 0.0,
        x2: float = 0.0,
        x3: float = 0.0,
        kind: str = "plain",
        whole: int = 1,
        noise: float = 0.0,
        fails_above: float = 1e9,
        diary: str = "",
        rng=None,
    ) -> None:
        super().__init__(rng=rng)
        self.x = x1, x2, x3
        self.kind, self.whole = kind, whole
        self.noise = noise * float(self.rng.standard_normal())
        self.fails_above, self.diary, self.seed = fails_above, diary, rng

    def step(self) -> None:
        """Note the seed, and fail if the first parameter is too large."""
        super().step()
        if self.diary:
            with open(Path(self.diary), "a") as file:
                file.write(f"{self.seed}\n")
        if self.x[0] > self.fails_above:
            raise ValueError("x1 is too large")

    def value(self) -> float:
        """Return the function without noise."""
        raise NotImplementedError

    def results(self) -> dict[str, float | None]:
        """Return the function, and a number that happens only for a large first parameter."""
        return {"y": self.value() + self.noise, "seldom": 1.0 if self.x[0] > 0.5 else None}


class Ishigami(Function):
    """Ishigami's function."""

    def value(self) -> float:
        """Return sin x1 + a sin^2 x2 + b x3^4 sin x1."""
        x1, x2, x3 = self.x
        return math.sin(x1) + A * math.sin(x2) ** 2 + B * x3**4 * math.sin(x1)


class Step(Function):
    """1 where x1 is above 0.97, else 0."""

    def results(self) -> dict[str, float]:
        """Return it as y."""
        return {"y": float(self.x[0] > 0.97)}


class Chance(Function):
    """A number that has nothing in common with that of another point or seed."""

    def results(self) -> dict[str, float]:
        """Return it as y."""
        parts = [int(1e6 * abs(x)) for x in self.x]
        return {"y": float(np.random.default_rng([*parts, int(self.seed)]).standard_normal())}


class GFunction(Function):
    """Sobol's g-function."""

    def value(self) -> float:
        """Return the product of (|4 x - 2| + a) / (1 + a)."""
        return math.prod((abs(4 * x - 2) + a) / (1 + a) for x, a in zip(self.x, WEIGHTS.values(), strict=True))


class Linear(Function):
    """A linear function, of another kind the reverse in its first parameter."""

    def value(self) -> float:
        """Return 3 x1 - 2 x2, or -3 x1 - 2 x2, and the whole number."""
        x1, x2, _ = self.x
        return (3 if self.kind == "plain" else -3) * x1 - 2 * x2 + self.whole


class Bowl(Function):
    """A bowl with its lowest place at x1 = 0.3, x2 = 0.01, and another height for each kind."""

    def value(self) -> float:
        """Return how far from the lowest place it is, at least 0."""
        x1, x2, _ = self.x
        return (x1 - 0.3) ** 2 + (math.log10(max(x2, 1e-9)) + 2) ** 2 + (self.kind != "best") + abs(self.whole - 5)
