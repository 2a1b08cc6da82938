"""The commands of the studies: reproduce, validate, learn-bench, bench; entry points (pyproject.toml)."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesa_swarm.base.files import check_apart, check_writable, checked_file, write_all
from mesa_swarm.cli.lines import print_lines, terminal_width
from mesa_swarm.cli.options import Folder, Jobs, Quiet, Tables, print_files, resumable
from mesa_swarm.errors import InvalidValueError, SwarmError, check_choice

if TYPE_CHECKING:
    from mesa_swarm_studies.benchmarks.learn_bench import Benchmark, Training
    from mesa_swarm_studies.laboratory import Laboratory
    from mesa_swarm_studies.registry import Item, Made

# Dots per inch of the pictures on a page, which are narrower than those that are stored.
ON_PAGES = 120


def bench(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="A few seconds, and rougher.")] = False,
    out: Folder = Path("results", "bench"),
) -> None:
    """Measure steps, starts, memory and many runs, beside goals, a bare C program and other simulators."""
    folder = check_writable(out)
    from mesa_swarm_studies.benchmarks.speed import report

    print_lines(report(folder, quick, terminal_width()))


def reproduce(
    *,
    figure: Annotated[list[str] | None, typer.Option(metavar="NUMBER", help="Such as 8.3 or task_allocation.")] = None,
    every: Annotated[bool, typer.Option("--all", help="All of the thesis, which is the default.")] = False,
    published: Annotated[bool, typer.Option("--published", help="All of published papers instead.")] = False,
    readings: Annotated[bool, typer.Option("--readings", help="How much depends on how one reads, instead.")] = False,
    names: Annotated[bool, typer.Option("--list", help="Only list them.")] = False,
    contents: Annotated[bool, typer.Option("--items", help="List what the thesis contains, with its state.")] = False,
    out: Folder = Path("results", "reproduction"),
    quick: Annotated[bool, typer.Option("--quick", help="A trial: few seeds, short runs, other files.")] = False,
    jobs: Jobs = -1,
    report: Annotated[Path | None, typer.Option(metavar="FILE.md", help="Write a page of the results.")] = None,
    quiet: Quiet = False,
) -> None:
    """Reproduce results of the thesis or of papers, each with a verdict; continue an interrupted call."""
    options = {
        "--all": every, "--published": published, "--readings": readings, "--figure": figure, "--items": contents
    }  # fmt: skip
    given = [name for name, used in options.items() if used]
    if len(given) > 1:
        raise InvalidValueError(f"{' and '.join(given)} are given at once; leave one out")
    if contents:
        _list_contents(report)
        return
    from mesa_swarm_studies import registry

    numbers = {registry.find_item(number).figure for number in figure or ()}
    source = registry.PAPER if published else registry.READING if readings else registry.THESIS
    chosen = [i for i in registry.items().values() if (i.figure in numbers if numbers else i.source == source)]
    if names:
        for item in chosen if given else registry.items().values():
            print_lines([f"{item.figure:5} {item.title} ({item.place})"], 6)
        return
    _make(chosen, out, _print_made, quick=quick, jobs=jobs, report=report, quiet=quiet)


def validate(
    *,
    only: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Such as kinetic_collisions.")] = None,
    names: Annotated[bool, typer.Option("--list", help="Only list them.")] = False,
    out: Folder = Path("results", "validation"),
    quick: Annotated[bool, typer.Option("--quick", help="A trial: few seeds, other files.")] = False,
    jobs: Jobs = -1,
    report: Annotated[Path | None, typer.Option(metavar="FILE.md", help="Write a page of the results.")] = None,
    quiet: Quiet = False,
) -> None:
    """Measure what physics predicts, each quantity beside its theory; continue an interrupted call."""
    from mesa_swarm.experiments import csv_text
    from mesa_swarm_studies import registry
    from mesa_swarm_studies.judging import UNDECIDED, header

    theories = {item.figure: item for item in registry.items().values() if item.source == registry.THEORY}
    numbers = {check_choice("item", name, theories) for name in only or theories}
    chosen = [item for name, item in theories.items() if name in numbers]
    if names:
        for item in chosen:
            print_lines([f"{item.figure:21} {item.title} ({item.section})"], 22)
        return
    made = _make(chosen, out, _print_table, quick=quick, jobs=jobs, report=report, quiet=quiet)
    rows = [(one.item.figure, *check.row) for one in made for check in one.result.checks]
    table = csv_text([("item", *header(registry.THEORY)), *rows])
    if not only:  # the table of all items; each has one of its own as well
        _write(out / f"validation{'_quick' if quick else ''}.csv", table)
    outcomes = Counter(check.outcome for one in made for check in one.result.checks)
    why = "; undecided: the interval is wider than required" if outcomes[UNDECIDED] else ""
    print_lines([f"{', '.join(f'{number} {outcome}' for outcome, number in outcomes.items())}{why}"], 0)


def _make(
    chosen: "Sequence[Item]",
    out: Path,
    show: "Callable[[Made, Path, bool], None]",
    *,
    quick: bool,
    jobs: int,
    report: Path | None,
    quiet: bool,
) -> "list[Made]":
    """Make results, and write and show each as soon as it is made; write the page of all if there is to be one."""
    from mesa_swarm.experiments import checked_jobs
    from mesa_swarm_studies import registry
    from mesa_swarm_studies.laboratory import Laboratory

    workers, folder = checked_jobs(jobs), check_writable(out)
    beside = None
    if report is not None:
        beside = check_writable(checked_file(report, ".md", "report").parent / "pictures")
    made = []
    with Laboratory(folder, quick=quick, jobs=workers, progress=not quiet) as laboratory, resumable(folder):
        for one in made_by(laboratory, chosen):
            made.append(one)
            show(one, _written(one, folder, "_quick" if quick else "", beside)[0], quick)
    if quick:
        print_lines(["Few seeds and short runs: this shows that it works; the verdicts mean nothing."], 0)
    if report is not None:
        _write(report, registry.report(made, quick=quick, runs=(laboratory.made, laboratory.found)))
    return made


def _write(path: Path, text: str) -> None:
    print(*write_all(path.parent, {path.name: text}))


def _print_table(one: "Made", picture: Path, quick: bool) -> None:
    """Print the verdict of a comparison with a theory, the table of its checks, and where its picture is."""
    from mesa_swarm.experiments import fitting
    from mesa_swarm_studies.registry import marked

    print_lines([f"{one.item.figure}: {one.item.title}: {marked(one.result, quick)} ({one.seconds:.0f} s)"], 4)
    rows = [[check.claim, check.reported, check.measured, check.outcome] for check in one.result.checks]
    head = ["quantity and setting", "theory", "measured [95 % interval]", "outcome"]
    print("\n".join(fitting([head, *rows], terminal_width())))
    print(f"{picture}\n", flush=True)


def _print_made(one: "Made", picture: Path, quick: bool) -> None:
    """Print the verdict of a result, its checks, and where its picture is."""
    from mesa_swarm_studies.registry import marked

    print_lines([f"{one.item.figure:5} {marked(one.result, quick)}: {one.item.title} ({one.seconds:.0f} s)"], 8)
    for check in one.result.checks:
        reported = f"the {one.item.source}: {check.reported}"
        print_lines([f"        {check.outcome}: {check.claim}: {check.measured} ({reported})"], 2)
    print(f"        {picture}", flush=True)


def _list_contents(report: Path | None) -> None:
    """Print the state of everything that the thesis contains, or write the page of it."""
    from mesa_swarm_studies.thesis import differences

    if report is None:
        print_lines(differences.lines(), 13)
    else:
        _write(checked_file(report, ".md", "report"), differences.page())


def made_by(laboratory: "Laboratory", chosen: "Sequence[Item]") -> "Iterator[Made]":
    """Yield results as they are made."""
    from mesa_swarm_studies.registry import Made

    for item in chosen:
        started = perf_counter()
        try:
            result = item.make(laboratory)
        except SwarmError:
            raise
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            if not laboratory.found:
                raise
            raise InvalidValueError(
                f"figure {item.figure} cannot be made of the runs in {laboratory.path} ({type(error).__name__}); "
                "remove the file to repeat the runs"
            ) from error
        yield Made(item=item, result=result, seconds=perf_counter() - started)


def _written(made: "Made", folder: Path, ending: str, beside: Path | None) -> list[Path]:
    """Write the pictures and the table of a result, all or none; the first is its picture.

    The ending of their names is one of its own for quick results, so that these do not replace full ones. `beside` is
    the folder of the pictures to which a page refers, if there will be one.
    """
    from mesa_swarm.viewing import png, svg

    contents: dict[str, str | bytes] = {}
    for word, picture in made.result.pictures.items():
        name = f"figure_{made.item.figure}" + (f"_{word}" if word else "") + ending
        contents |= {f"{name}.png": png(picture), f"{name}.svg": svg(picture, words=True)}
    contents[f"figure_{made.item.figure}{ending}.csv"] = made.result.csv(made.item.source)
    if beside is not None:
        contents[f"{beside.absolute()}/{made.item.figure}.png"] = png(made.result.pictures[""], ON_PAGES)
    return write_all(folder, contents)


def learn_bench(
    *,
    task: Annotated[str | None, typer.Option(metavar="A,B,...", help="Tasks; all by default.")] = None,
    only: Annotated[str | None, typer.Option(metavar="'A;B;...'", help="Contestants; all by default.")] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option(help="Controller from outside: .npz, .onnx, module:callable or .zip of SB3 (its code is run)."),
    ] = None,
    seeds: Annotated[int | None, typer.Option(min=1, max=1000, help="Trainings of each contestant; 10.")] = None,
    steps: Annotated[int | None, typer.Option(min=1, max=10_000_000, help="Of each training; 33,000.")] = None,
    evaluation_steps: Annotated[
        int | None, typer.Option(min=1, max=1_000_000, help="At most, on each map; 8,000, most tasks have fewer.")
    ] = None,
    maps: Annotated[int | None, typer.Option(min=1, max=50, help="Test maps; 50, most tasks have 20.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="In minutes: fewer seeds, steps and maps.")] = False,
    jobs: Jobs = -1,
    out: Folder = Path("results", "learn_bench"),
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write this page, .md, and its pictures.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume/--afresh", help="Continue an interrupted call.")] = True,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Train all learners, then measure them, and controllers from outside, on maps that were not used for training."""
    from mesa_swarm_studies.benchmarks import learn_bench as benchmarks

    if report is not None:
        check_writable(checked_file(report, ".md", "report").parent / "pictures")
        check_apart(report, policy or ())
    given = {"seeds": seeds, "steps": steps, "evaluation_steps": evaluation_steps, "maps": maps}
    benchmark = benchmarks.Benchmark(
        tasks=_names(task, ","),
        only=_names(only, ";"),
        policies=tuple(policy or ()),
        **{**(benchmarks.QUICK if quick else {}), **{name: n for name, n in given.items() if n is not None}},
    )
    how: dict[str, Any] = {"jobs": jobs, "resume": resume, "progress": not quiet, "tables": table or ()}
    with resumable(out):
        runs = benchmarks.learn_bench(benchmark, out=out, **how)
    _print_benchmark(benchmark, runs, out, table)
    if report is not None:
        write_all(report.parent, _page(benchmark, runs, report))
        print(report)


