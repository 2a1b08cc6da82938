"""Exercises that check themselves over several seeds, and what they require.

A hint may have several stages, the first of which reveals least: the first answer that does not pass shows the first
one, the next answer the second. An answer that could not be judged, such as one with a misspelt name, uses none up. An
exercise that passes begins anew. Errors of the check itself are not shown as the learner's.
"""

import functools
import inspect
import linecache
import math
import re
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from importlib.metadata import version
from numbers import Real
from pathlib import Path
from types import CodeType, FunctionType, TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, SwarmError, shortened, unknown_name, without_middle
from mesa_swarm.base.moved import moved_name
from mesa_swarm.control.arbiter import Subsumption
from mesa_swarm.control.behaviour import Behaviour, behaviour
from mesa_swarm.control.explore import Explore
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.teaching.verdicts import (
    CHECK_FAILED,
    JUDGED,
    NOT_JUDGED,
    Criterion,
    Verdict,
    format_number,
    rounding,
    seeds_in_words,
    verdict_on,
)


@dataclass
class Tries:
    """How many answers in a row an exercise has refused, and the last of them."""

    count: int = 0
    answer: Any = None

    def add(self, answer: Any) -> bool:
        """Count an answer and return True, unless it is the last one again: its cell has not run since."""
        if self.count and is_same(self.answer, answer):
            return False
        self.count, self.answer = self.count + 1, copy_answer(answer)
        return True


# By the stages of the exercise's hint.
_tries: dict[tuple[str, ...], Tries] = {}


def forget(stages: tuple[str, ...]) -> None:
    """Let an exercise begin with the first stage again."""
    _tries.pop(stages, None)


def next_stage(hint: str | Sequence[str], answer: Any, *, judged: bool) -> str:
    """Return the hint after an answer that did not pass, "" for none.

    Parameters
    ----------
    hint : str or sequence of str
        Its stages.
    answer : object
        The learner's.
    judged : bool
        Whether the answer was judged: one that could not be, such as one with a misspelt name, uses no stage up, and
        shows again what was shown.
    """
    stages = stages_of(hint)
    tries = _tries.setdefault(stages, Tries()) if any(stages) else Tries()
    new = tries.add(answer) if judged and any(stages) else True
    if not tries.count:
        return ""
    stage = min(tries.count, len(stages))
    again = "" if new else "; your answer is the same as before"
    label = f"({stage} of {len(stages)}{again}) " if len(stages) > 1 else ""
    return label + stages[stage - 1]


def stages_of(hint: str | Sequence[str]) -> tuple[str, ...]:
    """Return the stages of a hint."""
    return (hint,) if isinstance(hint, str) else tuple(hint)


def is_code(answer: Any) -> bool:
    """Return whether an answer is a function, a rule or a class, which a cell makes anew when it runs."""
    return callable(answer) or hasattr(answer, "decide")


def copy_answer(answer: Any) -> Any:
    """Return an answer as it is now: numbers may be changed in place, functions are replaced."""
    try:
        return answer if is_code(answer) else deepcopy(answer)
    except Exception:  # an answer of any type may be given
        return object()


def is_same(before: Any, now: Any) -> bool:
    """Return whether an answer is the one before.

    Examples
    --------
    >>> is_same({"distance": 6}, {"distance": 6}), is_same(lambda: 1, lambda: 1)
    (True, False)
    """
    if is_code(before) or is_code(now):
        return before is now
    try:
        return type(before) is type(now) and bool(before == now)
    except Exception:  # an answer of any type may be given
        return False


PACKAGE = str(Path(__file__).parent.parent)
LIBRARIES = ("site-packages", "dist-packages", "<frozen")
# Names that are missing in a check are missing whatever the answer is.
UNDENIABLE = NameError, ImportError


class CheckError(Exception):
    """An error of the check itself; its cause is what happened."""

    def __init__(self, seed: int | None = None) -> None:
        super().__init__(seed)
        self.seed = seed


