"""`batch_run`, which Mesa 4 has no more: a grid of parameters with every seed, as rows of the data collectors."""

from collections.abc import Iterable, Mapping
from itertools import product, starmap
from typing import Any, cast

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, shortened
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.experiments.experiment import MOST_STEPS
from mesa_swarm.experiments.sampling import check_different
from mesa_swarm.experiments.series import Watch
from mesa_swarm.experiments.worker_pool import MOST_JOBS, checked_jobs, is_remote, on_all
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.mesa_model import checked_seed, collected_of_agents
from mesa_swarm.model.parameters import check_names
from mesa_swarm.swarm_model import SwarmModel

LAST = -1  # the period of collected rows of which only the last is wanted

Row = dict[str, Any]


def batch_run(
    model: type | str,
    parameters: Mapping[str, Any],
    *,
    rng: Any = None,
    max_steps: int = 1000,
    data_collection_period: int = LAST,
    number_processes: int | None = 1,
    display_progress: bool = True,
) -> list[Row]:
    """Run a model with every combination of parameters and every seed, and return what its data collector has.

    It takes the place of `mesa.batch_run`, with every version of Mesa, and returns the same rows as that of Mesa 3.5,
    in the order of the runs. `sweep` stores the results of runs, and continues after an interruption.

    Parameters
    ----------
    model : type or str
        A SwarmModel, or its name or address (`gallery.find_model`).
    parameters : mapping
        By name a value, or several different ones in a list or another iterable, which is not a text.
    rng : int, SeedSequence or an iterable of them, optional
        The seed of each repetition of all combinations, each a different one; None for one that nothing can repeat.
    max_steps : int
        Steps after which a run ends, 1 to 100 million, unless the model stops running before.
    data_collection_period : int
        1 for all rows that were collected, k for every k-th of them, -1 for the last.
    number_processes : int or None
        1 for this process; None for one on each core.
    display_progress : bool
        Whether to show a bar.

    Returns
    -------
    list of dict
        Each with RunId, iteration, Step, the parameters, `rng`, and what was collected; with agent reporters a row for
        each agent.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If a value is not permitted, or the model has no such parameter.
    WorkerDiedError
        If a process dies.

    Notes
    -----
    An error in one run is raised and ends all of them. All rows are held in memory until the last run is done.

    Examples
    --------
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> rows = batch_run(FireFighting, {"n_robots": [2, 3]}, rng=[1, 2], max_steps=5, display_progress=False)
    >>> [(row["RunId"], row["iteration"], row["n_robots"], row["Step"]) for row in rows]
    [(0, 0, 2, 5), (1, 0, 3, 5), (2, 1, 2, 5), (3, 1, 3, 5)]
    """
    found = find_model(model) if isinstance(model, str) else model
    if not isinstance(found, type) or not issubclass(found, SwarmModel):
        raise InvalidValueError(f"model is {shortened(model)}; expected a SwarmModel class, or its name or address")
    grid = _grid(parameters)
    check_names(found, parameters)
    check_count("max_steps", max_steps, minimum=1, maximum=MOST_STEPS)
    if data_collection_period != LAST:
        check_count("data_collection_period", data_collection_period, minimum=1)
    if number_processes is None:
        workers = checked_jobs(-1)
    else:
        workers = check_count("number_processes", number_processes, minimum=1, maximum=MOST_JOBS)
    seeds = _seeds(rng)
    runs = [(i, {**point, "rng": seed}) for i, seed in enumerate(seeds) for point in grid]
    tasks = [(found, number, *run, max_steps, data_collection_period) for number, run in enumerate(runs)]
    rows: dict[int, list[Row]] = {}
    with progress_bar(len(tasks), "runs", display_progress) as bar:
        here = workers == 1 and (number_processes == 1 or not is_remote())
        done = starmap(_rows, tasks) if here else on_all(workers, _rows, tasks)
        for number, collected in done:
            rows[number] = collected
            bar.update()
    return [row for number in range(len(tasks)) for row in rows[number]]


def _seeds(rng: Any) -> list[Any]:
    """Return the seeds; the same twice would be the same run twice, and a generator goes on from run to run."""
    if isinstance(rng, (str, bytes)):
        raise InvalidValueError(f"rng is {shortened(rng)}; expected a whole number, or a list of them")
    seeds = [checked_seed(seed) for seed in rng] if isinstance(rng, Iterable) else [checked_seed(rng)]
    for seed in seeds:
        if isinstance(seed, (np.random.Generator, np.random.BitGenerator)):
            raise InvalidValueError(
                f"rng has {shortened(seed)}, which runs would share; expected whole numbers of at least 0, "
                "SeedSequences or None"
            )
    check_different("rng", (_identity(seed) for seed in seeds if seed is not None), "seeds")
    return seeds


def _identity(seed: Any) -> Any:
    """Return a value that is equal for seeds of equal runs: of a sequence that is made of a number, the number."""
    if not isinstance(seed, np.random.SeedSequence):
        return seed if isinstance(seed, int) else list(seed)
    is_number = isinstance(seed.entropy, int) and repr(seed) == repr(np.random.SeedSequence(seed.entropy))
    return seed.entropy if is_number else repr(seed)


def _grid(parameters: Mapping[str, Any]) -> list[Row]:
    """Return all combinations of values, the last parameter changing first."""
    if not isinstance(parameters, Mapping):
        raise InvalidValueError(f"parameters is {shortened(parameters)}; expected a dict of values by name")
    if "rng" in parameters:
        raise InvalidValueError("parameters has rng; expected the seeds beside it: batch_run(..., rng=[1, 2, 3])")
    values = {
        name: list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]
        for name, given in parameters.items()
    }
    for name, some in values.items():
        if not some:
            raise InvalidValueError(f"parameters has no value for {name}; leave it out for its default")
        check_different(f"{name} in parameters", some)
    return [dict(zip(values, point, strict=True)) for point in product(*values.values())]


def _rows(model_class: type, number: int, iteration: int, settings: Row, steps: int, period: int) -> tuple[int, list]:
    """Do a run, and return its number and its rows."""
    model = cast(SwarmModel, model_class(**settings))
    watch, collector = Watch(model), model.datacollector
    while model.running and model.steps < steps:
        model.step()
        watch(model)
    taken = watch.steps
    wanted = range(len(taken))[-1:] if period == LAST else range(0, len(taken), period)
    rows = []
    for k in wanted:
        row = {"RunId": number, "iteration": iteration, "Step": taken[k], **settings}
        row |= {name: values[k] for name, values in collector.model_vars.items()}
        rows += [row | of_agent for of_agent in collected_of_agents(collector, taken[k], watch.times[k])] or [row]
    return number, rows
