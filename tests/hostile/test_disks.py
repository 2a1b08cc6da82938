"""Whatever writes, on disks that fill up at any moment, in read-only folders, and two at a time."""

import contextlib
import io
import os
import re
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import cli
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run.exporting import Exporting
from mesa_swarm.learning import QPolicy, save_policy
from mesa_swarm.maps.map import Map
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.robots.design import AGENT3
from mesa_swarm.searches.evolved_controllers import Trial, evolve
from mesa_swarm.viewing.pictures import png, world_figure
from support.disks import read_only, small_disk
from support.hostile import attack

pytestmark = pytest.mark.slow

DISK_KILOBYTES = 4096
OLD = b"what stood there before\n" * 400
REMAINING = re.compile(r"its (\d+) rows so far remain")
JOB = "model = 'fire_fighting'\nsteps = 12\nseeds = 2\nrobots = 2\n"
WORKING = (
    *(f"mesa_swarm.experiments.{name}" for name in ("compare", "learning_figures", "reality_gap", "sweep")),
    "mesa_swarm.models.boids",
    *(f"mesa_swarm.viewing.{name}" for name in ("export", "replay_page", "run_pictures")),
    "mesa_swarm_studies.benchmarks.learn_bench",
    "mesa_swarm_studies.registry",
)
# Written to line by line, not replaced: what they hold is as whole as before.
APPENDED = ("ledger.jsonl", "runs.jsonl")
# Long paths are shown by their ends.
NAMED = 40


class RefusedError(Exception):
    """A command ended with an error, as it should."""


@dataclass(frozen=True)
class Writer:
    """What writes files into a folder: words of a command, or a function that raises a SwarmError.

    Parameters
    ----------
    does : callable
        Called with the folder of inputs and the one to write to; returns words, or None if it wrote by itself.
    files : tuple of str
        What it replaces.
    size : int
        About how many bytes it writes in all.
    slow : bool
        Whether it takes seconds.
    lines : int
        Most lines of errors: a job has one for each of its runs.
    also : str
        A pattern of other files that may be there afterwards, whole.
    """

    does: Callable[[Path, Path], list | None]
    files: tuple[str, ...] = ()
    size: int = 60_000
    slow: bool = False
    lines: int = 1
    also: str = ""


def _recorded(force):
    def words(_, out):
        run = ["run", "fire_fighting", "--set", "n_robots=3", "--steps", 300, "--record", out / "run.arrow", "--quiet"]
        return [*run, *["--force"] * force]

    return words


def _exported(name, *options):
    return lambda inputs, out: ["export", inputs / "run.arrow", out / name, "--force", "--quiet", *options]


def _to_folder(*words):
    return lambda inputs, out: [*(inputs / word if word == "job.toml" else word for word in words), "--out", out]


def _saved_policy(_, out):
    save_policy(QPolicy.untrained(AGENT3, rng=np.random.default_rng(1)), out / "mine.npz")


def _saved_map(_, out):
    Map.load("original").save(out / "hall.svg")


def _evolved(_, out):
    if (out / "diary.json").exists():
        (out / "diary.json").unlink()  # else it would go on with what stands there
    evolve(Trial(robots=2, steps=5), generations=2, population=4, finalists=1, final_trials=1, file=out / "diary.json")


def _page_recording(_, out):
    """Record on the page, twice; the second replaces the first."""
    session = Session("fire_fighting", {"n_robots": 2})
    exporting = session.companion(Exporting)
    exporting.switch.path = out / "recorded.arrow"
    try:
        for _ in range(2):
            exporting.record(True)
            for _ in range(60):
                session.step()
            exporting.record(False)
            if exporting.fault:
                raise SwarmError(exporting.fault)
            if exporting.switch.ended:
                raise SwarmError(f"{exporting.switch.path}: {exporting.switch.ended}")
    finally:
        switch = exporting.switch
        rows = len(Recording(switch.path)) if switch.path.exists() and switch.words else 0
        assert not switch.words or switch.words.endswith(f" {switch.last:,}")
        assert rows == max(0, switch.last - switch.first + 1), (rows, switch.words)
        session.close()


