"""Driven bodies in the tables of the engines: their items follow them, and are listed anew whenever they move.

Their edges and discs are rows of `Statics`, written in place; two more grids list which of them can be touched, or
seen, from a cell. A step of theirs is cut into the same pieces as that of the robots. In a piece no point of a body
moves farther than `LONGEST_STEP` of the least radius of a robot: bodies that close on a robot never reach its centre.
"""

import math
from typing import NamedTuple, cast

import numpy as np

from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.grid import CellLists, Grid, cell_index
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of, hypot, sin, vector_lengths
from mesa_swarm.kernels.type_names import Codes, Flags, Integers, RealRows, Reals
from mesa_swarm.physics.arcs import copy_places, least_radius
from mesa_swarm.world.bodies import BodyTable, Form
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.statics import CARRIED, Statics, edges_of

LONGEST_STEP = 0.4
# A body with farther to go jumps: it is put down where it was asked to be if no robot is there.
MOST_PIECES = 64
FEWEST_CELLS = 64
CELLS_PER_ITEM = 4
# Codes of kernels: there are no robots; loads have strayed so far that the tables of bodies have to be made anew.
DONE, ALONE, WORN = 0, 1, 2

# The place in an array of one number.
ONLY = 0
# As NumPy has it: Numba would compile a function once more for each literal.
IS_CARRIED = np.int8(CARRIED)


class MovingItems(NamedTuple):
    """The edges of bodies in their own frames, and the rows of `Statics` and the bodies of all edges and discs."""

    local: RealRows
    edge_row: Integers
    edge_body: Integers
    disc_row: Integers
    disc_body: Integers


class MoverArrays(NamedTuple):
    """The driven bodies as compiled functions take them.

    The first seven are columns of `BodyTable`, of which `rows` are the driven bodies. Then come, with a row for each
    body of the table, the poses at which bodies began the step and the piece, and which ones have jumped; their
    outlines, items, the body of each item of `Statics`, -1 for none; and lists of the items that can be touched, within
    `touch`, or seen, within `sight`, from each cell; and whether the latter are of present poses.
    """

    position: RealRows
    heading: Reals
    aim: RealRows
    aim_heading: Reals
    blocked: Flags
    reach: Reals
    mode: Codes
    rows: Integers
    start: RealRows
    start_heading: Reals
    before: RealRows
    before_heading: Reals
    jumps: Flags
    outlines: MovingItems
    items: Integers
    body_of: Integers
    touch_cells: CellLists
    touch: float
    sight_cells: CellLists
    sight: float
    listed: Flags


class BeginArrays(NamedTuple):
    """What `begin_ways` takes: columns of bodies, where driven ones begin, if there are any, and if they have gone."""

    pushers: Integers
    moved: Flags
    fresh: Flags
    position: RealRows
    heading: Reals
    start: RealRows
    start_heading: Reals
    driven: bool
    gone: Flags


class EndArrays(NamedTuple):
    """What `end_ways` takes.

    Columns of bodies, and of robots; what `have_strayed` takes of loads, and whether it was noted that they have.
    """

    position: RealRows
    heading: Reals
    aim: RealRows
    aim_heading: Reals
    mode: Codes
    carrier: Integers
    robot_position: RealRows
    robot_heading: Reals
    loads: Integers
    reference: RealRows
    load_reach: Reals
    slack: float
    noted: Flags


