"""Bodies that robots carry: gripped, put down where there is room, and let go where a process sends them."""

import math
from typing import NamedTuple

import numpy as np

from mesa_swarm.geometry.outlines import first_point, gap_of, gap_to_point, nearest_to_point
from mesa_swarm.geometry.overlap import is_in_polygon, wrap_angle
from mesa_swarm.kernels.block import Block, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import atan2, direction_of, hypot
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Codes, Flags, IntegerRows, Integers, RealRows, Reals
from mesa_swarm.physics.driven_bodies import MoverArrays, follow_bodies
from mesa_swarm.physics.load_room import Poses, Room, is_within, place_load, place_outlines, room_of
from mesa_swarm.physics.surroundings import Surroundings
from mesa_swarm.world.statics import CARRIED, DRIVEN, PUSHED

# A body is put down in one of these directions (rad), this share of its size from the robot's rim.
PUT_DOWN = np.radians([0, 15, -15, 30, -30, 45, -45, 60, -60])
CLEAR = 1.0 + 1e-6
# As NumPy has them: Numba would compile functions once more for each literal.
IS_CARRIED, IS_DRIVEN = np.int8(CARRIED), np.int8(DRIVEN)
NO_ROBOT = np.int64(-1)
# What `let_go` returns where a body was sent that cannot be sent, or to a place that is not on the map.
ASTRAY = 1
# Where no body is driven.
NO_BLOCK = np.empty(0, np.int64)


class CarryArrays(NamedTuple):
    """What functions of carried bodies take.

    Columns of robots and of bodies; the room of all bodies that may move, and the rows of these in the table, the
    driven ones from `first` on; the block of driven bodies; and edges, rings and discs of all that is solid.
    """

    robot_position: RealRows
    robot_heading: Reals
    robot_radius: Reals
    position: RealRows
    heading: Reals
    aim: RealRows
    aim_heading: Reals
    mode: Codes
    carrier: Integers
    reach: Reals
    poses: Poses
    room: Room
    first: int
    movers: Integers
    edges: RealRows
    rings: IntegerRows
    discs: RealRows
    bounds: Reals


class GripArrays(NamedTuple):
    """What `grip_all` takes: numbers of a block of `CarryArrays`, and what a gripper is.

    The column that it sets, the rows of its robots, which of the rows of bodies it may grip, how far and how wide
    (half, rad) it reaches; scratch: the number of what each robot carries, -1 for nothing, and whether it is to grip.
    """

    carry: Integers
    setting: Reals
    robots: Integers
    grips: Flags
    reach: float
    half_angle: float
    holds: Integers
    wants: Flags


class Carrying:
    """What is carried in a world: made anew with its surroundings.

    Attributes
    ----------
    block : Block
        Of `CarryArrays`.
    """

    def __init__(self, columns: dict[str, np.ndarray], scene: Surroundings) -> None:
        table, statics, moving = scene.bodies, scene.statics, scene.moving
        modes = table.mode[scene.rows]
        pushed, sent = np.flatnonzero(modes == PUSHED), np.flatnonzero(np.isin(modes, (DRIVEN, CARRIED)))
        indices = np.concatenate([pushed, sent])
        movers = NO_BLOCK if moving is None else moving.block
        self.rows, self.state = scene.rows[indices], (scene, columns["position"])
        room = room_of(statics, table, indices, np.empty(0, np.int64), scene.rows)
        self.arrays = CarryArrays(
            robot_position=columns["position"],
            robot_heading=columns["heading"],
            robot_radius=columns["radius"],
            position=table.position,
            heading=table.heading,
            aim=table.aim,
            aim_heading=table.aim_heading,
            mode=table.mode,
            carrier=table.carrier,
            reach=table.reach,
            poses=Poses(table.position, table.heading, table.mode, self.rows, np.empty(0, np.int64)),
            room=room,
            first=len(pushed),
            movers=movers,
            edges=statics.edges,
            rings=statics.rings,
            discs=statics.discs,
            bounds=statics.bounds,
        )
        self.block = Block(self.arrays)

    def is_of(self, columns: dict[str, np.ndarray], scene: Surroundings) -> bool:
        """Return whether it is still that of these columns of robots and this scene."""
        return self.state[0] is scene and self.state[1] is columns["position"]

    def gripping(
        self, setting: np.ndarray, robots: np.ndarray, grips: np.ndarray, reach: float, half_angle: float
    ) -> Kernel:
        """Return what grips and puts down for these robots, as the column `setting` has it, see `GripArrays`."""
        n = len(setting)
        scratch = np.full(n, -1, np.int64), np.zeros(n, np.bool_)
        block = Block(GripArrays(self.block.numbers, setting, robots, grips, reach, half_angle, *scratch))
        return Kernel(grip_all, block.numbers, (block, self))

    def release(self, row: int) -> bool:
        """Put down in front of its robot the body in a row, and return whether there is room."""
        return bool(release_body(self.block.numbers, int(np.flatnonzero(self.rows == row)[0])))


