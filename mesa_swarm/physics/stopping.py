"""Loads stop driven bodies that were sent to where they are, or past them."""

import math
from typing import NamedTuple, cast

import numpy as np

from mesa_swarm.geometry.outlines import normalize_solid, place_solid
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.kernels.type_names import Flags, RealRows, Reals
from mesa_swarm.physics.load_room import Poses, Room, is_within, place_load
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.world.bodies import Form

# Ways of driven bodies are searched for loads at places this share of the thinner body's thickness apart, at no more
# than this number of places.
LOOK = 0.5
MOST_LOOKS = 64


class StopBodiesArrays(NamedTuple):
    """What `stop_bodies` takes.

    The poses of all bodies, where they are sent, whether they are blocked, and their reach; of the driven ones the
    thickness; and the room of loads, whose outlines are scratch.
    """

    poses: Poses
    aim: RealRows
    aim_heading: Reals
    blocked: Flags
    reach: Reals
    thickness: Reals
    room: Room

    @classmethod
    def of(cls, surroundings: Surroundings, room: Room) -> "StopBodiesArrays":
        """Return the driven bodies and the loads of a world."""
        table, forms = surroundings.bodies, surroundings.bodies.forms
        return cls(
            poses=surroundings.poses,
            aim=table.aim,
            aim_heading=table.aim_heading,
            blocked=table.blocked,
            reach=table.reach,
            thickness=np.array([cast(Form, forms[row]).thickness for row in surroundings.driven.tolist()], float),
            room=room,
        )


def stop_at_loads(surroundings: Surroundings) -> None:
    """Write which driven bodies a load stops, as `stop_bodies` does."""
    if surroundings.room is not None and surroundings.moving is not None:
        stop_bodies(Block(StopBodiesArrays.of(surroundings, surroundings.room)).numbers, 0, 0, 0)


@compiled(nogil=True)
def stop_bodies(block, step, first, last):
    """Write which driven bodies a load stops: it is where the body is to go, or on the way."""
    a = unpack(block, StopBodiesArrays)
    for b in range(a.poses.driven.shape[0]):
        a.blocked[a.poses.driven[b]] = is_stopped(b, a)
    return 0


@compiled
def is_stopped(b, a):
    """Return whether driven body b is to move, and a load is in its way."""
    position, heading, row = a.poses.position, a.poses.heading, a.poses.driven[b]
    is_there = a.aim[row, 0] == position[row, 0] and a.aim[row, 1] == position[row, 1]
    if is_there and a.aim_heading[row] == heading[row]:
        return False
    for k in range(a.room.loads):
        if is_load_in_the_way(k, b, a):
            return True
    return False


@compiled(apart=True)
def is_load_in_the_way(k, b, a):
    """Return whether load k overlaps driven body b at a place of its way, of those at which it is looked for."""
    poses, row, load = a.poses, a.poses.driven[b], a.poses.loads[k]
    x, y, heading = poses.position[row, 0], poses.position[row, 1], poses.heading[row]
    way_x, way_y, turn = a.aim[row, 0] - x, a.aim[row, 1] - y, wrap_angle(a.aim_heading[row] - heading)
    length, load_x, load_y = hypot(way_x, way_y), poses.position[load, 0], poses.position[load, 1]
    if hypot(x - load_x, y - load_y) > a.reach[row] + a.reach[load] + length:
        return False
    place_load(k, load_x, load_y, poses.heading[load], a.room)
    apart = LOOK * min(a.thickness[b], a.room.forms.thickness[k])
    count = math.ceil(min((length + a.reach[row] * abs(turn)) / apart, float(MOST_LOOKS)))
    for look in range(1, count + 1):
        share = look / count
        if meets_body(k, b, x + share * way_x, y + share * way_y, heading + share * turn, a.room):
            return True
    return False


@compiled
def meets_body(k, b, x, y, heading, room):
    """Return whether load k, where it is placed, overlaps driven body b in a pose by more than rounding."""
    solid = room.still + room.loads + b
    place_solid(solid, x, y, heading, room.outlines)
    normalize_solid(solid, room.outlines)
    return is_within(k, solid, room.forms.core_radius[k], room)
