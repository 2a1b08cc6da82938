"""What work was done, in one line, where no progress bar can move."""

import os
import pty
import re
import subprocess
import sys
import termios

import pytest

from mesa_swarm.base.progress import progress_bar
from mesa_swarm.base.work_line import WorkDone, report_work, summarise_work

RUN = [sys.executable, "-m", "mesa_swarm", "run", "collision_avoidance", "--steps", "40"]


def process(*words):
    return subprocess.run([*RUN, *words], capture_output=True, text=True, check=True)


@pytest.mark.slow
def test_a_command_whose_errors_go_to_a_pipe_prints_one_line_at_the_end():
    assert re.fullmatch(r"40 of 40 steps in [\d.]+ s\n", process().stderr)
    assert process("--quiet").stderr == ""


@pytest.mark.slow
def test_a_command_in_a_terminal_draws_a_bar_and_no_line():
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))
    done = subprocess.run(RUN, stdout=subprocess.DEVNULL, stderr=theirs, check=True)
    os.close(theirs)
    shown = os.read(ours, 100_000).decode()
    os.close(ours)
    assert done.returncode == 0
    assert "40/40 steps" in shown
    assert "40 of 40" not in shown


def test_several_bars_of_a_command_are_one_line_by_unit(capsys):
    with summarise_work():
        for unit, total, done in (("runs", 3, 2), ("steps", 40, 40), ("runs", 4, 4)):
            with progress_bar(total, unit, is_shown=True) as bar:
                bar.update(done)
        assert capsys.readouterr().err == ""
    assert re.fullmatch(r"6 of 7 runs, 40 of 40 steps in [\d.]+ s\n", capsys.readouterr().err)


def test_work_done_before_is_named_and_no_work_is_no_line(capsys):
    with progress_bar(1_200, "runs", is_shown=True) as bar:
        bar.initial = bar.n = 1_000
        bar.update(200)
    assert capsys.readouterr().err.startswith("1,200 of 1,200 runs (1,000 done before) in ")
    with summarise_work(), progress_bar(3, "runs", is_shown=False) as bar:
        bar.update(3)
    assert capsys.readouterr().err == ""


def test_a_run_that_ends_in_an_error_has_the_work_so_far_above_the_error(capsys):
    def fail():
        with summarise_work(), progress_bar(3, "steps", is_shown=True) as bar:
            bar.update()
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        fail()
    assert capsys.readouterr().err.startswith("1 of 3 steps in ")


def test_a_bar_that_is_closed_twice_is_one_line(capsys):
    bar = progress_bar(1, "runs", is_shown=True)
    bar.update()
    bar.close()
    bar.close()
    assert capsys.readouterr().err.count("1 of 1 run in ") == 1


def test_without_standard_error_nothing_is_printed(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", None)
    report_work(WorkDone("runs", 1, 1), 0.0)
    assert capsys.readouterr().out == ""
