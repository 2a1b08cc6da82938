"""What all tests share."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[1] / "docs"))  # what makes the site
sys.path.append(str(Path(__file__).parents[1] / "release"))  # what builds the package

from mesa_swarm import cli
from mesa_swarm.model import gallery
from support.hostile import Tally, table
from support.pace import is_out_of_time, shuffle_files

pytest_plugins = ["support.searches"]


def pytest_addoption(parser):
    parser.addoption("--screenshots", metavar="DIR", help="where browser tests write pictures for a person to look at")
    parser.addoption(
        "--at-length", action="store_true", help="thousands of hostile inputs, the longest runs on all seeds"
    )


def pytest_sessionstart(session):
    """Compile before all tests what most need: processes of pytest-xdist would compile the same at the same time."""
    running = session.config
    is_whole = running.args_source is pytest.Config.ArgsSource.TESTPATHS and not running.option.collectonly
    if is_whole and not hasattr(running, "workerinput"):
        # Tests report what is wrong if it fails.
        subprocess.run([sys.executable, "-m", "mesa_swarm", "warm-up"], check=False)


@pytest.fixture(scope="session", autouse=True)
def no_terminal():
    """Let commands print whole lines, as for a file: processes of pytest-xdist have COLUMNS of a terminal."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("COLUMNS", raising=False)
        yield


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Count long tests among the slow ones, and shuffle the files as the variable `MESA_SWARM_ORDER` requires."""
    for item in items:
        if item.get_closest_marker("long"):
            item.add_marker(pytest.mark.slow)
    shuffle_files(items, os.environ.get("MESA_SWARM_ORDER"))


def pytest_runtest_setup(item):
    if item.get_closest_marker("slow") and is_out_of_time():
        pytest.skip("the time for slow tests is over")


@pytest.fixture
def model_folder(monkeypatch, tmp_path, tmp_path_factory):
    """Work in an empty folder; forget afterwards what was imported from it: other tests use the same names.

    What other tests have left of theirs is not there meanwhile.
    """
    monkeypatch.chdir(tmp_path)
    of_tests = str(tmp_path_factory.getbasetemp().parent)
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(of_tests):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "path", list(sys.path))
    finder = gallery.FileFinder()
    monkeypatch.setattr(gallery, "_FILES", finder)
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, finder])
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.fixture
def typed(capsys, monkeypatch, tmp_path):
    """Type a command in an empty folder; get its exit status, output and errors."""
    monkeypatch.chdir(tmp_path)

    def type_in(line):
        with pytest.raises(SystemExit) as left:
            cli.main(line.split() if isinstance(line, str) else line)
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in


@pytest.fixture
def amount(request):
    """Return a function of two numbers of inputs: a few, and those at length."""
    return lambda few, many: many if request.config.getoption("--at-length") else few


@pytest.fixture
def tally(request):
    """Return a function that makes the tally of an area; the test fails if anything in it failed."""
    tallies = []

    def begun(area):
        tallies.append(Tally(area))
        return tallies[-1]

    yield begun
    for one in tallies:
        request.node.user_properties.append(("hostile", one.row()))
    failures = [f"{one.area}: {failure}" for one in tallies for failure in one.failures]
    assert not failures, "\n".join([f"{len(failures)} failed, the first of them:", *failures[:20]])
    assert all(one.tried for one in tallies)


def pytest_terminal_summary(terminalreporter):
    """Print the table of attacks, those of all processes added up."""
    reports = [report for each in terminalreporter.stats.values() for report in each if hasattr(report, "when")]
    rows = [
        row
        for report in reports
        if report.when == "teardown"
        for name, row in report.user_properties
        if name == "hostile"
    ]
    if rows:
        terminalreporter.section("attacks")
        terminalreporter.write_line("\n".join(table(rows)))


# Tests that run in the background of a shell, and what they start, ignore Ctrl-C.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