@compiled
def release_body(carry, k):
    """Put down the body of number k in front of the robot that carries it, and return whether there is room."""
    c = unpack(carry, CarryArrays)
    place_outlines(c.poses, c.room)
    done = put_down(c, k)
    if done:
        follow_bodies(unpack(c.movers, MoverArrays), c.edges, c.discs)
    return done


@compiled(nogil=True)
def grip_all(block, step, first, last):
    """Let robots put down what they carry and are not to hold, and empty ones that are to grip take what is nearest."""
    g = unpack(block, GripArrays)
    c = unpack(g.carry, CarryArrays)
    goes, wants = note_held(c, g)
    if not goes and not wants:
        return 0
    place_outlines(c.poses, c.room)
    changed = False
    for i in g.robots:
        if g.holds[i] >= 0 and not g.setting[i] > 0.5:
            changed |= put_down(c, g.holds[i])
    changed |= wants and take_nearest(c, g)
    if changed:
        follow_bodies(unpack(c.movers, MoverArrays), c.edges, c.discs)
    return 0


@compiled
def note_held(c, g):
    """Write what each robot carries and whether it is to grip; return whether any is to put down, or to grip."""
    g.holds[:], g.wants[:] = NO_ROBOT, False
    for k in range(c.first, c.poses.loads.shape[0]):
        row = c.poses.loads[k]
        if c.mode[row] == IS_CARRIED:
            g.holds[c.carrier[row]] = k
    goes, wants = False, False
    for i in g.robots:
        closed = g.setting[i] > 0.5
        g.wants[i] = closed and g.holds[i] < 0
        goes |= g.holds[i] >= 0 and not closed
        wants |= g.wants[i]
    return goes, wants


@compiled
def take_nearest(c, g):
    """Let robots that want to take the bodies that they reach, the nearest pair first; return whether any did."""
    taken = False
    while True:
        least, robot, body = math.inf, NO_ROBOT, NO_ROBOT
        for i in g.robots:
            if not g.wants[i]:
                continue
            for k in range(c.first, c.poses.loads.shape[0]):
                row = c.poses.loads[k]
                if c.mode[row] == IS_DRIVEN and g.grips[row]:
                    gap = gap_of_grip(c, g, i, k)
                    if gap < least:
                        least, robot, body = gap, i, row
        if robot < 0:
            return taken
        c.mode[body], c.carrier[body] = IS_CARRIED, robot
        x, y, heading = c.robot_position[robot, 0], c.robot_position[robot, 1], c.robot_heading[robot]
        move_body(c, body, x, y, heading)
        g.wants[robot], taken = False, True


@compiled
def gap_of_grip(c, g, i, k):
    """Return the distance of a body from the rim of a robot whose gripper reaches it, infinite of any other."""
    x, y, row = c.robot_position[i, 0], c.robot_position[i, 1], c.poses.loads[k]
    apart = hypot(c.position[row, 0] - x, c.position[row, 1] - y)
    if apart > c.robot_radius[i] + g.reach + c.reach[row]:
        return math.inf
    px, py = nearest_to_point(c.room.still + k, x, y, math.inf, c.room.outlines)
    gap = (hypot(px - x, py - y) - c.room.forms.radius[k]) - c.robot_radius[i]
    bearing = wrap_angle(atan2(py - y, px - x) - c.robot_heading[i])
    return gap if gap <= g.reach and abs(bearing) <= g.half_angle else math.inf


@compiled
def put_down(c, k):
    """Put down the body of number k in front of the robot that carries it, and return whether there is room."""
    robot = c.carrier[c.poses.loads[k]]
    distance = c.robot_radius[robot] + CLEAR * c.room.forms.reach[k]
    for turn in PUT_DOWN:
        azimuth = c.robot_heading[robot] + turn
        cosine, sine = direction_of(azimuth)
        x = c.robot_position[robot, 0] + distance * cosine
        y = c.robot_position[robot, 1] + distance * sine
        if is_free_for(c, k, x, y, wrap_angle(azimuth)):
            free_body(c, k, x, y, wrap_angle(azimuth))
            return True
    return False


@compiled
def free_body(c, k, x, y, heading):
    """Let the body of number k be in a pose, carried by no robot."""
    row = c.poses.loads[k]
    c.mode[row], c.carrier[row] = IS_DRIVEN, NO_ROBOT
    move_body(c, row, x, y, heading)
    place_load(k, x, y, heading, c.room)


@compiled
def move_body(c, row, x, y, heading):
    """Write where a body is, and that it stays there."""
    c.position[row, 0], c.position[row, 1], c.heading[row] = x, y, heading
    c.aim[row, 0], c.aim[row, 1], c.aim_heading[row] = x, y, heading


