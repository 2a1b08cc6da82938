"""Estimating how others move from how their centroid moves, and driving as they do: MatchVelocity, Align, Cruise."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, HolonomicDrive, ProximitySensor, RobotDesign
from mesa_swarm.control import Align, Cruise, Explore, MatchVelocity, Subsumption, VectorSum, behaviour
from mesa_swarm.control.flocking import drive_arcs, track
from mesa_swarm.physics.arcs import advance_robots
from mesa_swarm.robots.drive import wheels_to_motion
from support.scenes import empty

EYES = RobotDesign(
    sensors=tuple(ProximitySensor(bearing_degrees=10.0 * k, field_of_view_degrees=10, range=100) for k in range(36))
)


@behaviour
def wander(me, left=0.8, right=0.8):
    """Drive at these shares of max_speed."""
    return left * me.max_speed, right * me.max_speed


def body_frame(vector, heading):
    c, s = math.cos(heading), math.sin(heading)
    return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])


@pytest.mark.parametrize(("left", "right"), [(0.9, 0.9), (0.0, 1.0), (-0.5, 1.0), (1.0, -1.0)])
def test_a_point_that_moves_steadily_is_estimated_exactly_however_the_robot_turns(left, right):
    """Against a twin that knows the world: the point's place is in the turning robot's frame."""
    start, heading, radius = np.array([3.0, -2.0]), 0.4, np.array([5.0])
    point, velocity = np.array([30.0, 10.0]), np.array([0.3, -0.4])
    turn = (right - left) / 10.0
    command = np.array([[left, right]])
    state = np.zeros((1, 2)), np.zeros(1, np.int64), np.zeros((1, 2)), np.zeros(1, np.int64)
    for k in range(40):
        place = body_frame(point - start, heading)
        track(place[None], np.ones(1, np.int64), command, radius, True, 0.1, 15.0, *state)
        if k >= 2:
            np.testing.assert_allclose(state[2][0], body_frame(velocity, heading), atol=1e-9)
        middle, v = heading + turn / 2, (left + right) / 2
        chord = v * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
        start = start + chord * np.array([math.cos(middle), math.sin(middle)])
        heading, point = heading + turn, point + velocity


def test_jumps_farther_than_neighbours_move_are_not_counted():
    state = np.zeros((1, 2)), np.zeros(1, np.int64), np.zeros((1, 2)), np.zeros(1, np.int64)
    for x in (10.0, 10.5, 60.0, 60.5):
        track(np.array([[x, 0.0]]), np.ones(1, np.int64), np.zeros((1, 2)), np.full(1, 5.0), True, 0.5, 15.0, *state)
    assert state[2][0] == pytest.approx([0.5, 0.0])
    assert state[3][0] == 2


def two_abreast(heading: float):
    """Return a world in which a robot that matches sees one that drives on, to its left."""
    model = empty(width=2000, height=2000)
    model.add_robots(EYES, poses=[(1000, 1000, heading)])
    model.add_robots(AGENT9.with_proximity(range=0), poses=[(1000, 1030, 0.0)])
    return model


def test_a_robot_that_matches_comes_to_drive_as_its_neighbour_does():
    model = two_abreast(0.6)
    model.control = Subsumption(MatchVelocity(memory=10), Explore(speed=0.7))
    model.run(120)
    assert model.swarm.heading[0] == pytest.approx(0.0, abs=0.35)
    assert np.mean(model.swarm.command[0]) == pytest.approx(0.7, abs=0.2)


def test_the_arc_reaches_the_point_to_which_the_neighbours_moved_in_one_step():
    velocity, radius = np.array([[0.3, 0.1], [0.5, -0.2]]), np.array([5.0, 2.0])
    command, layer = np.zeros((2, 2)), np.full(2, -1)
    drive_arcs(velocity, np.full(2, 9), 3, 0.0, np.full(2, 50.0), radius, command, layer, 0)
    motion, position, heading = np.empty((2, 3)), np.zeros((2, 2)), np.zeros(2)
    wheels_to_motion(command, radius, motion)
    advance_robots(position, heading, motion, 1)
    np.testing.assert_allclose(position, velocity, atol=1e-12)


def test_what_lies_behind_and_neighbours_that_stand_still_are_left_to_the_layers_below():
    velocity = np.array([[-0.5, 0.1], [0.05, 0.0], [0.5, 0.0]])
    command, layer = np.zeros((3, 2)), np.full(3, -1)
    drive_arcs(velocity, np.array([9, 9, 2]), 3, 0.1, np.ones(3), np.full(3, 5.0), command, layer, 0)
    assert layer.tolist() == [-1, -1, -1]


def test_boids_that_align_come_to_drift_as_their_neighbour_does():
    model = empty(width=2000, height=2000)
    boid = RobotDesign(name="boid", sensors=EYES.sensors, drive=HolonomicDrive())
    model.add_robots(boid, poses=[(1000, 1000, 1.0)])
    model.add_robots(RobotDesign(drive=HolonomicDrive()), poses=[(1030, 1000, 0.0)])
    model.control = VectorSum(Align(memory=5), Cruise(speed=0.5), weights=(4, 1))
    before = model.run(99).swarm.position.copy()
    travel = model.run(1).swarm.position - before
    azimuth = np.arctan2(travel[:, 1], travel[:, 0])
    assert azimuth[0] == pytest.approx(azimuth[1], abs=0.35)


def test_cruising_goes_on_in_the_last_direction():
    model = empty()
    model.add_robots(RobotDesign(drive=HolonomicDrive()), poses=[(100, 100, 0.0)])
    model.control = VectorSum(wander(left=0.3, right=0.4))
    model.step()
    model.swarm.columns["command"][:] = (0.0, 0.2)
    last = model.swarm.command.copy()
    model.control = VectorSum(Cruise(speed=0.5))
    model.step()
    assert last.any()
    assert model.swarm.command[0].tolist() == [0.5, 0.0]  # a new control forgets
    model.swarm.columns["command"][:] = (0.0, 0.2)
    model.step()
    assert model.swarm.command[0].tolist() == [0.0, 0.5]
