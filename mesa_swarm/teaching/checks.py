"""Exercises that check themselves over several seeds, and what they require.

A hint may have several stages, the first of which reveals least: the first failed check of an exercise shows the first
one, the next check the second. An exercise that passes begins anew.
"""

import linecache
import math
import re
import traceback
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mesa_swarm.control.arbiter import Subsumption
from mesa_swarm.control.behaviour import Behaviour, behaviour
from mesa_swarm.control.explore import Explore
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError, check_count, shortened, unknown_name
from mesa_swarm.moved import moved_name
from mesa_swarm.parameters import parameters_of
from mesa_swarm.swarm_model import SwarmModel

PACKAGE = str(Path(__file__).parent.parent)
LIBRARIES = ("site-packages", "dist-packages", "<frozen")


def in_words(error: BaseException) -> str:
    """Return an error as one sentence, with the line of the learner's own code at which it happened."""
    message = " ".join(str(error).split())
    if isinstance(error, SwarmError):
        return message
    line = own_line(error)
    where = f", at the line: {line}" if line else ""
    return f"it stopped with {type(error).__name__}: {message or 'no details'}{where}"


def own_line(error: BaseException) -> str:
    """Return the last line of the learner's own code in the traceback, or ""."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        foreign = frame.filename.startswith(PACKAGE) or any(part in frame.filename for part in LIBRARIES)
        line = (frame.line or linecache.getline(frame.filename, frame.lineno or 0)).strip()
        if line and not foreign:
            return line
    return ""


def is_missing(answer: object) -> bool:
    """Return whether an answer is still its placeholder: None or dots."""
    return answer is None or answer is ...


@dataclass(frozen=True, slots=True)
class Criterion:
    """A criterion for one number of every run.

    Parameters
    ----------
    what : str
        Name of the number: of a model's `results`, of an attribute of it, or of an entry of a mapping. With
        `measure` it is only a label.
    at_least, at_most : float
        Limits, both included; at least one of them is given.
    measure : callable, optional
        Takes what a run gave, such as the model, and returns the number.
    misses : int
        The number of seeds on which it may fail, at least 0.

    Raises
    ------
    InvalidValueError
        If no limit is given.

    Examples
    --------
    >>> print(Criterion("fires out", at_least=7))
    fires out: required >= 7
    >>> Criterion("fires out", at_least=7).is_met(6)
    False
    """

    what: str
    _: KW_ONLY
    at_least: float = -math.inf
    at_most: float = math.inf
    measure: Callable[[Any], float] | None = None
    misses: int = 0

    def __post_init__(self) -> None:
        check_count("misses", self.misses)
        if self.at_least == -math.inf and self.at_most == math.inf:
            raise InvalidValueError(f"{self.what!r} has no limit; give at_least, at_most or both")

    def __str__(self) -> str:
        low = f">= {self.at_least:,g}" if self.at_least > -math.inf else ""
        high = f"<= {self.at_most:,g}" if self.at_most < math.inf else ""
        return f"{self.what}: required {' and '.join(part for part in (low, high) if part)}"

    def is_met(self, number: float | None) -> bool:
        """Return whether a number is within the limits, but for rounding; None is not."""
        if number is None:
            return False
        return self.at_least - _rounding(self.at_least) <= number <= self.at_most + _rounding(self.at_most)

    def number_of(self, outcome: Any) -> float | None:
        """Return the number that a run gave."""
        if self.measure is not None:
            return self.measure(outcome)
        results = outcome if isinstance(outcome, Mapping) else getattr(outcome, "results", dict)()
        if self.what in results:
            return results[self.what]
        if not isinstance(outcome, Mapping) and hasattr(outcome, self.what):
            return getattr(outcome, self.what)
        raise UnknownNameError(unknown_name("result", self.what, results))


def _rounding(limit: float) -> float:
    """Return by how much a number may miss a limit that it meets on paper."""
    return ROUNDING * max(1.0, abs(limit)) if math.isfinite(limit) else 0.0


ROUNDING = 1e-6
PASSED = "All criteria met."
NOT_YET = "Not yet."


@dataclass(frozen=True, slots=True, repr=False)
class Verdict:
    """Whether an answer passes, and why: one line of text or more."""

    passed: bool
    text: str
    hint: str = ""

    def __repr__(self) -> str:
        if self.passed:
            return f"{PASSED}\n{self.text}"
        text = f"{NOT_YET}\n{self.text}" if "\n" in self.text or self.text.startswith(" ") else self._sentence()
        return f"{text}\nHint: {self.hint}{'' if self.hint.endswith(('.', '?')) else '.'}" if self.hint else text

    __str__ = __repr__

    def _sentence(self) -> str:
        return f"{NOT_YET} {self.text[:1].upper()}{self.text[1:].rstrip('.')}."


# How often in a row each exercise was not passed, by its hints.
_failures: Counter[tuple[str, ...]] = Counter()


def _hinted(verdict: Verdict, hint: str | Sequence[str]) -> Verdict:
    """Return a verdict with the next stage of its exercise's hint, if it did not pass."""
    stages = (hint,) if isinstance(hint, str) else tuple(hint)
    if verdict.passed or not any(stages):
        _failures.pop(stages, None)
        return verdict
    stage = min(_failures[stages], len(stages) - 1)
    _failures[stages] += 1
    number = f"({stage + 1} of {len(stages)}) " if len(stages) > 1 else ""
    return replace(verdict, hint=number + stages[stage])