def code_of(thing: Any) -> set[CodeType]:
    """Return the code of a function, rule, layer or class: what is defined within it, and its methods.

    Examples
    --------
    >>> len(code_of(lambda: [lambda: 1])), code_of(3)
    (2, set())
    """
    if isinstance(thing, FunctionType):
        return set(_list_codes(thing.__code__))
    if isinstance(thing, type):
        is_users = thing.__module__.partition(".")[0] not in ("builtins", "mesa_swarm")
        return set().union(*map(code_of, vars(thing).values())) if is_users else set()
    within = _function_within(thing)
    if within is not None:
        return code_of(within)
    return code_of(type(thing)) if hasattr(thing, "decide") else set()


def _function_within(thing: Any) -> Any:
    """Return the function of a rule, a method, a property or a function with fixed arguments, None for others."""
    if isinstance(thing, Behaviour):
        return thing.rule.function
    if isinstance(thing, functools.partial):
        return thing.func
    within = getattr(thing, "__func__", getattr(thing, "__wrapped__", None))  # of a method, or behind functools.cache
    return thing.fget if isinstance(thing, property) else within


def _list_codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _list_codes(constant)


@dataclass(frozen=True, slots=True)
class Place:
    """A line that is neither the package's nor a library's."""

    code: CodeType
    number: int

    @property
    def line(self) -> str:
        """Its text, "" if it is not known."""
        return linecache.getline(self.code.co_filename, self.number).strip()


def places_of_traceback(trace: TracebackType | None) -> list[Place]:
    """Return the places of a traceback that are neither the package's nor a library's, the last one first."""
    places = [Place(frame.f_code, number) for frame, number in traceback.walk_tb(trace)]
    return [place for place in places[::-1] if not _is_of_library(place.code.co_filename)]


def _is_of_library(file: str) -> bool:
    return file.startswith(PACKAGE) or any(part in file for part in LIBRARIES)


@dataclass(frozen=True, slots=True)
class Authors:
    """Whose code is whose.

    Parameters
    ----------
    answer : object
        The learner's: a function, rule, class, layer or plain value.
    check : tuple of callable
        What the check is made of.
    """

    answer: Any
    check: tuple[Any, ...] = ()

    def is_learners(self, place: Place) -> bool | None:
        """Return whether the learner wrote the code of a place; None if that is not known, as of helper functions."""
        answers, checks = code_of(self.answer), set().union(*map(code_of, self.check))
        if place.code in answers or place.code in checks:
            return place.code in answers
        file = place.code.co_filename
        in_own, in_checks = (file in {code.co_filename for code in codes} for codes in (answers, checks))
        return None if in_own == in_checks else in_own

    def is_last_learners(self, error: BaseException) -> bool | None:
        """Return whether the learner wrote the last place of an error of which that is known."""
        verdicts = map(self.is_learners, places_of_traceback(error.__traceback__))
        return next((learners for learners in verdicts if learners is not None), None)

    def in_words(self, error: BaseException, *, surely: bool = False) -> str:
        """Return an error of an answer in words, with the line of the learner's own code where it happened.

        What happened in code that the learner may not have written is named as such, unless the answer is `surely` its
        cause.
        """
        text = " ".join(str(error).split())
        places = [place for place in places_of_traceback(error.__traceback__) if place.line]
        if not isinstance(error, SwarmError):
            line = next((place.line for place in places if self.is_learners(place)), "")
            text = f"it stopped with {type(error).__name__}: {text or 'no details'}{line and f', at the line: {line}'}"
        if surely or not places or self.is_learners(places[0]):
            return text
        return (
            f"{text.rstrip('.')}. This happened in {places[0].code.co_name}, at the line: {places[0].line}; if you did "
            "not write that, and your answer is what is required, send this to your teacher"
        )


@contextmanager
def part_of_check(authors: Authors, seed: int | None = None, *, uses_answer: bool = False) -> Iterator[None]:
    """Turn errors of the check's own code into CheckError; those of the learner's code are passed on.

    With `uses_answer`, in code that works on what the learner gave, only such errors are the check's for certain as do
    not depend on that, such as a name that is missing: the others are passed on too.
    """
    try:
        yield
    except CheckError:
        raise
    except Exception as error:
        learners = authors.is_last_learners(error)
        if learners or (uses_answer and not (learners is False and isinstance(error, UNDENIABLE))):
            raise
        raise CheckError(seed) from error


def also_without(run: Callable[[], Any], seed: int) -> None:
    """Raise CheckError if what has failed with an answer fails without it too."""
    try:
        run()
    except Exception as error:
        raise CheckError(seed) from error


