"""What all arbiters share: layers, and copies of them that belong to one swarm."""

from collections.abc import Iterable, Sequence
from copy import copy

import numpy as np

from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.errors import InvalidValueError, asked, check_name, shortened
from mesa_swarm.robots.design import RobotDesign
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
        If something is not a layer, or has no name, or there is none, or too many.
    """

    # Whether all active layers drive a robot together; else the one that won drives it alone.
    sums = False

    def __init__(self, *layers: Layer) -> None:
        kind = type(self).__name__
        if not 1 <= len(layers) <= MOST_LAYERS:
            raise InvalidValueError(f"{kind} has {len(layers)} layers; expected 1 to {MOST_LAYERS}")
        for layer in layers:
            methods = [asked(layer, name) for name in ("decide", "bind")]
            if isinstance(layer, type) or not all(map(callable, methods)):
                raise InvalidValueError(
                    f"{kind} got {shortened(layer)}; expected layers such as Avoid(), or rules made with @behaviour"
                )
            if not hasattr(layer, "name"):
                raise InvalidValueError(
                    f"{kind} got a {type(layer).__name__} without a name; give the class one, such as name = 'Mine'"
                )
            check_name(f"name of a {type(layer).__name__}", layer.name)
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


def check_drives(control: Arbiter, designs: Iterable[RobotDesign]) -> None:
    """Refuse designs whose drive takes commands of another kind than a layer gives, where both say which they are for.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> from mesa_swarm.control import Cruise, VectorSum
    >>> check_drives(VectorSum(Cruise()), [AGENT9])
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: Cruise commands ...
    """
    for design in designs:
        for layer in control.layers:
            wheels = getattr(layer, "commands_wheels", None)
            if wheels is None or design.turns is None or bool(wheels) == design.turns:
                continue
            kinds = ("speeds forward and sideways", "speeds of wheels left and right")
            raise InvalidValueError(
                f"{layer.name} commands {kinds[bool(wheels)]}, but robots of the design {design.name} take "
                f"{kinds[design.turns]}; give the design another drive, or use layers that are for its drive"
            )


def driver(control: Arbiter, index: int) -> str:
    """Return the name of the layer with this index, and of an index that no layer has in words.

    Examples
    --------
    >>> from mesa_swarm.control import Explore, Subsumption
    >>> driver(Subsumption(Explore()), 0), driver(Subsumption(Explore()), -1), driver(Subsumption(Explore()), 7)
    ('Explore', 'no layer', 'layer 7, which is none,')
    """
    if index < 0:
        return "no layer"
    return control.layers[index].name if index < len(control.layers) else f"layer {index}, which is none,"
