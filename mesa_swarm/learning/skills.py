"""What a robot that learns to fight fires may do for a while, and what it tells situations apart by."""

import math

from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.steering import approach, turn_towards
from mesa_swarm.world.statics import FIRE, ROBOT

SKILLS = ("explore", "approach", "wait", "back off", "follow")
EXPLORE, APPROACH, WAIT, BACK_OFF, FOLLOW = range(len(SKILLS))
BODIES = ("free", "at a fire", "too hot, in the heat", "too hot, out of the heat")
# A robot seen farther than this from straight ahead is turned to; as `Follow` and `FightFire` do by default.
CRITICAL_ANGLE = math.radians(10.0)
# Who explores turns away from a fire nearer than this; as `Avoid` does by default.
NEAR = 15.0


def situation_words(situation: int) -> str:
    """Say what the robot is in.

    Examples
    --------
    >>> situation_words(0), situation_words(7)
    ('free', 'at a fire, sees a fire and a robot')
    """
    body, seen = divmod(situation, 4)
    what = ("", ", sees a robot", ", sees a fire", ", sees a fire and a robot")[seen]
    return f"{BODIES[body]}{what}"


SITUATIONS = tuple(situation_words(number) for number in range(4 * len(BODIES)))


@compiled
def situation_of(kind, i, at_fire, hot, heat):
    """Return the number of the situation that robot i is in: its body, whether it sees a fire, and a robot."""
    fire, robot = 0, 0
    for s in range(kind.shape[1]):
        if kind[i, s] == FIRE:
            fire = 1
        elif kind[i, s] == ROBOT:
            robot = 1
    body = (2 if heat > 0.0 else 3) if hot else (1 if at_fire else 0)
    return 4 * body + 2 * fire + robot


@compiled
def nearest_of(distance, kind, i, wanted):
    """Return the sensor of robot i that sees the nearest thing of a kind, -1 if none does."""
    nearest = -1
    for s in range(distance.shape[1]):
        if kind[i, s] == wanted and (nearest < 0 or distance[i, s] < distance[i, nearest]):
            nearest = s
    return nearest


@compiled
def perform(skill, distance, kind, bearing, forward, i, d, at_fire, side, speed, radius):
    """Return the wheel speeds of a skill for robot i of design d."""
    if skill == WAIT or (skill == APPROACH and at_fire):
        return 0.0, 0.0
    if skill == BACK_OFF:
        return -speed, -speed
    seen = nearest_of(distance, kind, i, ROBOT if skill == FOLLOW else FIRE)
    if seen >= 0 and skill != EXPLORE:
        return approach(bearing[d, seen], CRITICAL_ANGLE, speed, radius)
    ahead = seen >= 0 and (seen == forward[d, 0] or seen == forward[d, 1] or seen == forward[d, 2])
    if ahead and distance[i, seen] < NEAR:
        away = -bearing[d, seen] if bearing[d, seen] != 0.0 else side
        return turn_towards(math.copysign(math.pi, away), speed, radius)
    return speed, speed
