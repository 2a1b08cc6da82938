"""Diagnosis: what a watched model shows of behaviour that gets nowhere, and how it is told."""

import numpy as np
import pytest

from mesa_swarm import AGENT3, HolonomicDrive, RobotDesign
from mesa_swarm.analysis.pathology import KINDS, Episode, Pathologies, find_pathologies
from mesa_swarm.cli.diagnose_commands import MOST_TOLD, told
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.diagnosis import NEEDED, pathologies_of
from mesa_swarm.gallery import find_model
from scenes import ahead, blind, corridor, empty


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


def test_where_nothing_was_kept_it_says_what_to_do():
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


# ---- how it is told


def stuck(first, last, *robots):
    return Episode(kind="stuck", robots=robots, first_step=first, last_step=last)


def test_the_longest_are_told_first_by_unique_ids():
    found = Pathologies((stuck(1, 40, 0), stuck(5, 99, 1), stuck(7, 46, 0)))
    assert told(found, [11, 12]) == [
        "Robot 12 drove and did not move, in steps 5 to 99.",
        "Robot 11 drove and did not move, in steps 1 to 40.",
        "Robot 11 drove and did not move, in steps 7 to 46.",
    ]


def test_pairs_are_told_by_both_ids():
    pair = Episode(kind="head-on pair", robots=(0, 2), first_step=1, last_step=50, layers=(1,))
    assert told(Pathologies((pair,)), [4, 5, 6])[0].startswith("Robots 4 and 6 faced each other")


@pytest.mark.parametrize(("there", "lines"), [(MOST_TOLD, MOST_TOLD), (MOST_TOLD + 1, MOST_TOLD + 1)])
def test_no_more_than_twenty_are_told_and_the_rest_counted(there, lines):
    sentences = told(Pathologies(tuple(stuck(k, 50 + 2 * k, 0) for k in range(there))), [9])
    assert len(sentences) == lines
    assert sentences[0].endswith(f"in steps {there - 1} to {48 + 2 * there}.")
    assert (sentences[-1] == "... and 1 more, none of them longer.") == (there > MOST_TOLD)


def test_where_nothing_was_found_it_says_so():
    assert told(Pathologies(()), []) == ["No pathology was found."]
