"""Sensing and moving of plain robots in one call each.

In small worlds a step takes about as long as its calls from Python and the arrays that these pass.
"""

from typing import NamedTuple

from mesa_swarm.geometry.block import unpack
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.type_names import RealRows, Reals
from mesa_swarm.physics.crowd import sort_by_cell
from mesa_swarm.physics.motion import achieved_motion, copy_places, slip_of
from mesa_swarm.physics.sensing import sense_proximity
from mesa_swarm.physics.separation import SETTLED
from mesa_swarm.physics.travel import RobotArrays, travel_pieces
from mesa_swarm.robots.drive import motion_to_wheels, wheels_to_motion


class WheelArrays(NamedTuple):
    """The column slip; the speeds at which wheels rolled, and the poses before the step, which are scratch."""

    slip: RealRows
    rolled: RealRows
    start: RealRows
    start_heading: Reals


@compiled(nogil=True)
def sense_packed(eyes, crowd, movers, first, last, pairs):
    """Sort robots by cell, then do what `sense_proximity` does."""
    sort_by_cell(crowd)
    return sense_proximity(eyes, crowd, movers, first, last, pairs)


@compiled(nogil=True)
def move_packed(piece, pieces, pairs, turn_angle, driven, wheels, robots, crowd, statics, movers):
    """Move robots with two wheels that reach their speed at once, where there are no loads.

    What is driven becomes the motion, `travel_pieces` moves all, and the slip of what they have achieved is written.
    """
    r, w = unpack(robots, RobotArrays), unpack(wheels, WheelArrays)
    motion, collided, rolled = r.motion, r.collided, w.rolled
    if piece == 0:
        wheels_to_motion(driven, r.radius, motion)
        copy_places(r.position, w.start)
        for i in range(len(collided)):
            w.start_heading[i] = r.heading[i]
    piece, pieces, state = travel_pieces(piece, pieces, pairs, turn_angle, robots, crowd, statics, movers)
    if state == SETTLED:
        achieved_motion(w.start, r.position, w.start_heading, r.extra_turn, collided, motion)
        motion_to_wheels(motion, r.radius, rolled)
        for i in range(len(collided)):
            if not collided[i]:
                rolled[i, 0], rolled[i, 1] = driven[i, 0], driven[i, 1]
        slip_of(driven, rolled, w.slip)
    return piece, pieces, state
