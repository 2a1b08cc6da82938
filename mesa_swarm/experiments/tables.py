"""Tables as text and CSV, and the finding in one sentence."""

import csv
import io
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, groupby, zip_longest
from pathlib import Path
from textwrap import wrap
from typing import Any

from mesa_swarm.base.files import check_writable, write_all
from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.plan import PairedRuns
from mesa_swarm.experiments.reports import LEFT_OUT, OF, notes_on_rows
from mesa_swarm.experiments.statistics import (
    FEWEST,
    TIME,
    Interval,
    Summary,
    bootstrap_mean,
    known,
    pair_differences,
    summarised,
    superiority,
)

WIDEST = 100
GAP = "  "
# First cells of at most this width stay beside the others in a narrow table, whose columns have at least `LEAST`.
SHORT, LEAST = 12, 3
# Numbers from here on, and smaller ones, are written with a power of ten.
LARGEST, SMALLEST = 1e15, 1e-5


class Study:
    """What many runs show: a table, a finding, and the files that are written of them."""

    __slots__ = ()

    def __repr__(self) -> str:
        return "\n\n".join(filter(None, [self.table(), self.finding()]))

    def table(self, width: int = WIDEST) -> str:
        """Return the numbers as text, at most `width` columns wide."""
        raise NotImplementedError

    def finding(self) -> str:
        """Return the finding in one sentence, empty where there is none."""
        return ""

    def _texts(self) -> dict[str, str]:
        """Return tables and texts by the names of their files."""
        raise NotImplementedError

    def _pictures(self) -> dict[str, bytes]:
        """Return pictures by the names of their files."""
        raise NotImplementedError

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write tables and pictures, all of them or none, and return their paths.

        If a picture cannot be drawn, the tables are written without any, all of them or none, before that error is
        raised: the runs may have taken hours.

        Raises
        ------
        InvalidValueError
            If the folder cannot be written to.
        """
        place, texts = check_writable(folder), self._texts()
        try:
            pictures = self._pictures()
        except Exception:
            write_all(place, texts)
            raise
        return write_all(place, {**texts, **pictures})


@dataclass(frozen=True, slots=True)
class Row:
    """One measure under one value of the parameter, compared with the first value if it is another.

    The difference is over the `pairs` of seeds on which both happened. `larger` is the share of the `ranked` seeds on
    which it was larger than under the first value, ties half: see `superiority`.
    """

    measure: str
    value: Any
    summary: Summary
    difference: Interval | None = None
    pairs: int = 0
    larger: Interval | None = None
    ranked: int = 0


def summary_rows(comparison: PairedRuns) -> list[Row]:
    """Return a row for each measure and value, in order."""
    values = comparison.plan.values
    return [
        _row(measure, value, comparison.column(values[0], measure), comparison.column(value, measure), i > 0)
        for measure in comparison.measures
        for i, value in enumerate(values)
    ]


def _row(measure: str, value: Any, base: Sequence, column: Sequence, compared: bool) -> Row:
    if not compared:
        return Row(measure, value, summarised(column))
    differences = pair_differences(base, column)
    larger, ranked = superiority(base, column, times=measure.endswith(TIME))
    return Row(measure, value, summarised(column), bootstrap_mean(differences), len(differences), larger, ranked)


def text_table(comparison: PairedRuns, width: int = WIDEST) -> str:
    """Return the summary as aligned text, at most `width` columns wide."""
    plan = comparison.plan
    seeds = len(plan.seeds)
    title = f"{plan.model_class.__name__}: {quantity(seeds, 'paired seed')}, at most {plan.steps:,} steps each"
    cells, notes = table_and_notes(comparison)
    around = [wrap(line, width) for line in (title, *notes)]
    return "\n".join([*around[0], "", *fitting(cells, width), "", *chain(*around[1:])])


def table_and_notes(comparison: PairedRuns) -> tuple[list[list[str]], list[str]]:
    """Return the cells of the summary, line by line with the header first, and notes on how to read them."""
    plan, rows = comparison.plan, summary_rows(comparison)
    some_missing = any(row.summary.happened < row.summary.runs for row in rows)
    first = plan.values[0]
    header = ["", plan.parameter, "in runs", "mean [95 %]", f"minus {first} [95 %]", "larger on [95 %]"]
    cells = [header, *(_cells(row, row.value == first) for row in rows)]
    columns = [0, 1, 2, 3, 4, 5] if some_missing else [0, 1, 3, 4, 5]
    notes = [*_notes(rows, first, some_missing), *notes_on_rows(comparison.left_out)]
    return [[line[c] for c in columns] for line in cells], notes


def _notes(rows: list[Row], first: Any, some_missing: bool) -> list[str]:
    notes = [
        f"Means, and differences from {first} on the same seeds: bootstrap (BCa) over seeds.",
        f"larger on: the share of seeds on which it was larger than with {first}, ties half: Wilson.",
    ]
    if some_missing:
        notes.insert(0, "in runs: the number in which it occurred, share by Wilson; means are over those.")
        notes[1] = f"Differences from {first}: over seeds on which it occurred with both. Bootstrap (BCa)."
        notes.append("A time ('... at') that did not occur is larger than any; other missing values are left out.")
    if any(0 < n < FEWEST for row in rows for n in (row.summary.happened, row.pairs)):
        notes.append(f"Means and differences of fewer than {FEWEST} have no interval.")
    return notes


def _cells(row: Row, first: bool) -> list[str]:
    summary = row.summary
    share = f"{summary.happened}/{summary.runs} [{percent(summary.share)}]"
    return [
        row.measure[:WIDEST] if first else "",
        str(row.value)[:16],
        share,
        with_limits(summary.mean),
        "" if row.difference is None else _difference(row, row.difference),
        "" if row.larger is None else _larger(row.larger),
    ]


def _difference(row: Row, difference: Interval) -> str:
    counted = f" ({quantity(row.pairs, 'pair')})" if 0 < row.pairs < row.summary.runs else ""
    return with_limits(difference, signed=True) + counted


def _larger(share: Interval) -> str:
    return "-" if math.isnan(share.estimate) else f"{100 * share.estimate:.0f} % [{percent(share)}]"


def percent(share: Interval) -> str:
    """Return the limits of a share."""
    return f"{100 * share.low:.0f}-{100 * share.high:.0f} %"


def with_limits(interval: Interval, signed: bool = False) -> str:
    """Return an estimate with its limits, all with digits according to the width of the interval.

    Examples
    --------
    >>> with_limits(Interval(12.34, 11.02, 13.66)), with_limits(Interval(1e300, math.nan, math.nan))
    ('12.3 [11.0, 13.7]', '1e+300')
    """
    if math.isnan(interval.estimate):
        return "-"
    sign = "+" if signed else ""
    numbers = (interval.estimate, interval.low, interval.high)
    form = f",.{_digits(interval)}f" if _is_usual(numbers) else ".4g"
    number, low, high = (f"{x + 0.0:{sign}{form}}" for x in numbers)
    return number if math.isnan(interval.low) else f"{number} [{low}, {high}]"


def _is_usual(numbers: Iterable[float]) -> bool:
    """Return whether numbers can be written with six decimals and without a power of ten."""
    sizes = [abs(number) for number in numbers if not math.isnan(number)]
    return max(sizes) < LARGEST and (max(sizes) >= SMALLEST or max(sizes) == 0)


def _digits(interval: Interval) -> int:
    """Return how many decimals show two digits of the half width, or three of a number without one."""
    half = (interval.high - interval.low) / 2
    if not half > 0 and interval.estimate == round(interval.estimate):
        return 0
    size, kept = (abs(interval.estimate), 2) if math.isnan(half) or half == 0 else (half, 1)
    if size == 0:
        return 0
    return min(max(kept - math.floor(math.log10(size)), 0), 6)


def aligned(table: list[list[str]]) -> list[str]:
    """Return rows of cells as lines with straight columns, a rule below the first."""
    widths = [max(len(row[c]) for row in table) for c in range(len(table[0]))]
    lines = [GAP.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table]
    return [lines[0], "-" * (sum(widths) + len(GAP) * (len(widths) - 1)), *lines[1:]]


def fitting(table: list[list[str]], width: int | None = WIDEST) -> list[str]:
    r"""Return aligned rows of at most this width, None for any.

    If they are too wide, long first cells go on lines of their own, cells have several lines, and if that is not
    enough, columns go into further tables below. A number or a word is broken only if it is wider than the width.

    Examples
    --------
    >>> print("\n".join(fitting([["dial", "score [95 %]"], ["0.5", "12.3 [11.0, 13.6]"]], width=14)))
    dial  score
          [95 %]
    ------------
    0.5   12.3
          [11.0,
          13.6]
    """
    lines = aligned(table)
    if width is None or len(lines[1]) <= width:
        return lines
    if max(len(row[0]) for row in table) <= SHORT:
        return _in_parts(table, [[] for _ in table], width)
    names = [wrap(row[0], width) for row in table]
    return _in_parts([["", *row[1:]] for row in table], names, width)


def _in_parts(table: list[list[str]], above: list[list[str]], width: int) -> list[str]:
    """Return narrow tables below each other, each with the first column; `above` are lines over the rows."""
    edge = " " if any(above) else ""
    found: list[str] = []
    for columns in _columns_that_fit(table, width - len(edge)):
        rows = _narrow_rows([[row[c] for c in columns] for row in table], width - len(edge))
        header, *body = ([*name, *(edge + line for line in row)] for name, row in zip(above, rows, strict=True))
        rule = "-" * max(len(line) for row in (header, *body) for line in row)
        found += [*([""] if found else []), *header, rule, *chain(*body)]
    return found


def _columns_that_fit(table: list[list[str]], width: int) -> Iterable[list[int]]:
    """Yield the columns of each part, the first one in all of them."""
    least = _longest_words(table)
    part = [0]
    for c in range(1, len(least)):
        if len(part) > 1 and sum(least[i] + len(GAP) for i in part) + least[c] > width:
            yield part
            part = [0]
        part.append(c)
    yield part


def _narrow_rows(table: list[list[str]], width: int) -> list[list[str]]:
    """Return the lines of each row, the widest columns made narrower until all fit, words whole as long as possible."""
    widths, least = [max(map(len, column)) for column in zip(*table, strict=True)], _longest_words(table)
    while sum(widths) + len(GAP) * (len(widths) - 1) > width and max(widths) > LEAST:
        widths[max(range(len(widths)), key=lambda c: (widths[c] > least[c], widths[c]))] -= 1
    found = []
    for row in table:
        cells = [_in_lines(cell, max(w, 1)) for cell, w in zip(row, widths, strict=True)]
        lines = zip_longest(*cells, fillvalue="")
        found.append([GAP.join(part.ljust(w) for part, w in zip(one, widths, strict=True)).rstrip() for one in lines])
    return found


def _longest_words(table: list[list[str]]) -> list[int]:
    columns = zip(*table, strict=True)
    return [max(len(word) for cell in column for word in _in_lines(cell, 1, whole=True)) for column in columns]


def _in_lines(cell: str, width: int, *, whole: bool = False) -> list[str]:
    """Return a cell as lines, of `whole` words or not; a number stays with its unit if there is room for both."""
    together = wrap(
        cell.replace(" %", "\N{NO-BREAK SPACE}%"), width, break_long_words=not whole, break_on_hyphens=not whole
    )
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in together] or [""]


def markdown_fitting(text: str, width: int | None) -> list[str]:
    r"""Return the lines of a page whose Markdown tables are made to fit; None leaves the page as it is.

    Examples
    --------
    >>> markdown_fitting("a page\n\n| a | b |\n|---|---|\n| long | 1 |", 20)
    ['a page', '', 'a     b', '-------', 'long  1']
    """
    if width is None:
        return text.splitlines()
    found: list[str] = []
    for is_table, group in groupby(text.splitlines(), lambda line: line.startswith("|")):
        if is_table:
            rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in group]
            found += fitting([rows[0], *rows[2:]], width)
        else:
            found += chain(*(wrap(line, width) or [""] for line in group))
    return found


def runs_csv(comparison: PairedRuns) -> str:
    """Return one line per run: value, seed, steps, state hash and every measure, empty where it did not occur.

    If rows of a report are missing in any run, their number is a further column; so are, where the plan has them, what
    ended a run and the key of its series.
    """
    plan, runs = comparison.plan, comparison.runs
    names = dict.fromkeys([*comparison.measures, *(f"{LEFT_OUT}{OF}{name}" for name in comparison.left_out)])
    columns: dict[str, Iterable] = {
        plan.parameter: [run.value for run in runs],
        **{name: [getattr(run, name) for run in runs] for name in ("rng", "steps", "state_hash")},
        **{name: [run.numbers[name] for run in runs] for name in names},
    }
    if plan.until is not None:
        columns["ended_by"] = [run.ended_by for run in runs]
    if plan.series is not None:
        columns["run"] = [run.key for run in plan.runs(keyed=True)]
    return csv_text([columns, *zip(*columns.values(), strict=True)])


def summary_csv(rows: list[Row]) -> str:
    """Return one line per measure and value, with all limits."""
    header = ["measure", "value", "runs", "happened", "share", "share_low", "share_high"]
    header += ["mean", "mean_low", "mean_high", "pairs", "difference", "difference_low", "difference_high"]
    header += ["ranked", "larger", "larger_low", "larger_high"]
    return csv_text([header, *map(_numbers, rows)])


def _numbers(row: Row) -> list:
    summary = row.summary
    share, mean, difference, larger = map(_triple, (summary.share, summary.mean, row.difference, row.larger))
    counts = [row.measure, row.value, summary.runs, summary.happened]
    return [*counts, *share, *mean, row.pairs, *difference, row.ranked, *larger]


def _triple(interval: Interval | None) -> tuple:
    return (None,) * 3 if interval is None else tuple(map(known, (interval.estimate, interval.low, interval.high)))


def csv_text(lines: Iterable[Iterable]) -> str:
    """Return rows as CSV; None is an empty field."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


