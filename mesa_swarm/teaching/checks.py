"""Exercises that check themselves: run an answer over several seeds, and say what was expected and what came."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from mesa_swarm.control.behaviour import Behaviour, behaviour
from mesa_swarm.control.explore import Explore
from mesa_swarm.control.subsumption import Subsumption
from mesa_swarm.errors import unknown_name
from mesa_swarm.model import SwarmModel
from mesa_swarm.parameters import parameters_of
from mesa_swarm.teaching.failures import in_words, is_missing, told
from mesa_swarm.teaching.verdict import Verdict, seeds_in_words, shown, verdict_on
from mesa_swarm.teaching.wish import Wish

# Not those that the notebooks show: an answer is to be good on seeds that it was not made for.
SEEDS = (101, 102, 103, 104, 105)
NO_ANSWER = "there is no answer so far; put yours where the dots are"


def check_model(
    make: Callable[[int], Any], *wishes: Wish, steps: int = 0, seeds: Sequence[int] = SEEDS, hint: str = ""
) -> Verdict:
    """Run what a function makes with several seeds, and say whether it does as asked.

    Parameters
    ----------
    make : callable
        Takes a seed; returns a SwarmModel, which is then run, or a mapping of numbers by name.
    *wishes : Wish
        What is asked.
    steps : int
        That each model is run.
    seeds : sequence of int
    hint : str
        Said if the answer does not pass.

    Examples
    --------
    >>> check_model(lambda rng: {"seed": rng}, Wish("seed", at_most=4), seeds=[3, 4])
    Well done: what was asked for came.
      seed: at most 4 was asked for; with seeds 3 and 4 came 3, 4: as asked with all 2 seeds
    """
    if is_missing(make):
        return Verdict(False, NO_ANSWER, hint)
    if not callable(make):
        return Verdict(False, told("your answer", make, "a function that takes a seed"), hint)
    try:
        rows = [_numbers(make, wishes, steps, seed) for seed in seeds]
    except Exception as error:  # whatever it is, a learner is told in words
        return Verdict(False, in_words(error), hint)
    return verdict_on(wishes, list(zip(*rows, strict=True)), seeds, hint)


def _numbers(make: Callable[[int], Any], wishes: Sequence[Wish], steps: int, seed: int) -> list[float | None]:
    outcome = make(seed)
    if is_missing(outcome):
        raise ValueError(f"it returned {outcome}; return what you made")
    if not isinstance(outcome, Mapping):
        outcome.run(steps)
    return [wish.number_of(outcome) for wish in wishes]


def check_rule(
    rule: Any,
    *wishes: Wish,
    world: Callable[[int], Any],
    above: Sequence = (),
    below: Sequence = (Explore(),),
    steps: int = 1_000,
    seeds: Sequence[int] = SEEDS,
    hint: str = "",
) -> Verdict:
    """Let robots follow a rule in several worlds, and say whether they do as asked.

    Parameters
    ----------
    rule : function of me, or layer
    *wishes : Wish
    world : callable
        Takes a seed; returns a model with robots and no control.
    above, below : sequences of layers
        What has its say before the rule, and what drives robots that the rule leaves alone.
    steps, seeds, hint
        See `check_model`.

    Examples
    --------
    >>> from mesa_swarm.model import SwarmModel
    >>> from mesa_swarm.robots.design import AGENT3
    >>> def world(rng):
    ...     model = SwarmModel(rng=rng)
    ...     model.add_robots(AGENT3, 2)
    ...     return model
    >>> print(check_rule(..., Wish("total_collisions", at_most=0), world=world))
    Not yet. There is no answer so far; put yours where the dots are.
    """
    if is_missing(rule):
        return Verdict(False, NO_ANSWER, hint)

    def make(seed: int) -> SwarmModel:
        model = world(seed)
        model.control = Subsumption(*above, _layer(rule), *below)
        return model

    return check_model(make, *wishes, steps=steps, seeds=seeds, hint=hint)


def _layer(rule: Any) -> Any:
    is_plain = callable(rule) and not isinstance(rule, Behaviour) and not hasattr(rule, "decide")
    return behaviour(rule) if is_plain else rule


def check_settings(
    model: Callable[..., Any],
    settings: Mapping[str, Any],
    *wishes: Wish,
    only: Sequence[str] = (),
    steps: int = 1_000,
    seeds: Sequence[int] = SEEDS,
    hint: str = "",
) -> Verdict:
    """Run a model with a learner's settings, and say whether it does as asked.

    Parameters
    ----------
    model : type or function
        Of the gallery, one of your own, or a function that makes one; with keyword-only parameters and `rng`.
    settings : mapping
        Its parameters by name.
    *wishes : Wish
    only : sequence of str
        The parameters that may be set; any of them by default.
    steps, seeds, hint
        See `check_model`.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> print(check_settings(find_model("boids"), {"memry": 5}, Wish("alignment", at_least=0), only=["memory"]))
    Not yet. Unknown parameter 'memry'; did you mean 'memory'? known: memory.
    """
    if is_missing(settings) or (isinstance(settings, Mapping) and any(map(is_missing, settings.values()))):
        return Verdict(False, NO_ANSWER, hint)
    known = [name for name in parameters_of(model) if not only or name in only]
    if not isinstance(settings, Mapping):
        return Verdict(False, told("your answer", settings, f"settings by name, such as dict({known[0]}=...)"), hint)
    for name in settings:
        if name not in known:
            return Verdict(False, unknown_name("parameter", name, known), hint)
    return check_model(lambda rng: model(**settings, rng=rng), *wishes, steps=steps, seeds=seeds, hint=hint)


def check_estimate(
    guess: float,
    run: Callable[[int], float],
    *,
    within: float,
    what: str = "the mean",
    seeds: Sequence[int] = SEEDS,
    hint: str = "",
) -> Verdict:
    """Compare a number that a learner expects with the mean over several seeds.

    Parameters
    ----------
    guess : float
    run : callable
        Takes a seed, returns the number that came.
    within : float
        The guess passes if it is as near as this to the mean.
    what : str
        What is guessed, in words.
    seeds, hint
        See `check_model`.

    Examples
    --------
    >>> check_estimate(3, float, within=1, what="it", seeds=[1, 2])
    Not yet. You expected 3 for it, and 1.5 came in the mean of seeds 1 and 2, from 1 to 2; within 1 is near enough.
    """
    if is_missing(guess):
        return Verdict(False, NO_ANSWER, hint)
    try:
        wanted, came = float(guess), np.array([run(seed) for seed in seeds], dtype=float)
    except (TypeError, ValueError):
        return Verdict(False, told("your answer", guess, "a number"), hint)
    if not np.isfinite(wanted):
        return Verdict(False, told("your answer", guess, "a number"), hint)
    text = (
        f"you expected {shown(wanted)} for {what}, and {shown(came.mean())} came in the mean of "
        f"{seeds_in_words(seeds)}, from {shown(came.min())} to {shown(came.max())}; within {within:g} is near enough"
    )
    near = bool(abs(wanted - came.mean()) <= within)
    return Verdict(near, f"  {text}" if near else text, hint)


def check_function(
    function: Callable[..., Any],
    twin: Callable[..., Any],
    inputs: Callable[[int], tuple],
    *,
    tolerance: float = 1e-6,
    seeds: Sequence[int] = SEEDS,
    hint: str = "",
) -> Verdict:
    """Compare a learner's function with one that is right, on several inputs.

    Parameters
    ----------
    function, twin : callable
    inputs : callable
        Takes a seed, returns the arguments.
    tolerance : float
        By which numbers may differ.
    seeds, hint
        See `check_model`.

    Examples
    --------
    >>> check_function(lambda x: x * x, lambda x: x + x, lambda seed: (seed,), seeds=[2, 3])
    Not yet. It returned 9 where 6 was expected, with seed 3.
    """
    if is_missing(function):
        return Verdict(False, NO_ANSWER, hint)
    if not callable(function):
        return Verdict(False, told("your answer", function, "a function"), hint)
    for seed in seeds:
        expected = twin(*inputs(seed))
        try:
            got = function(*inputs(seed))
            same = not is_missing(got) and np.shape(got) == np.shape(expected)
            same = same and np.allclose(got, expected, rtol=0, atol=tolerance, equal_nan=True)
        except Exception as error:  # whatever it is, a learner is told in words
            return Verdict(False, in_words(error), hint)
        if not same:
            text = f"it returned {_short(got)} where {_short(expected)} was expected, with {seeds_in_words([seed])}"
            return Verdict(False, text, hint)
    return Verdict(True, f"  it returned what was expected with {seeds_in_words(seeds)}")


def _short(value: Any) -> str:
    if value is None:
        return "None"
    try:
        numbers = np.asarray(value, dtype=float)
        return f"{numbers:.6g}" if numbers.ndim == 0 else np.array2string(numbers, precision=4, threshold=6)
    except (TypeError, ValueError):
        return repr(value)[:60]
