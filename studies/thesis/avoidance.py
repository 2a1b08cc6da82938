"""Section 5.2.2: ways to turn away from what is near, in a corridor, in front of a wall and on a map."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm import AGENT3, Map, RobotDesign, SwarmModel, rectangle
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import LIGHT, plain_figure
from mesa_swarm_studies.judging import Check, Result, judged_mean, judged_measure, judged_share
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

Numbers = dict[str, float | None]
SEEDS = 24
DISTANCE = 15.0
# A corridor with two open ends; both side sensors of AGENT3 are activated in it.
WIDTH, BEGIN, END, MIDDLE = 22.0, 150.0, 350.0, 150.0
CORRIDOR_STEPS, WALL_STEPS, MAP_STEPS = 2_000, 200, 2_000
MIDWAY = (BEGIN + END) / 2
# Steps over which turns add up, in front of a wall.
COUNTED = 20
TRANSLATIONAL, STATIONARY = {"turn": "translational"}, {"turn": "stationary"}
IGNORING = {"sides": "ignore both"}
RANDOM, BACKING = {"front": "random"}, {"front": "back up"}
# A robot that has only its front sensor.
ONE_EYED = RobotDesign(name="one-eyed", sensors=AGENT3.sensors[:1])


def corridor_model(rng: int, **how: str) -> SwarmModel:
    """Return a robot in the middle of a narrow corridor, aside from its axis and oblique to it by chance."""
    model = SwarmModel(map=Map(name="corridor", bounds=(0, 0, 500, 300)), rng=rng)
    model.add_obstacle(rectangle((BEGIN, MIDDLE + WIDTH / 2), (END, 300)))
    model.add_obstacle(rectangle((BEGIN, 0), (END, MIDDLE - WIDTH / 2)))
    aside, heading = np.random.default_rng(rng).uniform(-1, 1, 2) * (WIDTH / 2 - 5.5, 0.5)
    model.add_robots(AGENT3, poses=[(MIDWAY, MIDDLE + aside, heading)])
    model.control = Subsumption(Avoid(distance=DISTANCE, **how), Explore())  # type: ignore[arg-type]
    return model


def corridor_path(rng: int, steps: int, **how: str) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (k, 2) and sides of the turns (k,) until the robot is out of the corridor."""
    model, places, sides = corridor_model(rng, **how), [], []
    for _ in range(steps):
        model.step()
        left, right = model.swarm.command[0]
        places.append(model.swarm.position[0].copy())
        sides.append(float(np.sign(right - left)))
        if not BEGIN < places[-1][0] < END:
            break
    return np.array(places), np.array(sides)


def corridor_run(rng: int, *, steps: int = CORRIDOR_STEPS, **how: str) -> Numbers:
    """Return whether a robot comes out of a corridor, how often its turns change sides, and how wide it swings."""
    places, sides = corridor_path(rng, steps, **how)
    turns = sides[sides != 0]
    return {
        "out": float(len(places) < steps),
        "changes per 100 steps": float(np.count_nonzero(np.diff(turns)) / len(places) * 100),
        "swing": float(np.std(places[:, 1])),
    }


def wall_run(rng: int, *, steps: int = WALL_STEPS, **how: str) -> Numbers:
    """Let a robot with nothing but a front sensor meet a wall; return its net turn in rad, and its collisions."""
    model = SwarmModel(map=Map(name="wall", bounds=(0, 0, 500, 1000)), rng=rng)
    heading = np.random.default_rng(rng).uniform(-0.2, 0.2)
    model.add_robots(ONE_EYED, poses=[(475, 500, heading)])
    model.control = Subsumption(Avoid(distance=DISTANCE, **how), Explore())  # type: ignore[arg-type]
    turned, counted = 0.0, 0
    for _ in range(steps):
        model.step()
        if model.swarm.layer[0] == 0 and counted < COUNTED:
            left, right = model.swarm.command[0]
            turned, counted = turned + (right - left) / (2.0 * ONE_EYED.radius), counted + 1
    return {"turned": abs(turned), "collisions": float(model.total_collisions)}


def map_run(rng: int, *, steps: int = MAP_STEPS, **how: Any) -> Numbers:
    """Return the collisions of ten robots on the map original."""
    model = find_model("collision_avoidance")(design="AGENT3", rng=rng, **how).run(steps)
    return {"collisions": float(next(iter(model.results().values())))}


