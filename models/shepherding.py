"""Shepherding: one robot drives a flock of sheep to a target.

WHAT IS IT? Sheep flee from a robot and crowd together. The robot collects stragglers and drives the flock.

HOW IT WORKS. Sheep are bodies that robots see, and that a compiled process sends. A sheep within 65 m of a robot walks
along a sum: away from robots, away from sheep within 2 m, towards the centre of its nearest `neighbours`, on as before,
and at random. A robot sees the flock's centre, the sheep farthest from it, and the target. It goes behind that sheep as
seen from the centre if it is beyond 2 N^(2/3) m, else behind the centre; it slows down near sheep. 1 m is 4 map units.

HOW TO USE IT. `n_sheep`, and `neighbours`: to how many others each sheep is attracted, 0 for all.
THINGS TO TRY. Ten neighbours: which is the largest flock that is brought home? Replace the camera by infrared sensors.
REFERENCE. Stroembom, Mann, Wilson, Hailes, Morton, Sumpter and King, J. R. Soc. Interface 11, 20140719 (2014).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numba import njit

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
    draw_number,
    process,
    until,
    value,
)
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.errors import check_count

METRE, SIDE = 4.0, 1000.0
FIELD = Map(name="field", bounds=(0, 0, SIDE, SIDE))
START, TARGET, NEAR = (500.0, 800.0), (200.0, 200.0), 10 * METRE
FRIGHT, APART, STRIDE = 65 * METRE, 2 * METRE, 1 * METRE
# Weights of terms of a sheep's direction; chance of a stride while no robot is near.
ATTRACTION, REPULSION, FEAR, INERTIA, NOISE, GRAZING = 1.05, 2.0, 1.0, 0.5, 0.3, 0.05


@njit
def look(places: np.ndarray) -> tuple[float, float, float, float]:
    """Return where the flock's centre and the sheep farthest from it are."""
    x, y = np.mean(places[:, 0]), np.mean(places[:, 1])
    far = np.argmax(np.array([math.hypot(place[0] - x, place[1] - y) for place in places]))
    return x, y, places[far, 0], places[far, 1]


@dataclass(frozen=True, kw_only=True)
class Camera(Sensor):
    """Where the flock's centre, the sheep farthest from it and the target are, in the robot's frame."""

    name, width = "flock", 6
    sheep: int

    @staticmethod
    def read(
        position: np.ndarray, heading: np.ndarray, bodies_position: np.ndarray, bodies_kind: np.ndarray, sheep: int,
        out: np.ndarray,
    ) -> None:  # fmt: skip
        """Write the places as each robot sees them."""
        places = (*look(bodies_position[bodies_kind == sheep]), *TARGET)
        for i in range(len(out)):
            cosine, sine = math.cos(heading[i]), math.sin(heading[i])
            for k in range(0, 6, 2):
                x, y = places[k] - position[i, 0], places[k + 1] - position[i, 1]
                out[i, k], out[i, k + 1] = cosine * x + sine * y, cosine * y - sine * x


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


@njit
def unit(x: float, y: float) -> tuple[float, float]:
    """Return a vector of length 1 in the same direction, and 0 for 0."""
    length = math.hypot(x, y)
    return (x / length, y / length) if length > 0 else (0.0, 0.0)


@njit
def away_from(x: float, y: float, places: np.ndarray, reach: float) -> tuple[float, float, int]:
    """Return the direction away from the places within reach, and how many there are; that of a sheep itself is 0."""
    sum_x, sum_y, count = 0.0, 0.0, 0
    for k in range(len(places)):
        if math.hypot(x - places[k, 0], y - places[k, 1]) < reach:
            away_x, away_y = unit(x - places[k, 0], y - places[k, 1])
            sum_x, sum_y, count = sum_x + away_x, sum_y + away_y, count + 1
    return (*unit(sum_x, sum_y), count)


@njit
def towards_nearest(i: int, places: np.ndarray, neighbours: int) -> tuple[float, float]:
    """Return the direction of a sheep towards the centre of its nearest neighbours."""
    gaps = np.array([math.hypot(place[0] - places[i, 0], place[1] - places[i, 1]) for place in places])
    nearest = np.argsort(gaps, kind="mergesort")[1 : neighbours + 1]  # after itself
    return unit(np.mean(places[nearest, 0]) - places[i, 0], np.mean(places[nearest, 1]) - places[i, 1])


