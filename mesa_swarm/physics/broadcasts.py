"""Broadcasts: heard within a range, cut off by obstacles, lost at random."""

import math
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.grid import CellLists, Grid, GridNumbers, cell_index, cells_of, sort_into_cells
from mesa_swarm.geometry.overlap import nearest_on_segment, segments_meet
from mesa_swarm.kernels.block import Block, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Words, draw_at, draw_word
from mesa_swarm.kernels.elementary import atan2, direction_of, hypot
from mesa_swarm.kernels.part import Kernel, Prepared
from mesa_swarm.kernels.type_names import Flags, IntegerRows, Integers, RealRows, Reals, RealTables
from mesa_swarm.physics.engine import CELLS_PER_ROBOT, FEWEST_CELLS
from mesa_swarm.physics.sensing import rotate_into_frame
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.robots.radio import HEARD, OF_HEARD, SEND, Radio
from mesa_swarm.robots.swarm import Swarm

NO_WORDS = Words(0, 0)
# What can be touched of driven bodies where there are none.
NO_LISTS = CellLists((0.0, 0.0, 0.0, 1, 1), np.zeros(2, np.int64), np.empty(0, np.int64))
# Columns of the swarm that the kernel reads, and that it writes besides those of messages.
OF_SENDERS = ("position", "heading", "number", "layer", "task", "sent_goal")
OF_HEARERS = ("heard_layer", "heard_task", "heard_from", "heard_goal")
NO_OWNERS = np.empty(0, np.int64)


class MessageArrays(NamedTuple):
    """What robots send (n, width) and hear (n, most, width) under one name of a message."""

    sent: RealRows
    heard: RealTables


class HearArrays(NamedTuple):
    """What `hear_all` takes: what `hear_states`, `hear_goals` and `hear_messages` do, and which of them are called.

    `words` is the stream that decides what is lost, `driven` what can be touched of driven bodies. `messages` are the
    numbers of a block of `MessageArrays` for each name, `sends` and `senders` scratch.
    """

    position: RealRows
    heading: Reals
    number: Integers
    layer: Integers
    task: Integers
    sent_goal: RealRows
    beacons: RealRows
    reach: float
    loss: float
    words: Words
    occlusion: bool
    grid: GridNumbers
    edges: RealRows
    discs: RealRows
    touch_cells: CellLists
    driven: CellLists
    heard_layer: Integers
    heard_task: Integers
    heard_from: RealRows
    heard_goal: RealRows
    states: bool
    goals: bool
    messages: IntegerRows
    number_heard: Integers
    distance: RealRows
    bearing: RealRows
    sends: Flags
    senders: IntegerRows


class Channel:
    """Carries broadcasts from robot to robot: a radio, and the grid that finds the robots in range."""

    def __init__(self, radio: Radio) -> None:
        self.radio = radio
        self._beacons = np.array(radio.beacons, dtype=float).reshape(-1, 2)
        self._prepared = Prepared()

    def kernel(self, swarm: Swarm, surroundings: Surroundings, words: Words = NO_WORDS) -> Kernel:
        """Return what writes the columns of what is heard, made anew when robots, obstacles or words are others.

        `words` are a stream of random bits, which decide what is lost.
        """
        prepared, state = self._prepared, (swarm.version, surroundings, words)
        if prepared.kernel is None or prepared.state != state:
            prepared.state, prepared.kernel = state, self._make_kernel(swarm, surroundings, words)
        return prepared.kernel

    def _make_kernel(self, swarm: Swarm, surroundings: Surroundings, words: Words) -> Kernel:
        radio, columns = self.radio, swarm.columns
        grid = Grid.over(surroundings.bounds, max(radio.range, 1e-9), FEWEST_CELLS + CELLS_PER_ROBOT * len(swarm))
        statics, moving = surroundings.statics, surroundings.moving
        messages = self._message_blocks(swarm)
        rows = stack_blocks(messages)
        block = Block(
            HearArrays(
                beacons=self._beacons,
                reach=float(radio.range),
                loss=float(radio.loss_probability),
                words=words,
                occlusion=radio.occlusion,
                grid=grid.numbers,
                edges=statics.edges,
                discs=statics.discs[: statics.first_apart],
                touch_cells=statics.touch_cells,
                driven=NO_LISTS if moving is None else moving.arrays.touch_cells,
                states=radio.state,
                goals=radio.goal,
                messages=rows,
                sends=np.zeros(len(swarm), np.bool_),
                senders=np.empty((len(swarm), int(radio.most)), np.int64),
                **self._columns_of_senders(swarm),
                **{name: columns[name] for name in (*OF_SENDERS, *OF_HEARERS)},
            )
        )
        return Kernel(hear_all, block.numbers, (block, messages))

    def _message_blocks(self, swarm: Swarm) -> list[Block]:
        """Return a block of `MessageArrays` for each name of a message."""
        n, most, columns = len(swarm), int(self.radio.most), swarm.columns
        return [
            Block(
                MessageArrays(
                    columns[f"{SEND}{name}"].reshape(n, width), columns[f"{HEARD}{name}"].reshape(n, most, width)
                )
            )
            for name, width in self.radio.message
        ]

    def _columns_of_senders(self, swarm: Swarm) -> dict[str, np.ndarray]:
        """Return the columns of how many messages are heard, and from where; empty ones without messages."""
        if not self.radio.message:
            return {"number_heard": np.empty(0, np.int64), "distance": np.empty((0, 0)), "bearing": np.empty((0, 0))}
        heard = (swarm.columns[f"{HEARD}{name}"] for name in OF_HEARD)
        return dict(zip(("number_heard", "distance", "bearing"), heard, strict=True))


