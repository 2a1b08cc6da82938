"""Which robots are near each other, and how those that overlap are pushed apart, or back to where they were.

Robots that overlap are pushed apart, half the overlap each, all at once, then out of static bodies, group by group:
groups of robots that pairs connect do not influence each other, so that threads can share them. In a group only robots
that were moved, and those near them, are looked at again. What still overlaps after `MOST_SWEEPS` rounds (in a narrow
wedge, in a jam) returns to where it was before the piece, and so does what then overlaps it, until no two bodies do.
"""

import math
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.grid import cell_at
from mesa_swarm.geometry.overlap import is_in_polygon
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.crew import part_of_row, share_rows
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.kernels.type_names import IntegerRows, Integers
from mesa_swarm.physics.arcs import copy_places, least_radius
from mesa_swarm.physics.contact import (
    A_ROBOT,
    SLOP,
    coincident_direction,
    deepest_static,
    disc_overlap,
    edge_overlap,
    note_contact,
    push_all_from_statics,
    unpack_solids,
)
from mesa_swarm.physics.crowd import OVERLAPS, SIZE, CrowdArrays, PairArrays, near_pairs
from mesa_swarm.physics.driven_bodies import return_bodies

# NumPy's numbers: Numba would compile a function once more for each literal one that is passed to it.
MOST_SWEEPS, NONE = np.int64(128), np.int64(0)
# Groups have numbers from 0; these are those that were not looked at, or that are not all within the rows at hand.
FRESH, LATER = np.int64(-2), np.int64(-1)
# How separating a group has ended, from good to bad.
SETTLED, STUCK, STRAYED = np.int64(0), np.int64(1), np.int64(2)
# Places in the outcome of a part of the rows.
LEFT, WORST = 0, 1
# Pairs nearer than this share of the least radius are watched while pushing.
MARGIN = 1.0


# Functions that are called from Python take blocks: `crowd` of `CrowdArrays`, `statics` of `StaticArrays`, `movers` of
# `MoverArrays`, or None, and `near` of `PairArrays`.


@compiled(nogil=True)
def separate(crowd, statics, movers, pairs, most_sweeps):
    """Push until no two robots overlap, at most `most_sweeps` times, and return whether that succeeded, and the pairs.

    They are out of static bodies where that is possible; which ones are clear of them is kept in `free`. `pairs` are
    those that were within the margin at the places `reference`. Where robots have gone too far from these, the pairs
    are listed anew, and the places written.
    """
    c, solids = unpack(crowd, CrowdArrays), unpack_solids(statics, movers)
    position, radius, number, contacts, free, reference = c.places, c.radii, c.numbers, c.contacts, c.free, c.reference
    n, margin, begins = len(radius), MARGIN * least_radius(radius), True
    push, awake, moved_rows = np.zeros((n, 2)), np.zeros(n, np.bool_), np.empty(n, np.int64)
    group, strayed, far = np.zeros(n, np.int64), np.zeros(1, np.bool_), farthest_of_all(reference, position)
    for _ in range(most_sweeps):
        anew = 2.0 * far > margin
        if anew:
            pairs = near_pairs(position, radius, margin, c.grid)
            copy_places(position, reference)
        if anew or begins:
            start, own = pairs_by_robot(pairs, n)
            selection, count, begins = np.arange(len(pairs) + 1), len(pairs), False
        overlaps = push_pairs(position, radius, number, pairs, selection[:count], push, contacts)
        if overlaps == 0:
            return free.all(), pairs
        moving = apply_pushes(position, push, radius, pairs, selection[:overlaps], awake, moved_rows)
        push_all_from_statics(moved_rows[:moving], position, radius, solids, contacts, free)
        far = farthest_from(reference, position, moved_rows[:moving])
        count = list_pairs_of(moved_rows[:moving], awake, pairs, start, own, selection, group, strayed)
        for k in range(moving):
            awake[moved_rows[k]] = False
    return False, pairs