WRITERS = {
    "run --record": Writer(_recorded(False), size=90_000, also="run.arrow"),
    "run --record --force": Writer(_recorded(True), ("run.arrow",), size=90_000),
    "run of a job": Writer(
        lambda inputs, out: ["run", inputs / "job.toml", "--record", out / "{seed}.arrow", "--force", "--quiet"],
        ("1.arrow", "2.arrow"),
        lines=2,
    ),
    "sweep": Writer(_to_folder("sweep", "job.toml", "--jobs", 1, "--quiet"), ("runs.parquet",), size=12_000),
    "sweep --record": Writer(
        _to_folder("sweep", "job.toml", "--record", "--jobs", 1, "--quiet"),
        ("runs.parquet",),
        also="recordings/*.arrow",
    ),
    "compare": Writer(
        _to_folder("compare", "fire_fighting", "--seeds", 2, "--steps", 5, "--jobs", 1, "--quiet"),
        ("runs.csv", "summary.csv", "finding.txt", "comparison.png", "over_time.png"),
        size=900_000,
        slow=True,
        also="*.png",
    ),
    "evolve": Writer(_evolved, size=2_000, also="diary.json"),
    "learn-bench": Writer(
        _to_folder(
            *("learn-bench", "--task", "avoid", "--only", "random", "--seeds", 1, "--steps", 20),
            *("--evaluation-steps", 10, "--maps", 2, "--jobs", 1, "--quiet"),
        ),
        ("learn_bench.csv", "learn_bench.json", "learn_bench.md", "learn_bench_avoid.png"),
        size=200_000,
        slow=True,
        also="learn_bench_curves.png",
    ),
    "reproduce": Writer(
        lambda _, out: [
            "reproduce",
            "--figure",
            "B.1",
            "--quick",
            "--quiet",
            "--out",
            out,
            "--report",
            out / "page.md",
        ],
        ("figure_B.1_quick.csv", "figure_B.1_quick.png", "figure_B.1_quick.svg", "pictures/B.1.png", "page.md"),
        size=130_000,
        also="figure_*",
    ),
    "reward-lab": Writer(
        _to_folder("reward-lab", "--rewards", "a", "--steps", 20, "--quiet"),
        ("reward_lab.png", "curves.csv", "marks.csv", "oscillations.csv"),
        size=170_000,
        slow=True,
    ),
    "reality-gap": Writer(
        _to_folder("reality-gap", "boids", "--seeds", 2, "--steps", 3, "--jobs", 1, "--quiet"),
        ("reality_gap.png", "reality_gap.csv"),
        size=90_000,
        slow=True,
    ),
    "picture": Writer(
        lambda _, out: ["picture", "boids", "--steps", "0,5", "--out", out / "p.png", "--quiet"],
        ("p.png",),
        size=170_000,
        slow=True,
    ),
    "map import": Writer(lambda _, out: ["map", "import", "original", out / "m.toml", "--force"], ("m.toml",), 4_000),
    "map show": Writer(lambda _, out: ["map", "show", "original", "--out", out / "m.png"], ("m.png",), slow=True),
    "export .png": Writer(_exported("e.png"), ("e.png",), slow=True),
    "export .svg": Writer(_exported("e.svg"), ("e.svg",), slow=True),
    "export moving .svg": Writer(_exported("e.svg", "--animate", "--every", 30), ("e.svg",), 12_000),
    "export .gif": Writer(_exported("e.gif", "--every", 30), ("e.gif",), size=100_000, slow=True),
    "export .mp4": Writer(_exported("e.mp4", "--every", 30), ("e.mp4",), size=24_000, slow=True),
    "export .html": Writer(_exported("e.html"), ("e.html",), size=80_000),
    "export .csv": Writer(_exported("e.csv"), ("e.csv",), size=30_000),
    "export .parquet": Writer(_exported("e.parquet"), ("e.parquet",), size=30_000),
    "save_policy": Writer(_saved_policy, ("mine.npz",), size=20_000),
    "Map.save": Writer(_saved_map, ("hall.svg",), size=4_000),
    "the page's recording": Writer(_page_recording, size=60_000, also="recorded.arrow"),
}


