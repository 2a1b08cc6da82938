"""Signposts: robots write on boards where a source lies; all of it is a part made of public names."""

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.models.signposts import FADES, REACH, SOURCE, Signposts
from mesa_swarm.recording import Recording

STORED = {"visits": 1.0}


def placed(position, heading=0.0, **settings):
    """Return a model of one robot that stands at a place, with the source at the middle of the map."""
    model = Signposts(n_robots=1, rng=1, **settings)
    model.parts["boards"].source[:] = (400.0, 300.0)
    model.robots[0].position, model.robots[0].heading = position, heading
    return model, model.parts["boards"], model.robots[0]


def test_a_run_has_the_stored_numbers():
    assert Signposts(rng=1).run(1000).results() == STORED


def test_a_robot_that_comes_to_the_source_has_visited_it_once():
    model, boards, _ = placed((400.0, 300.0 + SOURCE / 2))
    model.run(5)
    assert boards.visits.tolist() == [1]
    assert boards.since.tolist() == [0]
    assert boards.seen.tolist() == [[400.0, 300.0]]


def test_a_robot_that_was_at_the_source_writes_where_it_lies_seen_from_the_board():
    model, boards, robot = placed((400.0, 300.0))
    model.run(1)
    robot.position = tuple(boards.places[0])
    model.run(1)
    x, y = boards.seen[0] - boards.places[0]
    assert boards.azimuth[0] == pytest.approx(np.arctan2(y, x))
    assert boards.strength[0] == 1.0
    assert boards.written.tolist() == [1]


def test_a_robot_that_searches_reads_the_board_within_reach_and_turns_to_where_it_points():
    model, boards, robot = placed((100.0, 100.0))
    robot.position = tuple(boards.places[7] + (REACH - 5.0, 0.0))
    boards.strength[7], boards.azimuth[7] = 1.0, 2.0
    model.run(1)
    model.sense()
    assert robot.sign[0] == 1.0
    assert robot.sign[1] == pytest.approx(2.0 - robot.heading)
    model.run(40)
    assert robot.heading == pytest.approx(2.0, abs=0.05)


def test_messages_fade_every_few_steps():
    model, boards, _ = placed((20.0, 20.0), evaporation=0.01)
    boards.strength[-1] = 1.0
    model.run(2 * FADES)
    assert boards.strength[-1] == pytest.approx(0.99 ** (2 * FADES))


def test_the_source_moves_when_it_is_due():
    model, boards, _ = placed((20.0, 20.0), moves=50)
    model.run(49)
    assert boards.source.tolist() == [400.0, 300.0]
    model.run(1)
    assert boards.source.tolist() != [400.0, 300.0]


def test_without_boards_nothing_is_written():
    model = Signposts(boards=0, rng=1).run(300)
    assert not model.parts["boards"].written.any()


@pytest.mark.slow
def test_it_is_recorded_drawn_and_resumed_like_any_model(tmp_path):
    model = Signposts(rng=3)
    with model.record(tmp_path / "run.arrow", checkpoint_every=50):
        model.run(200)
    recording = Recording(tmp_path / "run.arrow")
    assert {"boards.read", "boards.since", "boards.visits", "boards.written", "shown"} <= set(recording.columns)
    assert len(recording.at(200)["shown"]) == 37
    assert Signposts.resume(tmp_path / "run.arrow", step=120).run(80).state_hash() == model.state_hash()
    assert Signposts.verify(tmp_path / "run.arrow").same


def test_going_on_with_fewer_boards_is_refused_and_drops_nothing():
    model = Signposts(n_robots=4, rng=1).run(5)
    with pytest.raises(InvalidValueError, match=r"^the change makes part boards with column \w+ of shape"):
        model.continued(boards=3)
    assert model.continued(evaporation=0.01).run(2).completed == 7
