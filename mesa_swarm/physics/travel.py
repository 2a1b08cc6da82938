"""A step of all robots, in pieces, with every contact resolved, in the order of cells.

A step is cut into pieces of at most half a radius. In each, robots advance along their arcs, leave static bodies,
deepest overlap first, and are separated from each other (see `separation`). Driven bodies move in the same pieces
before the robots do; robots are pushed out of their way, and where one cannot leave, the body returns as well and has
to stop.

What robots meet is resolved on copies of their columns in the order of cells: those near each other are near each other
in memory. Row p of these is the robot in row ``order[p]`` of the swarm.
"""

from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import Block, KernelCall, call_at, code_address, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, cos, direction_of, hypot
from mesa_swarm.kernels.prefetch import FEWEST_ROWS, fetch_to_read, fetch_to_write
from mesa_swarm.kernels.type_names import Flags, Integers, RealRows, Reals
from mesa_swarm.physics.arcs import count_pieces, move_along_arc, move_along_chord, recall_direction
from mesa_swarm.physics.contact import push_all_from_statics, unpack_solids
from mesa_swarm.physics.crowd import Crowd, CrowdArrays
from mesa_swarm.physics.driven_bodies import advance_bodies, count_body_pieces
from mesa_swarm.physics.separation import (
    MOST_SWEEPS,
    NONE,
    SETTLED,
    STRAYED,
    SeparationArrays,
    return_to_free_places,
    separate,
    separate_alone,
    separate_alone_beside_movers,
    separate_rows,
    separate_rows_beside_movers,
    separate_together,
    separate_together_beside_movers,
    stop_jumps,
)
from mesa_swarm.physics.threads import RowCrew
from mesa_swarm.world.statics import ROBOT

ONLY = 0
# How many robots ahead their rows are fetched.
AHEAD = 16


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


class TravelCalls(NamedTuple):
    """The kernels of robots that travel, which threads may share: see `advance_part`, `finish_part`, `separate_alone`.

    `pieces` is into how many pieces the step is cut.
    """

    pieces: Integers
    advance: KernelCall
    separate: KernelCall
    finish: KernelCall


class TravelArrays(NamedTuple):
    """What `advance_part` and `finish_part` take: blocks, of which `movers` is empty without driven bodies."""

    pieces: Integers
    robots: Integers
    crowd: Integers
    statics: Integers
    movers: Integers


@compiled(nogil=True, apart=True)
def travel_pieces(piece, pieces, turn_angle, calls, robots, crowd, statics, movers):
    """Move robots through the pieces of a step, from `piece` on, as long as these get apart; after the last, finish.

    Return the piece in which they did not, the number of pieces, which is counted before the first one, and the state
    in which separating has ended. `calls` is a block of `TravelCalls`; the rest is as `travel` takes it.
    """
    t, n = unpack(calls, TravelCalls), len(unpack(robots, RobotArrays).radius)
    if piece == 0:
        pieces = count_all_pieces(robots, movers)
    t.pieces[ONLY] = pieces
    for k in range(piece, pieces):
        if k > 0:  # after the piece before, also where its robots were got apart from Python
            turn_rows(turn_angle, robots, crowd)
        begin_piece(k, pieces, robots, crowd, statics, movers)
        call_at(t.advance.address, t.advance.block, k, NONE, n)
        state = call_at(t.separate.address, t.separate.block, NONE, NONE, n)
        if state != SETTLED:
            return k, pieces, state
    turn_rows(turn_angle, robots, crowd)
    call_at(t.finish.address, t.finish.block, NONE, NONE, n)
    return pieces, pieces, SETTLED


def calls_of_travel(crew: RowCrew, near: np.ndarray, blocks: Blocks) -> tuple[Block, list[Any]]:
    """Return the block of `TravelCalls` of a crew, and what it refers to; `near` are the numbers of `PairArrays`."""
    robots, crowd, statics, movers = blocks
    bodies = crowd, statics, np.empty(0, np.int64) if movers is None else movers
    advance, alone, together, rows = KERNELS if movers is None else KERNELS_BESIDE_MOVERS
    shared, outcomes, pieces = crew.parts > 1, np.zeros((crew.parts, 2), np.int64), np.zeros(1, np.int64)
    travelling = Block(TravelArrays(pieces, robots, *bodies))
    of_rows = code_address(rows) if shared else 0
    separating = Block(SeparationArrays(*bodies, near, crew.numbers, of_rows, outcomes))
    (advancing, kept), (finishing, kept_too) = (
        crew.call_of(kernel, travelling.numbers) for kernel in (advance, finish_part)
    )
    separate = KernelCall(code_address(together if shared else alone), separating.numbers)
    return Block(TravelCalls(pieces, advancing, separate, finishing)), [travelling, separating, kept, kept_too]


