"""Sensing and moving in one call each: the kernels of these stages, see `kernels.part.Kernel`.

In small worlds a step takes about as long as its calls from Python and the arrays that these pass.
"""

from typing import NamedTuple

import numpy as np

from mesa_swarm.kernels.block import KernelCall, call_at, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.crew import part_of_row, share_rows
from mesa_swarm.kernels.draws import Stream, draw_number
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
from mesa_swarm.physics.contact import StaticArrays
from mesa_swarm.physics.crowd import (
    LISTED,
    SIZE,
    CrowdArrays,
    PairArrays,
    SortCalls,
    near_pairs,
    put_pairs,
    sort_by_cell,
    sort_together,
)
from mesa_swarm.physics.driven_bodies import list_seen, return_to_start
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
from mesa_swarm.robots.drive import accelerate, drive_to_motion, lose_motion, motion_to_drive, slip_wheels

# Codes that kernels return: Python lists pairs in a longer array; it moves robots that overlap to free room; it
# returns to before the draws of this step.
DONE, LIST, SETTLE, REWIND = range(4)
# Places in arrays: of one number, of the progress of a step, of counts of collisions and of steps of robots.
ONLY, NEXT, PIECE, PIECES, IN_STEP, IN_ALL, ROBOT_STEPS = 0, 0, 1, 2, 0, 1, 2
# What is next of a step.
BEGIN, SET_OUT, TRAVEL = range(3)
# NumPy's numbers: Numba would compile a function once more for each literal one that is passed to it.
FIRST = np.int64(0)


class SenseCalls(NamedTuple):
    """What senses, and what threads share of it.

    The address of `sense_alone`, `sense_together` or those with driven bodies; who shares; the addresses of functions
    that sort, and of `sense_rows`, zeros where no threads share; and for each part of the rows the numbers of its
    `EyeArrays`, with scratch of its own, and how many pairs it has found.
    """

    sense: int
    crew: Integers
    sorting: SortCalls
    sense_rows: int
    eyes: IntegerRows
    counts: Integers