def turning_away(laboratory: Laboratory) -> Result:
    """Judge the ways to turn away of section 5.2.2."""
    seeds = laboratory.fresh_seeds(SEEDS)
    corridor = {"steps": laboratory.pick(CORRIDOR_STEPS, 500)}
    ways = laboratory.grid(corridor_run, [{**corridor, **how} for how in (TRANSLATIONAL, STATIONARY, IGNORING)], seeds)
    walls = laboratory.grid(wall_run, [TRANSLATIONAL, RANDOM], seeds)
    on_map = {"steps": laboratory.pick(MAP_STEPS, 300)}
    maps = laboratory.grid(map_run, [{**on_map, **how} for how in (TRANSLATIONAL, BACKING, RANDOM)], seeds)
    return Result(
        checks=(*wall_checks(*walls), *corridor_checks(*ways), *map_checks(*maps)),
        pictures={"": corridor_figure()},
        settings=(
            f"AGENT3, distance {DISTANCE:g}; corridor {WIDTH:g} wide, 200 long, {CORRIDOR_STEPS:,} steps; wall: only "
            f"the front sensor, {WALL_STEPS} steps; map original: 10 robots, {MAP_STEPS:,} steps"
        ),
        remarks=(
            f"In k steps of random sides the net turn is 0.1 |S_k| rad, S_k a symmetric random walk, in the mean 0.35 "
            f"rad for k = {COUNTED}. Turns to one side add up to 2 rad, or less where the wall is lost from sight.",
            "Side sensors decide soon after the front one: with them a random side in front does little.",
        ),
    )


def wall_checks(fixed: list[dict], random: list[dict]) -> tuple[Check, ...]:
    """Return the checks of a robot in front of a wall that turns to its own side, and to a random one."""
    shares = [b["turned"] / a["turned"] for a, b in zip(fixed, random, strict=True)]
    return (
        judged_mean(
            f"a side drawn in every step has no net turn: turn in {COUNTED} steps, relative to that to one side",
            "fails, no net turn",
            shares,
            high=0.5,
        ),
        judged_measure(
            "with it a robot runs into the wall: collisions",
            "fails",
            "collisions",
            {"one side": fixed, "random side": random},
        ),
    )


def corridor_checks(translational: list[dict], stationary: list[dict], ignoring: list[dict]) -> tuple[Check, ...]:
    """Return the checks of a robot in a corridor."""
    return (
        judged_share(
            "turning on the spot it never comes out of a narrow corridor",
            "oscillates between two states",
            [row["out"] == 0 for row in stationary],
            low=0.8,
        ),
        judged_share(
            "with one wheel stopped it comes out", "comes out", [row["out"] == 1 for row in translational], low=0.8
        ),
        judged_share(
            "ignoring both sides when both are activated, it comes out",
            "possible",
            [row["out"] == 1 for row in ignoring],
            low=0.8,
        ),
        judged_measure(
            "and goes in a zig-zag: swing across the corridor, standard deviation",
            "zig-zag",
            "swing",
            {"one wheel stopped": translational, "ignoring both": ignoring},
            main=False,
        ),
        judged_measure(
            "but changes sides less often, times in 100 steps",
            "not reported",
            "changes per 100 steps",
            {"ignoring both": ignoring, "one wheel stopped": translational},
            main=False,
        ),
    )


def map_checks(fixed: list[dict], backing: list[dict], random: list[dict]) -> tuple[Check, ...]:
    """Return the checks of ten robots on a map."""
    return (
        judged_measure(
            "robots that back up and turn without looking collide more",
            "rejected: not guided by sensors",
            "collisions",
            {"turning": fixed, "backing up": backing},
            main=False,
        ),
        judged_measure(
            "robots with side sensors collide more with a random side in front",
            "fails",
            "collisions",
            {"one side": fixed, "random side": random},
            main=False,
        ),
    )


def corridor_figure() -> Figure:
    """Return a figure of three paths through a corridor."""
    figure, grid = plain_figure((7.5, 4.8), 3, sharex=True)
    named = {"turning on the spot": STATIONARY, "one wheel stopped": TRANSLATIONAL, "ignoring both sides": IGNORING}
    for axes, (name, how), colour in zip(grid[:, 0], named.items(), LIGHT.series, strict=False):
        places, _ = corridor_path(1, CORRIDOR_STEPS, **how)
        for edge in (MIDDLE - WIDTH / 2, MIDDLE + WIDTH / 2):
            axes.axhline(edge, color=LIGHT.ink, linewidth=2)
        axes.plot(*places.T, ".-", color=colour, linewidth=1.2, markersize=2)
        axes.set_title(f"{name}, {len(places):,} steps", fontsize=10)
        axes.set(xlim=(MIDWAY - 5, END), ylim=(MIDDLE - WIDTH / 2 - 1, MIDDLE + WIDTH / 2 + 1), ylabel="y")
    axes.set_xlabel("x, map units")
    return figure


ITEMS = (Item(figure="5.2.2", title="ways to turn away", section="5.2.2", make=turning_away),)
