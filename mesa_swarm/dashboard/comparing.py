"""Comparison of two worlds on one page, and comparisons over many seeds in their own processes."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from typing import IO, Any, cast

from joblib import cpu_count

from mesa_swarm.dashboard import check_page_model
from mesa_swarm.dashboard.inputs import LARGEST_SEED, checked_setting, whole_number
from mesa_swarm.dashboard.pair import NAMES, Pair
from mesa_swarm.dashboard.session import Session
from mesa_swarm.errors import InvalidValueError, SwarmError, check_choice, in_words
from mesa_swarm.experiments.compare import Comparison, run_plan
from mesa_swarm.experiments.experiment import DEFAULT_STEPS
from mesa_swarm.experiments.figures import comparison_figure, main_measure
from mesa_swarm.experiments.plan import Plan, checked_plan
from mesa_swarm.experiments.pool import ending_with_us
from mesa_swarm.experiments.tables import runs_csv, table_and_notes
from mesa_swarm.gallery import find_model, imported
from mesa_swarm.parameters import Choice, Parameter, Slider, parameters_of
from mesa_swarm.viewing.pictures import png
from mesa_swarm.viewing.play_loop import Listeners

# Largest number of comparisons at the same time, of all users of this server.
MOST_AT_ONCE = 2
# Shortest time between notifications of progress, s.
NOTIFY_EVERY = 0.2
# The processes of comparisons have a lower priority than the page.
NICENESS = 10
# Of the picture, inches: small, so that its text is large beside the table.
SIZE = (8.6, 6.8)
_under_way = threading.BoundedSemaphore(MOST_AT_ONCE)


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """Results of a comparison, ready to be shown."""

    title: str
    finding: str
    table: list[list[str]]  # the first line is the header
    notes: list[str]
    picture: bytes  # a PNG
    runs: str  # every run, as CSV


def report_of(comparison: Comparison) -> Report:
    """Return the report of a comparison."""
    plan = comparison.plan
    table, notes = table_and_notes(comparison)
    figure = comparison_figure(comparison, [main_measure(comparison)])
    figure.set_size_inches(*SIZE)
    return Report(
        title=f"{plan.model_class.__name__}, {plan.parameter}: {len(plan.seeds)} paired seeds, {plan.steps:,} steps",
        finding=comparison.finding(),
        table=table,
        notes=notes,
        picture=png(figure),
        runs=runs_csv(comparison),
    )


class ManyRuns:
    """Carries out the runs of a plan in the background, one plan at a time; notifies from another thread."""

    def __init__(self) -> None:
        self.changed = Listeners()
        self.done = self.total = 0
        self.report: Report | None = None
        self.error = ""
        self._process: subprocess.Popen | None = None
        self._began = self._notified = 0.0
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether a plan is under way."""
        return self._process is not None

    @property
    def left(self) -> str:
        """The time left, empty before the first run is done."""
        if not self.running or not self.done:
            return ""
        seconds = (time.monotonic() - self._began) / self.done * (self.total - self.done)
        return f"about {timedelta(seconds=round(seconds))} left"

    def start(self, plan: Plan) -> None:
        """Begin with a plan, unless one is under way or too many are on this server."""
        with self._lock:
            if self.running:
                raise SwarmError("a comparison is under way; cancel it first")
            if not _under_way.acquire(blocking=False):
                raise SwarmError(f"{MOST_AT_ONCE} comparisons are under way on this server; try again when one is done")
            self.done, self.total, self.report, self.error = 0, len(plan), None, ""
            self._began = time.monotonic()
            try:
                self._process = _begun(plan)
            except Exception as error:
                _under_way.release()
                if not isinstance(error, OSError):  # a plan of a user's objects may not be picklable
                    raise
                raise SwarmError(f"no process could be started ({error.strerror})") from error
            threading.Thread(target=self._follow, args=(self._process,), name="many runs", daemon=True).start()
        self.changed.notify()

    def cancel(self) -> None:
        """Stop what is under way, at once and without results."""
        with self._lock:
            process, self._process = self._process, None
            if process is not None:
                _end(process)
        if process is not None:
            self.error = f"cancelled after {self.done} of {self.total} runs"
            self.changed.notify()

    def close(self) -> None:
        """Stop what is under way, and remove all listeners."""
        self.changed.clear()
        self.cancel()
        self.report = None

    def _follow(self, process: subprocess.Popen) -> None:
        """Receive the messages of the process until it ends, and clean up after it."""
        try:
            for kind, value in _received(process):
                if self._process is process:
                    self._take(kind, value)
        finally:
            _end(process)
            for pipe in _pipes(process):
                with suppress(OSError):
                    pipe.close()
            _under_way.release()
        with self._lock:
            ended_by_itself = self._process is process
            if ended_by_itself:
                self._process = None
        if ended_by_itself:
            self.error = self.error or ("" if self.report else "the runs ended without a result; try again")
            self.changed.notify()

    def _take(self, kind: str, value: Any) -> None:
        if kind == "run":
            self.done += 1
            if time.monotonic() - self._notified > NOTIFY_EVERY:
                self._notified = time.monotonic()
                self.changed.notify()
        elif kind == "report":
            self.report = value
        else:
            self.error = value