def walk(
    position: np.ndarray, bodies_position: np.ndarray, bodies_aim: np.ndarray, bodies_kind: np.ndarray,
    ahead_x: np.ndarray, ahead_y: np.ndarray, away: np.ndarray, home: np.ndarray, stream: Any, sheep: int = 0,
    neighbours: int = 0, spread: float = 50.0,
) -> None:  # fmt: skip
    """Send all sheep a stride, and look whether the flock is at the target."""
    flock = np.flatnonzero(bodies_kind == sheep)
    places = bodies_position[flock]
    for i in range(len(flock)):
        x, y = places[i]
        crowd_x, crowd_y, _ = away_from(x, y, places, APART)
        fear_x, fear_y, near = away_from(x, y, position, FRIGHT)
        turn, grazes = 2 * math.pi * draw_number(stream), draw_number(stream) < GRAZING
        noise_x, noise_y = math.cos(turn), math.sin(turn)
        way = unit(crowd_x, crowd_y) if crowd_x != 0 or crowd_y != 0 else (noise_x * grazes, noise_y * grazes)
        if near > 0:
            x_wanted, y_wanted = towards_nearest(i, places, neighbours)
            way = unit(
                ATTRACTION * x_wanted + REPULSION * crowd_x + FEAR * fear_x + INERTIA * ahead_x[i] + NOISE * noise_x,
                ATTRACTION * y_wanted + REPULSION * crowd_y + FEAR * fear_y + INERTIA * ahead_y[i] + NOISE * noise_y,
            )
        ahead_x[i], ahead_y[i] = way
        bodies_aim[flock[i], 0] = min(max(x + STRIDE * way[0], 0.0), SIDE)
        bodies_aim[flock[i], 1] = min(max(y + STRIDE * way[1], 0.0), SIDE)
    centre_x, centre_y, far_x, far_y = look(places)
    away[0] = math.hypot(centre_x - TARGET[0], centre_y - TARGET[1])
    home[0] = away[0] < NEAR and math.hypot(far_x - centre_x, far_y - centre_y) < spread


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
    # Distance of the flock's centre from the target, map units; whether the flock is there.
    away, is_home = value("walk.away"), value("walk.home")
    stops = until("is_home", equals=1)

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 5, 1, "shepherds")] = 1,
        n_sheep: Annotated[int, Slider(2, 200, 1, "sheep")] = 40,
        neighbours: Annotated[int, Slider(0, 200, 1, "others to which a sheep is attracted, 0 for all")] = 0,
        rng: Seed = None,
    ) -> None:
        super().__init__(map=FIELD, rng=rng, model_reporters={"away": "away"})
        n = check_count("n_sheep", n_sheep, minimum=2, maximum=1000)
        places = self.streams["sheep"].uniform(*START, (n, 2))
        for place in places.tolist():
            self.add_body(disc(place, METRE / 2), kind="sheep")
        sheep, spread = self.kind_code("sheep"), APART * n ** (2 / 3)
        eyes = (*all_round(12, range=8 * METRE).sensors, Camera(sheep=sheep))
        robot = RobotDesign(sensors=eyes, radius=METRE, max_speed=1.5 * STRIDE, drive=HolonomicDrive())
        self.add_robots(robot, check_count("n_robots", n_robots))
        others = min(check_count("neighbours", neighbours) or n, n - 1)
        away = math.hypot(*(places.mean(axis=0) - TARGET))
        memory = {"ahead_x": np.zeros(n), "ahead_y": np.zeros(n), "away": away, "home": False}
        self.add_process(process(memory=memory)(walk)(sheep=sheep, neighbours=others, spread=spread))
        self.control = Subsumption(herd(sheep=sheep, spread=spread, behind=APART * n**0.5))

    @property
    def home_at(self) -> int | None:
        """Step at which the flock was at the target, or None."""
        return self.stopped_at

    def results(self) -> dict[str, float | None]:
        """Return the measure used by a comparison: the step at which the flock was at the target, or None."""
        return {"brought home at": self.home_at}
