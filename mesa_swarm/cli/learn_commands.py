"""What the command learn-bench does with what was typed."""

from pathlib import Path

from mesa_swarm.experiments.learn_bench import (
    Benchmark,
    learn_bench,
    learning_pictures,
    markdown,
    runs_csv,
    summary_json,
)
from mesa_swarm.files import write_all


def bench(
    *,
    seeds: int,
    steps: int,
    evaluation_steps: int,
    only: str | None,
    jobs: int,
    out: Path,
    resume: bool,
    progress: bool,
) -> None:
    """Do all trainings and evaluations that are left, write the files, and print the tables and the paths."""
    chosen = tuple(name.strip() for name in only.split(";")) if only else ()
    benchmark = Benchmark(seeds=seeds, steps=steps, evaluation_steps=evaluation_steps, only=chosen)
    runs = learn_bench(benchmark, out=out, jobs=jobs, resume=resume, progress=progress)
    table = markdown(benchmark, runs)
    files: dict[str, str | bytes] = {
        "learn_bench.md": table,
        "learn_bench.csv": runs_csv(runs),
        "learn_bench.json": summary_json(benchmark, runs),
        **learning_pictures(runs),
    }
    paths = write_all(out, files)
    print("\n".join([table, *map(str, paths)]))