def workers_for(plan: Plan) -> int:
    """Return the number of processes for a plan: one less than the number of cores, which is left to the page."""
    return max(1, min(cpu_count() - 1, len(plan)))


def _begun(plan: Plan) -> subprocess.Popen:
    """Start the process, in its own group, and send it the plan."""
    message = pickle.dumps((imported(), plan, workers_for(plan)))  # what is imported comes first
    process = subprocess.Popen(
        [sys.executable, "-c", ending_with_us(f"from {__name__} import main; main()")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    with suppress(BrokenPipeError):  # it has ended already, which is noticed soon
        to_it, _ = _pipes(process)
        to_it.write(message)
        to_it.flush()
    return process


def _pipes(process: subprocess.Popen) -> tuple[IO[bytes], IO[bytes]]:
    """Return the pipes to and from the process, which `_begun` has made."""
    return cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)


def _received(process: subprocess.Popen) -> Iterator[tuple[str, Any]]:
    """Yield the messages of the process."""
    _, from_it = _pipes(process)
    while True:
        try:
            yield pickle.load(from_it)
        except Exception:  # its end, or half of a message when it was killed
            return


def _end(process: subprocess.Popen) -> None:
    """End the process and all that it has started, unless this was done: its number may be another's by now."""
    if process.returncode is not None:
        return
    with suppress(ProcessLookupError, PermissionError):  # it has ended by itself
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:  # on Windows
            process.kill()
    process.wait()


def main() -> None:
    """Carry out the runs of the plan on stdin, and send the results."""
    _, plan, workers = pickle.load(sys.stdin.buffer)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what models print goes elsewhere
    if hasattr(os, "nice"):
        os.nice(NICENESS)

    def send(kind: str, value: object) -> None:
        pickle.dump((kind, value), out)
        out.flush()

    _do(plan, workers, send)


def _do(plan: Plan, workers: int, send: Callable[[str, object], None]) -> None:
    try:
        send("report", report_of(run_plan(plan, workers, heard=lambda run: send("run", run.rng))))
    except Exception as problem:  # a model may raise anything
        send("error", in_words(problem))


FEWEST_SEEDS, MOST_SEEDS, USUAL_SEEDS = 2, 1000, 30
MOST_STEPS = 200_000


class Comparing:
    """A pair of worlds that differ in one parameter, and its effect over many seeds.

    All other parameters are those set for the same model on the Watch page.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.pair, self.runs = Pair(), ManyRuns()
        self.pair.set_speed(session.own_speed)
        self.seed, self.seeds = session.seed, USUAL_SEEDS
        # Why a setting was refused, by "A", "B", "worlds", "seed", "seeds", "steps" or "runs".
        self.faults: dict[str, str] = {}
        self.choose_model(session.name)

    @property
    def choices(self) -> dict[str, Parameter]:
        """The parameters that can be compared, by name."""
        known, named = self.parameters.values(), ("map", getattr(self.model_class, "compares", (None,))[0])
        return {one.name: one for one in known if one.name in named or isinstance(one.control, (Choice, Slider))}

    @property
    def shared_settings(self) -> dict[str, Any]:
        """All parameters that differ from the model's defaults, except the compared one."""
        session = self.session
        if session.name != self.name:
            return {}
        requested = {name: value for name, value in session.settings.items() if value != self.parameters[name].default}
        requested.pop(self.parameter, None)
        return {name: self._meant(name, value) for name, value in requested.items()}

    @property
    def waiting(self) -> frozenset[str]:
        """Of "A", "B" and "seed" those that will be as requested only after a reset."""
        return frozenset(name for name, value in self._requested().items() if self.built.get(name) != value)

    def choose_model(self, name: str) -> None:
        """Compare another model, in the parameter that it suggests."""
        self.name = check_page_model(name)
        self.model_class = find_model(name)
        self.parameters = parameters_of(self.model_class)
        self.steps = min(getattr(self.model_class, "steps_to_compare", DEFAULT_STEPS), MOST_STEPS)
        suggested = getattr(self.model_class, "compares", (None,))[0]
        self.choose_parameter(suggested if suggested in self.choices else next(iter(self.choices)))

    def choose_parameter(self, name: str) -> None:
        """Compare another parameter, and build both worlds."""
        self.parameter = check_choice("parameter", name, self.choices)
        maps = self.session.map_names(self.parameters.get("map"))
        self.values = two_values(self.model_class, self.choices[name], maps)
        self.faults = {}
        self.reset()

    def set_value(self, side: str, value: Any) -> None:
        """Set the value in world A or B, from the next reset on."""
        try:
            self.values[NAMES.index(side)] = self._checked(value)
            self.faults.pop(side, None)
        except Exception as problem:  # shown beside the control
            self.faults[side] = in_words(problem)
        self.pair.changed.notify()

    def set_count(self, name: str, text: str | int) -> None:
        """Set the "seed" of the two worlds, the number of "seeds", or the "steps" of each run."""
        low, high = {"seed": (0, LARGEST_SEED), "seeds": (FEWEST_SEEDS, MOST_SEEDS), "steps": (1, MOST_STEPS)}[name]
        try:
            setattr(self, name, whole_number(name, text, low, high))
            self.faults.pop(name, None)
        except InvalidValueError as problem:
            self.faults[name] = str(problem)
        self.pair.changed.notify()

    def reset(self) -> None:
        """Stop, and build both worlds as requested."""
        self.built, models = self._requested(), (None, None)
        self.faults.pop("worlds", None)
        try:
            models = self._models()
        except Exception as problem:  # a model may raise anything; it is shown
            self.faults["worlds"] = in_words(problem)
        self.pair.place(*models)

    def plan(self) -> Plan:
        """Return the plan of the comparison over many seeds."""
        values = [self._meant(self.parameter, value) for value in self.values]
        return checked_plan(
            self.model_class, self.parameter, values, self.seeds, steps=self.steps, settings=self.shared_settings
        )

    def start(self) -> None:
        """Begin to compare over many seeds, in the background."""
        self.pair.pause()
        try:
            self.runs.start(self.plan())
            self.faults.pop("runs", None)
        except Exception as problem:  # as in `reset`
            self.faults["runs"] = in_words(problem)
        self.pair.changed.notify()

    @property
    def linked(self) -> Listeners:
        """Notified when the words of a link change."""
        return self.pair.changed

    def words(self) -> dict[str, str]:
        """Return what is compared, as words of a link; settings of both worlds are those of the session."""
        first, second = (str(value) for value in self.values)
        counts = {name: str(getattr(self, name)) for name in ("seed", "seeds", "steps")}
        return {"model": self.name, "parameter": self.parameter, "A": first, "B": second, **counts}

    def show_words(self, words: dict[str, str]) -> list[str]:
        """Compare what the words of a link describe; return why some were ignored."""
        try:
            if words.get("model", self.name) != self.name:
                self.choose_model(words["model"])
            if words.get("parameter", self.parameter) != self.parameter:
                self.choose_parameter(words["parameter"])
        except SwarmError as problem:
            return [in_words(problem)]
        for name in NAMES:
            if name in words:
                self.set_value(name, words[name])
        for name in ("seed", "seeds", "steps"):
            if name in words:
                self.set_count(name, words[name])
        faults = list(self.faults.values())
        self.reset()
        return faults

    def close(self) -> None:
        """Stop and release everything."""
        self.runs.close()
        self.pair.close()

    def _requested(self) -> dict[str, Any]:
        first, second = self.values
        return {"A": first, "B": second, "seed": self.seed}

    def _models(self) -> tuple:
        settings = self.shared_settings
        return tuple(
            self.model_class(**settings, **{self.parameter: self._meant(self.parameter, value)}, rng=self.seed)
            for value in self.values
        )

    def _meant(self, name: str, value: Any) -> Any:
        """Return the uploaded map of this name, or the value itself."""
        return self.session.uploads.get(value, value) if name == "map" else value

    def _checked(self, value: Any) -> Any:
        parameter = self.choices[self.parameter]
        if parameter.name == "map":
            return check_choice("map", value, self.session.map_names(parameter))
        return checked_setting(parameter, value)


def two_values(model_class: type, parameter: Parameter, maps: list[str]) -> list:
    """Return two values of a parameter that are worth comparing.

    Those that the model suggests; else the first two of a list, or the default and the farther end of the slider.
    """
    named, values = getattr(model_class, "compares", (None, ()))
    if parameter.name == named and len(values) >= 2:
        return list(values[:2])
    control = parameter.control
    if isinstance(control, Slider):
        default, slider = parameter.default, control
        ends = sorted((slider.minimum, slider.maximum), key=lambda end: -abs(end - default))
        return [default, parameter.kind(ends[0])]
    options = list(control.options) if isinstance(control, Choice) and parameter.name != "map" else maps
    return (options * 2)[:2]
