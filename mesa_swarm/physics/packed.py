"""Sensing and moving of plain robots in one call each, with all arguments that stay the same in a `Block`.

In small worlds a step takes about as long as its calls from Python and the arrays that these pass.
"""

from mesa_swarm.geometry.block import unpack
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.physics.crowd import sort_by_cell
from mesa_swarm.physics.motion import achieved_motion, copy_places, slip_of
from mesa_swarm.physics.sensing import sense_proximity
from mesa_swarm.physics.separation import SETTLED
from mesa_swarm.physics.travel import travel_pieces
from mesa_swarm.robots.drive import motion_to_wheels, wheels_to_motion

GRID = "(float64 float64 float64 int64 int64)"
# The types of the arguments in the blocks, in their order there.
SENSING = " ".join((
    "float64[2C] float64[1C] int64[1C]",
    f"{GRID} int64[1C] int64[1C] int64[1C] float64[2C] float64[1C] int64[1C]",
    "float64 float64 float64[1C] int64[1C] float64[3C] int64[1C] float64[1C]",
    f"float64[2C] float64[2C] int8[1C] {GRID} int64[1C] int64[1C]",
    "float64[2C] int8[2C]",
))  # fmt: skip
MOVING = " ".join((
    "float64[2C] float64[2C] float64[2C] float64[1C]",
    "(int64[1C] float64[2C] float64[2C] float64[1C] int64[1C] bool[1C]"
    " (int64[1C] int64[1C] float64[2C] float64[1C] float64[2C]) int64[1C])",
    "float64[2C] float64[2C] float64[1C] float64[2C] float64[1C]",
    f"(float64[2C] float64[2C] int64[1C] int8[1C] float64[1C] {GRID} int64[1C] int64[1C] none)",
    "bool[1C] int64[1C] int64[1C] float64[2C] float64[1C] float64[1C]",
))  # fmt: skip


@compiled(nogil=True)
def sense_packed(first, last, pairs, block):
    """Sort robots by cell, then do what `sense_proximity` does, where no body moves."""
    (
        position, radius, number,
        grid, start, order, cell_of, places, radii, numbers,
        largest_radius, margin, heading, design, sensors, counts, reach,
        edges, discs, static_kind, static_grid, seen_start, seen_items,
        distance, kind,
    ) = unpack(block, SENSING)  # fmt: skip
    sort_by_cell(position, radius, number, grid, start, order, cell_of, places, radii, numbers)
    return sense_proximity(
        first, last, pairs, None, order, places, radii, largest_radius, margin, grid, start, heading, design, sensors,
        counts, reach, edges, discs, static_kind, static_grid, seen_start, seen_items, distance, kind,
    )  # fmt: skip


@compiled(nogil=True)
def move_packed(piece, pieces, pairs, turn_angle, driven, block):
    """Move robots with two wheels that reach their speed at once, where neither bodies nor loads move.

    What is driven becomes the motion, `travel_pieces` moves all, and the slip of what they have achieved is written.
    """
    (
        wheels, slip, before, heading_before,
        crowd, listed, position, heading, motion, radius, statics,
        collided, contact_kind, contact_index, contact_normal, contact_depth, extra_turn,
    ) = unpack(block, MOVING)  # fmt: skip
    if piece == 0:
        wheels_to_motion(driven, radius, motion)
        copy_places(position, before)
        for i in range(len(heading)):
            heading_before[i] = heading[i]
    ended = travel_pieces(
        piece, pieces, pairs, turn_angle, crowd, listed, position, heading, motion, radius, statics,
        collided, contact_kind, contact_index, contact_normal, contact_depth, extra_turn,
    )  # fmt: skip
    if ended[2] == SETTLED:
        achieved_motion(before, position, heading_before, extra_turn, collided, motion)
        motion_to_wheels(motion, radius, wheels)
        for i in range(len(heading)):
            if not collided[i]:
                wheels[i, 0], wheels[i, 1] = driven[i, 0], driven[i, 1]
        slip_of(driven, wheels, slip)
    return ended
