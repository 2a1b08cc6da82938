"""Comparisons of given results, without runs."""

from mesa_swarm.experiments.compare import Comparison
from mesa_swarm.experiments.plan import ComparisonPlan, PairedOutcome


def plan_of(model_class, parameter, values, seeds, steps):
    """Return a plan that was not checked."""
    points = [{parameter: value} for value in values]
    how = {"seeds": seeds, "steps": steps, "parameter": parameter, "values": values}
    return ComparisonPlan(model_class=model_class, settings={}, points=points, **how)


def comparison_of(columns, model_class, parameter, steps=100):
    """Return a comparison whose results are given by value and measure, one a seed."""
    values = tuple(columns)
    seeds = range(1, 1 + len(next(iter(columns[values[0]].values()))))
    runs = []
    for rng in seeds:
        for value in values:
            results = {name: column[rng - 1] for name, column in columns[value].items()}
            runs.append(PairedOutcome(steps=steps, state_hash="hash", results=results, value=value, rng=rng))
    return Comparison(plan_of(model_class, parameter, values, seeds, steps), tuple(runs))