def _print_benchmark(benchmark: "Benchmark", runs: "Sequence[Training]", out: Path, table: list[str] | None) -> None:
    """Write the tables and pictures of a benchmark, and print the tables and where they are."""
    from mesa_swarm.experiments import markdown_fitting
    from mesa_swarm_studies.benchmarks.learn_report import learning_pictures, markdown, runs_csv, summary_json

    text = markdown(benchmark, runs)
    files: dict[str, str | bytes] = {
        "learn_bench.md": text,
        "learn_bench.csv": runs_csv(runs),
        "learn_bench.json": summary_json(benchmark, runs),
        **learning_pictures(runs),
    }
    print_lines(markdown_fitting(text, terminal_width()), 0)
    print_files(out, files, table)


def _page(benchmark: "Benchmark", runs: "Sequence[Training]", page: Path) -> dict[str, str | bytes]:
    """Return a page of a benchmark and the pictures that it shows, in a folder beside it, by file name."""
    from mesa_swarm_studies.benchmarks.learn_report import ON_PAGES, learning_pictures, report_page

    shown = learning_pictures(runs, page.stem, ON_PAGES)
    return {page.name: report_page(benchmark, runs, page), **{f"pictures/{name}": shown[name] for name in shown}}


def _names(text: str | None, separator: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(separator)) if text else ()