class Moving:
    """The driven bodies of a world, as the compiled engine and the radio take them.

    Attributes
    ----------
    bodies : BodyTable
    rows : ndarray, shape (m,)
        Those of the driven bodies in the table.
    arrays : MoverArrays
    """

    def __init__(
        self,
        bodies: BodyTable,
        rows: np.ndarray,
        indices: np.ndarray,
        statics: Statics,
        bounds: Bounds,
        sight: float,
        touch: float,
    ) -> None:
        self.bodies, self.rows = bodies, rows
        self._statics = statics
        items = [statics.rows_of(index) for index in indices.tolist()]
        self.items = np.concatenate(items)
        self.body_of = np.full(len(statics.shape), -1)
        for row, own in zip(rows.tolist(), items, strict=True):
            self.body_of[own] = row
        edges = self.items[self.items < len(statics.edges)]
        discs = self.items[self.items >= len(statics.edges)]
        forms = [cast(Form, bodies.forms[row]) for row in rows.tolist()]
        own_edges = [edges_of(Shape(form.outline)) for form in forms if not form.radius]
        local = np.concatenate([np.empty((0, 4)), *own_edges])
        disc_row = discs - len(statics.edges)
        outlines = MovingItems(local, edges, self.body_of[edges], disc_row, self.body_of[discs])
        self.start, self.start_heading = bodies.position.copy(), bodies.heading.copy()
        self._extent = np.concatenate(
            [vector_lengths(local[:, 2] - local[:, 0], local[:, 3] - local[:, 1]), 2.0 * statics.discs[disc_row, 2]]
        )
        self.items = np.concatenate([edges, discs])
        count = len(bodies)
        columns = bodies.position, bodies.heading, bodies.aim, bodies.aim_heading, bodies.blocked, bodies.reach
        scratch = np.empty((count, 2)), np.empty(count), np.zeros(count, np.bool_)
        begun = *columns, bodies.mode, rows, self.start, self.start_heading
        self.arrays = MoverArrays(
            *(*begun, *scratch),
            outlines=outlines,
            items=self.items,
            body_of=self.body_of,
            touch_cells=self._lists(bounds, touch),
            touch=float(touch),
            sight_cells=self._lists(bounds, sight),
            sight=float(sight),
            listed=np.zeros(1, np.bool_),
        )
        self._block = Block(self.arrays)
        self.place()

    def _lists(self, bounds: Bounds, reach: float) -> CellLists:
        """Return empty lists that have room for the items at any pose."""
        cell = max(2.0 * reach, float(self._extent.sum()) / max(len(self._extent), 1), 1e-9)
        grid = Grid.over(bounds, cell, FEWEST_CELLS + CELLS_PER_ITEM * len(self._extent))
        across = np.floor((self._extent + 2.0 * reach) / grid.cell) + 2.0
        room = int((np.minimum(across, grid.columns) * np.minimum(across, grid.rows)).sum())
        return CellLists(grid.numbers, np.zeros(grid.cells + 1, np.int64), np.zeros(room, np.int64))

    @property
    def block(self) -> np.ndarray:
        """The bodies as compiled functions take them: the numbers of a block of `MoverArrays`."""
        return self._block.numbers

    def look(self) -> None:
        """List what can be seen from each cell, unless it is listed."""
        list_seen(self.block, self._statics.edges, self._statics.discs)

    def place(self) -> None:
        """Write and list all items at the present poses of their bodies."""
        place_bodies(self.block, self._statics.edges, self._statics.discs)

    def begin(self) -> None:
        """Store the poses at which the bodies begin a step."""
        self.start[:], self.start_heading[:] = self.bodies.position, self.bodies.heading

    def return_to_start(self) -> bool:
        """Put all bodies where they begin the step, none of them blocked, and return whether any is to move."""
        return bool(return_to_start(self.block, self._statics.edges, self._statics.discs))

    def go_freely(self) -> None:
        """Put all bodies that are not blocked where they were asked to be, in a world without robots."""
        table = self.bodies
        free = self.rows[~table.blocked[self.rows]]
        table.position[free], table.heading[free] = table.aim[free], table.aim_heading[free]
        self.place()


@compiled(nogil=True)
def begin_ways(block, step, first, last):
    """Forget what bodies did in the last step, and which are new, and note where they are.

    Without robots Python lets them go.
    """
    b = unpack(block, BeginArrays)
    if b.gone[ONLY]:
        b.gone[ONLY] = False
        return DONE
    b.pushers[:], b.moved[:], b.fresh[:] = 0, False, False
    if not b.driven:
        return DONE
    copy_places(b.position, b.start)
    for k in range(b.heading.shape[0]):
        b.start_heading[k] = b.heading[k]
    return ALONE if last == 0 else DONE


@compiled(nogil=True)
def end_ways(block, step, first, last):
    """Forget all requests of bodies, which are done or were blocked, and put carried ones where their robots are."""
    b = unpack(block, EndArrays)
    position, heading = b.position, b.heading
    for row in range(heading.shape[0]):
        if b.mode[row] == IS_CARRIED:
            robot = b.carrier[row]
            position[row, 0], position[row, 1] = b.robot_position[robot, 0], b.robot_position[robot, 1]
            heading[row] = b.robot_heading[robot]
    copy_places(position, b.aim)
    for k in range(heading.shape[0]):
        b.aim_heading[k] = heading[k]
    if not b.noted[ONLY] and have_strayed(position, heading, b.loads, b.reference, b.load_reach, b.slack):
        b.noted[ONLY] = True
        return WORN
    return DONE