@compiled
def is_free_for(c, k, x, y, heading):
    """Return whether the body of number k in a pose is on the map, and overlaps no robot and nothing solid.

    A body that was sent elsewhere is solid on all its way, of which a disc around it is taken.
    """
    room, outlines = c.room, c.room.outlines
    place_load(k, x, y, heading, room)
    core = room.still + room.loads + room.driven + k
    if not is_core_on_map(core, room.forms.core_radius[k], outlines, c.bounds):
        return False
    for i in range(c.robot_radius.shape[0]):
        far = room.forms.reach[k] + c.robot_radius[i]
        dx, dy = c.robot_position[i, 0] - x, c.robot_position[i, 1] - y
        if abs(dx) <= far and abs(dy) <= far:
            gap = gap_to_point(room.still + k, c.robot_position[i, 0], c.robot_position[i, 1], math.inf, outlines)[0]
            if gap - room.forms.radius[k] < c.robot_radius[i]:
                return False
    px, py = first_point(core, outlines)
    for p in range(c.rings.shape[0]):
        if is_in_polygon(px, py, c.edges, c.rings[p, 0], c.rings[p, 1]):
            return False
    for solid in range(room.still + room.loads):
        if solid != room.still + k and meets(c, k, solid):
            return False
    return True


@compiled
def is_core_on_map(core, radius, outlines, bounds):
    """Return whether all within a radius of a solid is on the map."""
    for r in range(outlines.solids[core], outlines.solids[core + 1]):
        left, low, right, high = outlines.boxes[r, 0], outlines.boxes[r, 1], outlines.boxes[r, 2], outlines.boxes[r, 3]
        within = bounds[0] <= left - radius and bounds[1] <= low - radius
        if not (within and right + radius <= bounds[2] and high + radius <= bounds[3]):
            return False
    return True


@compiled
def meets(c, k, solid):
    """Return whether the body of number k, where its outlines are, overlaps a solid."""
    room, other = c.room, solid - c.room.still
    if other >= 0:
        row = c.poses.loads[other]
        if c.mode[row] == IS_CARRIED:
            return False
        if c.aim[row, 0] != c.position[row, 0] or c.aim[row, 1] != c.position[row, 1]:
            return meets_way(c, k, row)
        if c.aim_heading[row] != c.heading[row]:
            return meets_way(c, k, row)
    return is_within(k, solid, room.forms.core_radius[k], room)


@compiled
def meets_way(c, k, row):
    """Return whether the body of number k overlaps what the disc around another one sweeps over on its way."""
    room, outlines = c.room, c.room.outlines
    way, core = outlines.solids.shape[0] - 2, room.still + room.loads + room.driven + k
    r, boxes = outlines.solids[way], outlines.boxes
    v = outlines.rings[r]
    ax, ay, bx, by = c.position[row, 0], c.position[row, 1], c.aim[row, 0], c.aim[row, 1]
    outlines.points[v, 0], outlines.points[v, 1], outlines.points[v + 1, 0], outlines.points[v + 1, 1] = ax, ay, bx, by
    boxes[r, 0], boxes[r, 1], boxes[r, 2], boxes[r, 3] = min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)
    return gap_of(core, way, math.inf, outlines) <= room.forms.core_radius[k] + c.reach[row]


@compiled
def is_sent(c, row):
    """Return whether a body is to be elsewhere."""
    is_there = c.aim[row, 0] == c.position[row, 0] and c.aim[row, 1] == c.position[row, 1]
    return not is_there or c.aim_heading[row] != c.heading[row]


@compiled
def is_any_astray(c):
    """Return whether a body is sent to a place that is not on the map, or cannot be sent.

    At the end of the phase resolve all bodies were to stay where they are: what differs was written since.
    """
    position, heading, aim, aim_heading, mode, bounds = c.position, c.heading, c.aim, c.aim_heading, c.mode, c.bounds
    for row in range(mode.shape[0]):  # of all obstacles too: without a call for each
        x, y, turn = aim[row, 0], aim[row, 1], aim_heading[row]
        if x == position[row, 0] and y == position[row, 1] and turn == heading[row]:
            continue
        on_map = bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]
        can_go = mode[row] == IS_DRIVEN or mode[row] == IS_CARRIED
        if not (can_go and on_map and math.isfinite(turn)):
            return True
    return False


@compiled(nogil=True)
def let_go(block, step, first, last):
    """Put carried bodies where a process has sent them, if they have room there.

    Places that are not on the map are refused, and requests of bodies at rest and of loads; all others are for the next
    step.
    """
    c = unpack(block, CarryArrays)
    placed, changed = False, False
    if is_any_astray(c):  # nothing is done
        return ASTRAY
    for k in range(c.first, c.poses.loads.shape[0]):
        row = c.poses.loads[k]
        if not is_sent(c, row):
            continue
        x, y, heading = c.aim[row, 0], c.aim[row, 1], wrap_angle(c.aim_heading[row])
        c.aim_heading[row] = heading
        if c.mode[row] != IS_CARRIED:
            continue
        if not placed:
            place_outlines(c.poses, c.room)
            placed = True
        c.aim[row, 0], c.aim[row, 1], c.aim_heading[row] = c.position[row, 0], c.position[row, 1], c.heading[row]
        if is_free_for(c, k, x, y, heading):
            free_body(c, k, x, y, heading)
            changed = True
    if changed:
        follow_bodies(unpack(c.movers, MoverArrays), c.edges, c.discs)
    return 0
