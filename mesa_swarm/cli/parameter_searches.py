"""Which parameters matter, and which values fit: sensitivity, calibrate."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.base.files import check_writable
from mesa_swarm.cli.options import (
    Jobs,
    Model,
    Quiet,
    Series,
    Settings,
    StepsOfRuns,
    Tables,
    Until,
    prepare,
    print_study,
    resumable,
)
from mesa_swarm.model.gallery import find_model, short_name

if TYPE_CHECKING:
    from mesa_swarm.experiments.sampling import Range

commands = typer.Typer()

Ranges = Annotated[
    list[str] | None,
    typer.Option(
        "--range",
        metavar="NAME=LOW:HIGH",
        help="Range of a parameter, NAME=LOW:HIGH:log for a logarithmic one, NAME=A,B,... for values; repeat it.",
    ),
]
Targets = Annotated[
    list[str] | None,
    typer.Option(metavar="MEASURE=VALUE", help="Target of a measure, MEASURE=VALUE:SCALE with a scale; repeat it."),
]
Missing = Annotated[
    list[str] | None,
    typer.Option(metavar="MEASURE=VALUE", help="What counts where a measure did not happen; repeat it."),
]
FreshRuns = Annotated[
    int, typer.Option(min=1, max=100_000, help="Runs of the best with seeds of their own; intervals need 6.")
]
DesignSeed = Annotated[int, typer.Option("--rng", min=0, max=2**31 - 1, help="Seed of the design or search.")]
Retry = Annotated[bool, typer.Option("--retry-failed", help="Repeat runs that ended in an error.")]
Results = Annotated[
    Path | None, typer.Option("--out", help="Folder of tables, picture and runs; in results/ by default.")
]


@commands.command("sensitivity")
def sensitivity_command(
    model: Model,
    *,
    ranges: Ranges = None,
    measure: Annotated[str, typer.Option(help="A result, or a report as 'mean of NAME'.")],
    method: Annotated[str, typer.Option(help="sobol: shares of the variance; morris: screening.")] = "sobol",
    points: Annotated[
        int, typer.Option(min=2, max=100_000, help="Base points of sobol, a power of two; trajectories of morris.")
    ] = 64,
    seeds: Annotated[int, typer.Option(min=1, max=100_000, help="Runs at each point.")] = 20,
    difference: Annotated[
        str | None, typer.Option(metavar="NAME=A,B", help="Measure B minus A on the same seed, of this parameter.")
    ] = None,
    missing: Annotated[float | None, typer.Option(help="What counts where the measure did not happen.")] = None,
    steps: StepsOfRuns = None,
    setting: Settings = None,
    rng: DesignSeed = 1,
    jobs: Jobs = -1,
    out: Results = None,
    retry_failed: Retry = False,
    until: Until = None,
    series: Series = None,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Measure how much a measure depends on each parameter (SALib); continue an interrupted call."""
    prepare()
    from mesa_swarm.searches import sensitivity as studies

    studies.need_salib()
    model_class = find_model(model)
    folder = check_writable(out or Path("results", f"sensitivity_{short_name(model)}_{method}"))
    own: dict[str, Any] = {"method": method, "points": points, "seeds": seeds, "missing": missing}
    own |= {"series": series or False, "tables": table or ()}
    if difference is not None:
        own["difference"] = _parsed_difference(model_class, difference)
    options = {"steps": steps, "rng": rng, "jobs": jobs, "retry_failed": retry_failed, "until": until, **own}
    study = _study(studies.sensitivity, model_class, ranges, measure, folder, setting, quiet, options)
    print_study(study, folder, [study.sweep.path, *study.sweep.written], finding=True)