def error_report(error: CheckError, version: str) -> str:
    """Return what the learner is to send to the teacher: the error, where it happened, and with which seed."""
    cause = error.__cause__ or error
    lines = [f"{type(cause).__name__}: {' '.join(str(cause).split()) or 'no details'}"]
    places = places_of_traceback(cause.__traceback__)[:1]
    lines += [f"in {place.code.co_name}, line {place.number}: {place.line or 'unknown'}" for place in places]
    seed = "" if error.seed is None else f"with seed {shortened(error.seed)}, "
    return "\n".join(f"  {without_middle(line)}" for line in [*lines, f"{seed}mesa_swarm {version}"])


def is_missing(answer: object) -> bool:
    """Return whether an answer is still its placeholder: None or dots."""
    return answer is None or answer is ...


def _add_hint(verdict: Verdict, hint: str | Sequence[str], answer: object) -> Verdict:
    """Return a verdict with the next stage of its exercise's hint, if it did not pass."""
    if verdict.passed:
        forget(stages_of(hint))
    if verdict.passed or verdict.status == CHECK_FAILED:
        return verdict
    return replace(verdict, hint=next_stage(hint, answer, judged=verdict.status == JUDGED))


def _not_judged(text: str) -> Verdict:
    return Verdict(False, text, status=NOT_JUDGED)


def _broken(error: CheckError) -> Verdict:
    """Return that the check has failed, and what to send to the teacher."""
    return Verdict(False, error_report(error, version("mesa-swarm")), status=CHECK_FAILED)


def _refuse_answer(answer: object, expectation: str) -> Verdict:
    return _not_judged(f"your answer is {shortened(answer)}; expected {expectation}")


def _refusal(answer: object, expects: str, accepts: Callable[[Any], bool] | None) -> Verdict | None:
    """Return why an answer cannot be checked, if it cannot."""
    if is_missing(answer):
        return _not_judged(NO_ANSWER)
    if accepts is None:
        return None
    try:
        with part_of_check(Authors(answer, (accepts,)), uses_answer=True):
            accepted = bool(accepts(answer))
    except CheckError as error:
        return _broken(error)
    except Exception:  # an answer of any type may be given
        accepted = False
    return None if accepted else _refuse_answer(answer, expects)


# Other seeds than the notebooks show: an answer is tested on seeds that it was not made for.
SEEDS = (101, 102, 103, 104, 105)
NO_ANSWER = "there is no answer yet; put yours where the dots are"


# An answer that is checked by itself is given beside the function that uses it.
GIVEN: Any = object()


def check_model(
    make: Callable[[int], Any],
    *criteria: Criterion,
    answer: Any = GIVEN,
    expects: str = "another answer",
    accepts: Callable[[Any], bool] | None = None,
    steps: int = 0,
    seeds: Sequence[int] = SEEDS,
    hint: str | Sequence[str] = "",
) -> Verdict:
    """Run what a function makes with several seeds, and check the results.

    Parameters
    ----------
    make : callable
        Takes a seed; returns a SwarmModel, which is then run, or a mapping of numbers by name.
    *criteria : Criterion
        The criteria.
    answer : object, optional
        The learner's answer, where `make` is not it but uses it.
    expects : str
        What an answer must be, in words.
    accepts : callable, optional
        Takes the answer and returns whether it is such; it may raise.
    steps : int
        That each model is run.
    seeds : sequence of int
    hint : str or sequence of str
        Shown if the answer does not pass; of several stages the first one at first.

    Examples
    --------
    >>> check_model(lambda rng: {"seed": rng}, Criterion("seed", at_most=4), seeds=[3, 4])
    All criteria met.
      seed: required <= 4; measured 3, 4 with seeds 3 and 4; 2 of 2 seeds pass
    """
    refusal = _refusal(make, "a function that takes a seed", callable) or _refusal(answer, expects, accepts)
    is_answer = answer is GIVEN
    subject = make if is_answer else answer
    trial = _Trial(make, criteria, subject, () if is_answer else (make,), steps=steps, makes_outcome=is_answer)
    return _add_hint(refusal or _model_verdict(trial, seeds), hint, subject)


