"""VectorSum: the weighted sum of what all active layers ask for (motor schemas: Arkin 1989)."""

import math
from collections.abc import Sequence

import numpy as np

from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.drive import no_longer

HEAVIEST = 1e6
# What is asked for beyond this is taken to be this, so that sums stay finite.
LARGEST_WISH = 1e300


class VectorSum(Arbiter):
    """Layers whose commands are added up, each with its weight: cooperation where `Subsumption` is competition.

    Commands are linear in the motion that they make, so that their sum makes the sum of the motions. A sum
    that asks for more than a wheel, or a body that goes sideways, can do is slowed as a whole, which keeps its
    direction. The column `layer`
    tells whose share was the largest, the first of equals; a robot for which no layer is active stops.

    Parameters
    ----------
    *layers : Layer
        Layers, or rules made with `behaviour`; a layer of weight 0 is asked but not heard.
    weights : sequence of float, optional
        One a layer, -1,000,000 to 1,000,000; 1 each by default.

    Raises
    ------
    InvalidValueError
        If something is not a layer, or the weights are not one number a layer.

    Examples
    --------
    >>> from mesa_swarm.control import Avoid, Explore
    >>> VectorSum(Avoid(), Explore(), weights=(2, 1)).weights
    (2.0, 1.0)
    """

    sums = True

    def __init__(self, *layers: Layer, weights: Sequence[float] | None = None) -> None:
        super().__init__(*layers)
        given = [1.0] * len(layers) if weights is None else weights
        ordered = isinstance(given, Sequence) and not isinstance(given, str)
        ordered = ordered or (isinstance(given, np.ndarray) and given.ndim == 1)
        if not ordered or len(given) != len(layers):
            raise InvalidValueError(f"weights is {shortened(weights)}; expected {len(layers)} numbers, one a layer")
        self.weights = tuple(check_number("weight", weight, minimum=-HEAVIEST, maximum=HEAVIEST) for weight in given)

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> None:
        """Write the summed command (n, 2) and the layer with the largest share (n,) of every robot."""
        wish, active, largest = np.empty_like(command), np.empty_like(layer), np.zeros(len(layer))
        command.fill(0.0)
        layer.fill(-1)
        for index, (part, weight) in enumerate(zip(self.layers, self.weights, strict=True)):
            wish.fill(0.0)
            active.fill(-1)
            part.decide(senses, wish, active, index)
            add_weighted(wish, active, weight, index, command, layer, largest)
        slow_down(command, senses.max_speed, senses.design, senses.sideways)


@compiled
def add_weighted(wish, active, weight, index, command, layer, largest):
    """Add what a layer asks for where it is active, and note where its share is the largest so far.

    A layer that asks for NaN, and is heard, has the largest share of all: whoever finds the NaN then knows whose it is.
    """
    for i in range(layer.shape[0]):
        if active[i] < 0:
            continue
        if weight != 0.0 and (math.isnan(wish[i, 0]) or math.isnan(wish[i, 1])) and largest[i] < math.inf:
            command[i, 0], command[i, 1], layer[i], largest[i] = math.nan, math.nan, index, math.inf
            continue
        x, y = weighted(wish[i, 0], weight), weighted(wish[i, 1], weight)
        command[i, 0] += x
        command[i, 1] += y
        share = math.hypot(x, y)
        if layer[i] < 0 or share > largest[i]:
            layer[i], largest[i] = index, share


@compiled
def weighted(wish: float, weight: float) -> float:
    """Return the weighted wish, which is finite; nothing if the weight is 0.

    Examples
    --------
    >>> weighted(0.5, 3.0), weighted(math.nan, 0.0), weighted(-math.inf, 1e6)
    (1.5, 0.0, -1e+306)
    """
    if weight == 0.0:
        return 0.0
    return weight * min(max(wish, -LARGEST_WISH), LARGEST_WISH)


@compiled
def slow_down(command, max_speed, design, sideways):
    """Scale commands that ask for more than max_speed of any wheel, or of a body that goes sideways."""
    for i in range(command.shape[0]):
        if sideways[design[i]]:
            command[i, 0], command[i, 1] = no_longer(command[i, 0], command[i, 1], max_speed[i])
            continue
        most = max(abs(command[i, 0]), abs(command[i, 1]))
        if most > max_speed[i]:
            share = max_speed[i] / most
            command[i, 0] *= share
            command[i, 1] *= share