def obstacles_of(surroundings: Surroundings) -> tuple:
    """Return what stops a broadcast, as `is_cut` takes it."""
    statics, moving = surroundings.statics, surroundings.moving
    driven = None if moving is None else tuple(moving.arrays.touch_cells)
    return statics.edges, statics.discs[: statics.first_apart], *statics.touch_cells, driven


@compiled(nogil=True)
def hear_all(block, step, first, last):
    """Write what all robots hear of states, goals and messages."""
    h = unpack(block, HearArrays)
    word = draw_word(h.words) if h.loss > 0.0 else np.uint64(0)
    if last == 0:
        return 0
    position, heading, number, grid = h.position, h.heading, h.number, h.grid
    limits = h.reach, h.loss, word, h.occlusion
    lists, driven = h.touch_cells, (h.driven.grid, h.driven.start, h.driven.items)
    obstacles = h.edges, h.discs, lists.grid, lists.start, lists.items, driven
    if h.states:
        heard = h.heard_layer, h.heard_task, h.heard_from
        hear_states(position, heading, number, h.layer, h.task, limits, grid, obstacles, *heard)
    if h.goals:
        hear_goals(position, heading, number, h.sent_goal, h.beacons, limits, grid, obstacles, h.heard_goal)
    if h.messages.shape[0] > 0:
        note_senders(h.messages, h.sends)
        senders = h.senders
        hear_messages(
            position, heading, number, h.sends, limits, grid, obstacles, h.number_heard, h.distance, h.bearing, senders
        )
        deliver_messages(h.messages, senders)
    return 0


@compiled
def note_senders(messages, sends):
    """Write which robots send a message: those that have set a number of any name."""
    sends[:] = False
    for m in range(messages.shape[0]):
        sent = unpack(messages[m], MessageArrays).sent
        for i in range(sent.shape[0]):
            for w in range(sent.shape[1]):
                if not math.isnan(sent[i, w]):
                    sends[i] = True


@compiled
def deliver_messages(messages, senders):
    """Write the numbers that robots hear from their senders, rows (n, most), NaN where there is none."""
    for m in range(messages.shape[0]):
        message = unpack(messages[m], MessageArrays)
        sent, heard = message.sent, message.heard
        for i in range(heard.shape[0]):
            for k in range(heard.shape[1]):
                for w in range(heard.shape[2]):
                    heard[i, k, w] = sent[senders[i, k], w] if senders[i, k] >= 0 else math.nan


@compiled
def send_goals(position, heading, goal, sent_goal):
    """Write the places on the map of goals that are given in the robots' own frames; NaN stays NaN."""
    for i in range(position.shape[0]):
        cosine, sine = direction_of(heading[i])
        sent_goal[i, 0] = position[i, 0] + cosine * goal[i, 0] - sine * goal[i, 1]
        sent_goal[i, 1] = position[i, 1] + sine * goal[i, 0] + cosine * goal[i, 1]


@compiled
def hear_states(
    position, heading, number, layer, task, limits, grid, obstacles, heard_layer, heard_task, heard_from,
):  # fmt: skip
    """Write layer, task and place of the nearest robot heard that has a task; -1 and NaN where none is heard.

    `limits` are the range, the loss probability, the step's random word, and whether obstacles stop broadcasts; `grid`
    is the one that the senders are sorted into; for `obstacles` see `is_cut`. Places are in the hearer's frame.
    """
    rows = np.flatnonzero(task >= 0)
    places = position[rows]
    heard = nearest_heard(position, number, places, places, number[rows], limits, grid, obstacles)
    put_in_frames(position, heading, places, heard, heard_from)
    for i in range(position.shape[0]):
        heard_layer[i] = layer[rows[heard[i]]] if heard[i] >= 0 else -1
        heard_task[i] = task[rows[heard[i]]] if heard[i] >= 0 else -1