@dataclass(frozen=True, slots=True)
class _Trial:
    """How an answer becomes numbers.

    `make` takes a seed and returns the outcome, which the answer itself has made where `makes_outcome`; `parts` are the
    functions of the check besides the measures. `without` does the same for some steps without the answer: what fails
    there too is not the answer's fault. Where it is `decisive`, everything else is.
    """

    make: Callable[[int], Any]
    criteria: Sequence[Criterion]
    answer: Any
    parts: tuple[Any, ...] = ()
    _: KW_ONLY
    steps: int = 0
    makes_outcome: bool = False
    without: Callable[[int, int], Any] | None = None
    decisive: bool = False

    def __post_init__(self) -> None:
        if not self.criteria:
            raise InvalidValueError("a check without a criterion passes every answer; give it one or more")

    @property
    def authors(self) -> Authors:
        """Who wrote what."""
        return Authors(self.answer, (*self.parts, *(criterion.measure for criterion in self.criteria)))

    def numbers(self, seed: int) -> list[float | None]:
        """Return the number of each criterion with a seed."""
        steps = 0
        try:
            with part_of_check(self.authors, seed, uses_answer=True):
                outcome = self.make(seed)
                steps = 0 if isinstance(outcome, Mapping) or is_missing(outcome) else self.steps
                if steps:
                    _run(outcome, steps)
        except CheckError:
            raise
        except Exception:
            if self.without is not None:
                also_without(partial(self.without, seed, steps), seed)
            raise
        with part_of_check(self.authors, seed, uses_answer=self.makes_outcome):
            if is_missing(outcome):
                raise ValueError(f"it returned {outcome}; return what you made")
            return [_number(criterion, outcome) for criterion in self.criteria]


def _number(criterion: Criterion, outcome: Any) -> float | None:
    number = criterion.number_of(outcome)
    if number is None or isinstance(number, (Real, np.bool_)) or (isinstance(number, np.ndarray) and not number.ndim):
        return number
    raise InvalidValueError(f"{criterion.what} is {shortened(number)}; expected a number, or None for undefined")


def _model_verdict(trial: _Trial, seeds: Sequence[int]) -> Verdict:
    try:
        rows = [trial.numbers(seed) for seed in seeds_of_check(seeds)]
    except CheckError as error:
        return _broken(error)
    except Exception as error:  # every error of a learner becomes a sentence
        # Errors of rules are raised from within the model, whose code is that of the check.
        of_rule = trial.without is not None and isinstance(error, SwarmError)
        return _not_judged(trial.authors.in_words(error, surely=trial.decisive or of_rule))
    return verdict_on(trial.criteria, list(zip(*rows, strict=True)), seeds)


def seeds_of_check(seeds: Sequence[int]) -> Sequence[int]:
    """Return the seeds of a check, of which there is at least one."""
    if not len(seeds):
        raise CheckError from InvalidValueError("seeds is empty; expected at least one")
    return seeds


def _run(model: Any, steps: int) -> None:
    """Run a model; an error names its robots by their places among the robots, where unique_ids count all agents."""
    try:
        model.run(steps)
    except SwarmError as error:
        ids = [robot.unique_id for robot in getattr(model, "robots", ())]

        def place(match: re.Match[str]) -> str:
            number = int(match[1])
            return f"robot {ids.index(number) + 1} of {len(ids)}" if number in ids else match[0]

        text = re.sub(r"\brobot (\d+)\b", place, str(error))
        raise SwarmError(text).with_traceback(error.__traceback__) from error


def check_rule(
    rule: Any,
    *criteria: Criterion,
    world: Callable[[int], Any],
    above: Sequence = (),
    below: Sequence = (Explore(),),
    steps: int = 1_000,
    seeds: Sequence[int] = SEEDS,
    hint: str | Sequence[str] = "",
) -> Verdict:
    """Let robots follow a rule in several worlds, and check the results.

    Parameters
    ----------
    rule : function of me, or layer
    *criteria : Criterion
    world : callable
        Takes a seed; returns a model with robots and no control.
    above, below : sequences of layers
        Layers before the rule, and layers that drive robots for which the rule passes.
    steps, seeds, hint
        See `check_model`.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> from mesa_swarm.robots.design import AGENT3
    >>> def world(rng):
    ...     model = SwarmModel(rng=rng)
    ...     model.add_robots(AGENT3, 2)
    ...     return model
    >>> print(check_rule(..., Criterion("total_collisions", at_most=0), world=world))
    Not yet. There is no answer yet; put yours where the dots are.
    """
    layers = (*above, *below)

    def make(seed: int) -> SwarmModel:
        with part_of_check(Authors(rule, (world,)), seed):
            model = world(seed)
            Subsumption(*layers)
        model.control = Subsumption(*above, _layer(rule), *below)
        return model

    def without(seed: int, steps: int) -> None:
        model = world(seed)
        model.control = Subsumption(*layers)
        model.run(steps)

    refusal = _refusal(rule, "a function of me with @behaviour, or a layer such as Avoid()", _is_rule)
    trial = _Trial(make, criteria, rule, (world, *layers), steps=steps, without=without)
    return _add_hint(refusal or _model_verdict(trial, seeds), hint, rule)