@commands.command("calibrate")
def calibrate_command(
    model: Model,
    *,
    ranges: Ranges = None,
    target: Targets = None,
    points: Annotated[int, typer.Option(min=1, max=100_000, help="Points of the search.")] = 80,
    batch: Annotated[int, typer.Option(min=1, max=100_000, help="Points that are proposed at a time.")] = 8,
    seeds: Annotated[int, typer.Option(min=1, max=100_000, help="Runs at each point of the search.")] = 5,
    fresh: FreshRuns = 20,
    missing: Missing = None,
    steps: StepsOfRuns = None,
    setting: Settings = None,
    rng: DesignSeed = 1,
    jobs: Jobs = -1,
    out: Results = None,
    retry_failed: Retry = False,
    until: Until = None,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Search parameters at which measures are near their targets (Optuna); continue an interrupted call."""
    prepare()
    from mesa_swarm.experiments.run_tables import RunFiles, checked_forms
    from mesa_swarm.experiments.sweep import TABLE
    from mesa_swarm.searches import calibration as studies

    studies.need_optuna()
    model_class = find_model(model)
    folder = check_writable(out or Path("results", f"calibrate_{short_name(model)}"))
    if not target:
        raise InvalidValueError("no target is given; give at least one, such as --target 'fires out=7'")
    targets = {name: numbers[0] if len(numbers) == 1 else numbers for name, numbers in _numbers("target", target, 2)}
    absent = {name: number for name, (number,) in _numbers("missing", missing or [], 1)}
    own = {"points": points, "batch": batch, "seeds": seeds, "fresh": fresh, "missing": absent, "tables": table or ()}
    options = {"steps": steps, "rng": rng, "jobs": jobs, "retry_failed": retry_failed, "until": until, **own}
    study = _study(studies.calibrate, model_class, ranges, targets, folder, setting, quiet, options)
    forms = checked_forms(table or ())
    tables = [path for place in (folder, folder / studies.FRESH) for path in RunFiles(place, forms=forms).tables]
    print_study(study, folder, [folder / TABLE, *tables], finding=True)


def _study(
    search: Callable[..., Any],
    model_class: type,
    ranges: Sequence[str] | None,
    measured: Any,
    folder: Path,
    setting: Sequence[str] | None,
    quiet: bool,
    options: dict[str, Any],
) -> Any:
    """Return what a search makes of a model, ranges and what is measured; where it is interrupted it can continue."""
    from mesa_swarm.model.parameters import parse_settings

    settings = parse_settings(model_class, setting or ())
    with resumable(folder):
        ends = parsed_ranges(model_class, ranges)
        return search(model_class, ends, measured, settings=settings, out=folder, progress=not quiet, **options)


def parsed_ranges(model_class: type, texts: Sequence[str] | None) -> "dict[str, Range]":
    """Return the ranges that texts such as "k1=0.001:0.01" describe, as the parameters' types."""
    from mesa_swarm.experiments.sampling import Range
    from mesa_swarm.model.parameters import parse_settings

    if not texts:
        raise InvalidValueError("no range is given; give one for each parameter, such as --range n_robots=5:20")
    found: dict[str, Range] = {}
    for text in texts:
        name, _, described = text.partition("=")
        if name in found:
            raise InvalidValueError(f"range of {shortened(name)} is given twice; leave one out")
        ends, is_log = described.removesuffix(":log"), described.endswith(":log")
        separator = ":" if ":" in ends else ","
        if separator not in described or (separator == ":" and ends.count(":") != 1):
            raise InvalidValueError(
                f"range {shortened(text)} is unclear; expected NAME=LOW:HIGH, NAME=LOW:HIGH:log or NAME=A,B,..."
            )
        values = [parse_settings(model_class, [f"{name}={part.strip()}"])[name] for part in ends.split(separator)]
        found[name] = (
            Range(low=values[0], high=values[1], log=is_log) if separator == ":" else Range(values=tuple(values))
        )
    return found


def _parsed_difference(model_class: type, text: str) -> tuple[str, Any, Any]:
    """Return the parameter and the two values of a text such as "strategy=A,B"."""
    from mesa_swarm.model.parameters import parse_settings

    name, _, listed = text.partition("=")
    parts = [part.strip() for part in listed.split(",")]
    if len(parts) != 2:
        raise InvalidValueError(f"difference {shortened(text)} is unclear; expected NAME=A,B")
    first, second = (parse_settings(model_class, [f"{name}={part}"])[name] for part in parts)
    return name, first, second


def _numbers(option: str, texts: Sequence[str], most: int) -> list[tuple[str, list[float]]]:
    """Return names with numbers, of texts such as "fires out=7" and "fires out=7:2"."""
    found: list[tuple[str, list[float]]] = []
    for text in texts:
        name, _, listed = text.rpartition("=")
        try:
            numbers = [float(part) for part in listed.split(":")]
        except ValueError:
            numbers = []
        if not name or not 1 <= len(numbers) <= most:
            wanted = "MEASURE=VALUE or MEASURE=VALUE:SCALE" if most == 2 else "MEASURE=VALUE"
            raise InvalidValueError(f"{option} {shortened(text)} is unclear; expected {wanted}")
        if name in dict(found):
            raise InvalidValueError(f"{option} of {shortened(name)} is given twice; leave one out")
        found.append((name, numbers))
    return found