class ProximityArrays(NamedTuple):
    """What proximity sensors take: numbers of blocks, `movers` empty without driven bodies, and what is inside what.

    Sensors are looked for inside walls where robots are disturbed, or where `exposed` are beyond their bodies: by
    columns and tables of the swarm, and the edges, their kinds, rings and bounds of `Statics`. `calls` are
    the kernels that sense.
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
    calls: SenseCalls


class ErrorArrays(NamedTuple):
    """What errs, and what is refreshed less often than every step.

    The table of errors; whether there are any, their draws, and the column error; whether any reading is held, the
    readings before a step, and which step that is: of one that is sensed again they are the same.
    """

    table: RealTables
    errs: bool
    noise: NoiseArrays
    error: RealRows
    holds: bool
    old_distance: RealRows
    old_kind: CodeRows
    noted: Integers


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
    """What `sense_robots` takes: numbers of blocks of `ProximityArrays`, `ErrorArrays` and `DeviceArrays`.

    What functions pass on are blocks: to pass many arrays takes the compiler longer than to read some of a block.
    """

    proximity: Integers
    errors: Integers
    devices: Integers


class CountArrays(NamedTuple):
    """What `count_collided` takes: the column collided, the numbers of this step and of all, and of steps of robots."""

    collided: Flags
    counts: Integers


class SettleArrays(NamedTuple):
    """What `settle_first` takes: whether robots are disturbed."""

    disturbed: Flags


class WheelArrays(NamedTuple):
    """How wheels roll.

    The columns command, design, slip and drive.speed; the speeds at which wheels are driven, and whether they are
    other ones than those commanded. Of each design the kind of its drive, its acceleration, whether its velocity as a
    whole is limited, probability and magnitude of slip, and the shares of motion lost; whether any acceleration is
    limited, any wheel slips by chance, and any motion is lost. The stream of slip; scratch for draws, and for the
    speeds at which wheels roll.
    """

    command: RealRows
    design: Integers
    slip: RealRows
    speed: RealRows
    driven: RealRows
    spoiled: bool
    kinds: Integers
    acceleration: Reals
    sideways: Flags
    probability: Reals
    magnitude: Reals
    directed: RealRows
    limited: bool
    slips: bool
    slides: bool
    stream: Stream
    draws: RealRows
    rolled: RealRows


class LoadCalls(NamedTuple):
    """Whether there are loads, and what moves them, finds those that robots overlap then, and returns these.

    And what stops driven bodies that have a load in their way, where there are any.
    """

    present: bool
    push: KernelCall
    note_stuck: KernelCall
    take_back: KernelCall
    stop: KernelCall


class MoveArrays(NamedTuple):
    """What `move_robots` takes.

    The angle at which robots turn along faces; the margin of pairs; whether robots are disturbed; what is next of the
    step, its next piece, and how many pieces there are, while the step is interrupted; the poses before the step, which
    are scratch; the kernels `set_out` and `arrive`, which threads may share; and the numbers of blocks, `movers` empty
    without driven bodies, `travel` that of `TravelCalls`.
    """

    turn_angle: Reals
    margin: float
    disturbed: Flags
    progress: Integers
    start: RealRows
    start_heading: Reals
    wheels: Integers
    set_out: KernelCall
    arrive: KernelCall
    loads: LoadCalls
    robots: Integers
    crowd: Integers
    statics: Integers
    movers: Integers
    pairs: Integers
    travel: Integers


@compiled(nogil=True)
def sense_robots(block, step, first, last):
    """Sort robots by cell, write what all sensors read, and list the pairs near each other: all rows at once."""
    return _sense(block, None, step, last)


@compiled(nogil=True)
def sense_robots_and_movers(block, step, first, last):
    """Do what `sense_robots` does, in a world with driven bodies."""
    return _sense(block, unpack(unpack(block, SenseArrays).proximity, ProximityArrays).movers, step, last)


@compiled(apart=True)
def _sense(block, movers, step, n):
    if n == 0:
        return DONE
    s = unpack(block, SenseArrays)
    p = unpack(s.proximity, ProximityArrays)
    if p.distance.shape[1] > 0:
        note_readings(s.errors, p.distance, p.kind, step)
        if movers is not None:
            list_seen(movers, p.edges, unpack(p.eyes, EyeArrays).discs)
        if call_at(p.calls.sense, s.proximity, FIRST, FIRST, n) != DONE:
            return LIST
        if p.exposed or p.disturbed[ONLY]:
            sense_inside(
                p.position, p.heading, p.design, p.sensors, p.counts, p.edges, p.static_kind, p.rings, p.bounds,
                p.distance, p.kind,
            )  # fmt: skip
    return _finish(block, step)


@compiled(nogil=True)
def sense_alone(block, step, first, last):
    """Sort robots by cell, write the readings of proximity sensors, and list the pairs near each other."""
    return _sense_alone(block, None, last)


@compiled(nogil=True)
def sense_alone_beside_movers(block, step, first, last):
    """Do the same in a world with driven bodies."""
    return _sense_alone(block, unpack(block, ProximityArrays).movers, last)


@compiled
def _sense_alone(block, movers, n):
    p = unpack(block, ProximityArrays)
    near = unpack(p.pairs, PairArrays)
    sort_by_cell(p.crowd)
    count = sense_proximity(p.eyes, p.crowd, movers, FIRST, n, near.room)
    near.state[SIZE] = count
    near.state[LISTED] = count < near.room.shape[0]
    return DONE if near.state[LISTED] else LIST


@compiled(nogil=True)
def sense_together(block, step, first, last):
    """Do the same by threads, each of which lists pairs in a part of the room."""
    p = unpack(block, ProximityArrays)
    calls, near = p.calls, unpack(p.pairs, PairArrays)
    room, counts, parts = near.room, calls.counts, len(calls.counts)
    sort_together(calls.crew, calls.sorting, p.crowd)
    counts[:] = 0
    share_rows(calls.crew, calls.sense_rows, block, FIRST, last)
    size = len(room) // parts
    if counts.max() >= size:
        near.state[SIZE], near.state[LISTED] = parts * (counts.max() + 1), 0
        return LIST
    count = FIRST
    for part in range(parts):
        for k in range(counts[part]):
            room[count, 0], room[count, 1] = room[part * size + k, 0], room[part * size + k, 1]
            count += 1
    near.state[SIZE], near.state[LISTED] = count, 1
    return DONE


@compiled(nogil=True)
def sense_rows(block, step, first, last):
    """Write the readings of some rows, for `share_rows`."""
    return _sense_rows(block, None, first, last)


@compiled(nogil=True)
def sense_rows_beside_movers(block, step, first, last):
    """Do the same in a world with driven bodies."""
    return _sense_rows(block, unpack(block, ProximityArrays).movers, first, last)


@compiled
def _sense_rows(block, movers, first, last):
    p = unpack(block, ProximityArrays)
    eyes, counts, room = p.calls.eyes, p.calls.counts, unpack(p.pairs, PairArrays).room
    part = part_of_row(first, len(p.heading), len(counts))
    size = len(room) // len(counts)
    own_room = room[part * size : (part + 1) * size]
    counts[part] = sense_proximity(eyes[part], p.crowd, movers, first, last, own_room)
    return 0


@compiled
def note_readings(block, distance, kind, step):
    """Note the readings before this step, where some are held, unless that was done when it was sensed before.

    Imperfections disturb what is held as well: noted anew, it would be disturbed twice.
    """
    errors = unpack(block, ErrorArrays)
    if errors.holds and errors.noted[ONLY] != step:
        old_distance, old_kind = errors.old_distance, errors.old_kind
        for i in range(distance.shape[0]):
            for s in range(distance.shape[1]):
                old_distance[i, s], old_kind[i, s] = distance[i, s], kind[i, s]
    errors.noted[ONLY] = step


@compiled(apart=True)
def _finish(block, step):
    s, moment = unpack(block, SenseArrays), step - 1
    p, errors, d = unpack(s.proximity, ProximityArrays), unpack(s.errors, ErrorArrays), unpack(s.devices, DeviceArrays)
    if errors.errs:
        if not draw_noise(errors.noise, moment):
            return REWIND
        add_errors(p.distance, p.design, p.sensors, errors.table, errors.noise.draws, moment, errors.error)
    if errors.holds:
        hold_readings(moment, p.design, errors.table, errors.old_distance, errors.old_kind, p.distance, p.kind)
    if d.radiation.shape[1] > 0:
        sense_radiation(p.position, p.heading, p.design, d.radiation_sensors, d.radiating, d.radiation)
    if d.line.shape[1] > 0:
        sense_line(p.position, p.heading, p.design, d.mounts, d.marks, d.rings, d.discs, d.line)
    return DONE


@compiled(nogil=True)
def settle_first(block, step, first, last):
    """Have Python move robots that overlap anything to free room, before anything that a step does to wheels."""
    return SETTLE if last > 0 and unpack(block, SettleArrays).disturbed[ONLY] else DONE


@compiled(nogil=True)
def move_robots(block, step, first, last):
    """Move loads and robots: all rows, as they meet.

    What is driven becomes the motion, robots push loads, `travel_pieces` moves all, and the slip of what wheels have
    achieved is written. If a robot could not give way to a load, that one returns, and all travel again.
    """
    return _move(block, None, last)


@compiled(nogil=True)
def move_robots_and_movers(block, step, first, last):
    """Do what `move_robots` does, in a world with driven bodies."""
    return _move(block, unpack(block, MoveArrays).movers, last)


@compiled(apart=True)
def _move(block, movers, n):
    if n == 0:
        return DONE
    m = unpack(block, MoveArrays)
    progress, near = m.progress, unpack(m.pairs, PairArrays)
    code = _begin_move(block, n) if progress[NEXT] == BEGIN else DONE
    if code == DONE:
        near.state[LISTED] = 0  # from here on robots are elsewhere
        code = _go(block, movers, n)
    if code == DONE:
        progress[NEXT] = BEGIN
        call_at(m.arrive.address, m.arrive.block, FIRST, FIRST, n)
    return code


@compiled(apart=True)
def _begin_move(block, n):
    """Let wheels roll, and robots push loads."""
    m = unpack(block, MoveArrays)
    if m.disturbed[ONLY]:
        return SETTLE
    if not unpack(m.pairs, PairArrays).state[LISTED] and not _list_pairs(block):
        return LIST
    draw_slip(m.wheels)
    call_at(m.set_out.address, m.set_out.block, FIRST, FIRST, n)
    if m.loads.present:
        call_at(m.loads.push.address, m.loads.push.block, FIRST, FIRST, n)
    m.progress[NEXT] = SET_OUT
    return DONE


@compiled(apart=True)
def _go(block, movers, n):
    """Let all travel; robots that could not give way to a load go back, to travel once more when it has returned."""
    m = unpack(block, MoveArrays)
    progress, loads, r = m.progress, m.loads, unpack(m.robots, RobotArrays)
    while True:
        if progress[NEXT] == SET_OUT:
            progress[NEXT], progress[PIECE] = TRAVEL, 0
            if movers is not None:
                statics = unpack(m.statics, StaticArrays)
                if return_to_start(movers, statics.edges, statics.discs) and loads.present:
                    call_at(loads.stop.address, loads.stop.block, FIRST, FIRST, n)
        if not _travel(block, movers):
            return LIST
        if not loads.present or call_at(loads.note_stuck.address, loads.note_stuck.block, FIRST, FIRST, n) == 0:
            return DONE
        _copy_poses(m.start, m.start_heading, r.position, r.heading)
        call_at(loads.take_back.address, loads.take_back.block, FIRST, FIRST, n)
        progress[NEXT] = SET_OUT


@compiled
def _list_pairs(block):
    """List the pairs of robots near each other, and return whether there was room for all."""
    m = unpack(block, MoveArrays)
    sort_by_cell(m.crowd)
    c = unpack(m.crowd, CrowdArrays)
    return put_pairs(near_pairs(c.reference, c.radii, m.margin, c.grid), unpack(m.pairs, PairArrays))


@compiled
def _travel(block, movers):
    """Go through the pieces of the step from the next one on, and return whether there was room for all pairs."""
    m = unpack(block, MoveArrays)
    near, progress, crowd, statics = unpack(m.pairs, PairArrays), m.progress, m.crowd, m.statics
    turn_angle, piece, pieces, state = m.turn_angle[ONLY], progress[PIECE], progress[PIECES], SETTLED + 1
    while state != SETTLED:
        piece, pieces, state = travel_pieces(piece, pieces, turn_angle, m.travel, m.robots, crowd, statics, movers)
        if state != SETTLED:
            pairs, piece = get_apart(state, near.room[: near.state[SIZE]], crowd, statics, movers), piece + 1
            if not put_pairs(pairs, near):
                progress[PIECE], progress[PIECES] = piece, pieces
                return False
    return True


@compiled
def _copy_poses(position, heading, other_position, other_heading):
    copy_places(position, other_position)
    for i in range(heading.shape[0]):
        other_heading[i] = heading[i]


@compiled(nogil=True)
def set_out(block, step, first, last):
    """Let the wheels of some rows roll, and note the poses before the step."""
    m = unpack(block, MoveArrays)
    r = unpack(m.robots, RobotArrays)
    roll_wheels(m.wheels, r.radius[first:last], r.motion[first:last], first, last)
    _copy_poses(r.position[first:last], r.heading[first:last], m.start[first:last], m.start_heading[first:last])
    return 0


@compiled(nogil=True)
def arrive(block, step, first, last):
    """Write what some rows have achieved: the motion of robots that collided, and the slip of their wheels."""
    m = unpack(block, MoveArrays)
    r = unpack(m.robots, RobotArrays)
    collided, motion = r.collided[first:last], r.motion[first:last]
    write_achieved_motion(
        m.start[first:last],
        r.position[first:last],
        m.start_heading[first:last],
        r.extra_turn[first:last],
        collided,
        motion,
    )
    write_rolled_slip(m.wheels, collided, r.radius[first:last], motion, first, last)
    return 0


@compiled
def draw_slip(block):
    """Draw the numbers that decide which wheels slip, of all rows."""
    w = unpack(block, WheelArrays)
    if w.slips:
        draws = w.draws
        for i in range(draws.shape[0]):
            for k in range(draws.shape[1]):
                draws[i, k] = draw_number(w.stream)


@compiled
def roll_wheels(block, radius, motion, first, last):
    """Write the speeds that acceleration and slip leave of those that are driven, and the motion that they make.

    Of rows in [first, last), of which `radius` and `motion` are.
    """
    w = unpack(block, WheelArrays)
    design, rolled, source = w.design[first:last], w.rolled[first:last], w.driven[first:last]
    if w.limited:
        accelerate(source, w.acceleration, design, w.sideways, w.speed[first:last])
        source = w.speed[first:last]
    if w.slips:
        slip_wheels(source, w.probability, w.magnitude, design, w.draws[first:last], rolled)
    else:
        for i in range(rolled.shape[0]):
            for k in range(rolled.shape[1]):
                rolled[i, k] = source[i, k]
    drive_to_motion(w.kinds, design, rolled, radius, motion)
    if w.slides:
        lose_motion(motion, design, w.directed)
        for i in range(rolled.shape[0]):
            motion_to_drive(i, w.kinds[design[i]], motion, radius, rolled)


@compiled
def write_rolled_slip(block, collided, radius, motion, first, last):
    """Write which share of the commands wheels did not roll, with what was taken before they were driven.

    Wheels of robots that collided have rolled as these have achieved. Of rows in [first, last), likewise.
    """
    w = unpack(block, WheelArrays)
    design, rolled, driven, slip = w.design[first:last], w.rolled[first:last], w.driven[first:last], w.slip[first:last]
    for i in range(rolled.shape[0]):
        if collided[i]:
            motion_to_drive(i, w.kinds[design[i]], motion, radius, rolled)
    # Motors of limited acceleration roll on where none is driven: only the others have a share of what is driven.
    if w.spoiled and not w.limited:
        write_wheel_slip(driven, rolled, slip)
        for i in range(rolled.shape[0]):
            for k in range(rolled.shape[1]):
                rolled[i, k] = driven[i, k] * (1.0 - slip[i, k])
    write_wheel_slip(w.command[first:last], rolled, slip)


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
