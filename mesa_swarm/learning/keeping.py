"""What learners know outlasts the control that they are in: taken out they keep it, put back they go on with it."""

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from mesa_swarm.errors import LearningError
from mesa_swarm.robots.swarm import Swarm


class Left:
    """What a layer remembered of a swarm's robots when it was taken out; it reads as the swarm did.

    Parameters
    ----------
    swarm : Swarm
    prefix : str
        Of the layer's columns.

    Examples
    --------
    >>> swarm = Swarm()
    >>> _ = swarm.remember("0.Rule.seen", (), float, 0.0)
    >>> sorted(Left(swarm, "0.Rule").columns)
    ['0.Rule.seen', 'number']
    """

    def __init__(self, swarm: Swarm, prefix: str) -> None:
        self.swarm, self.prefix, self.designs = swarm, prefix, swarm.designs
        self.whereabouts = whereabouts(swarm)
        names = [name for name in swarm.columns if name == "number" or name.startswith(f"{prefix}.")]
        self.columns = {name: swarm.columns[name].copy() for name in names}

    def __len__(self) -> int:
        """How many robots there were."""
        return len(self.columns["number"])

    def remember(self, name: str, shape: tuple, dtype: type, initial: object) -> np.ndarray:
        """Return the column of this name."""
        return self.columns[name]

    def lay(self, prefix: str) -> None:
        """Let those of the robots that are still there have what was remembered of them, in columns of this prefix."""
        columns = self.swarm.columns
        _, now, then = np.intersect1d(columns["number"], self.columns["number"], return_indices=True)
        for name, old in self.columns.items():
            if name != "number":
                # Columns may have become wider, with robots of more sensors.
                known: Any = (now, *(slice(0, width) for width in old.shape[1:]))
                columns[prefix + name.removeprefix(self.prefix)][known] = old[then]


class Keeper:
    """Base of layers that learn: bound again in the same model, they go on as if they had never been taken out.

    In another model, robots begin with what was learned: see `_take_along`.
    """

    name: str
    frozen: bool
    start: Any = None
    # A swarm, or what is left of it to a layer that was taken out.
    _home: Any = None
    _prefix = ""

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember in columns of the swarm what each robot knows; go on with what was learned before, if anything."""
        home = self._home
        left = home if isinstance(home, Left) and home.swarm is swarm else None
        if home is not None and left is None:
            self._take_along()
        self._home, self._prefix, self._rng = swarm, prefix, rng
        self._remember(swarm, prefix)
        if left is not None:
            left.lay(prefix)

    def unbind(self) -> None:
        """Keep what the robots know, as its columns are about to be dropped."""
        self._home = Left(self._robots, self._prefix)

    def _check_frozen(self) -> None:
        """Refuse to drive by what nobody has learned."""
        if self.frozen and not (self.start and self.start.steps):
            raise LearningError(
                f"{self.name} is frozen and knows nothing; give it a trained policy as start, or let it learn"
            )

    def _training(self, names: Sequence[str], lessons: int, training: dict) -> dict:
        """Return where a policy comes from: these parameters, the world, what it started from, and what is given."""
        return {
            "learner": type(self).__name__,
            "mesa_swarm": version("mesa-swarm"),
            **whereabouts(self._robots),
            **{name: getattr(self, name) for name in names},
            "robots": len(self._robots),
            "lessons": lessons,
            **({"started_from": self.start.training} if self.start else {}),
            **training,
        }

    def _remember(self, swarm: Swarm, prefix: str) -> None:
        """Make the columns."""
        raise NotImplementedError

    def _take_along(self) -> None:
        """Make what was learned the start of another model's robots, or refuse to."""
        raise NotImplementedError

    @property
    def _robots(self) -> Any:
        """The swarm that it belongs to, or what is left of it."""
        if self._home is None:
            raise LearningError(
                f"this {self.name} is in no model: a model learns with a copy of it; ask model.control.layers[0], "
                "or whichever layer it is there"
            )
        return self._home

    def _column(self, name: str) -> np.ndarray:
        return self._robots.columns[f"{self._prefix}.{name}"]


def whereabouts(robots: Swarm | Left) -> dict[str, str | int]:
    """Return the design of the robots, on which map they are, and how many steps their model has taken."""
    if isinstance(robots, Left):
        return robots.whereabouts
    if not len(robots):
        return {}
    model = robots.agents[0].model
    return {"design": robots.designs[0].name, "map": str(model.map.name), "model_steps": int(model.steps)}
