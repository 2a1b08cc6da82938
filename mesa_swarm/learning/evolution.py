"""Evolution: a reproducible search by covariance matrix adaptation."""

import math
from collections.abc import Sequence

import numpy as np

from mesa_swarm.errors import InvalidValueError, LearningError, check_count, check_number, shortened


class Evolution:
    """Search for numbers whose fitness is greatest, by CMA-ES [1]_: `ask` for candidates, `tell` their fitness.

    The search is determined by its seed and the fitnesses: the same fitnesses give the same candidates, bit for bit,
    so that a file has to store only these.

    Parameters
    ----------
    start : sequence of float
        The first mean, at least two numbers.
    sigma : float
        Standard deviation of the first candidates, above 0.
    population : int
        Candidates a generation, at least 4.
    seed : int
        0 to 2^31 - 1.

    Raises
    ------
    InvalidValueError

    References
    ----------
    .. [1] Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772.

    Examples
    --------
    >>> search = Evolution([3.0, -2.0], sigma=1.0, population=8, seed=1)
    >>> for _ in range(60):
    ...     search.tell([-float(x @ x) for x in search.ask()])
    >>> bool(abs(search.mean).max() < 1e-3)
    True
    """

    def __init__(self, start: Sequence[float] | np.ndarray, *, sigma: float, population: int, seed: int) -> None:
        try:
            first = np.array(start, dtype=float)
        except (TypeError, ValueError):
            first = np.empty(0)
        if first.ndim != 1 or len(first) < 2 or not np.isfinite(first).all():
            raise InvalidValueError(f"start is {shortened(start)}; expected a row of at least two finite numbers")
        from cmaes import CMA  # noqa: PLC0415 - it loads scipy.stats, for which models do not wait

        self.population = check_count("population", population, minimum=4, maximum=10_000)
        self._search = CMA(
            mean=first,
            sigma=check_number("sigma", sigma, above=0, maximum=1e6),
            population_size=self.population,
            seed=check_count("seed", seed),
        )
        self._asked: np.ndarray | None = None
        self.history: list[list[float]] = []
        self.means: list[np.ndarray] = []

    @property
    def generations(self) -> int:
        """The number of generations evaluated."""
        return len(self.history)

    @property
    def mean(self) -> np.ndarray:
        """The mean of the search distribution, a copy."""
        return self._search.mean.copy()

    def ask(self) -> np.ndarray:
        """Return the candidates of this generation (population, d), the same ones until `tell`."""
        if self._asked is None:
            self._asked = np.array([self._search.ask() for _ in range(self.population)])
        return self._asked.copy()

    def tell(self, fitness: Sequence[float]) -> None:
        """Take the fitness of each candidate in their order, and begin the next generation.

        Raises
        ------
        LearningError
            If it is not one finite number for each; the search is then unchanged.
        """
        values = [float(value) for value in fitness]
        if len(values) != self.population:
            raise LearningError(f"{len(values)} fitnesses given; expected {self.population}, one a candidate")
        wrong = next((k for k, value in enumerate(values) if not math.isfinite(value)), None)
        if wrong is not None:
            raise LearningError(
                f"the fitness of candidate {wrong} in generation {self.generations} is {values[wrong]}; "
                "expected a finite number"
            )
        # CMA-ES minimises.
        self._search.tell([(x, -value) for x, value in zip(self.ask(), values, strict=True)])
        self._asked = None
        self.history.append(values)
        self.means.append(self.mean)