@compiled
def hear_goals(position, heading, number, sent_goal, beacons, limits, grid, obstacles, heard_goal):
    """Write, of the goals that each robot hears, the nearest, in its own frame; NaN where none is heard.

    `sent_goal` is on the map, and not finite where no goal is sent.
    """
    rows = np.flatnonzero(np.isfinite(sent_goal[:, 0] + sent_goal[:, 1]))
    places = np.concatenate((beacons, position[rows]))
    goals = np.concatenate((beacons, sent_goal[rows]))
    # Numbers of robots begin at 0: those of beacons are below.
    numbers = np.concatenate((np.arange(-beacons.shape[0], 0), number[rows]))
    heard = nearest_heard(position, number, places, goals, numbers, limits, grid, obstacles)
    put_in_frames(position, heading, goals, heard, heard_goal)


@compiled
def hear_messages(
    position, heading, number, sends, limits, grid, obstacles, count, distance, bearing, senders,
):  # fmt: skip
    """Write how many messages each robot hears, and of each how far and where its sender is, and its row.

    The nearest come first; at most as many as `senders` (n, most) has columns; what is left over is NaN, and row -1.
    """
    reach, loss, word, occlusion = limits
    left, below, per_unit, columns, rows = grid
    of_row = np.flatnonzero(sends)
    places, most = position[of_row], senders.shape[1]
    start, order = sorted_senders(places, grid)
    count[:], distance[:], bearing[:], senders[:] = 0, math.nan, math.nan, -1
    for i in range(position.shape[0]):
        x, y, heard = position[i, 0], position[i, 1], 0
        first = cell_index(x - reach, left, per_unit, columns)
        last = cell_index(x + reach, left, per_unit, columns)
        lowest = cell_index(y - reach, below, per_unit, rows)
        highest = cell_index(y + reach, below, per_unit, rows)
        for row in range(lowest, highest + 1):
            for k in range(start[first + columns * row], start[last + columns * row + 1]):
                j = of_row[order[k]]
                square = (position[j, 0] - x) ** 2 + (position[j, 1] - y) ** 2
                if j == i or square > reach * reach:
                    continue
                if heard == most and not is_nearer_robot(
                    square, number[j], distance[i, most - 1], number[senders[i, most - 1]]
                ):
                    continue
                if loss > 0.0 and is_lost(word, number[j], number[i], loss):
                    continue
                if occlusion and is_cut(position[j, 0], position[j, 1], x, y, obstacles):
                    continue
                heard = min(heard + 1, most)
                place = heard - 1
                while place > 0 and is_nearer_robot(
                    square, number[j], distance[i, place - 1], number[senders[i, place - 1]]
                ):
                    distance[i, place], senders[i, place] = distance[i, place - 1], senders[i, place - 1]
                    place -= 1
                distance[i, place], senders[i, place] = square, j
        count[i] = heard
        cosine, sine = direction_of(heading[i])
        for k in range(heard):
            j = senders[i, k]
            ahead, aside = rotate_into_frame(position[j, 0] - x, position[j, 1] - y, cosine, sine)
            distance[i, k], bearing[i, k] = math.sqrt(distance[i, k]), atan2(aside, ahead)


@compiled
def is_nearer_robot(square, number, other_square, other_number):
    """Return whether one robot comes before another: by distance, then by its number."""
    return square < other_square or (square == other_square and number < other_number)


@compiled
def nearest_heard(position, number, places, targets, numbers, limits, grid, obstacles):
    """Return, for every robot, the broadcast it hears whose target is nearest, -1 for none.

    Of equally near targets that of the sender with the smaller number counts: independent of order. Senders are at
    `places` and broadcast the points `targets`; no robot hears the sender with its own number.
    """
    reach, loss, word, occlusion = limits
    left, below, per_unit, columns, rows = grid
    nearest = np.full(position.shape[0], -1)
    if places.shape[0] == 0:
        return nearest
    start, order = sorted_senders(places, grid)
    for i in range(position.shape[0]):
        x, y, best = position[i, 0], position[i, 1], math.inf
        first = cell_index(x - reach, left, per_unit, columns)
        last = cell_index(x + reach, left, per_unit, columns)
        lowest = cell_index(y - reach, below, per_unit, rows)
        highest = cell_index(y + reach, below, per_unit, rows)
        for row in range(lowest, highest + 1):
            for k in range(start[first + columns * row], start[last + columns * row + 1]):
                j = order[k]
                if (places[j, 0] - x) ** 2 + (places[j, 1] - y) ** 2 > reach * reach or numbers[j] == number[i]:
                    continue
                square = (targets[j, 0] - x) ** 2 + (targets[j, 1] - y) ** 2
                if square > best or (square == best and numbers[j] > numbers[nearest[i]]):
                    continue
                if loss > 0.0 and is_lost(word, numbers[j], number[i], loss):
                    continue
                if occlusion and is_cut(places[j, 0], places[j, 1], x, y, obstacles):
                    continue
                nearest[i], best = j, square
    return nearest


