"""Sensing and moving of plain robots in one call each: the kernels of these stages, see `kernels.part.Kernel`.

In small worlds a step takes about as long as its calls from Python and the arrays that these pass.
"""

from typing import NamedTuple

import numpy as np

from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import (
    CodeRows,
    Codes,
    FlagRows,
    Flags,
    IntegerRows,
    Integers,
    RealRows,
    Reals,
    RealTables,
)
from mesa_swarm.physics.arcs import copy_places, write_achieved_motion, write_wheel_slip
from mesa_swarm.physics.crowd import LISTED, SIZE, CrowdArrays, PairArrays, near_pairs, put_pairs, sort_by_cell
from mesa_swarm.physics.driven_bodies import list_seen
from mesa_swarm.physics.sensing import (
    EyeArrays,
    add_errors,
    hold_readings,
    sense_inside,
    sense_line,
    sense_proximity,
    sense_radiation,
)
from mesa_swarm.physics.sensor_noise import NoiseArrays, draw_noise
from mesa_swarm.physics.separation import SETTLED
from mesa_swarm.physics.travel import RobotArrays, get_apart, travel_pieces
from mesa_swarm.robots.drive import motion_to_wheels, wheels_to_motion

# Codes that kernels return: Python lists pairs in a longer array; it moves robots that overlap to free room; it
# returns to before the draws of this step.
DONE, LIST, SETTLE, REWIND = 0, 1, 2, 3
# Places in arrays: of one number, of the progress of a step, of counts of collisions and of steps of robots.
ONLY, PIECE, PIECES, IN_STEP, IN_ALL, ROBOT_STEPS = 0, 0, 1, 0, 1, 2
# NumPy's numbers: Numba would compile a function once more for each literal one that is passed to it.
FIRST = np.int64(0)


class ProximityArrays(NamedTuple):
    """What proximity sensors take: numbers of blocks, `movers` empty without driven bodies, and what is inside what.

    Sensors are looked for inside walls where robots are disturbed, or where `exposed` are beyond their bodies: by
    columns and tables of the swarm, and the edges, their kinds, rings and bounds of `Statics`.
    """

    eyes: Integers
    crowd: Integers
    movers: Integers
    pairs: Integers
    disturbed: Flags
    exposed: int
    position: RealRows
    heading: Reals
    design: Integers
    sensors: RealTables
    counts: Integers
    edges: RealRows
    static_kind: Codes
    rings: IntegerRows
    bounds: Reals
    distance: RealRows
    kind: CodeRows


class ErrorArrays(NamedTuple):
    """What errs, and what is refreshed less often than every step.

    The table of errors; whether there are any, their draws, and the column error; whether any reading is held, the
    readings before this step, and whether they are noted, while the kernel is interrupted.
    """

    table: RealTables
    errs: bool
    noise: NoiseArrays
    error: RealRows
    holds: bool
    old_distance: RealRows
    old_kind: CodeRows
    noted: Flags


class DeviceArrays(NamedTuple):
    """What `sense_radiation` and `sense_line` take."""

    radiation_sensors: RealTables
    radiating: Integers
    radiation: RealRows
    mounts: RealTables
    marks: RealRows
    rings: IntegerRows
    discs: RealRows
    line: FlagRows


class SenseArrays(NamedTuple):
    """What `sense_robots` takes."""

    proximity: ProximityArrays
    errors: ErrorArrays
    devices: DeviceArrays


class CountArrays(NamedTuple):
    """What `count_collided` takes: the column collided, the numbers of this step and of all, and of steps of robots."""

    collided: Flags
    counts: Integers


class MoveArrays(NamedTuple):
    """What `move_robots` takes.

    The speeds at which wheels are driven; the angle at which robots turn along faces; the margin of pairs; whether
    robots are disturbed; the piece of the step that is next, and how many pieces there are, while the step is
    interrupted. Then the column slip; the speeds at which wheels rolled, and the poses before the step, which are
    scratch; and the numbers of blocks, `movers` empty without driven bodies.
    """

    driven: RealRows
    turn_angle: Reals
    margin: float
    disturbed: Flags
    progress: Integers
    slip: RealRows
    rolled: RealRows
    start: RealRows
    start_heading: Reals
    robots: Integers
    crowd: Integers
    statics: Integers
    movers: Integers
    pairs: Integers


@compiled(nogil=True)
def sense_robots(block, step, first, last):
    """Sort robots by cell, write what all sensors read, and list the pairs near each other: all rows at once."""
    return _sense(unpack(block, SenseArrays), None, step, last)


@compiled(nogil=True)
def sense_robots_and_movers(block, step, first, last):
    """Do what `sense_robots` does, in a world with driven bodies."""
    s = unpack(block, SenseArrays)
    return _sense(s, s.proximity.movers, step, last)


@compiled(nogil=True)
def finish_readings(block, step, first, last):
    """Do what follows on exact readings of proximity sensors: errors, readings that are held, and other sensors."""
    return _finish(unpack(block, SenseArrays), step)