# An evolution goes on from its diary, and a page has one recording.
RACES = [name for name in WRITERS if name not in ("evolve", "the page's recording")]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Return a folder with a recording and a job; after this, what records, draws and reproduces is warm."""
    folder = tmp_path_factory.mktemp("inputs")
    for module in WORKING:
        import_module(module)
    png(world_figure({"warm": FireFighting(rng=1)}))
    model = FireFighting(n_robots=3, rng=1)
    with model.record(folder / "run.arrow"):
        model.run(60)
    (folder / "job.toml").write_text(JOB)
    return folder


def fill(disk, room):
    """Leave this number of bytes, in whole pages, on a disk."""
    with (disk / "ballast").open("wb", buffering=0) as ballast:
        free = os.statvfs(disk)
        os.posix_fallocate(ballast.fileno(), 0, max(1, (free.f_bavail * free.f_bsize) // 4096 * 4096 - room))


def emptied(folder):
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()


def furnished(folder, writer):
    """Put old files where a writer writes to."""
    for name in writer.files:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(OLD)


def ended(writer, inputs, out):
    """Have it write; return its exit status and the lines where errors go."""
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
            words = writer.does(inputs, out)
            if words is not None:
                cli.main(list(map(str, words)))
    except SystemExit as left:
        return left.code or 0, errors.getvalue().splitlines()
    except SwarmError as error:
        return 2, str(error).splitlines()
    return 0, errors.getvalue().splitlines()


def check(writer, out, status, lines):
    """Raise AssertionError unless it ended well: whole, or refused with everything as it was."""
    __tracebackhide__ = True
    found = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()} - {"ballast"}
    drafts = [name for name in found if name.endswith(".draft")]
    assert not drafts, f"left behind: {drafts}"
    allowed = {*writer.files, *APPENDED, *(path.relative_to(out).as_posix() for path in out.glob(writer.also or "-"))}
    assert found <= allowed, f"left behind: {found - allowed}"
    for name in found:
        if name.endswith(".arrow") and (content := (out / name).read_bytes()) != OLD:
            rows = len(Recording(out / name))
            kept = [int(number) for line in lines for number in REMAINING.findall(line)]
            assert Recording(out / name).complete or rows in kept or not writer.files, f"{name}: {rows} rows, {lines}"
            assert rows, f"{name} has no rows, {len(content)} bytes"
    if not status:
        assert all((out / name).read_bytes() != OLD for name in writer.files), (
            "it reports that it has written, and has not"
        )
        return
    assert 1 <= len(lines) <= writer.lines, lines
    assert all(str(out)[-NAMED:] in line and len(line) <= 320 for line in lines), lines
    for name in writer.files:
        if not name.endswith(".arrow"):
            assert (out / name).read_bytes() == OLD, f"{name} was replaced: {lines}"
    raise RefusedError(lines[0].removeprefix("mesa-swarm: ")[-300:])


def tried(writer, inputs, out, room):
    """Do it once on a disk with so much room."""
    emptied(out)
    furnished(out, writer)
    fill(out, room)
    try:
        check(writer, out, *ended(writer, inputs, out))
    except AssertionError as error:
        raise AssertionError(f"{error} {traceback.format_exc()[-200:]}") from None


@pytest.mark.parametrize("name", WRITERS)
def test_on_a_full_disk_each_writer_refuses_in_one_line_and_what_was_there_stays(
    name, inputs, tmp_path, tally, amount, monkeypatch
):
    monkeypatch.chdir(inputs)
    writer = WRITERS[name]
    rng = np.random.default_rng(sum(map(ord, name)))
    rooms = [0, *rng.integers(0, int(1.3 * writer.size), amount(1 if writer.slow else 3, 40)).tolist()]
    rooms = rooms[amount(writer.slow, 0) :]
    with small_disk(tmp_path / "disk", DISK_KILOBYTES) as disk:
        attempts = [(f"{name} with room for {room} bytes", room) for room in rooms]
        results = attack(
            lambda room: tried(writer, inputs, disk, room), attempts, refusals=RefusedError, cpu=60, memory=700
        )
        tally("disks: full").add(results)


def refused_in(folder, inputs, names):
    for name in names:
        status, lines = ended(WRITERS[name], inputs, folder)
        assert status, f"{name} has written"
        assert 1 <= len(lines) <= WRITERS[name].lines, (name, lines)
        assert all(str(folder)[-NAMED:] in line and re.search("Read-only|Permission", line) for line in lines), (
            name,
            lines,
        )


def test_in_a_read_only_folder_each_writer_refuses_in_one_line_before_its_work(
    inputs, tmp_path, tally, amount, monkeypatch
):
    monkeypatch.chdir(inputs)
    folder = tmp_path / "folder"
    folder.mkdir()
    for writer in WRITERS.values():
        furnished(folder, writer)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    names = [name for name in RACES if name != "run --record"]  # which stops at the name, as "--force" does not
    with read_only(folder):
        results = attack(lambda name: refused_in(folder, inputs, [name]), [(name, name) for name in names], refusals=())
        tally("disks: read-only").add(results)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def started(writer, inputs, out, gate, report):
    """Fork a process that writes as soon as the gate is opened, and reports how it ended."""
    child = os.fork()
    if child:
        return child
    try:
        with report.open("w") as file:
            os.read(gate, 1)
            status, lines = ended(writer, inputs, out)
            file.write("\n".join([str(status), *lines]))
    finally:
        os._exit(0)


def raced(writer, inputs, out, home):
    """Have two processes write the same at once; return what each reported."""
    gate, opener = os.pipe()
    reports = [home / "first", home / "second"]
    children = [started(writer, inputs, out, gate, report) for report in reports]
    os.write(opener, b"!!")
    for child in children:
        signal.alarm(120)
        os.waitpid(child, 0)
        signal.alarm(0)
    os.close(gate)
    os.close(opener)
    return [report.read_text().splitlines() for report in reports]


@pytest.mark.parametrize("name", RACES)
def test_two_that_write_the_same_at_once_leave_one_whole_output_or_one_refuses(
    name, inputs, tmp_path, tally, amount, monkeypatch
):
    monkeypatch.chdir(inputs)
    writer, counted = WRITERS[name], tally("disks: two writers of one output")
    out = tmp_path / "out"
    out.mkdir()
    for number in range(amount(0 if writer.slow else 1, 15)):
        emptied(out)
        furnished(out, writer)
        reports = raced(writer, inputs, out, tmp_path)
        counted.check(f"{name}, {number}", *judged(writer, out, reports))
    if amount(writer.slow, False):
        counted.check(f"{name}, at length only", True)


def judged(writer, out, reports):
    """Return whether a race ended well, and if not why."""
    if not all(reports):
        return False, "one of them died"
    statuses = [int(report[0]) for report in reports]
    if all(statuses):
        return False, f"both refused: {reports}"
    try:
        check(writer, out, 0, [])
    except (AssertionError, SwarmError) as error:
        return False, f"{type(error).__name__}: {error} after {reports}"
    refusals = [report[1:] for report in reports if report[0] != "0"]
    return all(1 <= len(lines) <= writer.lines for lines in refusals), f"refusals: {refusals}"


@pytest.mark.parametrize("name", ["run --record --force", "Map.save", "export .csv", "export .html"])
def test_a_kill_at_any_moment_leaves_the_old_file_or_the_new_one_and_what_it_left_behind_is_tidied_up(
    name, inputs, tmp_path, tally, amount, monkeypatch
):
    monkeypatch.chdir(inputs)
    writer, counted = WRITERS[name], tally("disks: killed while a file is replaced")
    rng = np.random.default_rng(7)
    out = tmp_path / "out"
    out.mkdir()
    (file,) = writer.files
    for number in range(amount(2, 100)):
        emptied(out)
        furnished(out, writer)
        gate, opener = os.pipe()
        child = started(writer, inputs, out, gate, tmp_path / "report")
        os.write(opener, b"!")
        time.sleep(rng.uniform(0, 0.4))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        content = (out / file).read_bytes()
        recorded = file.endswith(".arrow") and content != OLD
        readable = not recorded or len(Recording(out / file)) > 0
        status, lines = ended(writer, inputs, out)
        whole = readable if recorded else content in (OLD, (out / file).read_bytes())
        counted.check(f"{name}, kill {number}", whole, f"{len(content)} bytes")
        left = sorted(path.name for path in out.iterdir())
        counted.check(f"{name}, after kill {number}", not status and left == [file], f"{lines} {left}")