def _refused(answer: object, expected: str) -> Verdict:
    return Verdict(False, f"your answer is {shortened(answer)}; expected {expected}")


def _refusal(answer: object, expects: str, accepts: Callable[[Any], bool] | None) -> Verdict | None:
    """Return why an answer cannot be checked, if it cannot."""
    if is_missing(answer):
        return Verdict(False, NO_ANSWER)
    if accepts is None:
        return None
    try:
        accepted = bool(accepts(answer))
    except Exception:  # an answer of any type may be given
        accepted = False
    return None if accepted else _refused(answer, expects)


def verdict_on(
    criteria: Sequence[Criterion], numbers: Sequence[Sequence[float | None]], seeds: Sequence[int]
) -> Verdict:
    """Return the verdict on measured numbers, a row a criterion."""
    rows = list(zip(criteria, numbers, strict=True))
    passed = all(sum(not criterion.is_met(number) for number in row) <= criterion.misses for criterion, row in rows)
    return Verdict(passed, "\n".join(_line(criterion, row, seeds) for criterion, row in rows))


def _line(criterion: Criterion, row: Sequence[float | None], seeds: Sequence[int]) -> str:
    met, runs = sum(map(criterion.is_met, row)), len(row)
    measured = ", ".join(map(shown, row))
    enough = f" ({runs - criterion.misses} required)" if criterion.misses else ""
    return f"  {criterion}; measured {measured} with {seeds_in_words(seeds)}; {met} of {runs} seeds pass{enough}"


def shown(number: float | None) -> str:
    """Return a number for a reader, "undefined" for None and NaN."""
    if number is None or math.isnan(number):
        return "undefined"
    return f"{float(number):,.4g}" if abs(number) < 1000 else f"{number:,.0f}"


def seeds_in_words(seeds: Sequence[int]) -> str:
    """Return which seeds these are."""
    first, last, count = seeds[0], seeds[-1], len(seeds)
    if count > 2 and list(seeds) == list(range(first, last + 1)):
        return f"seeds {first} to {last}"
    names = ", ".join(map(str, seeds[:-1]))
    return f"seeds {names} and {last}" if count > 1 else f"seed {first}"


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
    return _hinted(_model_verdict(make, criteria, (answer, expects, accepts), steps, seeds), hint)


def _model_verdict(
    make: Callable[[int], Any], criteria: Sequence[Criterion], given: tuple, steps: int, seeds: Sequence[int]
) -> Verdict:
    refusal = _refusal(make, "a function that takes a seed", callable) or _refusal(*given)
    if refusal is not None:
        return refusal
    try:
        rows = [_numbers(make, criteria, steps, seed) for seed in seeds]
    except Exception as error:  # every error of a learner becomes a sentence
        return Verdict(False, in_words(error))
    return verdict_on(criteria, list(zip(*rows, strict=True)), seeds)