@compiled
def _sense(s, movers, step, n):
    if n == 0:
        return DONE
    p, errors = s.proximity, s.errors
    if p.distance.shape[1] > 0:
        note_readings(errors, p.distance, p.kind)
        if movers is not None:
            list_seen(movers, p.edges, unpack(p.eyes, EyeArrays).discs)
        sort_by_cell(p.crowd)
        pairs = unpack(p.pairs, PairArrays)
        count = sense_proximity(p.eyes, p.crowd, movers, FIRST, n, pairs.room)
        pairs.state[SIZE] = count
        if count >= pairs.room.shape[0]:
            return LIST
        pairs.state[LISTED] = True
        if p.exposed or p.disturbed[ONLY]:
            sense_inside(
                p.position, p.heading, p.design, p.sensors, p.counts, p.edges, p.static_kind, p.rings, p.bounds,
                p.distance, p.kind,
            )  # fmt: skip
    return _finish(s, step)


@compiled
def note_readings(errors, distance, kind):
    """Note the readings before this step, where some are held, unless that was done before an interruption."""
    if errors.holds and not errors.noted[ONLY]:
        old_distance, old_kind = errors.old_distance, errors.old_kind
        for i in range(distance.shape[0]):
            for s in range(distance.shape[1]):
                old_distance[i, s], old_kind[i, s] = distance[i, s], kind[i, s]
    errors.noted[ONLY] = True


@compiled
def _finish(s, step):
    p, errors, d, moment = s.proximity, s.errors, s.devices, step - 1
    if errors.errs:
        if not draw_noise(errors.noise, moment):
            return REWIND
        add_errors(p.distance, p.design, p.sensors, errors.table, errors.noise.draws, moment, errors.error)
    if errors.holds:
        hold_readings(moment, p.design, errors.table, errors.old_distance, errors.old_kind, p.distance, p.kind)
    errors.noted[ONLY] = False
    if d.radiation.shape[1] > 0:
        sense_radiation(p.position, p.heading, p.design, d.radiation_sensors, d.radiating, d.radiation)
    if d.line.shape[1] > 0:
        sense_line(p.position, p.heading, p.design, d.mounts, d.marks, d.rings, d.discs, d.line)
    return DONE


@compiled(nogil=True)
def move_robots(block, step, first, last):
    """Move robots with two wheels that reach their speed at once, where there are no loads: all rows, as they meet.

    What is driven becomes the motion, `travel_pieces` moves all, and the slip of what they have achieved is written.
    """
    return _move(unpack(block, MoveArrays), None, last)


@compiled(nogil=True)
def move_robots_and_movers(block, step, first, last):
    """Do what `move_robots` does, in a world with driven bodies."""
    m = unpack(block, MoveArrays)
    return _move(m, m.movers, last)


@compiled
def _move(m, movers, n):
    if n == 0:
        return DONE
    if m.disturbed[ONLY]:
        return SETTLE
    driven, progress, crowd, statics = m.driven, m.progress, m.crowd, m.statics
    r, near = unpack(m.robots, RobotArrays), unpack(m.pairs, PairArrays)
    motion, collided, rolled, start, start_heading = r.motion, r.collided, m.rolled, m.start, m.start_heading
    piece, pieces = progress[PIECE], progress[PIECES]
    if piece == 0:
        if not near.state[LISTED]:
            sort_by_cell(crowd)
            c = unpack(crowd, CrowdArrays)
            if not put_pairs(near_pairs(c.reference, c.radii, m.margin, c.grid), near):
                return LIST
        wheels_to_motion(driven, r.radius, motion)
        copy_places(r.position, start)
        for i in range(n):
            start_heading[i] = r.heading[i]
    progress[PIECE], near.state[LISTED] = 0, 0  # from here on robots are elsewhere
    pairs, turn_angle, state = near.room[: near.state[SIZE]], m.turn_angle[ONLY], SETTLED + 1
    while state != SETTLED:
        piece, pieces, state = travel_pieces(piece, pieces, pairs, turn_angle, m.robots, crowd, statics, movers)
        if state != SETTLED:
            pairs, piece = get_apart(state, pairs, crowd, statics, movers), piece + 1
            if not put_pairs(pairs, near):
                progress[PIECE], progress[PIECES] = piece, pieces
                return LIST
    write_achieved_motion(start, r.position, start_heading, r.extra_turn, collided, motion)
    motion_to_wheels(motion, r.radius, rolled)
    for i in range(n):
        if not collided[i]:
            rolled[i, 0], rolled[i, 1] = driven[i, 0], driven[i, 1]
    write_wheel_slip(driven, rolled, m.slip)
    return DONE


@compiled(nogil=True)
def count_collided(block, step, first, last):
    """Count the robots that have collided in this step, of all rows, and add them to those of all steps."""
    c = unpack(block, CountArrays)
    collided, counts, count = c.collided, c.counts, 0
    for i in range(last):
        count += collided[i]
    counts[IN_STEP] = count
    counts[IN_ALL] += count
    counts[ROBOT_STEPS] += last
    return DONE