def _is_rule(rule: Any) -> bool:
    return hasattr(rule, "decide") or (callable(rule) and not isinstance(rule, type))


def _layer(rule: Any) -> Any:
    is_plain = callable(rule) and not isinstance(rule, Behaviour) and not hasattr(rule, "decide")
    return behaviour(rule) if is_plain else rule


def check_settings(
    model: Callable[..., Any],
    settings: Mapping[str, Any],
    *criteria: Criterion,
    only: Sequence[str] = (),
    steps: int = 1_000,
    seeds: Sequence[int] = SEEDS,
    hint: str | Sequence[str] = "",
) -> Verdict:
    """Run a model with a learner's settings, and check the results.

    Parameters
    ----------
    model : type or function
        Of the gallery, one of your own, or a function that makes one; with keyword-only parameters and `rng`.
    settings : mapping
        Its parameters by name.
    *criteria : Criterion
    only : sequence of str
        The parameters that may be set; any of them by default.
    steps, seeds, hint
        See `check_model`.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> print(check_settings(find_model("boids"), {"memry": 5}, Criterion("alignment", at_least=0), only=["memory"]))
    Not yet. Unknown parameter 'memry'; did you mean 'memory'? known: memory.
    """
    names = [name for name in parameters_of(model) if not only or name in only]

    def make(seed: int) -> Any:
        return model(**settings, rng=seed)

    def without(seed: int, steps: int) -> None:
        outcome = model(rng=seed)
        if not isinstance(outcome, Mapping):
            outcome.run(steps)

    has_defaults = _has_defaults(model)
    defaults = without if has_defaults else None
    trial = _Trial(make, criteria, settings, (model,), steps=steps, without=defaults, decisive=has_defaults)
    return _add_hint(_settings_refusal(settings, names) or _model_verdict(trial, seeds), hint, settings)


def _has_defaults(model: Callable[..., Any]) -> bool:
    """Return whether a model can be made without settings."""
    try:
        inspect.signature(model).bind(rng=0)
    except (TypeError, ValueError):
        return False
    return True


def _settings_refusal(settings: Any, names: Sequence[str]) -> Verdict | None:
    if is_missing(settings) or (isinstance(settings, Mapping) and any(map(is_missing, settings.values()))):
        return _not_judged(NO_ANSWER)
    if not isinstance(settings, Mapping):
        return _refuse_answer(settings, f"settings by name, such as dict({names[0]}=...)")
    odd = [name for name in settings if name not in names]
    return _not_judged(unknown_name("parameter", odd[0], names)) if odd else None


def check_estimate(
    guess: float,
    run: Callable[[int], float],
    *,
    within: float,
    what: str = "the mean",
    seeds: Sequence[int] = SEEDS,
    hint: str | Sequence[str] = "",
) -> Verdict:
    """Compare a number that a learner expects with the mean over several seeds.

    Parameters
    ----------
    guess : float
    run : callable
        Takes a seed, returns the measured number.
    within : float
        The largest difference from the mean with which the guess passes.
    what : str
        What is guessed, in words.
    seeds, hint
        See `check_model`.

    Examples
    --------
    >>> check_estimate(3, float, within=1, what="it", seeds=[1, 2])
    Not yet. You expected 3 for it; the mean of seeds 1 and 2 is 1.5 (1 to 2); required: within 1.
    """
    verdict = _refusal(guess, "a number", _is_number) or _estimate_verdict(float(guess), run, within, what, seeds)
    return _add_hint(verdict, hint, guess)


