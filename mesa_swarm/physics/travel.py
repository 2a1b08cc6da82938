"""A step of all robots, in pieces, with every contact resolved, in the order of cells.

A step is cut into pieces of at most half a radius. In each, robots advance along their arcs, leave static bodies,
deepest overlap first, and are separated from each other (see `separation`). Driven bodies move in the same pieces
before the robots do; robots are pushed out of their way, and where one cannot leave, the body returns as well and has
to stop.

What robots meet is resolved on copies of their columns in the order of cells: those near each other are near each other
in memory. Row p of these is the robot in row ``order[p]`` of the swarm.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.physics.contact import push_all_from_statics
from mesa_swarm.physics.motion import count_pieces, moved_by
from mesa_swarm.physics.moving import advance_bodies, count_body_pieces
from mesa_swarm.physics.separation import (
    MOST_SWEEPS,
    NONE,
    SETTLED,
    STRAYED,
    finish_separation,
    overlaps_of,
    put_back,
    scratch_of,
    separate,
    separate_groups,
    separate_near,
    stop_jumps,
)
from mesa_swarm.world.statics import ROBOT

# Calls a function of the first row and one past the last for ranges of a given number of rows, and returns the results.
Share = Callable[[int, Callable[[int, int], Any]], list]


@compiled(nogil=True, apart=True)
def travel_pieces(
    piece, pieces, pairs, turn_angle, crowd, listed, position, heading, motion, radius, statics,
    collided, contact_kind, contact_index, contact_normal, contact_depth, extra_turn,
):  # fmt: skip
    """Move robots through the pieces of a step, from `piece` on, as long as these get apart; after the last, finish.

    Return the piece in which they did not, the number of pieces, which is counted before the first one, and the state
    in which separating has ended. The rest is as `travel` takes it.
    """
    n = len(heading)
    if piece == 0:
        extra_turn[:] = 0.0
        pieces = count_body_pieces(count_pieces(motion, radius), radius, statics[8])
    for k in range(piece, pieces):
        begin_piece(k, pieces, crowd, position, radius, statics)
        advance_rows(NONE, n, k, pieces, crowd, position, heading, motion, statics)
        state = separate_near(crowd[1], crowd[3], crowd[4], statics, crowd[6], crowd[5], MOST_SWEEPS, listed, pairs)
        if state != SETTLED:
            return k, pieces, state
        turn_along_faces(crowd[0], heading, motion, crowd[6][4], turn_angle, extra_turn)
    finish_rows(NONE, n, crowd, position, collided, contact_kind, contact_index, contact_normal, contact_depth)
    return pieces, pieces, SETTLED


def travel(move: Callable, moved: tuple, pairs: np.ndarray, turn_angle: float, *given: Any) -> np.ndarray:
    """Move all robots through one step, resolve every contact, and write the contact columns.

    Return the pairs near each other at `listed`, which is written where robots have gone too far from it.

    `position` (n, 2) and `heading` are changed; `motion` (n, 3) is the one that the wheels would make, along the body.
    `crowd` are the copies of columns that `Crowd.arrays` describes; `pairs` those near each other at `listed`.

    A robot whose travel is farther than `turn_angle` (rad) from a flat face's normal is turned along the face;
    `extra_turn` becomes the turn that faces added. `statics` are edges, discs, owner, body, bounds, grid numbers,
    touched_start and touched_items, and `Moving.numbers` or None; see there for how bodies move.

    `move` is `travel_pieces` or does the same, and `moved` what it takes besides.
    """
    piece, pieces, state = move(0, 0, pairs, turn_angle, *moved)
    while state != SETTLED:
        crowd, listed, grid, _, heading, motion, _, statics, *_, extra_turn = given
        pairs = _resolve(state, crowd, listed, pairs, grid, statics)
        turn_along_faces(crowd[0], heading, motion, crowd[6][4], turn_angle, extra_turn)
        piece, pieces, state = move(piece + 1, pieces, pairs, turn_angle, *moved)
    return pairs


def travel_together(share: Share, pairs: np.ndarray, turn_angle: float, *given: Any) -> np.ndarray:
    """Do what `travel` does, given the same, the rows of robots in ranges by ``share(n, rows)``."""
    crowd, listed, grid, position, heading, motion, radius, statics, *written, extra_turn = given
    n = len(heading)
    extra_turn.fill(0.0)
    pieces = count_body_pieces(count_pieces(motion, radius), radius, statics[8])
    for piece in range(pieces):
        begin_piece(piece, pieces, crowd, position, radius, statics)
        moved = piece, pieces, crowd, position, heading, motion, statics
        share(n, partial(_on_rows, advance_rows, moved))
        state = _separate_together(share, crowd, listed, pairs, statics)
        if state != SETTLED:
            pairs = _resolve(state, crowd, listed, pairs, grid, statics)
        turn_along_faces(crowd[0], heading, motion, crowd[6][4], turn_angle, extra_turn)
    share(n, partial(_on_rows, finish_rows, (crowd, position, *written)))
    return pairs


def _separate_together(share: Share, crowd: tuple, listed: np.ndarray, pairs: np.ndarray, statics: tuple) -> int:
    """Separate robots as `separate_near` does."""
    _, places, _, radii, numbers, free, contacts, _ = crowd
    state, met = overlaps_of(places, radii, listed, pairs)
    if state == STRAYED:
        return state
    bodies = places, radii, numbers, statics, contacts, free, listed, pairs, *scratch_of(places, radii, pairs)
    found = share(len(radii), partial(_on_rows, separate_groups, (met, met, MOST_SWEEPS, bodies)))
    later, state = np.concatenate([late for late, _ in found]), max(state for _, state in found)
    return finish_separation(MOST_SWEEPS, bodies, met, later, state)


def _resolve(
    state: int, crowd: tuple, listed: np.ndarray, pairs: np.ndarray, grid: tuple, statics: tuple
) -> np.ndarray:
    """Separate robots that have to go far, or put back those that stay stuck, and return the pairs near each other."""
    _, places, before, radii, numbers, free, contacts, _ = crowd
    settled = False
    if state == STRAYED:
        settled, pairs = separate(places, radii, numbers, grid, statics, contacts, free, MOST_SWEEPS, listed, pairs)
    if not settled:
        put_back(places, before, radii, grid, statics, contacts, free, listed, pairs)
    return pairs


def _on_rows(kernel: Callable, given: tuple, first: int, last: int) -> Any:
    return kernel(first, last, *given)


@compiled
def begin_piece(piece, pieces, crowd, position, radius, statics):
    """Move driven bodies through a piece of their way."""
    order, places, radii = crowd[0], crowd[1], crowd[3]
    edges, discs, movers = statics[0], statics[1], statics[8]
    if movers is not None:
        if piece == 0:
            for p in range(order.shape[0]):
                places[p, 0], places[p, 1] = position[order[p], 0], position[order[p], 1]
        advance_bodies(piece, pieces, radius, movers, edges, discs)
        stop_jumps(places, radii, edges, discs, movers)


@compiled(nogil=True, apart=True)
def advance_rows(first, last, piece, pieces, crowd, position, heading, motion, statics):
    """Move robots p in [first, last) through a piece of their arcs, and out of static bodies."""
    order, places, before, radii, _, free, contacts, rows = crowd
    depth, face = contacts[3], contacts[4]
    for p in range(first, last):
        i = order[p]
        if piece == 0:
            places[p, 0], places[p, 1] = position[i, 0], position[i, 1]
            depth[p] = 0.0
        before[p, 0], before[p, 1] = places[p, 0], places[p, 1]
        face[p, 2] = 0.0
        dx, dy, heading[i] = moved_by(heading[i], motion[i, 0], motion[i, 1], motion[i, 2], pieces)
        places[p, 0] += dx
        places[p, 1] += dy
    push_all_from_statics(rows[first:last], places, radii, statics, contacts, free)


@compiled(apart=True)
def turn_along_faces(order, heading, motion, face, turn_angle, extra_turn):
    """Turn robots so that they travel parallel to the flat face that they met at a grazing incidence."""
    for p in range(order.shape[0]):
        if face[p, 2] == 0.0:
            continue
        i = order[p]
        speed = math.hypot(motion[i, 0], motion[i, 1])
        if speed == 0.0:
            continue
        ahead, left = motion[i, 0] / speed, motion[i, 1] / speed
        cosine, sine = math.cos(heading[i]), math.sin(heading[i])
        tx, ty = cosine * ahead - sine * left, sine * ahead + cosine * left
        into = -(tx * face[p, 0] + ty * face[p, 1])
        if into <= 0.0 or into >= math.cos(turn_angle):
            continue
        along_x, along_y = tx + into * face[p, 0], ty + into * face[p, 1]
        turn = math.atan2(tx * along_y - ty * along_x, tx * along_x + ty * along_y)
        extra_turn[i] += turn
        heading[i] = wrapped(heading[i] + turn)


@compiled(nogil=True, apart=True)
def finish_rows(first, last, crowd, position, collided, contact_kind, contact_index, contact_normal, contact_depth):
    """Write the positions and the contacts of robots p in [first, last) into the columns."""
    order, places = crowd[0], crowd[1]
    kind, index, normal, depth, _ = crowd[6]
    for p in range(first, last):
        i = order[p]
        position[i, 0], position[i, 1] = places[p, 0], places[p, 1]
        if depth[p] > 0.0:
            contact_kind[i] = kind[p]
            contact_index[i] = order[index[p]] if kind[p] == ROBOT else index[p]
            contact_normal[i, 0], contact_normal[i, 1] = normal[p, 0], normal[p, 1]
        elif collided[i]:
            contact_kind[i] = contact_index[i] = -1
            contact_normal[i, 0] = contact_normal[i, 1] = 0.0
        contact_depth[i] = depth[p]
        collided[i] = depth[p] > 0.0
