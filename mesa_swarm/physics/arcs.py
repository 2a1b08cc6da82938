"""Moving bodies along exact arcs, and the slip that the achieved motion reveals (PHYSICS 2)."""

import math

from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of, sin

# A motion may overlap at most this share of a radius before contact is resolved.
LONGEST_PIECE = 0.5


@compiled
def copy_places(source, target):
    """Copy places (n, 2): for ``target[:] = source`` Numba would compile, for seconds, how to word an error."""
    for i in range(source.shape[0]):
        target[i, 0], target[i, 1] = source[i, 0], source[i, 1]


@compiled
def least_radius(radius):
    """Return the least radius, 0 without any: for ``radius.min()`` Numba would compile ``take`` and its errors."""
    least = radius[0] if len(radius) else 0.0
    for r in radius:
        least = min(least, r)
    return least


@compiled
def largest_of(radius):
    """Return the largest radius, 0 without any."""
    largest = 0.0
    for r in radius:
        largest = max(largest, r)
    return largest


@compiled
def count_pieces(motion, radius):
    """Return the number of pieces of the step such that no robot moves more than half the least radius in one."""
    square = 0.0
    for i in range(motion.shape[0]):
        square = max(square, motion[i, 0] * motion[i, 0] + motion[i, 1] * motion[i, 1])
    return max(1, math.ceil(math.sqrt(square) / (LONGEST_PIECE * least_radius(radius)) - 1e-9)) if square > 0.0 else 1


@compiled
def sinc(half_turn: float) -> float:
    """Return sin(a) / a, the length of an arc's chord relative to the arc, which turns by 2 a."""
    if abs(half_turn) < 1e-4:
        return 1.0 - half_turn * half_turn / 6.0
    return sin(half_turn) / half_turn


@compiled
def move_along_arc(heading, ahead, left, turn, pieces):
    """Return by how much a robot moves in one of `pieces` equal parts of its arc, dx and dy, and its next heading.

    The body moves with constant (ahead, left, turn): its chord is sinc(turn / 2) times the arc and points along the
    heading half-way.
    """
    half_way = heading + turn / pieces / 2.0
    return move_along_chord(direction_of(half_way), heading, ahead, left, turn, pieces)


@compiled
def move_along_chord(direction, heading, ahead, left, turn, pieces):
    """Return the same where the direction of the chord is known."""
    turn = turn / pieces
    chord = sinc(turn / 2.0) / pieces
    cosine, sine = direction
    return chord * (cosine * ahead - sine * left), chord * (sine * ahead + cosine * left), wrap_angle(heading + turn)


@compiled
def recall_direction(i, heading, known):
    """Return cosine and sine of a heading, computed anew where it is not that of row i of `known`, which is written.

    Most robots drive straight on for many steps. Zero has two signs, and so has its sine.
    """
    if known[i, 0] != heading or heading == 0.0:
        known[i, 0] = heading
        known[i, 1], known[i, 2] = direction_of(heading)
    return known[i, 1], known[i, 2]


@compiled
def advance_robots(position, heading, motion, pieces):
    """Move every robot along one of `pieces` equal parts of its arc; positions and headings are written."""
    for i in range(position.shape[0]):
        dx, dy, heading[i] = move_along_arc(heading[i], motion[i, 0], motion[i, 1], motion[i, 2], pieces)
        position[i, 0] += dx
        position[i, 1] += dy


@compiled
def write_achieved_motion(start, position, start_heading, extra_turn, collided, motion):
    """Replace the motion of robots that collided by the one that they achieved.

    `motion` (n, 3) is along the body: ahead, to the left, and the turn (rad). `start`, `position` (n, 2) and
    `start_heading` are on the map, before and after the step; walls have added `extra_turn`. Half a circle of length
    pi / 2 takes a robot 1 to its left: its motion is (pi / 2, 0, pi).
    """
    for i in range(position.shape[0]):
        if not collided[i]:
            continue
        half_way = start_heading[i] + motion[i, 2] / 2.0
        chord = sinc(motion[i, 2] / 2.0)
        dx, dy = position[i, 0] - start[i, 0], position[i, 1] - start[i, 1]
        motion[i, 2] += extra_turn[i]
        if abs(chord) > 1e-6:
            cosine, sine = direction_of(half_way)
            motion[i, 0] = (cosine * dx + sine * dy) / chord
            motion[i, 1] = (cosine * dy - sine * dx) / chord


@compiled
def write_wheel_slip(command, wheels, slip):
    """Write (m - v) / m per wheel, 0 where m = 0 (A.5)."""
    for i in range(command.shape[0]):
        for w in range(command.shape[1]):
            m = command[i, w]
            slip[i, w] = (m - wheels[i, w]) / m if m != 0.0 else 0.0