@compiled
def have_strayed(position, heading, loads, reference, reach, slack):
    """Return whether a point of a load may be farther than `slack` from where it was at the poses of reference."""
    for k in range(loads.shape[0]):
        b = loads[k]
        shift = hypot(position[b, 0] - reference[k, 0], position[b, 1] - reference[k, 1])
        chord = 2.0 * abs(sin((heading[b] - reference[k, 2]) / 2.0))
        if shift + reach[k] * chord > slack:
            return True
    return False


@compiled
def place_bodies(block, edges, discs):
    """Write and list the items of all bodies where these are now."""
    follow_bodies(unpack(block, MoverArrays), edges, discs)


@compiled
def list_seen(block, edges, discs):
    """List the items of all bodies by the cells from which they can be seen, unless they are listed."""
    movers = unpack(block, MoverArrays)
    if not movers.listed[ONLY]:
        list_items(edges, discs, movers.items, movers.sight, movers.sight_cells)
        movers.listed[ONLY] = True


@compiled
def return_to_start(block, edges, discs):
    """Put all bodies where they begin the step, none of them blocked, and return whether any is to move."""
    m = unpack(block, MoverArrays)
    position, heading, start, start_heading, aim = m.position, m.heading, m.start, m.start_heading, m.aim
    went, goes = False, False
    for b in m.rows:
        if position[b, 0] != start[b, 0] or position[b, 1] != start[b, 1] or heading[b] != start_heading[b]:
            position[b, 0], position[b, 1], heading[b] = start[b, 0], start[b, 1], start_heading[b]
            went = True
        m.blocked[b] = False
        goes |= aim[b, 0] != position[b, 0] or aim[b, 1] != position[b, 1] or m.aim_heading[b] != heading[b]
    if went:
        follow_bodies(m, edges, discs)
    return goes


@compiled
def place_items(position, heading, outlines, edges, discs):
    """Write the edges and discs of all bodies at their poses."""
    local, edge_row, edge_body, disc_row, disc_body = outlines
    for k in range(local.shape[0]):
        b, row = edge_body[k], edge_row[k]
        cosine, sine = direction_of(heading[b])
        edges[row, 0] = cosine * local[k, 0] - sine * local[k, 1] + position[b, 0]
        edges[row, 1] = sine * local[k, 0] + cosine * local[k, 1] + position[b, 1]
        edges[row, 2] = cosine * local[k, 2] - sine * local[k, 3] + position[b, 0]
        edges[row, 3] = sine * local[k, 2] + cosine * local[k, 3] + position[b, 1]
    for k in range(disc_row.shape[0]):
        discs[disc_row[k], 0], discs[disc_row[k], 1] = position[disc_body[k], 0], position[disc_body[k], 1]


@compiled
def hide_carried(movers, edges, discs):
    """Let the items of bodies that robots carry be nowhere."""
    for item in movers.items:
        if movers.mode[movers.body_of[item]] == IS_CARRIED:
            if item < edges.shape[0]:
                edges[item] = np.nan
            else:
                discs[item - edges.shape[0], :2] = np.nan


@compiled
def list_items(edges, discs, items, reach, lists):
    """List items by the cells from which they are within reach, see `list_boxes_by_cell`; in place.

    Those that are nowhere are not listed.
    """
    x, y, per_unit, columns, rows = lists.grid
    start, entries = lists.start, lists.items
    start[:] = 0
    for fill in range(2):
        for item in items:
            x_min, y_min, x_max, y_max = item_box(item, edges, discs)
            if math.isnan(x_min):
                continue
            left = cell_index(x_min - reach, x, per_unit, columns)
            right = cell_index(x_max + reach, x, per_unit, columns)
            below = cell_index(y_min - reach, y, per_unit, rows)
            above = cell_index(y_max + reach, y, per_unit, rows)
            for row in range(below, above + 1):
                for column in range(left, right + 1):
                    c = column + columns * row
                    if fill == 1:
                        start[c] -= 1
                        entries[start[c]] = item
                    else:
                        start[c] += 1
        if fill == 0:
            # After filling backwards from the end of each cell, start is its beginning.
            for c in range(1, columns * rows):
                start[c] += start[c - 1]
            start[columns * rows] = start[columns * rows - 1]


