"""Shepherding: one robot drives a flock of sheep to a target.

WHAT IS IT? Sheep flee from a robot and crowd together. The robot collects stragglers and drives the flock.

HOW IT WORKS. Sheep are ordinary Mesa agents, each with a body that robots see. A sheep within 65 m of a robot walks
along a sum: away from robots, away from sheep within 2 m, towards the centre of its nearest `neighbours`, on as before,
and at random. A robot sees the flock's centre, the sheep farthest from it, and the target. It goes behind that sheep as
seen from the centre if it is beyond 2 N^(2/3) m, else behind the centre; it slows down near sheep. 1 m is 4 map units.

HOW TO USE IT. `n_sheep`, and `neighbours`: to how many others each sheep is attracted, 0 for all.
THINGS TO TRY. Ten neighbours: which is the largest flock that is brought home? Replace the camera by infrared sensors.
REFERENCE. Stroembom, Mann, Wilson, Hailes, Morton, Sumpter and King, J. R. Soc. Interface 11, 20140719 (2014).
"""

from dataclasses import dataclass
from typing import Annotated, Any

import mesa
import numpy as np

from mesa_swarm import (
    HolonomicDrive,
    Map,
    RobotDesign,
    Seed,
    Sensor,
    Slider,
    SwarmModel,
    all_round,
    disc,
    process,
    until,
)
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.errors import check_count

METRE = 4.0
FIELD = Map(name="field", bounds=(0, 0, 1000, 1000))
START, TARGET, NEAR = (500.0, 800.0), 200 + 200j, 10 * METRE  # positions are complex numbers, x + y i
FRIGHT, APART, STRIDE = 65 * METRE, 2 * METRE, 1 * METRE
# Weights of terms of a sheep's direction; chance of a stride while no robot is near.
ATTRACTION, REPULSION, FEAR, INERTIA, NOISE, GRAZING = 1.05, 2.0, 1.0, 0.5, 0.3, 0.05


@dataclass(frozen=True, kw_only=True)
class Camera(Sensor):
    """Where the flock's centre, the sheep farthest from it and the target are, in the robot's frame."""

    name, width = "flock", 6

    def arguments(self, model: "Shepherding") -> dict[str, np.ndarray]:
        """Return these three places on the map."""
        return {"places": np.array([*model.centre_and_farthest(), TARGET])}

    @staticmethod
    def read(position: np.ndarray, heading: np.ndarray, places: np.ndarray, out: np.ndarray) -> None:
        """Write the places as each robot sees them."""
        for i in range(len(out)):
            for k in range(len(places)):
                offset = (places[k] - complex(position[i, 0], position[i, 1])) * np.exp(-1j * heading[i])
                out[i, 2 * k], out[i, 2 * k + 1] = offset.real, offset.imag


@behaviour
def herd(me: Any, sheep: int = 0, spread: float = 50.0, behind: float = 30.0) -> tuple[float, float]:
    """Go behind the farthest sheep if it is far from the others, otherwise behind the flock."""
    centre, far = complex(me.flock[0], me.flock[1]), complex(me.flock[2], me.flock[3])
    away, out = centre - complex(me.flock[4], me.flock[5]), far - centre
    if np.isnan(abs(away) + abs(out)):  # the camera failed
        return 0.0, 0.0
    aim = far + APART * out / abs(out) if abs(out) > spread else centre + behind * away / abs(away)
    way = aim / (abs(aim) + 1e-9) + NOISE * np.exp(2j * np.pi * me.chance)
    speed = 0.3 * APART if ((me.kind == sheep) & (me.distance < 4.5 * METRE)).any() else me.max_speed
    return speed * way.real / abs(way), speed * way.imag / abs(way)


class Sheep(mesa.Agent):
    """A sheep: an ordinary Mesa agent, of which robots see the body."""

    def __init__(self, model: SwarmModel, position: tuple[float, float]) -> None:
        super().__init__(model)
        self.position, self.ahead = position, 0j
        model.add_body(disc(self.position, METRE / 2), kind="sheep", agent=self)

    def step(self, place: list[float], way: complex) -> None:
        """Go a stride from a place in a direction, 0 for none, within the field."""
        x, y = place[0] + STRIDE * way.real, place[1] + STRIDE * way.imag
        self.position, self.ahead = (min(max(x, 0.0), FIELD.width), min(max(y, 0.0), FIELD.height)), way