ONE_SEED = "inconclusive with one seed"


def finding(comparison: PairedRuns) -> str:
    """Return the finding in one sentence.

    About the model's ``headline``, an event (a measure that is None where it did not occur, and the words for
    it), if it has one; else about its first measure.
    """
    measure, words = getattr(comparison.plan.model_class, "headline", ("", ""))
    if measure in comparison.measures:
        return _about_event(comparison, measure, words)
    return _about_number(comparison, comparison.measures[0])


def _about_event(comparison: PairedRuns, measure: str, words: str) -> str:
    plan = comparison.plan
    shares = {value: summarised(comparison.column(value, measure)) for value in plan.values}
    order = sorted(plan.values, key=lambda value: -shares[value].happened)
    texts = [
        _share_text(plan.parameter, value, shares[value], words if i == 0 else "") for i, value in enumerate(order)
    ]
    best, worst = shares[order[0]], shares[order[-1]]
    clear = not best.share.meets(worst.share)
    verdict = "no difference" if best.happened == worst.happened else _verdict(len(plan.seeds), clear)
    extremes = _chosen(len(order))
    return f"{', '.join(texts)}: {verdict}{extremes}{_most_different(comparison, measure, order)}."


def _share_text(parameter: str, value: Any, summary: Summary, words: str) -> str:
    count = f"in {summary.happened} of {summary.runs} runs (95 % interval {percent(summary.share)})"
    if words:
        return f"With {parameter} {value} the swarm {words} {count}"
    return f"with {value} in {summary.happened} of {summary.runs} ({percent(summary.share)})"