def travel(crowd: Crowd, turn_angle: float, calls: np.ndarray, blocks: Blocks) -> None:
    """Move all robots through one step, resolve every contact, and write the contact columns.

    The pairs of the crowd are those near each other at `reference`; where robots have gone too far from there, both are
    renewed. A robot whose travel is farther than `turn_angle` (rad) from a flat face's normal is turned along the face.
    For `calls` see `calls_of_travel`; for how bodies move see `moving`.
    """
    _, *bodies = blocks
    piece, pieces, state = travel_pieces(0, 0, turn_angle, calls, *blocks)
    while state != SETTLED:
        crowd.pairs = get_apart(state, crowd.pairs, *bodies)
        piece, pieces, state = travel_pieces(piece + 1, pieces, turn_angle, calls, *blocks)


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


@compiled(nogil=True)
def advance_part(block, piece, first, last):
    """Move robots p in [first, last) through a piece of their arcs, and out of static bodies."""
    advance_rows(piece, block, None, first, last)
    return 0


@compiled(nogil=True)
def advance_part_beside_movers(block, piece, first, last):
    """Do the same in a world with driven bodies."""
    advance_rows(piece, block, unpack(block, TravelArrays).movers, first, last)
    return 0


@compiled
def advance_rows(piece, block, movers, first, last):
    """Move robots p in [first, last) through a piece of their arcs, and out of static bodies."""
    a = unpack(block, TravelArrays)
    robots, crowd, statics, pieces = a.robots, a.crowd, a.statics, a.pieces[ONLY]
    r, c, solids = unpack(robots, RobotArrays), unpack(crowd, CrowdArrays), unpack_solids(statics, movers)
    position, heading, motion, order, places, before = r.position, r.heading, r.motion, c.order, c.places, c.before
    depth, face, extra_turn, known = c.contacts.depth, c.contacts.face, r.extra_turn, c.directions
    ahead_of = AHEAD if order.shape[0] >= FEWEST_ROWS else 0
    for p in range(first, last):
        i = order[p]
        if ahead_of > 0:
            later = order[min(p + ahead_of, last - 1)]
            fetch_to_write(position, later)
            fetch_to_write(heading, later)
            fetch_to_read(motion, later)
            fetch_to_read(known, later)
            fetch_to_write(extra_turn, later)
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


@compiled(nogil=True)
def finish_part(block, step, first, last):
    """Write the positions and the contacts of robots p in [first, last) into the columns."""
    a = unpack(block, TravelArrays)
    r, c = unpack(a.robots, RobotArrays), unpack(a.crowd, CrowdArrays)
    position, collided, order, places = r.position, r.collided, c.order, c.places
    contact_kind, contact_index, contact_normal = r.contact_kind, r.contact_index, r.contact_normal
    kind, other, normal, depth = c.contacts.kind, c.contacts.other, c.contacts.normal, c.contacts.depth
    contact_depth, ahead_of = r.contact_depth, AHEAD if order.shape[0] >= FEWEST_ROWS else 0
    for p in range(first, last):
        i = order[p]
        if ahead_of > 0:
            later = order[min(p + ahead_of, last - 1)]
            fetch_to_write(position, later)
            fetch_to_write(collided, later)
            fetch_to_write(contact_depth, later)
        position[i, 0], position[i, 1] = places[p, 0], places[p, 1]
        if depth[p] > 0.0:
            contact_kind[i] = kind[p]
            contact_index[i] = order[other[p]] if kind[p] == ROBOT else other[p]
            contact_normal[i, 0], contact_normal[i, 1] = normal[p, 0], normal[p, 1]
        elif collided[i]:
            contact_kind[i] = contact_index[i] = -1
            contact_normal[i, 0] = contact_normal[i, 1] = 0.0
        contact_depth[i] = depth[p]
        collided[i] = depth[p] > 0.0
    return 0


# Of worlds without and with driven bodies: what advances rows, what separates robots alone and by threads, and rows.
KERNELS = advance_part, separate_alone, separate_together, separate_rows
KERNELS_BESIDE_MOVERS = (
    advance_part_beside_movers,
    separate_alone_beside_movers,
    separate_together_beside_movers,
    separate_rows_beside_movers,
)
