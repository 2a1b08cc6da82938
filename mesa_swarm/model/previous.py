"""A part that keeps columns of robots as they were before the last step."""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, unknown_name
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.measuring import Copies, copy_rows
from mesa_swarm.kernels.part import Column, Context, Kernel, Part, Phase, Stage


class Previous(Part):
    """What columns of robots were before the last step, such as positions, of which follows how each has moved.

    Robots that were added since have NaN.

    Parameters
    ----------
    *names : str
        Of columns of real numbers of the swarm.

    Raises
    ------
    InvalidValueError
        If a column holds other numbers.
    UnknownNameError
        If the swarm has no such column.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, Previous, SwarmModel
    >>> from mesa_swarm.control import Explore, Subsumption
    >>> model = SwarmModel(rng=1)
    >>> (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    >>> previous = model.add_part(Previous("position"))
    >>> model.control = Subsumption(Explore())
    >>> (model.run(2).swarm.position - previous.columns()["position"].array).tolist()
    [[1.0, 0.0]]
    """

    name = "previous"

    def __init__(self, *names: str) -> None:
        self.names = names
        self.values: dict[str, np.ndarray] = {}

    def bind(self, context: Context) -> None:
        """Take the swarm, and its columns as they are, unless there are copies already."""
        self.swarm, self.replan = context.model.swarm, context.model.parts.replan
        for name in self.names:
            if name not in self.swarm.columns:
                raise UnknownNameError(unknown_name("column", name, self.swarm.columns))
            if self.swarm.columns[name].dtype != np.float64:
                raise InvalidValueError(f"column {name} is of {self.swarm.columns[name].dtype}; expected real numbers")
            self.values.setdefault(name, self.swarm.columns[name].copy())

    def columns(self) -> Mapping[str, Column]:
        """Return the copies by the names of the columns."""
        return {name: Column(array, "robots", "index", np.nan) for name, array in self.values.items()}

    def replace(self, name: str, array: np.ndarray) -> None:
        """Have another array as a copy."""
        self.values = {**self.values, name: array}
        self.replan()

    def store(self) -> dict:
        """Return nothing: which columns are copied follows from the part."""
        return {}

    def stages(self) -> Iterator[Stage]:
        """Copy each column before anything of a step."""
        for name in self.names:
            arrays = [as_bytes(array) for array in (self.swarm.columns[name], self.values[name])]
            block = Block(Copies(*arrays))
            kernel = Kernel(copy_rows, block.numbers, block)
            yield Stage(Phase.SENSE, partial(kernel.run, 0, 0), f"{name} is kept", kernel)


def as_bytes(array: np.ndarray) -> np.ndarray:
    """Return an array of rows as one of bytes, of the same memory.

    Examples
    --------
    >>> as_bytes(np.zeros((3, 2))).shape
    (3, 16)
    """
    rows = len(array)
    return array.reshape(rows, array.size // rows if rows else 0).view(np.uint8)