@compiled(nogil=True, apart=True)
def separate_near(crowd, statics, movers, near, most_sweeps):
    """Do what `separate` does as long as no robot goes farther than half the margin, and return how that ended.

    `STRAYED` means that one has to go farther: all are where they were.
    """
    state, count = find_overlaps(crowd, near)
    if count == 0:
        return state if unpack(crowd, CrowdArrays).free.all() else max(state, STUCK)
    start_groups(crowd, near)
    p, n = unpack(near, PairArrays), len(unpack(crowd, CrowdArrays).radii)
    begin = p.overlaps[:count]
    _, state = separate_groups(crowd, statics, movers, near, begin, p.later, p.selection, most_sweeps, NONE, n)
    return finish_separation(crowd, statics, movers, near, p.later[:NONE], most_sweeps, state)


class SeparationArrays(NamedTuple):
    """What kernels take that separate robots.

    Blocks, `movers` empty without driven bodies; and where threads share the rows, who does, the address of
    `separate_rows` or that with driven bodies, and for each part of the rows how many groups are left for later and the
    worst state in which one has ended.
    """

    crowd: Integers
    statics: Integers
    movers: Integers
    near: Integers
    crew: Integers
    separate: int
    outcomes: IntegerRows


@compiled(nogil=True)
def separate_alone(block, step, first, last):
    """Do what `separate_near` does, as a kernel that returns the state."""
    a = unpack(block, SeparationArrays)
    return separate_near(a.crowd, a.statics, None, a.near, MOST_SWEEPS)


@compiled(nogil=True)
def separate_alone_beside_movers(block, step, first, last):
    """Do the same in a world with driven bodies."""
    a = unpack(block, SeparationArrays)
    return separate_near(a.crowd, a.statics, a.movers, a.near, MOST_SWEEPS)


@compiled(nogil=True)
def separate_together(block, step, first, last):
    """Do the same by threads."""
    return _separate_together(block, None, last)


@compiled(nogil=True)
def separate_together_beside_movers(block, step, first, last):
    """Do the same by threads in a world with driven bodies."""
    return _separate_together(block, unpack(block, SeparationArrays).movers, last)


