"""Diagnosis: what a watched model shows of behaviour that makes no progress."""

import numpy as np
import pytest

from mesa_swarm import AGENT3, HolonomicDrive, RobotDesign
from mesa_swarm.analysis.pathology import KINDS, find_pathologies
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.experiments.diagnosis import NEEDED, pathologies_of
from mesa_swarm.model.gallery import find_model
from support.scenes import ahead, blind, corridor, empty


def in_corridor(turn, **options):
    model = corridor(width=22.0)
    model.add_robots(AGENT3, poses=[(150, 150, 0.1)], tendency="left")
    model.control = Subsumption(Avoid(distance=15, turn=turn), Explore())
    model.watch(**{"last": None, **options})
    return model


def against_a_wall():
    model = empty()
    model.add_robots(blind(), poses=[(395, 150, 0.0), (100, 100, 0.0)])
    model.control = Subsumption(ahead)
    model.watch(last=None)
    return model.run(80)


def test_a_robot_that_turns_on_the_spot_in_a_corridor_is_found_and_one_that_stops_a_wheel_is_not():
    found = pathologies_of(in_corridor("stationary").run(500))
    assert found.counts() == {**dict.fromkeys(KINDS, 0), "corridor flip": 1}
    assert found[0].last_step == 500
    assert len(pathologies_of(in_corridor("translational").run(500))) == 0


def test_rows_are_those_of_the_swarm():
    (episode,) = pathologies_of(against_a_wall())
    assert (episode.kind, episode.robots) == ("stuck", (0,))
    assert (episode.first_step, episode.last_step) == (2, 80)


def test_it_is_what_find_pathologies_finds_in_the_kept_arrays():
    model = find_model("collision_avoidance")(n_robots=30, turn="stationary", rng=1)
    kept = model.watch(last=None)
    model.run(400)
    swarm = model.swarm
    found = pathologies_of(model)
    assert len(found) > 5
    assert found == find_pathologies(
        steps=np.arange(1, 401),
        **{name: kept[name] for name in NEEDED},
        radius=swarm.radius,
        max_speed=swarm.max_speed,
        forward=[(robot.design.front, robot.design.left, robot.design.right) for robot in model.robots],
    )


def test_the_last_steps_alone_can_be_diagnosed():
    found = pathologies_of(in_corridor("stationary", last=100).run(500))
    assert found[0].first_step >= 401


def test_only_what_is_needed_must_be_watched():
    assert len(pathologies_of(in_corridor("stationary", columns=NEEDED).run(200))) == 1


def test_where_no_step_is_watched_the_error_has_the_cure():
    unwatched = find_model("collision_avoidance")(n_robots=2, rng=1).run(5)
    unstepped, layers = in_corridor("stationary"), in_corridor("stationary", columns=("layer",)).run(5)
    for model, words in (
        (unwatched, r"no steps are stored to diagnose; call model\.watch\(last=None\)"),
        (unstepped, "no step is stored to diagnose"),
        (layers, "not stored: position, heading, command, distance, kind; add them"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            pathologies_of(model)


def test_steps_that_were_left_out_are_refused():
    with pytest.raises(InvalidValueError, match="watch with every=1"):
        pathologies_of(in_corridor("stationary", every=2).run(100))


def test_robots_without_wheels_left_and_right_are_refused():
    model = empty()
    model.add_robots(blind(), poses=[(100, 100, 0.0)])
    model.add_robots(RobotDesign(name="glider", drive=HolonomicDrive()), poses=[(200, 100, 0.0)])
    model.control = Subsumption(ahead)
    model.watch()
    with pytest.raises(InvalidValueError, match="robots of the design glider have no wheels left and right"):
        pathologies_of(model.run(3))