@compiled
def sorted_senders(places, grid):
    """Return the senders sorted by cell, see `sort_into_cells`."""
    start = np.empty(cells_of(grid) + 1, np.int64)
    order, cell_of = np.empty(places.shape[0], np.int64), np.empty(places.shape[0], np.int64)
    sort_into_cells(places, grid, start, order, cell_of)
    return start, order


@compiled
def put_in_frames(position, heading, points, rows, out):
    """Write for every robot the chosen point in the robot's frame, NaN where none is chosen."""
    for i in range(position.shape[0]):
        out[i, 0], out[i, 1] = math.nan, math.nan
        if rows[i] >= 0:
            dx, dy = points[rows[i], 0] - position[i, 0], points[rows[i], 1] - position[i, 1]
            cosine, sine = direction_of(heading[i])
            out[i, 0], out[i, 1] = rotate_into_frame(dx, dy, cosine, sine)


@compiled
def is_cut(ax, ay, bx, by, obstacles):
    """Return whether an obstacle's edge or disc meets the segment a-b; touching it is enough.

    `obstacles` are edges, discs, grid, and start and items of the lists of what can be touched, see `Statics`, and
    the last three of driven bodies, or None.
    """
    return is_cut_but(ax, ay, bx, by, obstacles, NO_OWNERS, -1)


@compiled
def is_cut_but(ax, ay, bx, by, obstacles, owners, but):
    """Return the same, but for the items of one body: `but` is its index in `owners`, -1 for none."""
    edges, discs, grid, start, items, moving = obstacles
    return is_cut_by(ax, ay, bx, by, edges, discs, owners, but, grid, start, items) or is_cut_by_driven(
        ax, ay, bx, by, edges, discs, owners, but, moving
    )


@compiled
def is_cut_by_driven(ax, ay, bx, by, edges, discs, owners, but, moving):
    """Return the same for the driven bodies alone."""
    if moving is None:
        return False
    return is_cut_by(ax, ay, bx, by, edges, discs, owners, but, *moving)


@compiled
def is_cut_by(ax, ay, bx, by, edges, discs, owners, but, grid, start, items):
    """Return whether an item that a grid lists meets the segment a-b, but for those of one owner."""
    left, below, per_unit, columns, rows = grid
    if ax > bx:
        ax, ay, bx, by = bx, by, ax, ay
    first, last = cell_index(ax, left, per_unit, columns), cell_index(bx, left, per_unit, columns)
    for column in range(first, last + 1):
        # Rounding of where the segment enters and leaves a column is harmless: lists reach beyond their cells.
        enters = 0.0 if column == first else (left + column / per_unit - ax) / (bx - ax)
        leaves = 1.0 if column == last else (left + (column + 1) / per_unit - ax) / (bx - ax)
        y, other_y = ay + enters * (by - ay), ay + leaves * (by - ay)
        lowest = cell_index(min(y, other_y), below, per_unit, rows)
        highest = cell_index(max(y, other_y), below, per_unit, rows)
        for row in range(lowest, highest + 1):
            cell = column + columns * row
            for k in range(start[cell], start[cell + 1]):
                if but >= 0 and owners[items[k]] == but:
                    continue
                if item_meets(items[k], ax, ay, bx, by, edges, discs):
                    return True
    return False


@compiled
def item_meets(item, ax, ay, bx, by, edges, discs):
    """Return whether an item, see `Statics`, meets the segment a-b; an item beyond these discs stops nothing."""
    disc = item - edges.shape[0]
    if disc < 0:
        return segments_meet(ax, ay, bx, by, edges[item, 0], edges[item, 1], edges[item, 2], edges[item, 3])
    if disc >= discs.shape[0]:
        return False
    x, y, _ = nearest_on_segment(discs[disc, 0], discs[disc, 1], ax, ay, bx, by)
    return hypot(x - discs[disc, 0], y - discs[disc, 1]) <= discs[disc, 2]


@compiled
def is_lost(word, sender, hearer, probability):
    """Return whether a broadcast is lost, by a hash of the step's word and both numbers: independent of order."""
    return draw_at(word, sender, hearer) < probability
