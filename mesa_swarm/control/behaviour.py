"""Rules of one's own: plain Python about one robot, compiled when first used."""

import inspect
import math
import warnings
from collections import namedtuple
from collections.abc import Callable

import numpy as np
from numba import njit
from numba.core.errors import NumbaError

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import (
    BehaviourError,
    InvalidValueError,
    UncompiledBehaviourWarning,
    UnknownNameError,
    check_number,
    unknown_name,
)
from mesa_swarm.robots.swarm import Swarm

# What a rule returns when it has nothing to say: a pair of numbers like any other, so that it compiles.
PASS = (math.inf, math.inf)

Me = namedtuple(
    "Me",
    "distance kind bearing radiation line front left right radius max_speed tendency temperature heat hot "
    "extinguishing heard_layer heard_task heard_x heard_y goal_x goal_y",
)


class Behaviour:
    """A rule about one robot, as a layer. Made by `behaviour`; call it to change the rule's parameters.

    Parameters
    ----------
    rule : callable
        ``rule(me, **parameters) -> (left, right)`` or PASS.
    parameters : dict
        Values of the rule's parameters: finite numbers.
    """

    def __init__(self, rule: Callable, parameters: dict[str, float], compiled: list | None = None) -> None:
        self.rule = rule
        self.parameters = parameters
        self.name = rule.__name__
        self.__doc__ = rule.__doc__
        # Shared by all variants of the rule, so that it is compiled once.
        self._compiled = [] if compiled is None else compiled

    def __call__(self, **changes: float) -> "Behaviour":
        """Return the same rule with other parameters."""
        for name, value in changes.items():
            if name not in self.parameters:
                raise UnknownNameError(unknown_name(f"parameter of {self.name}", name, self.parameters))
            check_number(f"{self.name}'s {name}", value)
        return Behaviour(self.rule, {**self.parameters, **changes}, self._compiled)

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember whose rule this is, to name the robot when the rule goes wrong."""
        self._swarm = swarm

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Apply the rule to every robot that no earlier layer drives.

        Raises
        ------
        BehaviourError
            If the rule returned anything but two finite speeds or PASS.
        """
        columns = (
            senses.distance, senses.kind, senses.bearing, senses.radiation, senses.line, senses.forward,
            senses.radius, senses.max_speed, senses.tendency, senses.temperature, senses.heat, senses.hot,
            senses.fire, senses.design, senses.heard_layer, senses.heard_task, senses.heard_from, senses.heard_goal,
        )  # fmt: skip
        values = tuple(float(v) for v in self.parameters.values())
        if not self._compiled:
            self._compiled.append(_compile(self.rule, columns, values))
        wrong = self._compiled[0](columns, values, command, layer, index)
        if wrong >= 0:
            robot = self._swarm.agents[wrong].unique_id
            left, right = command[wrong]
            raise BehaviourError(
                f"rule {self.name} returned ({left:g}, {right:g}) for robot {robot}; "
                "expected two finite wheel speeds, or PASS"
            )


def behaviour(rule: Callable) -> Behaviour:
    """Make a layer of a rule about one robot.

    The rule gets `me`, what the robot knows: `distance`, `kind`, `bearing` (one entry a proximity sensor),
    `radiation`, `line`; `front`, `left`, `right` (indices of sensors); `radius`, `max_speed`, `tendency` (1
    left, -1 right), `temperature`, `heat`, `hot`, `extinguishing`. With a `Radio` it also hears of the nearest
    robot that has a task: `heard_layer` and `heard_task` (-1 for none), and where that is, `heard_x` ahead and
    `heard_y` left; and where the nearest goal is, `goal_x` and `goal_y` (NaN for none). The rule returns the
    speeds of the left and the right wheel, or `PASS` to leave the robot to the layers below. Its other
    parameters need defaults that are numbers. It is compiled when first used; a rule that cannot be is run as
    plain Python, with a warning.

    Raises
    ------
    InvalidValueError
        If a parameter of the rule has no default.

    Examples
    --------
    >>> @behaviour
    ... def timid(me, distance=20.0):
    ...     if 0 <= me.distance[me.front] < distance:
    ...         return -me.max_speed, -me.max_speed
    ...     return PASS
    >>> timid(distance=25).parameters
    {'distance': 25}
    """
    if not callable(rule) or not hasattr(rule, "__name__"):
        raise InvalidValueError(f"behaviour got {rule!r:.60}; expected a function of me")
    _me, *rest = list(inspect.signature(rule).parameters.values()) or [None]
    if _me is None:
        raise InvalidValueError(f"rule {rule.__name__} takes nothing; expected me as its first parameter")
    for parameter in rest:
        if parameter.default is parameter.empty:
            raise InvalidValueError(
                f"rule {rule.__name__} has the parameter {parameter.name} without a default; give it a number"
            )
        check_number(f"{rule.__name__}'s {parameter.name}", parameter.default)
    return Behaviour(rule, {p.name: p.default for p in rest})


def _compile(rule: Callable, columns: tuple, values: tuple) -> Callable:
    """Return the loop over all robots, compiled if the rule can be, else plain with a warning."""
    # Bounds are checked: an index that is one too many would otherwise read another robot's memory.
    run = njit(error_model="numpy")(_loop(njit(error_model="numpy", boundscheck=True)(rule)))
    try:
        run(columns, values, np.empty((0, 2)), np.empty(0, np.int64), 0)
    except NumbaError as problem:
        reason = next((line for line in str(problem).splitlines() if line.strip()), "unknown reason")
        warnings.warn(
            f"rule {rule.__name__} cannot be compiled and runs as plain Python, about 100 times slower: {reason}",
            UncompiledBehaviourWarning,
            stacklevel=5,
        )
        return _plain(rule)
    return run


def _loop(rule: Callable) -> Callable:
    """Return the loop that applies a compiled rule to every robot that no layer drives yet."""

    def run(columns, values, command, layer, index):
        (
            distance, kind, bearing, radiation, line, forward, radius, max_speed, tendency, temperature, heat,
            hot, fire, design, heard_layer, heard_task, heard_from, heard_goal,
        ) = columns  # fmt: skip
        for i in range(layer.shape[0]):
            if layer[i] >= 0:
                continue
            d = design[i]
            me = Me(
                distance[i], kind[i], bearing[d], radiation[i], line[i], forward[d, 0], forward[d, 1],
                forward[d, 2], radius[i], max_speed[i], tendency[i], temperature[i], heat[i], hot[i],
                fire[i] >= 0, heard_layer[i], heard_task[i], heard_from[i, 0], heard_from[i, 1], heard_goal[i, 0],
                heard_goal[i, 1],
            )  # fmt: skip
            left, right = rule(me, *values)
            if left == math.inf and right == math.inf:
                continue
            command[i, 0] = left
            command[i, 1] = right
            if not (math.isfinite(left) and math.isfinite(right)):
                return i
            layer[i] = index
        return -1

    return run


def _plain(rule: Callable) -> Callable:
    """Return the same loop for a rule that stays plain Python, whatever it returns."""

    def checked(me, *values):
        wheels = rule(me, *values)  # what it raises is the user's to see
        try:
            left, right = wheels
            return float(left), float(right)
        except (TypeError, ValueError):
            raise BehaviourError(
                f"rule {rule.__name__} did not return two wheel speeds; expected (left, right), or PASS"
            ) from None

    return _loop(checked)