@process
def walk(model: "Shepherding") -> None:
    """Let all sheep walk."""
    flock = model.agents_by_type[Sheep]
    for sheep, place, way in zip(flock, model.movers.position.tolist(), model.ways(flock.get("ahead"))):  # noqa: B905
        sheep.step(place, way)


class Shepherding(SwarmModel):
    """One robot that brings a flock of sheep to a target; stops running when the flock is there.

    Examples
    --------
    >>> Shepherding(n_sheep=5, rng=1).run(10).results()["brought home at"] is None
    True
    """

    compares = "n_sheep", (16, 24)
    steps_to_compare = 2_000
    headline = "brought home at", "brought the flock to the target"
    stops = until("is_home", equals=True)

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 5, 1, "shepherds")] = 1,
        n_sheep: Annotated[int, Slider(2, 200, 1, "sheep")] = 40,
        neighbours: Annotated[int, Slider(0, 200, 1, "others to which a sheep is attracted, 0 for all")] = 0,
        rng: Seed = None,
    ) -> None:
        super().__init__(map=FIELD, rng=rng)
        n = check_count("n_sheep", n_sheep, minimum=2, maximum=1000)
        self.neighbours = min(check_count("neighbours", neighbours) or n, n - 1)
        for place in self.streams["sheep"].uniform(*START, (n, 2)).tolist():
            Sheep(self, tuple(place))
        eyes = (*all_round(12, range=8 * METRE).sensors, Camera())
        robot = RobotDesign(sensors=eyes, radius=METRE, max_speed=1.5 * STRIDE, drive=HolonomicDrive())
        self.add_robots(robot, check_count("n_robots", n_robots))
        self.most_spread = APART * n ** (2 / 3)
        code, behind = self.kind_code("sheep"), APART * n**0.5
        self.add_process(walk)
        self.control = Subsumption(herd(sheep=code, spread=self.most_spread, behind=behind))

    def centre_and_farthest(self) -> tuple[complex, complex]:
        """Return where the flock's centre and the sheep farthest from it are."""
        places = self.movers.position[: len(self.agents_by_type[Sheep])] @ (1, 1j)
        return places.mean(), places[abs(places - places.mean()).argmax()]

    @property
    def is_home(self) -> bool:
        """Whether the flock is at the target."""
        centre, far = self.centre_and_farthest()
        return abs(centre - TARGET) < NEAR and abs(far - centre) < self.most_spread

    @property
    def home_at(self) -> int | None:
        """Step at which the flock was at the target, or None."""
        return self.stopped_at

    def ways(self, ahead: list[complex]) -> np.ndarray:
        """Return the direction (n,) in which each sheep walks, 0 for one that stands."""
        places, chance = self.movers.position[: len(ahead)] @ (1, 1j), self.streams["sheep"].random((2, len(ahead)))
        gaps, robots = places[:, None] - places, places[:, None] - self.swarm.position @ (1, 1j)
        nearest = abs(gaps).argsort(axis=1, kind="stable")[:, 1 : self.neighbours + 1]  # after itself
        crowded = unit((unit(gaps) * (abs(gaps) < APART)).sum(axis=1))
        near, noise = abs(robots) < FRIGHT, np.exp(2j * np.pi * chance[0])
        flight = ATTRACTION * unit(places[nearest].mean(axis=1) - places) + REPULSION * crowded + NOISE * noise
        flight += FEAR * unit((unit(robots) * near).sum(axis=1)) + INERTIA * np.array(ahead)
        calm = np.where(crowded != 0, crowded, noise * (chance[1] < GRAZING))
        return np.where(near.any(axis=1), unit(flight), calm)

    def results(self) -> dict[str, float | None]:
        """Return the measure used by a comparison: the step at which the flock was at the target, or None."""
        return {"brought home at": self.home_at}


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return complex numbers of magnitude 1 in the same directions, and 0 for 0."""
    return np.divide(vectors, abs(vectors), out=np.zeros_like(vectors), where=vectors != 0)
