"""What the commands list, run, compare and dashboard do with what was typed."""

from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.compare import LEDGER, run_plan
from mesa_swarm.experiments.plan import checked_plan
from mesa_swarm.experiments.pool import checked_jobs
from mesa_swarm.experiments.run_records import filled_in
from mesa_swarm.files import check_writable
from mesa_swarm.gallery import description, find_model, model_names
from mesa_swarm.parameters import parameters_of, parsed_settings


def list_models() -> None:
    """Print every model with its parameters and their defaults."""
    for name in model_names():
        model_class = find_model(name)
        print(f"{name}\n    {description(model_class)}")
        for parameter in parameters_of(model_class).values():
            setting = f"{parameter.name}={in_brief(parameter.default)}"
            print(f"      {setting:28} {parameter.help}".rstrip())


def run(
    model: str,
    settings: Sequence[str],
    *,
    steps: int,
    rng: int,
    progress: bool,
    record: Path | None = None,
    force: bool = False,
) -> None:
    """Run a model, record it if asked, and print what came of it."""
    model_class = find_model(model)
    record = record and Path(filled_in(str(record), model, rng))
    built = model_class(**parsed_settings(model_class, settings), rng=rng)
    with built.record(record, overwrite=force) if record else nullcontext():
        try:
            built.run(steps, progress=progress)
        except KeyboardInterrupt:
            if record:
                print(f"{built.completed} steps are kept in {record}")
            raise
    results = built.results() if hasattr(built, "results") else {}
    print_pairs({"steps": built.steps, **results, "state hash": built.state_hash()})


def compare(
    model: str,
    settings: Sequence[str],
    *,
    parameter: str | None,
    values: str | None,
    seeds: int,
    steps: int | None,
    jobs: int,
    out: Path | None,
    progress: bool,
) -> None:
    """Check everything, do all runs, write the files, and print the table, the paths and the finding."""
    model_class = find_model(model)
    folder = check_writable(out or Path("results", f"compare_{model}"))
    workers = checked_jobs(jobs)
    plan = checked_plan(
        model_class,
        parameter=parameter,
        values=None if values is None else parsed_values(model_class, parameter, values),
        seeds=seeds,
        steps=steps,
        settings=parsed_settings(model_class, settings),
    )
    try:
        comparison = run_plan(plan, workers, progress, folder=folder)
    except KeyboardInterrupt:
        print(f"the runs so far are stored in {folder / LEDGER}; the same command goes on where this one stopped")
        raise
    paths = comparison.save(folder)
    if comparison.done_before:
        print(f"{comparison.done_before:,} of {len(comparison.runs):,} runs were done before, see {folder / LEDGER}")
    print("\n".join([comparison.table(), "", *map(str, paths), "", comparison.finding()]))


def parsed_values(model_class: type, parameter: str | None, values: str) -> list:
    """Return values that were typed with commas between them, as the parameter's type.

    Examples
    --------
    >>> parsed_values(find_model("fire_fighting"), "n_robots", "5, 10")
    [5, 10]
    """
    name = parameter or getattr(model_class, "compares", (None,))[0]
    if name is None:
        raise InvalidValueError("values are given without their parameter; give both")
    return [parsed_settings(model_class, [f"{name}={text.strip()}"])[name] for text in values.split(",")]


def dashboard(model: str, *, port: int, browser: bool, host: str, recordings: Path | None = None) -> None:
    """Serve the page, or say what it needs."""
    try:
        page = import_module("mesa_swarm.dashboard")
    except ModuleNotFoundError as error:
        raise InvalidValueError(
            f"the dashboard needs {error.name}; install it with: pip install 'mesa-swarm[dashboard]'"
        ) from error
    page.launch(model, port, browser, host, recordings)


def print_pairs(pairs: dict) -> None:
    """Print names and values in two columns.

    Examples
    --------
    >>> print_pairs({"steps": 10, "out at": None})
    steps   10
    out at  -
    """
    width = max(map(len, pairs))
    for name, value in pairs.items():
        print(f"{name:{width}}  {in_brief(value)}")


def in_brief(value: object) -> str:
    """Return a value as a user would write it.

    Examples
    --------
    >>> in_brief(0.1 + 0.2), in_brief(None)
    ('0.3', '-')
    """
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