def _most_different(comparison: PairedRuns, headline: str, order: list) -> str:
    """Return the other event whose share differs most between the best and the worst value, in words."""
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


def _about_number(comparison: PairedRuns, measure: str) -> str:
    plan = comparison.plan
    means = {value: summarised(comparison.column(value, measure)).mean for value in plan.values}
    known = [value for value in plan.values if means[value].estimate == means[value].estimate]
    if len(known) < 2:
        return f"{measure} occurred with fewer than two of the values of {plan.parameter}: nothing to compare."
    low, high = (pick(known, key=lambda value: means[value].estimate) for pick in (min, max))
    if low == high:
        return f"{measure} was {with_limits(means[low])} with every {plan.parameter}: no difference."
    return (
        f"{measure} was {with_limits(means[high])} with {plan.parameter} {high} "
        f"and {with_limits(means[low])} with {low}, {_difference_text(comparison, measure, low, high)}"
        f"{_chosen(len(plan.values))}."
    )


def _difference_text(comparison: PairedRuns, measure: str, low: Any, high: Any) -> str:
    """Return the difference of a measure between two values in words, on how many seeds, and whether it is clear."""
    columns = comparison.column(low, measure), comparison.column(high, measure)
    differences = pair_differences(*columns)
    mean = bootstrap_mean(differences)
    larger, seeds = superiority(*columns, times=measure.endswith(TIME))
    times = "later" if measure.endswith(TIME) else "larger"
    share = f"{100 * larger.estimate:.0f} % of {seeds} seeds ({percent(larger)})"
    return (
        f"a difference of {with_limits(mean)} over {len(differences)} paired seeds, {times} with {high} on {share}: "
        f"{_verdict(len(differences), mean.excludes_zero)}"
    )


def _verdict(seeds: int, clear: bool) -> str:
    if seeds < 2:
        return ONE_SEED
    if seeds < FEWEST and not clear:
        return f"inconclusive with {seeds} seeds, {FEWEST} are required"
    return "a clear difference" if clear else "inconclusive with these seeds"


def _chosen(values: int) -> str:
    return f" (highest and lowest of {values})" if values > 2 else ""
