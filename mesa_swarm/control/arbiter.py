"""What all arbiters share: layers, and copies of them that belong to one swarm."""

from collections.abc import Sequence
from copy import copy

import numpy as np

from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.streams import Streams

MOST_LAYERS = 64


class Arbiter:
    """Layers, and how what they ask for becomes one command: see `Subsumption` and `VectorSum`.

    Parameters
    ----------
    *layers : Layer
        Layers, or rules made with `behaviour`.

    Raises
    ------
    InvalidValueError
        If something is not a layer, or there is none, or too many.
    """

    # Whether all active layers drive a robot together; else the one that won drives it alone.
    sums = False

    def __init__(self, *layers: Layer) -> None:
        kind = type(self).__name__
        if not 1 <= len(layers) <= MOST_LAYERS:
            raise InvalidValueError(f"{kind} has {len(layers)} layers; expected 1 to {MOST_LAYERS}")
        for layer in layers:
            methods = [getattr(layer, name, None) for name in ("decide", "bind")]
            if isinstance(layer, type) or not all(map(callable, methods)):
                raise InvalidValueError(
                    f"{kind} got {layer!r:.60}; expected layers such as Avoid(), or rules made with @behaviour"
                )
        self.layers: Sequence[Layer] = layers

    def bound(self, swarm: Swarm, streams: Streams) -> "Arbiter":
        """Return a copy whose layers have their columns and random streams in this swarm.

        A copy, so that one arbiter can be given to many models. Layers that were bound before begin anew, but
        learners go on with what they have learned.
        """
        mine = copy(self)
        mine.layers = tuple(map(copy, self.layers))
        for index, layer in enumerate(mine.layers):
            layer.bind(swarm, f"{index}.{layer.name}", streams[f"decide.{layer.name}"])
        return mine

    def unbind(self) -> None:
        """Let layers that have an ``unbind()`` keep what they know, as the columns of all are about to be dropped."""
        for layer in self.layers:
            unbind = getattr(layer, "unbind", None)
            if callable(unbind):
                unbind()

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> None:
        """Write the command (n, 2) and the winning layer (n,) of every robot."""
        raise NotImplementedError
