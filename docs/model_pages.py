"""The page of each model: a recorded run, what `model_info` knows, measured results, and the description by ODD."""

import math
from collections.abc import Mapping, Sequence

from measure_models import REST, SEEDS, STEPS, settings_of, stored

from mesa_swarm import model_info
from mesa_swarm.experiments.statistics import TIME, Interval, summarised
from mesa_swarm.model.odd import odd

# Where the part that is folded begins, before which results stand.
FOLDED = "<details"


def model_page(name: str) -> str:
    """Return the page of a model as Markdown."""
    info = model_info(name)
    title, _, rest = info.markdown(level=1, command=info.command).partition("\n")
    before, _, after = rest.partition(FOLDED)
    described = f"## Description by the ODD protocol\n\n{odd(info, level=3)}"
    parts = (f"{title}\n\n<!-- recorded run: {name} -->", before.strip(), results(name), FOLDED + after, described)
    return "\n\n".join(parts)


def results(name: str) -> str:
    """Return the section with the measured results of a model, for its defaults and each of its presets."""
    values = stored()[name]
    labels = list(settings_of(name))
    measures = list(values[labels[0]])
    rows = [f"| {key} | {' | '.join(cell(key, values[label][key]) for label in labels)} |" for key in measures]
    head = [f"| measure | {' | '.join(labels)} |", "|---" * (len(labels) + 1) + "|"]
    return "\n".join([f"## Results\n\n{_caption(name, values)}\n", *head, *rows])


def _caption(name: str, values: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    text = (
        f"Seeds {SEEDS[0]} to {SEEDS[-1]} for each setting, {STEPS[name]:,} steps or until the model stops: means of "
        f"{len(SEEDS)} runs with 95 % intervals (bootstrap). Of an event: the number of runs in which it happened, "
        "with the interval of its share (Wilson), and the mean step in these runs. An interval around a mean of fewer "
        "than six runs is not known."
    )
    measures = {key for rows in values.values() for key in rows}
    if "share at rest" in measures:
        text += f" At rest: displaced by less than 10 units in the last {REST} steps."
    if "share colliding in a step" in measures:
        text += f" Colliding: the mean over the last {REST} steps."
    return f"{text} `python docs/measure_models.py {name}` measures this table again."


def cell(key: str, row: Sequence[float]) -> str:
    """Return one cell of the table."""
    summary = summarised([None if math.isnan(value) else value for value in row])
    mean = _shown(summary.mean)
    if key.endswith(TIME):
        runs = f"{summary.happened} of {summary.runs} runs [{summary.share.low:.0%}".removesuffix("%")
        return f"{runs} to {summary.share.high:.0%}]".replace("%", " %") + (f"; {mean}" if summary.happened else "")
    if not summary.happened:
        return "undefined"
    return mean if summary.happened == summary.runs else f"{mean} in {summary.happened} runs"


def _shown(interval: Interval) -> str:
    if math.isnan(interval.low):
        return _number(interval.estimate)
    return f"{_number(interval.estimate)} [{_number(interval.low)}, {_number(interval.high)}]"


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
