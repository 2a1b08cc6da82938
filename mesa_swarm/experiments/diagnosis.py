"""Unproductive behaviour of a watched model, and oscillation of trained robots."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mesa_swarm.analysis.pathology import Pathologies, find_pathologies, flips_of
from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import PolicyLayer, QPolicy
from mesa_swarm.model.gallery import find_model
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.robots.snapshots import Snapshots, check_watched
from mesa_swarm.swarm_model import SwarmModel

NEEDED = ("position", "heading", "command", "layer", "distance", "kind")


def pathologies_of(model: SwarmModel) -> Pathologies:
    """Find the episodes in which robots got nowhere, in the steps that `model.watch()` has recorded.

    Parameters
    ----------
    model : SwarmModel
        Watched with ``every=1``; with ``last=None`` no step is lost.

    Returns
    -------
    Pathologies
        Its rows are those of `model.swarm`; see `analysis.find_pathologies` for what counts.

    Raises
    ------
    InvalidValueError
        If no step is watched, columns are missing, steps were left out, or robots have a drive whose commands are
        not the speeds of wheels left and right.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> model = find_model("collision_avoidance")(n_robots=3, rng=1)
    >>> watched = model.watch(last=None)
    >>> len(pathologies_of(model.run(100)))
    0
    """
    swarm, watched = model.swarm, check_watched(model.watched, NEEDED, "diagnose", "watch(last=None)")
    if watched.every != 1:
        raise InvalidValueError(f"every {watched.every}th step is watched; expected all steps: watch with every=1")
    check_wheels(model)
    return find_pathologies(
        steps=watched.steps,
        position=watched["position"],
        heading=watched["heading"],
        command=watched["command"],
        layer=watched["layer"],
        distance=watched["distance"],
        kind=watched["kind"],
        radius=swarm.radius,
        max_speed=swarm.max_speed,
        forward=swarm.table.forward[swarm.design],
    )


def check_wheels(model: SwarmModel) -> None:
    """Refuse a model with robots whose commands are not the speeds of wheels left and right."""
    for design in model.swarm.designs:
        if not design.turns:
            raise InvalidValueError(
                f"robots of the design {design.name} have no wheels left and right; diagnose those that have"
            )


# Initial direction of the wall, and its distance: along it, or towards it.
SCENES = {"beside a wall": (0.0, (5.0, 25.0)), "towards a wall": (-90.0, (15.0, 40.0))}
# Largest deviation of the initial heading, rad.
SPREAD = 0.3
# Only flips with something nearer than this share of the range count: 30 units, within which robots respond to walls.
IN_SIGHT = 0.6
WALL, MIDDLE = 20.0, 400.0
CORRIDOR, THRESHOLD = "corridor flip", "back-and-forth at a threshold"
MEASURES = ("turns to and fro", "back and forth", CORRIDOR, THRESHOLD)


def trained(
    reward: str, actions: int, rng: int, *, steps: int = 20_000, n_robots: int = 15, beta: float = 5e-3, **settings: Any
) -> QPolicy:
    """Let robots of the model `QLearning`, with these settings, learn as in the thesis, and return their policy.

    Examples
    --------
    >>> trained("b", 4, 1, steps=20, n_robots=2).copies
    2
    """
    model = find_model("q_learning")(reward=reward, actions=actions, beta=beta, n_robots=n_robots, rng=rng, **settings)
    return model.run(check_count("steps", steps, minimum=1)).learner.policy()


def oscillation(
    policy: QPolicy, *, scene: str, rng: int = 1, steps: int = 300, temperature: float = 0.05
) -> dict[str, float]:
    """Put each robot of a policy alone beside, or before, a long wall, and return how it oscillates.

    Parameters
    ----------
    policy : QPolicy
        Trained with `AGENT9`; it does not learn further.
    scene : str
        "beside a wall": along it, 5 to 25 units off; "towards a wall": 15 to 40 off; at random within 17 degrees.
    rng : int
        Seed of poses and choices.
    steps : int
    temperature : float
        Of the choice; low, so that chance is small.

    Returns
    -------
    dict of float
        Means over the robots. "turns to and fro" and "back and forth": flips per 100 of the steps with a wall within
        0.6 of the range, of the turn, and of the direction of travel. "corridor flip" and "back-and-forth at a
        threshold": shares of all steps that are in such an episode, see `analysis.find_pathologies`.

    Examples
    --------
    >>> policy = trained("b", 4, 1, steps=20, n_robots=1)
    >>> sorted(oscillation(policy, scene="beside a wall", steps=60)) == sorted(MEASURES)
    True
    """
    check_choice("scene", scene, SCENES)
    rows = [_measured(model, steps) for model in _models(policy, scene, rng, steps, temperature)]
    return {name: float(np.mean([row[name] for row in rows])) for name in MEASURES}


def oscillating_robot(
    policy: QPolicy,
    *,
    scene: str,
    measure: str,
    robot: int | None = None,
    rng: int = 1,
    steps: int = 300,
    temperature: float = 0.05,
) -> dict[str, Any]:
    """Return the way and the commands of the robot with the largest value of a measure of `oscillation`.

    Parameters
    ----------
    policy, scene, rng, steps, temperature
        As for `oscillation`, which drives the same robots in the same way.
    measure : str
        One of those that `oscillation` returns; of equal robots the first.
    robot : int, optional
        The number of another robot instead.

    Returns
    -------
    dict
        "robot": its number. Lists of floats: "x", "y", the position after each step, map units; "left", "right", the
        commands as shares of max_speed.

    Examples
    --------
    >>> policy = trained("b", 4, 1, steps=20, n_robots=1)
    >>> way = oscillating_robot(policy, scene="beside a wall", measure="back and forth", steps=60)
    >>> len(way["x"]), sorted(way)
    (60, ['left', 'right', 'robot', 'x', 'y'])
    """
    check_choice("measure", measure, MEASURES)
    models = _models(policy, check_choice("scene", scene, SCENES), rng, steps, temperature)
    if robot is None:
        robot = int(np.argmax([_measured(each, steps)[measure] for each in models]))
    model = models[check_count("robot", robot, maximum=len(models) - 1)]
    watched = check_watched(model.watched, NEEDED, "draw", "watch()")
    x, y = watched["position"][:, 0].T
    left, right = watched["command"][:, 0].T / model.swarm.max_speed[0]
    columns = {"x": x, "y": y, "left": left, "right": right}
    return {"robot": robot, **{name: values.round(6).tolist() for name, values in columns.items()}}


def _models(policy: QPolicy, scene: str, rng: int, steps: int, temperature: float) -> list[SwarmModel]:
    """Return a watched model for each robot of a policy, in which it drove alone."""
    cooled = replace(policy, temperature=check_number("temperature", temperature, above=0))
    seeds = np.random.SeedSequence(check_count("rng", rng)).spawn(cooled.copies)
    return [_driven(cooled.of_robot(k), scene, seed, steps) for k, seed in enumerate(seeds)]


def _driven(policy: QPolicy, scene: str, seed: np.random.SeedSequence, steps: int) -> SwarmModel:
    degrees, (least, most) = SCENES[scene]
    chance = np.random.default_rng(seed)
    model = SwarmModel(map="openspace", rng=int(chance.integers(2**31)))
    y = WALL + AGENT9.radius + chance.uniform(least, most)
    model.add_robots(AGENT9, poses=[(MIDDLE, y, np.radians(degrees) + chance.uniform(-SPREAD, SPREAD))])
    model.control = Subsumption(PolicyLayer(policy=policy))
    model.watch(last=None, columns=NEEDED)
    return model.run(steps)


def _measured(model: SwarmModel, steps: int) -> dict[str, float]:
    """Return how the robot of a watched model oscillated."""
    sight = max(float(sensor.range) for sensor in AGENT9.proximity)
    return {**flips(check_watched(model.watched, NEEDED, "measure", "watch()"), sight), **_episodes(model, steps)}


def flips(watched: Snapshots | Mapping[str, np.ndarray], sight: float) -> dict[str, float]:
    """Return flips of turn and of travel per 100 of the steps in which something is within 0.6 of the range."""
    distance, command = watched["distance"], watched["command"]
    nearest = np.where(distance < 0, np.inf, distance).min(axis=2)
    near = nearest < IN_SIGHT * sight
    turn, travel = np.sign(command[..., 1] - command[..., 0]), np.sign(command.sum(axis=2))
    share = 100.0 / max(int(np.count_nonzero(near)), 1)
    return {
        "turns to and fro": share * np.count_nonzero(flips_of(turn) & near),
        "back and forth": share * np.count_nonzero(flips_of(travel) & near),
    }


def _episodes(model: SwarmModel, steps: int) -> dict[str, float]:
    found = pathologies_of(model)
    return {kind: sum(episode.steps for episode in found.of_kind(kind)) / steps for kind in (CORRIDOR, THRESHOLD)}
