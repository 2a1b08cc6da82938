"""A step of all robots, in pieces, with every contact resolved, in the order of cells.

A step is cut into pieces of at most half a radius. In each, robots advance along their arcs, leave static bodies,
deepest overlap first, and are separated from each other (see `separation`). Driven bodies move in the same pieces
before the robots do; robots are pushed out of their way, and where one cannot leave, the body returns as well and has
to stop.

What robots meet is resolved on copies of their columns in the order of cells: those near each other are near each other
in memory. Row p of these is the robot in row ``order[p]`` of the swarm.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, cos, direction_of, hypot
from mesa_swarm.kernels.type_names import Flags, Integers, RealRows, Reals
from mesa_swarm.physics.arcs import count_pieces, move_along_arc, move_along_chord, recall_direction
from mesa_swarm.physics.contact import push_all_from_statics, unpack_solids
from mesa_swarm.physics.crowd import CrowdArrays
from mesa_swarm.physics.driven_bodies import advance_bodies, count_body_pieces
from mesa_swarm.physics.separation import (
    MOST_SWEEPS,
    NONE,
    SETTLED,
    STRAYED,
    check_overlaps,
    finish_separation,
    return_to_free_places,
    separate,
    separate_groups,
    separate_near,
    start_groups,
    stop_jumps,
)
from mesa_swarm.world.statics import ROBOT

# Calls a function of the first row and one past the last for ranges of a given number of rows, and returns the results.
Share = Callable[[int, Callable[[int, int], Any]], list]


class RobotArrays(NamedTuple):
    """The columns that a step of all robots reads and writes.

    `motion` (n, 3) is the one that the wheels would make, along the body; `extra_turn` (n,) becomes the turn that flat
    faces added. The others are columns of the swarm; of these, only `radius` is not written.
    """

    position: RealRows
    heading: Reals
    motion: RealRows
    radius: Reals
    collided: Flags
    contact_kind: Integers
    contact_index: Integers
    contact_normal: RealRows
    contact_depth: Reals
    extra_turn: Reals


class Blocks(NamedTuple):
    """What moves in a step, as compiled functions take it: numbers of blocks of the arrays of these names, or None."""

    robots: np.ndarray
    crowd: np.ndarray
    statics: np.ndarray
    movers: np.ndarray | None


@compiled(nogil=True, apart=True)
def travel_pieces(piece, pieces, pairs, turn_angle, robots, crowd, statics, movers):
    """Move robots through the pieces of a step, from `piece` on, as long as these get apart; after the last, finish.

    Return the piece in which they did not, the number of pieces, which is counted before the first one, and the state
    in which separating has ended. The rest is as `travel` takes it.
    """
    n = len(unpack(robots, RobotArrays).radius)
    if piece == 0:
        pieces = count_all_pieces(robots, movers)
    for k in range(piece, pieces):
        if k > 0:  # after the piece before, also where its robots were got apart from Python
            turn_rows(turn_angle, robots, crowd)
        begin_piece(k, pieces, robots, crowd, statics, movers)
        advance_rows(k, pieces, robots, crowd, statics, movers, NONE, n)
        state = separate_near(crowd, statics, movers, pairs, MOST_SWEEPS)
        if state != SETTLED:
            return k, pieces, state
    turn_rows(turn_angle, robots, crowd)
    finish_rows(robots, crowd, NONE, n)
    return pieces, pieces, SETTLED


def travel(pairs: np.ndarray, turn_angle: float, blocks: Blocks) -> np.ndarray:
    """Move all robots through one step, resolve every contact, and write the contact columns.

    `pairs` are those near each other at `reference`. Return them; where robots have gone too far from there, both are
    renewed. A robot whose travel is farther than `turn_angle` (rad) from a flat face's normal is turned along the face.
    For how bodies move see `moving`.
    """
    _, *bodies = blocks
    piece, pieces, state = travel_pieces(0, 0, pairs, turn_angle, *blocks)
    while state != SETTLED:
        pairs = get_apart(state, pairs, *bodies)
        piece, pieces, state = travel_pieces(piece + 1, pieces, pairs, turn_angle, *blocks)
    return pairs


def travel_together(share: Share, n: int, pairs: np.ndarray, turn_angle: float, blocks: Blocks) -> np.ndarray:
    """Do what `travel` does, the rows of n robots in ranges by ``share(n, rows)``."""
    robots, *bodies = blocks
    crowd, _, movers = bodies
    pieces = count_all_pieces(robots, movers)
    for piece in range(pieces):
        begin_piece(piece, pieces, *blocks)
        share(n, partial(advance_rows, piece, pieces, *blocks))
        state = _separate_together(share, n, pairs, bodies)
        if state != SETTLED:
            pairs = get_apart(state, pairs, *bodies)
        turn_rows(turn_angle, robots, crowd)
    share(n, partial(finish_rows, robots, crowd))
    return pairs


def _separate_together(share: Share, n: int, pairs: np.ndarray, bodies: Sequence) -> int:
    """Separate robots as `separate_near` does."""
    crowd, *_ = bodies
    state, overlaps = check_overlaps(crowd, pairs)
    if state == STRAYED:
        return state
    groups = start_groups(crowd, pairs)
    results = share(n, partial(separate_groups, *bodies, pairs, groups, overlaps, overlaps, MOST_SWEEPS))
    later, state = np.concatenate([late for late, _ in results]), max(state for _, state in results)
    return finish_separation(*bodies, pairs, groups, overlaps, later, MOST_SWEEPS, state)


@compiled(nogil=True, apart=True)
def get_apart(state, pairs, crowd, statics, movers):
    """Separate robots that have to go far, or put back those that stay stuck, and return the pairs near each other."""
    is_apart = False
    if state == STRAYED:
        is_apart, pairs = separate(crowd, statics, movers, pairs, MOST_SWEEPS)
    if not is_apart:
        return_to_free_places(crowd, statics, movers, pairs)
    return pairs


@compiled
def count_all_pieces(robots, movers):
    """Return into how many pieces the step of robots and driven bodies is cut."""
    r = unpack(robots, RobotArrays)
    return count_body_pieces(count_pieces(r.motion, r.radius), r.radius, movers)


@compiled
def begin_piece(piece, pieces, robots, crowd, statics, movers):
    """Move driven bodies through a piece of their way."""
    if movers is not None:
        r, c, solids = unpack(robots, RobotArrays), unpack(crowd, CrowdArrays), unpack_solids(statics, movers)
        order, places, position = c.order, c.places, r.position
        if piece == 0:
            for p in range(order.shape[0]):
                places[p, 0], places[p, 1] = position[order[p], 0], position[order[p], 1]
        advance_bodies(piece, pieces, r.radius, solids.movers, solids.edges, solids.discs)
        stop_jumps(places, c.radii, solids.edges, solids.discs, solids.movers)


@compiled(nogil=True, apart=True)
def advance_rows(piece, pieces, robots, crowd, statics, movers, first, last):
    """Move robots p in [first, last) through a piece of their arcs, and out of static bodies."""
    r, c, solids = unpack(robots, RobotArrays), unpack(crowd, CrowdArrays), unpack_solids(statics, movers)
    position, heading, motion, order, places, before = r.position, r.heading, r.motion, c.order, c.places, c.before
    depth, face, extra_turn, known = c.contacts.depth, c.contacts.face, r.extra_turn, c.directions
    for p in range(first, last):
        i = order[p]
        if piece == 0:
            places[p, 0], places[p, 1] = position[i, 0], position[i, 1]
            depth[p], extra_turn[i] = 0.0, 0.0
        before[p, 0], before[p, 1] = places[p, 0], places[p, 1]
        face[p, 2] = 0.0
        ahead, left, turn = motion[i, 0], motion[i, 1], motion[i, 2]
        if turn == 0.0:
            direction = recall_direction(i, heading[i] + turn, known)
            dx, dy, heading[i] = move_along_chord(direction, heading[i], ahead, left, turn, pieces)
        else:
            dx, dy, heading[i] = move_along_arc(heading[i], ahead, left, turn, pieces)
        places[p, 0] += dx
        places[p, 1] += dy
    push_all_from_statics(c.rows[first:last], places, c.radii, solids, c.contacts, c.free)


@compiled(apart=True)
def turn_rows(turn_angle, robots, crowd):
    """Turn robots along the faces that they met in a piece of the step, see `turn_along_faces`."""
    r, c = unpack(robots, RobotArrays), unpack(crowd, CrowdArrays)
    turn_along_faces(c.order, r.heading, r.motion, c.contacts.face, turn_angle, r.extra_turn)


@compiled(apart=True)
def turn_along_faces(order, heading, motion, face, turn_angle, extra_turn):
    """Turn robots so that they travel parallel to the flat face that they met at a grazing incidence."""
    for p in range(order.shape[0]):
        if face[p, 2] == 0.0:
            continue
        i = order[p]
        speed = hypot(motion[i, 0], motion[i, 1])
        if speed == 0.0:
            continue
        ahead, left = motion[i, 0] / speed, motion[i, 1] / speed
        cosine, sine = direction_of(heading[i])
        tx, ty = cosine * ahead - sine * left, sine * ahead + cosine * left
        into = -(tx * face[p, 0] + ty * face[p, 1])
        if into <= 0.0 or into >= cos(turn_angle):
            continue
        along_x, along_y = tx + into * face[p, 0], ty + into * face[p, 1]
        turn = atan2(tx * along_y - ty * along_x, tx * along_x + ty * along_y)
        extra_turn[i] += turn
        heading[i] = wrap_angle(heading[i] + turn)


@compiled(nogil=True, apart=True)
def finish_rows(robots, crowd, first, last):
    """Write the positions and the contacts of robots p in [first, last) into the columns."""
    r, c = unpack(robots, RobotArrays), unpack(crowd, CrowdArrays)
    position, collided, order, places = r.position, r.collided, c.order, c.places
    contact_kind, contact_index, contact_normal = r.contact_kind, r.contact_index, r.contact_normal
    kind, other, normal, depth = c.contacts.kind, c.contacts.other, c.contacts.normal, c.contacts.depth
    for p in range(first, last):
        i = order[p]
        position[i, 0], position[i, 1] = places[p, 0], places[p, 1]
        if depth[p] > 0.0:
            contact_kind[i] = kind[p]
            contact_index[i] = order[other[p]] if kind[p] == ROBOT else other[p]
            contact_normal[i, 0], contact_normal[i, 1] = normal[p, 0], normal[p, 1]
        elif collided[i]:
            contact_kind[i] = contact_index[i] = -1
            contact_normal[i, 0] = contact_normal[i, 1] = 0.0
        r.contact_depth[i] = depth[p]
        collided[i] = depth[p] > 0.0
