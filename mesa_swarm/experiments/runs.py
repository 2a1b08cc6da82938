"""One run and its outcome; outstanding runs, done on many processes and stored in a ledger."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.base.files import show_path
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.experiments.fingerprints import shown_value, without_addresses
from mesa_swarm.experiments.ledger import LONGEST_ERROR, Outcome
from mesa_swarm.experiments.reports import counted, reduced, split_measure
from mesa_swarm.experiments.series import OF_AGENTS, RNG, RUN, RunSeries, Watch
from mesa_swarm.experiments.until import EndCondition
from mesa_swarm.experiments.worker_pool import is_remote, on_all
from mesa_swarm.experiments.worker_tasks import SchedulerLostError, WorkerDiedError
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.kernels.compiling import compilation
from mesa_swarm.swarm_model import SwarmModel

# NumPy has no numbers for larger whole ones.
LARGEST_WHOLE = 2**63 - 1
# Steps after which most of what a model needs is compiled.
COMPILING_STEPS = 2


SomeOutcome = TypeVar("SomeOutcome", bound=Outcome)


class Store(Protocol):
    """Where outcomes of runs are looked up and stored by the keys of runs: a `Ledger`, or files of another kind."""

    @property
    def path(self) -> Path:
        """The file or folder, for errors."""

    def outcome(self, key: str) -> Outcome | None:
        """Return the outcome of a run, None if it is not done."""

    def append(self, key: str, outcome: Outcome) -> None:
        """Store the outcome of a run."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run to do, of a model class or a function that returns numbers, given the settings and ``rng``.

    Its key is that of no other run; in a ledger, the fingerprint of all that decides the outcome.
    """

    make: Callable[..., Any]
    settings: Mapping[str, Any]
    rng: int
    steps: int = 0
    key: str = ""
    # Measures besides the model's results: see `experiments.reports`.
    reports: tuple[str, ...] = ()
    # Which point of its experiment it belongs to, from 0.
    point: int = 0
    # What ends it before its number of steps, and where its series is stored.
    until: EndCondition | None = None
    series: RunSeries | None = None

    def made(self) -> Any:
        """Return the model before its first step, or the numbers of the function."""
        return self.make(**self.settings, rng=self.rng)

    def watched(self, model: SwarmModel, progress: bool = False) -> Watch | None:
        """Let its model take the steps, and return what watched it where there is a condition or a series."""
        if self.until is None and self.series is None:
            model.run(self.steps, progress=progress)
            return None
        watch = Watch(model, self.until, poses=self.series is not None and OF_AGENTS in self.series.parts)
        model.run(self.steps, progress=progress, until=watch)
        return watch

    def stored(self, model: SwarmModel, watch: Watch | None, outcome: SomeOutcome) -> SomeOutcome:
        """Write the series of its model, if that is wanted, and return the outcome with what ended the run."""
        if watch is None:
            return outcome
        if self.series is not None:
            settings = {name: shown_value(value) for name, value in self.settings.items()}
            self.series.write({RUN: self.key, **settings, RNG: self.rng}, model, watch)
        return replace(outcome, ended_by=watch.ended_by(model))

    @property
    def is_kept(self) -> bool:
        """Whether its series is on the disk, if that is wanted."""
        return self.series is None or self.series.has(self.key)


def do_runs(
    runs: Iterable[Run],
    work: Callable[[Run], SomeOutcome],
    *,
    count: int,
    done: int = 0,
    ledger: Store | None = None,
    workers: int = 1,
    tries: int = 1,
    progress: bool = False,
    unit: str = "runs",
) -> Iterator[tuple[Run, SomeOutcome]]:
    """Do outstanding runs, store each outcome before the next is waited for, and yield both.

    Runs are read as workers become free, never far ahead. For the progress bar, `count` counts all runs and `done`
    those that are not outstanding. An outcome replaces a stored one only if the names of its results differ. A run
    whose worker dies is repeated up to `tries` times; after several, the death is its outcome, after a single one a
    WorkerDiedError is raised.
    """
    if tries == 1:  # else a run that kills its process would end this one
        workers = min(workers, max(count - done, 1))
    with progress_bar(count, unit, progress) as bar, _stored_runs_named(ledger):
        bar.initial = bar.n = done
        bar.refresh()
        for run, outcome in _outcomes(runs, work, workers, tries):
            if ledger is not None and not _is_stored(ledger, run, outcome):
                ledger.append(run.key, outcome)
            bar.update()
            yield run, outcome
        bar.update(count - bar.n)  # runs that occur several times were done once


@contextmanager
def _stored_runs_named(ledger: Store | None) -> Iterator[None]:
    """Add to the error about a lost scheduler where finished runs are."""
    try:
        yield
    except SchedulerLostError as error:
        if ledger is None:
            raise
        raise SchedulerLostError(
            f"{error}; finished runs are stored in {show_path(ledger.path)}: start the scheduler and its workers "
            "again, and call it again for the rest"
        ) from None


def call(run: Run) -> Outcome:
    """Do the run of a function that returns numbers."""
    return Outcome(steps=run.steps, results=run.made())


def completed(
    runs: Sequence[Run],
    work: Callable[[Run], Outcome] = call,
    *,
    ledger: Store | None,
    known: Mapping[str, Outcome] | None = None,
    each: Callable[[Any], object] = lambda outcome: None,
    **how: Any,
) -> dict[str, Outcome]:
    """Return the outcomes of all runs by key, after doing those that are not known as `do_runs` does.

    Those are known that a ledger has, unless `known` is given. `each` is called with each new outcome.
    """
    found = dict(stored_in(ledger, runs) if known is None else known)
    left = [run for run in runs if run.key not in found]
    for run, outcome in do_runs(left, work, count=len(runs), done=len(runs) - len(left), ledger=ledger, **how):
        found[run.key] = outcome
        each(outcome)
    return found


def done_in_order(runs: Sequence[Run], **how: Any) -> list[tuple[Run, Outcome]]:
    """Return runs with their outcomes, in their order, after doing those that are not known; see `completed`."""
    outcomes = completed(runs, **how)
    return [(run, outcomes[run.key]) for run in runs]


def stored_in(ledger: Store | None, runs: Iterable[Run]) -> dict[str, Outcome]:
    """Return the outcomes that a ledger has of runs whose series are stored, if they are to be, by key."""
    outcomes = {} if ledger is None else {run.key: ledger.outcome(run.key) for run in runs if run.is_kept}
    return {key: outcome for key, outcome in outcomes.items() if outcome is not None}


def _is_stored(ledger: Store, run: Run, outcome: Outcome) -> bool:
    """Return whether a ledger has results of the same names in the same order for a run, whatever their values."""
    before = ledger.outcome(run.key)
    return before is not None and list(before.numbers) == list(outcome.numbers)


def simulate(run: Run) -> Outcome:
    """Do the run of a model; its errors are raised."""
    model = run.made()
    watch = run.watched(model)
    return run.stored(model, watch, outcome_of(model, reports=run.reports))


def outcome_of(model: SwarmModel, measures: Sequence[str] = (), reports: Sequence[str] = ()) -> Outcome:
    """Return the outcome of a model that has run: these results of it, all by default, and these of its reports.

    With the reports come the numbers of rows that they leave out.
    """
    own = {} if reports and not hasattr(model, "results") else results_of(model)
    numbers = numbers_of({name: own[name] for name in measures or own if name in own or name not in reports})
    state_hash = model.state_hash()  # before reporters are called
    reported = reduced(model, counted(name for name in reports if name not in own))
    whole = {**dict.fromkeys(counted(reports), 0), **numbers, **reported}
    return Outcome(model.steps, state_hash, {name: whole[name] for name in (*(measures or own), *whole)})


def attempt(
    run: Run,
    observed: Callable[[Any], AbstractContextManager] = nullcontext,
    progress: bool = False,
    beyond: tuple[type[Exception], ...] = (),
    words: Callable[[BaseException], str] | None = None,
) -> Outcome:
    """Do the run of a model; its error is an outcome too, except those `beyond`, which are not caused by the run.

    The context manager that `observed` returns for the model is entered while it runs: a recorder. `words` puts an
    error into one line, by default `error_in_words`.
    """
    try:
        model = run.made()
        with observed(model):
            watch = run.watched(model, progress)
        outcome = outcome_of(model, reports=run.reports)
        results = {name: None if value is None else float(value) for name, value in outcome.numbers.items()}
    except beyond:
        raise
    except (Exception, SystemExit) as error:
        return Outcome(error=(words or error_in_words)(error))
    return run.stored(model, watch, replace(outcome, results=results))


def error_in_words(error: BaseException) -> str:
    """Return an error as one line that is the same whenever it happens."""
    words = " ".join(without_addresses(str(error)).split())
    # Names of files may hold what cannot be written as text.
    return f"{type(error).__name__}: {words}".encode("utf-8", "backslashreplace").decode()[:LONGEST_ERROR]


def numbers_of(results: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the results of a run as numbers of Python's, which read back from a file as the same; NaN is None.

    The mean of nothing is NaN, or masked: like None, it does not count as measured.
    """
    numbers = {}
    for name, number in results.items():
        is_numpy = isinstance(number, (np.generic, np.ndarray)) and number.ndim == 0
        simple = fill_masked(number).item() if is_numpy else number
        if isinstance(simple, float) and math.isnan(simple):
            simple = None
        numbers[name] = simple if is_plain(simple) else check_result(name, simple)
    return numbers


