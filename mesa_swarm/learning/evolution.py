"""Evolution: a reproducible search by covariance matrix adaptation, of numbers alone or with categories."""

import math
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, LearningError, check_count, check_number, shortened
from mesa_swarm.base.extras import require_extra
from mesa_swarm.geometry.masked_arrays import fill_masked

Candidate = tuple[np.ndarray, np.ndarray]
Candidates = TypeVar("Candidates", np.ndarray, list[Candidate])


class Search(Generic[Candidates]):
    """Base of searches whose optimiser, of the package cmaes, asks for one candidate after the other."""

    def __init__(self, kind: str, *, sigma: float, population: int, seed: int, **others: Any) -> None:
        require_extra("cmaes", "evolution", "evolution needs")
        import cmaes  # noqa: PLC0415 - it loads scipy.stats, for which models do not wait

        self.population = check_count("population", population, minimum=4, maximum=10_000)
        self._search = getattr(cmaes, kind)(
            sigma=check_number("sigma", sigma, above=0, maximum=1e6),
            population_size=self.population,
            seed=check_count("seed", seed),
            **others,
        )
        self._asked: list[Any] = []
        self.history: list[list[float]] = []

    @property
    def generations(self) -> int:
        """The number of generations evaluated."""
        return len(self.history)

    def ask(self) -> Candidates:
        """Return the candidates of this generation, (population, d) or a list, the same ones until `tell`."""
        if not self._asked:
            self._asked = [self._search.ask() for _ in range(self.population)]
        return self._shown(self._asked)

    def tell(self, fitness: Sequence[float]) -> None:
        """Take the fitness of each candidate in their order, and begin the next generation.

        Raises
        ------
        LearningError
            If it is not one finite number for each; the search is then unchanged.
        """
        values = checked_fitness(fitness, self.population, self.generations)
        candidates = self.ask()
        # The optimisers minimise.
        self._search.tell([(candidate, -value) for candidate, value in zip(self._asked, values, strict=True)])
        self._asked = []
        self.history.append(values)
        self._note(candidates, values)

    def _shown(self, candidates: list[Any]) -> Candidates:
        """Return copies of candidates as `ask` shows them."""
        raise NotImplementedError

    def _note(self, candidates: Candidates, values: list[float]) -> None:
        """Note what a generation has found."""
        raise NotImplementedError


class Evolution(Search[np.ndarray]):
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
            first = np.array(fill_masked(start), dtype=float)
        except (TypeError, ValueError):
            first = np.empty(0)
        if first.ndim != 1 or len(first) < 2 or not np.isfinite(first).all():
            raise InvalidValueError(f"start is {shortened(start)}; expected a row of at least two finite numbers")
        super().__init__("CMA", mean=first, sigma=sigma, population=population, seed=seed)
        self.means: list[np.ndarray] = []

    @property
    def mean(self) -> np.ndarray:
        """The mean of the search distribution, a copy."""
        return self._search.mean.copy()

    def _shown(self, asked: list[Any]) -> np.ndarray:
        return np.array(asked)

    def _note(self, candidates: np.ndarray, values: list[float]) -> None:
        self.means.append(self.mean)


class MixedEvolution(Search[list[Candidate]]):
    """Search for numbers and categories whose fitness is greatest, by CatCMA [1]_: `ask` and `tell` as of `Evolution`.

    A candidate is a pair of arrays: of numbers (d,), which begin around 0.5, and of the index of a category each (k,),
    which begin equally probable.

    Parameters
    ----------
    numbers : int
        How many numbers a candidate has, at least 2.
    categories : sequence of int
        Of each of its categorical variables the number of categories, at least 2.
    sigma : float
        Standard deviation of the first candidates' numbers, above 0.
    population : int
        Candidates a generation, at least 4.
    seed : int
        0 to 2^31 - 1.

    Raises
    ------
    InvalidValueError

    References
    ----------
    .. [1] Hamano et al., CatCMA: stochastic optimization for mixed-category problems, GECCO 2024, arXiv:2405.09962.

    Examples
    --------
    >>> search = MixedEvolution(2, [3, 3], sigma=0.3, population=12, seed=1)
    >>> for _ in range(60):
    ...     search.tell([float((c == 2).sum() - x @ x) for x, c in search.ask()])
    >>> search.best[-1][1]
    array([2, 2])
    """

    def __init__(self, numbers: int, categories: Sequence[int], *, sigma: float, population: int, seed: int) -> None:
        check_count("numbers", numbers, minimum=2, maximum=10_000)
        kinds = np.array([check_count("categories", count, minimum=2, maximum=1000) for count in categories], np.int64)
        if not len(kinds):
            raise InvalidValueError("categories is empty; expected one number at least, or use Evolution")
        mean = np.full(numbers, 0.5)
        super().__init__("CatCMA", mean=mean, cat_num=kinds, sigma=sigma, population=population, seed=seed)
        self.best: list[Candidate] = []

    def _shown(self, asked: list[Any]) -> list[Candidate]:
        return [(x.copy(), np.argmax(c, axis=1)) for x, c in asked]

    def _note(self, candidates: list[Candidate], values: list[float]) -> None:
        self.best.append(candidates[int(np.argmax(values))])


def checked_fitness(fitness: Sequence[float], population: int, generation: int) -> list[float]:
    """Return the fitness of a generation, one finite number for each candidate.

    Raises
    ------
    LearningError
    """
    values = [float(value) for value in fitness]
    if len(values) != population:
        raise LearningError(f"{len(values)} fitnesses given; expected {population}, one a candidate")
    wrong = next((k for k, value in enumerate(values) if not math.isfinite(value)), None)
    if wrong is not None:
        raise LearningError(
            f"the fitness of candidate {wrong} in generation {generation} is {values[wrong]}; expected a finite number"
        )
    return values