def _numbers(make: Callable[[int], Any], criteria: Sequence[Criterion], steps: int, seed: int) -> list[float | None]:
    outcome = make(seed)
    if is_missing(outcome):
        raise ValueError(f"it returned {outcome}; return what you made")
    if not isinstance(outcome, Mapping):
        _run(outcome, steps)
    return [criterion.number_of(outcome) for criterion in criteria]


def _run(model: Any, steps: int) -> None:
    """Run a model; an error names its robots by their places among the robots, where unique_ids count all agents."""
    try:
        model.run(steps)
    except SwarmError as error:
        ids = [robot.unique_id for robot in getattr(model, "robots", ())]

        def place(named: re.Match[str]) -> str:
            number = int(named[1])
            return f"robot {ids.index(number) + 1} of {len(ids)}" if number in ids else named[0]

        raise SwarmError(re.sub(r"\brobot (\d+)\b", place, str(error))) from error


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

    def make(seed: int) -> SwarmModel:
        model = world(seed)
        model.control = Subsumption(*above, _layer(rule), *below)
        return model

    given = rule, "a function of me with @behaviour, or a layer such as Avoid()", _is_rule
    return _hinted(_model_verdict(make, criteria, given, steps, seeds), hint)


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
    >>> from mesa_swarm.gallery import find_model
    >>> print(check_settings(find_model("boids"), {"memry": 5}, Criterion("alignment", at_least=0), only=["memory"]))
    Not yet. Unknown parameter 'memry'; did you mean 'memory'? known: memory.
    """
    known = [name for name in parameters_of(model) if not only or name in only]
    verdict = _settings_refusal(settings, known) or _model_verdict(
        lambda rng: model(**settings, rng=rng), criteria, (GIVEN, "", None), steps, seeds
    )
    return _hinted(verdict, hint)


def _settings_refusal(settings: Any, known: Sequence[str]) -> Verdict | None:
    if is_missing(settings) or (isinstance(settings, Mapping) and any(map(is_missing, settings.values()))):
        return Verdict(False, NO_ANSWER)
    if not isinstance(settings, Mapping):
        return _refused(settings, f"settings by name, such as dict({known[0]}=...)")
    unknown = [name for name in settings if name not in known]
    return Verdict(False, unknown_name("parameter", unknown[0], known)) if unknown else None


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
    return _hinted(verdict, hint)


def _is_number(guess: Any) -> bool:
    return not isinstance(guess, str | bool) and math.isfinite(float(guess))


def _estimate_verdict(
    expected: float, run: Callable[[int], float], within: float, what: str, seeds: Sequence[int]
) -> Verdict:
    measured = np.array([run(seed) for seed in seeds], dtype=float)
    text = (
        f"you expected {shown(expected)} for {what}; the mean of {seeds_in_words(seeds)} is {shown(measured.mean())} "
        f"({shown(measured.min())} to {shown(measured.max())}); required: within {within:g}"
    )
    near = bool(abs(expected - measured.mean()) <= within + _rounding(within))
    return Verdict(near, f"  {text}" if near else text)


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
    return _hinted(refusal or _function_verdict(function, twin, inputs, tolerance, seeds), hint)


def _function_verdict(
    function: Callable[..., Any],
    twin: Callable[..., Any],
    inputs: Callable[[int], tuple],
    tolerance: float,
    seeds: Sequence[int],
) -> Verdict:
    for seed in seeds:
        expected = twin(*inputs(seed))
        try:
            got = function(*inputs(seed))
            same = not is_missing(got) and np.shape(got) == np.shape(expected)
            same = same and np.allclose(got, expected, rtol=0, atol=tolerance, equal_nan=True)
        except Exception as error:  # every error of a learner becomes a sentence
            return Verdict(False, in_words(error))
        if not same:
            text = f"it returned {_short(got)} where {_short(expected)} was expected, with {seeds_in_words([seed])}"
            return Verdict(False, text)
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
