"""Subsumption: ordered layers, of which the first that is active drives the robot (thesis 5.2.1)."""

import numpy as np

from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.layer import Senses


class Subsumption(Arbiter):
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

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> None:
        """Write the command (n, 2) and the winning layer (n,) of every robot."""
        command.fill(0.0)
        layer.fill(-1)
        for index, part in enumerate(self.layers):
            part.decide(senses, command, layer, index)