def _is_number(guess: Any) -> bool:
    return not isinstance(guess, str | bool) and math.isfinite(float(guess))


def _estimate_verdict(
    expected: float, run: Callable[[int], float], within: float, what: str, seeds: Sequence[int]
) -> Verdict:
    numbers = []
    try:
        for seed in seeds_of_check(seeds):
            with part_of_check(Authors(expected, (run,)), seed):
                numbers.append(float(run(seed)))
    except CheckError as error:
        return _broken(error)
    measured = np.array(numbers)
    average = measured.mean()
    mean, least, largest = map(format_number, (average, measured.min(), measured.max()))
    text = (
        f"you expected {format_number(expected)} for {what}; the mean of {seeds_in_words(seeds)} is {mean} "
        f"({least} to {largest}); required: within {within:g}"
    )
    passes = bool(abs(expected - average) <= within + rounding(within))
    return Verdict(passes, f"  {text}" if passes else text)


def check_function(
    function: Callable[..., Any],
    twin: Callable[..., Any],
    inputs: Callable[[int], tuple],
    *,
    answer: Any = GIVEN,
    expects: str = "another answer",
    accepts: Callable[[Any], bool] | None = None,
    tolerance: float = 1e-6,
    seeds: Sequence[int] = SEEDS,
    hint: str | Sequence[str] = "",
) -> Verdict:
    """Compare a learner's function with a correct one, on several inputs.

    Parameters
    ----------
    function, twin : callable
        The learner's, and the correct one.
    inputs : callable
        Takes a seed, returns the arguments.
    answer, expects, accepts
        See `check_model`.
    tolerance : float
        By which numbers may differ.
    seeds, hint
        See `check_model`.

    Examples
    --------
    >>> check_function(lambda x: x * x, lambda x: x + x, lambda seed: (seed,), seeds=[2, 3])
    Not yet. It returned 9 where 6 was expected, with seed 3.
    """
    refusal = _refusal(function, "a function", callable) or _refusal(answer, expects, accepts)
    authors = Authors(function, (twin, inputs)) if answer is GIVEN else Authors(answer, (function, twin, inputs))
    verdict = refusal or _function_verdict(_Twins(function, twin, inputs, tolerance), authors, seeds)
    return _add_hint(verdict, hint, function if answer is GIVEN else answer)


@dataclass(frozen=True, slots=True)
class _Twins:
    """A function to be checked, the correct one, what makes their arguments, and by which numbers may differ."""

    function: Callable[..., Any]
    twin: Callable[..., Any]
    inputs: Callable[[int], tuple]
    tolerance: float

    def same(self, result: Any, expected: Any) -> bool:
        """Return whether results are the same."""
        try:
            alike = np.shape(result) == np.shape(expected)
            return alike and np.allclose(result, expected, rtol=0, atol=self.tolerance, equal_nan=True)
        except (TypeError, ValueError):  # of a text, or of a list of lists of different lengths
            return False


def _function_verdict(twins: _Twins, authors: Authors, seeds: Sequence[int]) -> Verdict:
    try:
        for seed in seeds_of_check(seeds):
            with part_of_check(authors, seed):
                expected, arguments = twins.twin(*twins.inputs(seed)), twins.inputs(seed)
            with part_of_check(authors, seed, uses_answer=True):
                result = twins.function(*arguments)
            if not twins.same(result, expected):
                text = (
                    f"it returned {_short(result)} where {_short(expected)} was expected, with {seeds_in_words([seed])}"
                )
                return Verdict(False, text, status=NOT_JUDGED if is_missing(result) else JUDGED)
    except CheckError as error:
        return _broken(error)
    except Exception as error:  # every error of a learner becomes a sentence
        return _not_judged(authors.in_words(error))
    return Verdict(True, f"  it returned what was expected with {seeds_in_words(seeds)}")


def _short(value: Any) -> str:
    if value is None:
        return "None"
    try:
        numbers = np.asarray(value, dtype=float)
        return f"{numbers:.6g}" if numbers.ndim == 0 else np.array2string(numbers, precision=4, threshold=6)
    except (TypeError, ValueError):
        return repr(value)[:60]


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> object:
        """Return a name by which a part of this module was called before."""
        return moved_name(__name__, name)