@compiled
def item_box(item, edges, discs):
    """Return x_min, y_min, x_max and y_max of an edge or a disc, see `Statics`."""
    if item < edges.shape[0]:
        ax, ay, bx, by = edges[item, 0], edges[item, 1], edges[item, 2], edges[item, 3]
        return min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)
    x, y, r = discs[item - edges.shape[0], 0], discs[item - edges.shape[0], 1], discs[item - edges.shape[0], 2]
    return x - r, y - r, x + r, y + r


@compiled
def bound_of_way(b, movers):
    """Return how far a body is to travel in this step: an upper bound of the way of any of its points."""
    if movers.blocked[b]:
        return 0.0
    aim, start = movers.aim, movers.start
    turn = abs(wrap_angle(movers.aim_heading[b] - movers.start_heading[b]))
    return hypot(aim[b, 0] - start[b, 0], aim[b, 1] - start[b, 1]) + movers.reach[b] * turn


@compiled
def count_body_pieces(pieces, radius, movers):
    """Return the number of pieces of a step, more than those of the robots if bodies travel farther.

    `movers` are the numbers of a block, or None.
    """
    if movers is None:
        return pieces
    m, longest = unpack(movers, MoverArrays), LONGEST_STEP * least_radius(radius)
    for b in m.rows:
        least = math.ceil(bound_of_way(b, m) / longest - 1e-9)
        if least <= MOST_PIECES:
            pieces = max(pieces, int(least))
    return pieces


@compiled
def advance_bodies(piece, pieces, radius, movers, edges, discs):
    """Move the bodies through a piece of their way, all of it in the first piece where that is too far to travel.

    Return whether any moved, and write which ones jumped.
    """
    if movers is None:
        return False
    position, heading, aim, aim_heading = movers.position, movers.heading, movers.aim, movers.aim_heading
    start, start_heading, before_heading, jumps = (
        movers.start,
        movers.start_heading,
        movers.before_heading,
        movers.jumps,
    )
    jumps[:] = False
    longest, has_moved = LONGEST_STEP * least_radius(radius), False
    for b in movers.rows:
        movers.before[b, 0], movers.before[b, 1], before_heading[b] = position[b, 0], position[b, 1], heading[b]
        way = bound_of_way(b, movers)
        if way == 0.0:
            continue
        jumps[b] = piece == 0 and way > (MOST_PIECES + 1e-9) * longest
        if jumps[b] or piece == pieces - 1:
            position[b, 0], position[b, 1], heading[b] = aim[b, 0], aim[b, 1], aim_heading[b]
        elif way <= (MOST_PIECES + 1e-9) * longest:
            share = (piece + 1) / pieces
            position[b, 0] = start[b, 0] + share * (aim[b, 0] - start[b, 0])
            position[b, 1] = start[b, 1] + share * (aim[b, 1] - start[b, 1])
            heading[b] = wrap_angle(start_heading[b] + share * wrap_angle(aim_heading[b] - start_heading[b]))
        has_moved = True
    if has_moved:
        follow_bodies(movers, edges, discs)
    return has_moved


@compiled
def follow_bodies(movers, edges, discs):
    """Write and list the items of all bodies where these are now, from where they can be touched."""
    place_items(movers.position, movers.heading, movers.outlines, edges, discs)
    hide_carried(movers, edges, discs)
    list_items(edges, discs, movers.items, movers.touch, movers.touch_cells)
    movers.listed[ONLY] = False


@compiled
def return_bodies(goes, movers, edges, discs):
    """Put bodies where they were before this piece of the step, for the rest of it, and return whether any moved."""
    position, heading, before, before_heading = movers.position, movers.heading, movers.before, movers.before_heading
    went = False
    for b in movers.rows:
        is_back = position[b, 0] == before[b, 0] and position[b, 1] == before[b, 1] and heading[b] == before_heading[b]
        if goes[b] and not is_back:
            position[b, 0], position[b, 1], heading[b] = before[b, 0], before[b, 1], before_heading[b]
            movers.blocked[b] = True
            went = True
    if went:
        follow_bodies(movers, edges, discs)
    return went
