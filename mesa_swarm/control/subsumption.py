"""Subsumption: ordered layers, of which the first that is active drives the robot (thesis 5.2.1)."""

from collections.abc import Sequence
from copy import copy

import numpy as np

from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.streams import Streams

MOST_LAYERS = 64


class Subsumption:
    """Layers in order of importance; the first active one's command stands and suppresses the rest.

    A robot for which no layer is active stops.

    Parameters
    ----------
    *layers : Layer
        Most important first: layers, or rules made with `behaviour`.

    Raises
    ------
    InvalidValueError
        If something is not a layer, or there is none.

    Examples
    --------
    >>> from mesa_swarm.control import Avoid, Explore
    >>> [layer.name for layer in Subsumption(Avoid(distance=15), Explore()).layers]
    ['Avoid', 'Explore']
    """

    def __init__(self, *layers: Layer) -> None:
        if not 1 <= len(layers) <= MOST_LAYERS:
            raise InvalidValueError(f"Subsumption has {len(layers)} layers; expected 1 to {MOST_LAYERS}")
        for layer in layers:
            if not callable(getattr(layer, "decide", None)) or isinstance(layer, type):
                raise InvalidValueError(
                    f"Subsumption got {layer!r:.60}; expected layers such as Avoid(), or rules made with @behaviour"
                )
        self.layers: Sequence[Layer] = layers

    def bound(self, swarm: Swarm, streams: Streams) -> "Subsumption":
        """Return a copy whose layers have their columns and random streams in this swarm.

        A copy, so that one arbiter can be given to many models.
        """
        mine = Subsumption(*map(copy, self.layers))
        for index, layer in enumerate(mine.layers):
            layer.bind(swarm, f"{index}.{layer.name}", streams[f"decide.{layer.name}"])
        return mine

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> None:
        """Write the command (n, 2) and the winning layer (n,) of every robot."""
        command.fill(0.0)
        layer.fill(-1)
        for index, part in enumerate(self.layers):
            part.decide(senses, command, layer, index)
