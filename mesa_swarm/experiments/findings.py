"""One sentence that says what a comparison found, no more than its intervals bear out."""

from typing import TYPE_CHECKING, Any

from mesa_swarm.experiments.statistics import (
    FEWEST,
    TIME,
    Summary,
    bootstrap_mean,
    pair_differences,
    summarised,
    superiority,
)
from mesa_swarm.experiments.tables import in_words, percent

if TYPE_CHECKING:  # compare imports this module
    from mesa_swarm.experiments.compare import Comparison

ONE_SEED = "one seed says nothing about others"


def finding(comparison: "Comparison") -> str:
    """Return what was found, in one sentence.

    About the model's ``headline``, an event (a measure that is None where it did not happen, and the words for
    it), if it has one; else about its first measure.

    Parameters
    ----------
    comparison : Comparison
    """
    measure, words = getattr(comparison.plan.model_class, "headline", ("", ""))
    if measure in comparison.measures:
        return _about_event(comparison, measure, words)
    return _about_number(comparison, comparison.measures[0])


def _about_event(comparison: "Comparison", measure: str, words: str) -> str:
    plan = comparison.plan
    shares = {value: summarised(comparison.column(value, measure)) for value in plan.values}
    order = sorted(plan.values, key=lambda value: -shares[value].happened)
    texts = [
        _share_text(plan.parameter, value, shares[value], words if i == 0 else "") for i, value in enumerate(order)
    ]
    best, worst = shares[order[0]], shares[order[-1]]
    clear = not best.share.meets(worst.share)
    verdict = "no difference was seen" if best.happened == worst.happened else _verdict(len(plan.seeds), clear)
    extremes = _chosen(len(order))
    return f"{', '.join(texts)}: {verdict}{extremes}{_most_different(comparison, measure, order)}."


def _share_text(parameter: str, value: Any, summary: Summary, words: str) -> str:
    count = f"in {summary.happened} of {summary.runs} runs (95 % interval {percent(summary.share)})"
    if words:
        return f"With {parameter} {value} the swarm {words} {count}"
    return f"with {value} in {summary.happened} of {summary.runs} ({percent(summary.share)})"


def _most_different(comparison: "Comparison", headline: str, order: list) -> str:
    """Name the other event whose share differs most between the best and the worst value."""
    best, worst = order[0], order[-1]
    counts = {
        measure: tuple(summarised(comparison.column(value, measure)).happened for value in (best, worst))
        for measure in comparison.measures
        if measure != headline and None in comparison.column(best, measure) + comparison.column(worst, measure)
    }
    measure = max(counts, key=lambda name: abs(counts[name][0] - counts[name][1]), default=None)
    if measure is None or counts[measure][0] == counts[measure][1]:
        return ""
    what, (more, fewer) = measure.removesuffix(" at"), counts[measure]
    return f"; most different is {what!r}: in {more} runs with {best}, in {fewer} with {worst}"


def _about_number(comparison: "Comparison", measure: str) -> str:
    plan = comparison.plan
    means = {value: summarised(comparison.column(value, measure)).mean for value in plan.values}
    seen = [value for value in plan.values if means[value].estimate == means[value].estimate]
    if len(seen) < 2:
        return f"{measure} happened with fewer than two of the values of {plan.parameter}: nothing to compare."
    low, high = (pick(seen, key=lambda value: means[value].estimate) for pick in (min, max))
    if low == high:
        return f"{measure} was {in_words(means[low])} with every {plan.parameter}: no difference was seen."
    return (
        f"{measure} was {in_words(means[high])} with {plan.parameter} {high} and {in_words(means[low])} with {low}, "
        f"{_difference_text(comparison, measure, low, high)}{_chosen(len(plan.values))}."
    )


def _difference_text(comparison: "Comparison", measure: str, low: Any, high: Any) -> str:
    """Say by how much a measure is larger under one value than another, on how many seeds, and what that shows."""
    columns = comparison.column(low, measure), comparison.column(high, measure)
    differences = pair_differences(*columns)
    mean = bootstrap_mean(differences)
    larger, seeds = superiority(*columns, times=measure.endswith(TIME))
    times = "later" if measure.endswith(TIME) else "larger"
    share = f"{100 * larger.estimate:.0f} % of {seeds} seeds ({percent(larger)})"
    return (
        f"a difference of {in_words(mean)} over {len(differences)} paired seeds, {times} with {high} on {share}: "
        f"{_verdict(len(differences), mean.excludes_zero)}"
    )


def _verdict(seeds: int, clear: bool) -> str:
    if seeds < 2:
        return ONE_SEED
    if seeds < FEWEST and not clear:
        return f"{seeds} seeds are too few to tell which is larger"
    return "a clear difference" if clear else "these seeds do not settle which is larger"


def _chosen(values: int) -> str:
    return f" (highest and lowest of {values})" if values > 2 else ""
