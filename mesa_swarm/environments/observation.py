"""What a learner is told of each robot: its readings, all within [0, 1]; nothing that the robot could not know."""

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_choice
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.world.statics import FIRE, OBSTACLE, ROBOT

ENCODINGS = ("distance", "typed")
# The blocks of a typed observation, in their order.
KINDS = (OBSTACLE, ROBOT, FIRE)
BODY = 4


class Observer:
    """Turns the columns of robots of one design into rows of numbers in [0, 1].

    A row is, in this order:

    - each proximity sensor's distance / range, 1 if it sees nothing;
    - with encoding "typed": for obstacles, then for robots, then for fires, 1 for each sensor that sees one, else 0;
    - each radiation sensor's temperature;
    - each line sensor's 1 over a mark, else 0;
    - with `body`: the robot's own temperature / `leave` (at most 1), and 1 or 0 for: it is too hot, it takes heat,
      it is extinguishing.

    Parameters
    ----------
    design : RobotDesign
        With at least one proximity sensor of a range above 0.
    encoding : str
        "distance", or "typed": the kinds of things as well.
    body : bool
        Whether robots are told of their own heat.
    leave : float
        The temperature at which a robot leaves a fire.

    Examples
    --------
    >>> from mesa_swarm.robots.design import AGENT9, AGENT_FIRE
    >>> Observer(AGENT9, encoding="distance").width, Observer(AGENT_FIRE, encoding="typed", body=True).width
    (9, 41)
    """

    def __init__(self, design: RobotDesign, *, encoding: str, body: bool = False, leave: float = 1.0) -> None:
        ranges = [float(sensor.range) for sensor in design.proximity]
        if not ranges or min(ranges) <= 0:
            raise InvalidValueError(
                f"design {design.name} has no proximity sensors, or one of range 0, and would observe nothing there; "
                "use one such as AGENT9"
            )
        self._typed = check_choice("encoding", encoding, ENCODINGS) == "typed"
        self._reach = np.array(ranges)
        self._body = body
        self._leave = leave
        blocks = 1 + len(KINDS) * self._typed
        self.width = blocks * len(ranges) + len(design.radiation) + len(design.line) + BODY * body

    def observe(self, columns: dict[str, np.ndarray], out: np.ndarray) -> None:
        """Write the observations of the first robots, as many as `out` (k, width) has rows."""
        observe(
            columns["distance"],
            columns["kind"],
            columns["radiation"],
            columns["line"],
            columns["temperature"],
            columns["hot"],
            columns["heat"],
            columns["fire"],
            self._reach,
            self._typed,
            self._body,
            self._leave,
            out,
        )


# This calls no compiled function of another file, so that Numba's own cache cannot go stale.
@compiled
def observe(
    distance, kind, radiation, line, temperature, hot, heat, fire, reach, typed, body, leave, out
):  # fmt: skip
    """Write the rows that `Observer` describes."""
    sensors = distance.shape[1]
    for i in range(out.shape[0]):
        for s in range(sensors):
            seen = kind[i, s]
            out[i, s] = 1.0 if distance[i, s] < 0.0 else min(distance[i, s] / reach[s], 1.0)
            if typed:
                out[i, sensors + s] = seen == OBSTACLE
                out[i, 2 * sensors + s] = seen == ROBOT
                out[i, 3 * sensors + s] = seen == FIRE
        at = 4 * sensors if typed else sensors
        for q in range(radiation.shape[1]):
            out[i, at + q] = radiation[i, q]
        at += radiation.shape[1]
        for k in range(line.shape[1]):
            out[i, at + k] = line[i, k]
        at += line.shape[1]
        if body:
            out[i, at] = min(temperature[i] / leave, 1.0)
            out[i, at + 1] = hot[i]
            out[i, at + 2] = heat[i] > 0.0
            out[i, at + 3] = fire[i] >= 0