def is_plain(number: object) -> bool:
    """Return whether this is a result as `numbers_of` returns it."""
    if isinstance(number, float):
        return math.isfinite(number)
    return number is None or (isinstance(number, int) and abs(number) <= LARGEST_WHOLE)


def has_numbers(outcome: Outcome, names: Sequence[str] = ()) -> bool:
    """Return whether an outcome is that of a run which `simulate` did: results, each of which is a number or None.

    Only a report may be infinite. With `names` the results have these names, in this order.
    """
    numbers = outcome.numbers.items()
    if names and list(outcome.numbers) != list(names):
        return False
    return bool(numbers) and all(is_plain(number) or _is_infinite_report(name, number) for name, number in numbers)


def _is_infinite_report(name: str, number: object) -> bool:
    return isinstance(number, float) and math.isinf(number) and split_measure(name) is not None


def check_result(name: str, number: object) -> float:
    """Return a result as a float, or refuse it."""
    try:
        return check_number(f"result {shortened(name)}", number)
    except InvalidValueError as error:
        raise InvalidValueError(f"{error} or None") from None


def results_of(model: SwarmModel) -> Mapping[str, Any]:
    """Return the results of a model, or refuse a model that has none."""
    results = getattr(model, "results", None)
    if results is None:
        raise InvalidValueError(
            f"{type(model).__name__} has no method results(), which returns what is compared; or name reports of its "
            "model_reporters as measures, such as 'mean of NAME'"
        )
    return results()


