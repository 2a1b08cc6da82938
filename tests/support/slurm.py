"""A stand-in for SLURM on one machine: `sbatch`, `squeue` and `scancel`, whose jobs are processes of this machine.

It knows the options that the documentation uses, in a script's #SBATCH lines and on the command line: --array=1-N or K,
--dependency=afterany:ID, --output, --job-name, --parsable and --wrap; all others are ignored. Tasks of an array run at
the same time, two at most. What it remembers is in the folder of the variable STANDIN, one folder a job.
"""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

AT_A_TIME = 2


def installed(folder: Path) -> dict[str, str]:
    """Return the environment in which the three commands are this stand-in's, after writing them to a folder."""
    place, jobs = folder / "bin", folder / "jobs"
    place.mkdir(parents=True)
    jobs.mkdir()
    for name in ("sbatch", "squeue", "scancel"):
        program = place / name
        words = shlex.join([sys.executable, str(Path(__file__).resolve()), name])
        program.write_text(f'#!/bin/sh\nexec {words} "$@"\n')
        program.chmod(0o755)
    path = os.pathsep.join([str(place), str(Path(sys.executable).parent), os.environ["PATH"]])
    return {**os.environ, "PATH": path, "STANDIN": str(jobs)}


def jobs_folder() -> Path:
    return Path(os.environ["STANDIN"])


def options_of(words: list[str]) -> Namespace:
    parser = ArgumentParser(allow_abbrev=False)
    parser.add_argument("-J", "--job-name", default="job")
    parser.add_argument("-o", "--output")
    parser.add_argument("--array")
    parser.add_argument("--cpus-per-task", default="1")
    parser.add_argument("--dependency")
    parser.add_argument("--parsable", action="store_true")
    parser.add_argument("--wrap")
    known, rest = parser.parse_known_args(words)
    known.script = rest[-1] if rest and not rest[-1].startswith("-") else None
    return known


def sbatch(words: list[str]) -> None:
    """Accept a job: its script and options are stored, and a process of its own carries it out."""
    given = options_of(words)
    text = f"#!/bin/sh\n{given.wrap}\n" if given.wrap else Path(given.script).read_text()
    lines = [word for line in re.findall(r"^#SBATCH (.*)$", text, re.MULTILINE) for word in shlex.split(line)]
    number = 1 + max((int(folder.name) for folder in jobs_folder().iterdir()), default=0)
    home = jobs_folder() / str(number)
    home.mkdir()
    (home / "script").write_text(text)
    (home / "script").chmod(0o755)
    (home / "name").write_text(options_of([*lines, *words]).job_name)
    process = subprocess.Popen(
        [sys.executable, __file__, "carry_out", str(home), *lines, *(words if given.wrap else words[:-1])],
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    (home / "process").write_text(str(process.pid))
    print(number if given.parsable else f"Submitted batch job {number}")


def carry_out(words: list[str]) -> None:
    """Wait for the jobs on which this one depends, and run its tasks."""
    home, options = Path(words[0]), options_of(words[1:])
    for other in re.findall(r"\d+", options.dependency or ""):
        while is_there(jobs_folder() / other):
            time.sleep(0.05)
    begin, _, end = (options.array or "0").partition("-")
    first, last = int(begin), int(end or begin)
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        list(pool.map(lambda task: run_task(home, options, task, last - first + 1), range(first, last + 1)))
    (home / "done").touch()


def run_task(home: Path, options: Namespace, task: int, tasks: int) -> None:
    environment = {**os.environ, "SLURM_JOB_ID": home.name, "SLURM_CPUS_PER_TASK": options.cpus_per_task}
    if options.array:
        environment |= {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": str(tasks)}
    file = (options.output or "slurm-%j.out").replace("%j", home.name).replace("%J", home.name)
    file = file.replace("%x", options.job_name).replace("%a", str(task)).replace("%A", home.name)
    with open(file, "w") as output:
        subprocess.run([home / "script"], env=environment, stdout=output, stderr=subprocess.STDOUT, check=False)


def is_there(home: Path) -> bool:
    return not (home / "done").exists()


def squeue(words: list[str]) -> None:
    """Print a line for each job that is waiting or running."""
    for home in sorted(jobs_folder().iterdir(), key=lambda home: int(home.name)):
        if is_there(home):
            print(home.name, (home / "name").read_text())


def scancel(words: list[str]) -> None:
    """Kill jobs, with all that they have started."""
    for number in words:
        home = jobs_folder() / number
        with suppress(OSError):  # it has ended
            os.killpg(int((home / "process").read_text()), signal.SIGKILL)
        (home / "done").touch()


if __name__ == "__main__":
    {"sbatch": sbatch, "carry_out": carry_out, "squeue": squeue, "scancel": scancel}[sys.argv[1]](sys.argv[2:])
