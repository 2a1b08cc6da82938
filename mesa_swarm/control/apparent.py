"""How those that a robot sees move, told from how their perceived centroid moves (thesis 5.3.4)."""

import math

import numpy as np

from mesa_swarm.control.layer import Senses
from mesa_swarm.control.perception import centroids
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.physics.motion import sinc
from mesa_swarm.robots.swarm import Swarm

# How many steps in a row must be compared before there is an estimate.
FEWEST = 3


class Apparent:
    """The estimated velocity of the visible centroid of each robot, kept in columns of the swarm.

    The displacement m of the centroid between two steps, corrected for what the robot itself was told to drive
    (it cannot know whether it slipped), is v = m / dt (5.3, corrected). A sensor sees no motion across its
    sector, and a jump when what it sees passes to its neighbour, so v is the exponential mean over the last
    `memory` steps. Displacements longer than `jump` are others coming into sight or leaving it: not counted.

    Parameters
    ----------
    swarm : Swarm
    prefix : str
        Of the columns' names.
    memory : float
        Steps, at least 1.
    jump : float
        Map units.
    turns : bool
        Whether commands are wheel speeds left and right, which turn the body; else forward and sideways.
    """

    def __init__(self, swarm: Swarm, prefix: str, memory: float, jump: float, turns: bool) -> None:
        self._swarm, self._prefix, self._turns = swarm, prefix, turns
        self._share, self._jump = 1.0 / memory, jump
        swarm.remember(f"{prefix}.centroid", (2,), np.float64, 0.0)
        swarm.remember(f"{prefix}.velocity", (2,), np.float64, 0.0)
        swarm.remember(f"{prefix}.seen", (), np.int64, 0)
        swarm.remember(f"{prefix}.compared", (), np.int64, 0)

    def update(self, senses: Senses) -> tuple[np.ndarray, np.ndarray]:
        """Take in this step's readings; return velocity (n, 2) in the robot's frame, and steps compared (n,)."""
        centroid, seen = centroids(senses)
        columns = self._swarm.columns
        before, velocity = columns[f"{self._prefix}.centroid"], columns[f"{self._prefix}.velocity"]
        seen_before, compared = columns[f"{self._prefix}.seen"], columns[f"{self._prefix}.compared"]
        track(
            centroid, seen, senses.last_command, senses.radius, self._turns, self._share, self._jump,
            before, seen_before, velocity, compared,
        )  # fmt: skip
        return velocity, compared


@compiled
def track(centroid, seen, command, radius, turns, share, jump, before, seen_before, velocity, compared):
    """Bring the estimates up to date, and remember what is seen now."""
    for i in range(centroid.shape[0]):
        ahead, left, turn = command[i, 0], command[i, 1], 0.0
        if turns:
            turn = (command[i, 1] - command[i, 0]) / (2.0 * radius[i])
            chord = 0.5 * (command[i, 0] + command[i, 1]) * sinc(0.5 * turn)
            ahead, left = chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn)
        cosine, sine = math.cos(turn), math.sin(turn)
        # Everything is told in the frame that the robot has now: turned by `turn`, moved by (ahead, left).
        x, y = before[i, 0] - ahead, before[i, 1] - left
        moved_x = centroid[i, 0] - (cosine * x + sine * y)
        moved_y = centroid[i, 1] - (cosine * y - sine * x)
        vx, vy = velocity[i, 0], velocity[i, 1]
        vx, vy = cosine * vx + sine * vy, cosine * vy - sine * vx
        if seen[i] == 0:
            vx, vy, compared[i] = 0.0, 0.0, 0
        elif seen_before[i] > 0 and math.hypot(moved_x, moved_y) <= jump:
            compared[i] += 1
            weight = max(share, 1.0 / compared[i])
            vx += weight * (moved_x - vx)
            vy += weight * (moved_y - vy)
        velocity[i, 0], velocity[i, 1] = vx, vy
        before[i, 0], before[i, 1] = centroid[i, 0], centroid[i, 1]
        seen_before[i] = seen[i]