@compiled
def _separate_together(block, movers, n):
    a = unpack(block, SeparationArrays)
    crowd, near, outcomes = a.crowd, a.near, a.outcomes
    state, count = find_overlaps(crowd, near)
    if count == 0:
        return state if unpack(crowd, CrowdArrays).free.all() else max(state, STUCK)
    start_groups(crowd, near)
    p = unpack(near, PairArrays)
    outcomes[:, :] = 0
    share_rows(a.crew, a.separate, block, MOST_SWEEPS, n)
    waiting, state = NONE, SETTLED
    for part in range(len(outcomes)):
        begin = first_pair_of(p, n * part // len(outcomes))
        for k in range(outcomes[part, LEFT]):
            p.later[waiting + k] = p.later[begin + k]
        waiting += outcomes[part, LEFT]
        state = max(state, outcomes[part, WORST])
    return finish_separation(crowd, a.statics, movers, near, p.later[:waiting], MOST_SWEEPS, state)


@compiled(nogil=True)
def separate_rows(block, most_sweeps, first, last):
    """Separate the groups that are within rows [first, last), for `share_rows`."""
    return _separate_rows(block, None, most_sweeps, first, last)


@compiled(nogil=True)
def separate_rows_beside_movers(block, most_sweeps, first, last):
    """Do the same in a world with driven bodies."""
    return _separate_rows(block, unpack(block, SeparationArrays).movers, most_sweeps, first, last)


@compiled
def _separate_rows(block, movers, most_sweeps, first, last):
    a = unpack(block, SeparationArrays)
    p, n, parts = unpack(a.near, PairArrays), len(unpack(a.crowd, CrowdArrays).radii), len(a.outcomes)
    part = part_of_row(first, n, parts)
    # Pairs ascend by their first row: those of other parts are elsewhere, and so is what is written of them.
    begin, end = first_pair_of(p, first), first_pair_of(p, last)
    selection, later = p.selection[begin + part : end + part + 1], p.later[begin : end + 1]
    overlaps = p.overlaps[: p.state[OVERLAPS]]
    a.outcomes[part, LEFT], a.outcomes[part, WORST] = separate_groups(
        a.crowd, a.statics, movers, a.near, overlaps, later, selection, most_sweeps, first, last
    )
    return 0


@compiled
def first_pair_of(near, row):
    """Return the place of the first pair whose first robot is in this row or a later one."""
    room, low, high = near.room, NONE, near.state[SIZE]
    while low < high:
        middle = (low + high) // 2
        if room[middle, 0] < row:
            low = middle + 1
        else:
            high = middle
    return low


@compiled(nogil=True, apart=True)
def find_overlaps(crowd, near):
    """List the pairs that overlap by more than rounding; return a state, and how many.

    The state is `STRAYED` if robots went too far since pairs were listed, of which then none counts, else `SETTLED`.
    """
    c, p = unpack(crowd, CrowdArrays), unpack(near, PairArrays)
    position, radius, room, overlaps = c.places, c.radii, p.room, p.overlaps
    p.state[OVERLAPS] = 0
    if 2.0 * farthest_of_all(c.reference, position) > MARGIN * least_radius(radius):
        return STRAYED, NONE
    count = NONE
    for k in range(p.state[SIZE]):
        i, j = room[k, 0], room[k, 1]
        dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
        overlaps[count] = k
        count += radius[i] + radius[j] - math.sqrt(dx * dx + dy * dy) > SLOP * min(radius[i], radius[j])
    p.state[OVERLAPS] = count
    return SETTLED, count


@compiled(nogil=True, apart=True)
def start_groups(crowd, near):
    """Prepare the groups before separating begins: none is known yet."""
    c, p = unpack(crowd, CrowdArrays), unpack(near, PairArrays)
    scratch, group = c.scratch, c.scratch.group
    list_own_pairs(p.room[: p.state[SIZE]], scratch.start, p.own)
    for i in range(len(group)):
        group[i] = FRESH
    p.strayed[: p.state[OVERLAPS]] = False
    copy_places(c.places, scratch.begins)


@compiled(nogil=True, apart=True)
def separate_groups(crowd, statics, movers, near, begin, later, selection, most_sweeps, first, last):
    """Separate groups of robots near each other in which pairs overlap; groups are independent.

    Only the groups that the pairs `begin` are in, and of these only those that are within rows [first, last). Return
    how many are left for later, the first pair of each in `later`, and the worst state in which a group ends:
    `SETTLED`; `STUCK` if robots overlap after `most_sweeps`; `STRAYED` if one has gone so far that it may have met
    robots beyond its group, which is then left as it is. `selection` has room for one more than all pairs of the rows.
    """
    c, p, solids = unpack(crowd, CrowdArrays), unpack(near, PairArrays), unpack_solids(statics, movers)
    position, radius, number, contacts, free, reference = c.places, c.radii, c.numbers, c.contacts, c.free, c.reference
    scratch, pairs, strayed, margin = c.scratch, p.room, p.strayed, MARGIN * least_radius(radius)
    start, own, push, awake, group = scratch.start, p.own, scratch.push, scratch.awake, scratch.group
    members, moved_rows, worst = scratch.members[first:last], scratch.moved[first:last], SETTLED
    waiting = collect_groups(first, last, begin, pairs, start, own, group, members, later)
    count = select_pairs(first, last, p.overlaps[: p.state[OVERLAPS]], pairs, group, selection)
    for _ in range(most_sweeps):
        overlaps = push_pairs(position, radius, number, pairs, selection[:count], push, contacts)
        if overlaps == 0:
            return waiting, worst
        moving = apply_pushes(position, push, radius, pairs, selection[:overlaps], awake, moved_rows)
        push_all_from_statics(moved_rows[:moving], position, radius, solids, contacts, free)
        if 2.0 * farthest_from(reference, position, moved_rows[:moving]) > margin:
            mark_strayed(reference, position, moved_rows[:moving], margin, group, strayed)
            worst = STRAYED
        count = list_pairs_of(moved_rows[:moving], awake, pairs, start, own, selection, group, strayed)
        for k in range(moving):
            awake[moved_rows[k]] = False
    return waiting, max(worst, STUCK)


@compiled(apart=True)
def collect_groups(first, last, begin, pairs, start, own, group, members, later):
    """Give numbers to the groups that pairs `begin` belong to, where all of a group is within rows [first, last).

    `members` is scratch. Write the first pair of other groups into `later`, and return how many there are.
    """
    waiting, all_rows = NONE, last - first == len(group)
    for number in range(len(begin)):
        i = pairs[begin[number], 0]
        if i < first or i >= last or group[i] >= 0 or (group[i] == LATER and not all_rows):
            continue
        members[0], size, at, whole = i, 1, 0, True
        group[i] = number
        while at < size:
            a = members[at]
            at += 1
            for place in range(start[a], start[a + 1]):
                other = pairs[own[place], 0] + pairs[own[place], 1] - a
                if other < first or other >= last:
                    whole = False
                elif group[other] < 0:
                    group[other] = number
                    members[size] = other
                    size += 1
        if not whole:
            later[waiting] = begin[number]
            waiting += 1
            for at in range(size):
                group[members[at]] = LATER
    return waiting


@compiled
def select_pairs(first, last, overlaps, pairs, group, selection):
    """Select the pairs that overlap, of groups that have a number and begin in rows [first, last); return how many."""
    count = NONE
    for k in overlaps:
        i = pairs[k, 0]
        if first <= i < last and group[i] >= 0:
            selection[count] = k
            count += 1
    return count


@compiled
def mark_strayed(reference, position, moved_rows, margin, group, strayed):
    """Mark the groups of which a robot has gone farther than half the margin."""
    for i in moved_rows:
        dx, dy = position[i, 0] - reference[i, 0], position[i, 1] - reference[i, 1]
        if 2.0 * math.sqrt(dx * dx + dy * dy) > margin:
            strayed[group[i]] = True


@compiled(nogil=True, apart=True)
def finish_separation(crowd, statics, movers, near, later, most_sweeps, state):
    """Separate the groups that were left for `later`, and return the worst state; put all back if some have strayed."""
    c, p = unpack(crowd, CrowdArrays), unpack(near, PairArrays)
    group = c.scratch.group
    if len(later):
        for i in range(len(group)):
            group[i] = min(group[i], LATER)
        p.strayed[: len(later)] = False
        _, worst = separate_groups(
            crowd, statics, movers, near, later, p.later[:NONE], p.selection, most_sweeps, NONE, len(group)
        )
        state = max(state, worst)
    if state == STRAYED:
        copy_places(c.scratch.begins, c.places)
    elif not c.free.all():
        state = max(state, STUCK)
    return state


@compiled
def farthest_of_all(reference, position):
    """Return the largest distance of robots from where they were listed."""
    square = 0.0
    for i in range(position.shape[0]):
        dx, dy = position[i, 0] - reference[i, 0], position[i, 1] - reference[i, 1]
        square = max(square, dx * dx + dy * dy)
    return math.sqrt(square)


@compiled
def farthest_from(reference, position, moved_rows):
    """Return the largest distance of the robots that were moved from where they were listed."""
    square = 0.0
    for i in moved_rows:
        dx, dy = position[i, 0] - reference[i, 0], position[i, 1] - reference[i, 1]
        square = max(square, dx * dx + dy * dy)
    return math.sqrt(square)


@compiled
def pairs_by_robot(pairs, n):
    """Return the pairs of each robot: those of robot i are ``own[start[i]:start[i + 1]]``."""
    start, own = np.empty(n + 1, np.int64), np.empty(2 * pairs.shape[0], np.int64)
    list_own_pairs(pairs, start, own)
    return start, own


@compiled
def list_own_pairs(pairs, start, own):
    """Write where the pairs of each robot start, and these, likewise."""
    n = len(start) - 1
    for i in range(n + 1):
        start[i] = 0
    for k in range(pairs.shape[0]):
        start[pairs[k, 0]] += 1
        start[pairs[k, 1]] += 1
    for i in range(n):
        start[i + 1] += start[i]
    # From the end, so that start is the beginning of each when all are written, and its pairs ascend.
    for k in range(pairs.shape[0] - 1, -1, -1):
        for side in range(2):
            i = pairs[k, side]
            start[i] -= 1
            own[start[i]] = k


@compiled
def list_pairs_of(moved_rows, awake, pairs, start, own, selection, group, strayed):
    """Write the pairs of robots that were moved, each once, into `selection`, and return how many; `awake` marks them.

    Those of groups that have strayed are left out. `selection` has room for one more than all pairs.
    """
    count = 0
    for i in moved_rows:
        if strayed[group[i]]:
            continue
        for place in range(start[i], start[i + 1]):
            k = own[place]
            other = pairs[k, 0] + pairs[k, 1] - i
            selection[count] = k
            count += not awake[other] or i < other
    return count


@compiled
def push_pairs(position, radius, number, pairs, selection, push, contacts):
    """Add to `push` half of each overlap of the pairs `selection` (A.7); return how many overlap: they come first."""
    count = 0
    for k in selection:
        i, j = pairs[k, 0], pairs[k, 1]
        dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
        distance = math.sqrt(dx * dx + dy * dy)
        overlap = radius[i] + radius[j] - distance
        if overlap <= SLOP * min(radius[i], radius[j]):
            continue
        if distance > 0.0:
            nx, ny = dx / distance, dy / distance
        else:
            nx, ny = coincident_direction(number[i], number[j])
        push[i, 0] += nx * overlap / 2.0
        push[i, 1] += ny * overlap / 2.0
        push[j, 0] -= nx * overlap / 2.0
        push[j, 1] -= ny * overlap / 2.0
        note_contact(i, A_ROBOT, j, nx, ny, overlap, contacts)
        note_contact(j, A_ROBOT, i, -nx, -ny, overlap, contacts)
        selection[count] = k
        count += 1
    return count


@compiled
def apply_pushes(position, push, radius, pairs, overlaps, awake, moved_rows):
    """Push all robots at once, each at most a quarter of its radius; return the count of rows ``moved[:count]``.

    They are marked in `awake`.
    """
    count = 0
    for k in overlaps:
        for side in range(2):
            i = pairs[k, side]
            if push[i, 0] == 0.0 and push[i, 1] == 0.0:
                continue
            length = hypot(push[i, 0], push[i, 1])
            share = min(1.0, 0.25 * radius[i] / length)
            position[i, 0] += share * push[i, 0]
            position[i, 1] += share * push[i, 1]
            push[i, 0], push[i, 1] = 0.0, 0.0
            awake[i] = True
            moved_rows[count] = i
            count += 1
    return count


@compiled(apart=True)
def return_to_free_places(crowd, statics, movers, pairs):
    """Return to their last free place the robots that overlap, and those that then overlap them."""
    c, solids = unpack(crowd, CrowdArrays), unpack_solids(statics, movers)
    position, before, radius, reference, contacts, free = c.places, c.before, c.radii, c.reference, c.contacts, c.free
    n = len(radius)
    back = np.zeros(n, np.bool_)
    farthest = max(farthest_of_all(reference, position), farthest_of_all(reference, before))
    # All pairs that can overlap, at whichever of its two places each robot ends.
    if n and 2.0 * farthest > MARGIN * least_radius(radius):
        pairs = near_pairs(reference, radius, 2.0 * farthest, c.grid)
    goes = np.zeros(n, np.bool_)
    for i in range(n):
        if not free[i]:  # the last push may have freed it
            depth = deepest_static(position[i, 0], position[i, 1], radius[i], solids)[0]
            goes[i] = depth > SLOP * radius[i]
    # With driven bodies, those that overlap robots return as well, also after robots have returned.
    _return_bodies(position, radius, solids.edges, solids.discs, solids.movers, goes)
    while True:
        # All that overlap return at once: independent of the order of the pairs.
        for k in range(pairs.shape[0]):
            i, j = pairs[k, 0], pairs[k, 1]
            if not (back[i] and back[j]) and _collide(i, j, position, radius, contacts):
                goes[i], goes[j] = True, True
        went = _return_all(position, before, goes, back)
        if not (_return_bodies(position, radius, solids.edges, solids.discs, solids.movers, goes) or went):
            return


@compiled
def _collide(i, j, position, radius, contacts):
    """Return whether two robots overlap, and note their contact if so."""
    dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    overlap = radius[i] + radius[j] - distance
    if overlap <= SLOP * min(radius[i], radius[j]):
        return False
    if distance > 0.0:
        note_contact(i, A_ROBOT, j, dx / distance, dy / distance, overlap, contacts)
        note_contact(j, A_ROBOT, i, -dx / distance, -dy / distance, overlap, contacts)
    return True


@compiled
def _return_all(position, before, goes, back):
    """Put robots where they were before this piece of the step, and return whether any moved."""
    went = False
    for i in range(position.shape[0]):
        if goes[i] and not back[i]:
            position[i, 0], position[i, 1] = before[i, 0], before[i, 1]
            back[i] = True
            went = True
    return went


@compiled
def _return_bodies(position, radius, edges, discs, movers, goes):
    """Return driven bodies that overlap robots to where they were before this piece, and mark these robots.

    The result is whether a body moved, or a robot was marked that was not before.
    """
    if movers is None:
        return False
    bodies = np.zeros(len(movers.heading), np.bool_)
    marked = False
    for i in range(position.shape[0]):
        if mark_overlapped(position[i, 0], position[i, 1], radius[i], edges, discs, movers, bodies) and not goes[i]:
            goes[i], marked = True, True
    return return_bodies(bodies, movers, edges, discs) or marked


@compiled
def mark_overlapped(x, y, radius, edges, discs, movers, bodies):
    """Mark the driven bodies that overlap a disc, and return whether there is one."""
    body_of, start, items = movers.body_of, movers.touch_cells.start, movers.touch_cells.items
    cell = cell_at(x, y, movers.touch_cells.grid)
    any_marked = False
    for k in range(start[cell], start[cell + 1]):
        item = items[k]
        if item < edges.shape[0]:
            depth = edge_overlap(x, y, radius, edges, item)[0]
        else:
            depth = disc_overlap(x, y, radius, discs, item - edges.shape[0])[0]
        if depth > SLOP * radius:
            bodies[body_of[item]] = True
            any_marked = True
    return any_marked


@compiled
def stop_jumps(position, radius, edges, discs, movers):
    """Return bodies that have jumped onto a robot to where they were."""
    if movers is None:
        return
    place, reach, jumps = movers.position, movers.reach, movers.jumps
    edge_row, edge_body = movers.outlines.edge_row, movers.outlines.edge_body
    if not jumps.any():
        return
    bodies = np.zeros(len(jumps), np.bool_)
    for i in range(position.shape[0]):
        mark_overlapped(position[i, 0], position[i, 1], radius[i], edges, discs, movers, bodies)
    for b in np.flatnonzero(jumps & ~bodies):
        rows = edge_row[edge_body == b]
        for i in range(position.shape[0]):
            x, y, far = position[i, 0], position[i, 1], reach[b] + radius[i]
            near = len(rows) > 0 and (x - place[b, 0]) ** 2 + (y - place[b, 1]) ** 2 < far * far
            bodies[b] |= near and is_in_polygon(x, y, edges, rows[0], rows[-1] + 1)
    return_bodies(bodies & jumps, movers, edges, discs)