def check_results(model: SwarmModel) -> None:
    """Refuse a model without results, or with a result that is not a number."""
    for name, number in results_of(model).items():
        if number is not None and number is not np.ma.masked and not isinstance(number, (bool, np.bool_)):
            check_result(name, number)


def _outcomes(
    runs: Iterable[Run], work: Callable[[Run], SomeOutcome], workers: int, tries: int
) -> Iterator[tuple[Run, SomeOutcome]]:
    """Yield runs with their outcomes as they are done, and go on when workers die."""
    if workers == 1 and not is_remote():
        yield from ((run, work(run)) for run in runs)
        return
    fresh = _compiled_first(iter(runs))
    deaths: Counter[str] = Counter()
    again: list[Run] = []
    while True:
        under_way: dict[str, Run] = {}
        try:
            for key, outcome in on_all(workers, _keyed, _noted(chain(again, fresh), work, under_way)):
                yield under_way[key], outcome
                del under_way[key]  # by now it is in the ledger
            return
        except WorkerDiedError:
            if tries == 1:
                raise
            deaths.update(under_way.keys())  # a mapping would be taken for counts
        # A run under way when its worker died is tried again beside others, and from then on alone.
        again = [run for key, run in under_way.items() if deaths[key] == 1]
        for key, run in under_way.items():
            if deaths[key] > 1:
                yield run, _alone(work, run, tries - deaths[key], tries)


def _compiled_first(runs: Iterator[Run]) -> Iterator[Run]:
    """Return the runs, after a model of the gallery has compiled here what else each worker would compile."""
    for first in runs:
        if isinstance(first.make, type) and compilation.lacks(first.make):
            with suppress(Exception):  # the run itself has it too
                first.made().run(COMPILING_STEPS)
        return chain([first], runs)
    return runs


def _noted(runs: Iterable[Run], work: Callable, under_way: dict[str, Run]) -> Iterator[tuple[Callable, Run]]:
    """Yield tasks for workers, and note what is handed out."""
    for run in runs:
        if run.key not in under_way:  # samples of whole numbers may have a point twice
            under_way[run.key] = run
            yield work, run


def _keyed(work: Callable[[Run], SomeOutcome], run: Run) -> tuple[str, SomeOutcome]:
    return run.key, work(run)


def _alone(work: Callable[[Run], SomeOutcome], run: Run, left: int, tries: int) -> SomeOutcome:
    """Try a run with nothing beside it, so that no other run can be the cause."""
    for _ in range(left):
        try:
            (outcome,) = on_all(2, work, [(run,)])  # two, since one would be this very process
            return outcome
        except WorkerDiedError:
            pass
    return cast(SomeOutcome, Outcome(error=f"WorkerDiedError: the process died in each of {tries} tries"))
