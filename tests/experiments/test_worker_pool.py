"""Processes that work at the same time."""

import os
import sys
from contextlib import closing, contextmanager
from signal import SIGINT, default_int_handler, getsignal
from threading import Event, Thread
from time import sleep

import pytest
from joblib import cpu_count, parallel_config
from joblib.externals.loky import get_reusable_executor

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.experiments import worker_pool as pool
from mesa_swarm.experiments.worker_pool import checked_jobs, ending_with_us, in_order, is_remote, on_all


@pytest.fixture
def own_workers():
    """End the workers of a test: a later task that imports far more than theirs looks to joblib like a memory leak."""
    yield
    get_reusable_executor().shutdown(wait=True, kill_workers=True)


def test_minus_one_is_a_job_on_each_core():
    assert (checked_jobs(2), checked_jobs(-1)) == (2, cpu_count())
    with pytest.raises(InvalidValueError, match="or -1 for one on each core"):
        checked_jobs(0)


@pytest.mark.slow
@pytest.mark.usefixtures("own_workers")
@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_tasks(workers):
    assert in_order(workers, pow, [(2, 3), (3, 2)]) == [8, 9]


@pytest.mark.slow
@pytest.mark.usefixtures("own_workers")
def test_an_interrupt_while_further_tasks_are_being_handed_out_is_raised(monkeypatch):
    being_read = Event()

    def tasks():
        for k in range(12):
            if k == 11:  # by now a thread of joblib reads them
                being_read.set()
                sleep(0.5)
            yield 2, k

    @contextmanager
    def interrupted():
        yield
        assert being_read.wait(60)
        raise KeyboardInterrupt

    def use():
        with pytest.raises(KeyboardInterrupt):
            list(on_all(2, pow, tasks()))

    monkeypatch.setattr(pool, "_interrupts_held", interrupted)
    using = Thread(target=use, daemon=True)
    using.start()
    using.join(60)
    assert not using.is_alive(), "workers and the thread that hands out tasks wait for each other"


@pytest.mark.skipif(sys.platform == "win32", reason="a process of Windows cannot be sent Ctrl-C alone")
@pytest.mark.usefixtures("own_workers")
def test_an_interrupt_that_another_thread_receives_waits_until_workers_have_started():
    started, end = Event(), Event()

    def tasks():
        for k in range(3):
            if k == 1:
                os.kill(os.getpid(), SIGINT)
                sleep(0.2)
                started.set()
            yield 2, k

    Thread(target=end.wait, daemon=True).start()  # it does not block interrupts
    with pytest.raises(KeyboardInterrupt):
        list(on_all(2, pow, tasks()))
    end.set()
    assert started.is_set()
    assert getsignal(SIGINT) is default_int_handler


@pytest.mark.slow
@pytest.mark.usefixtures("own_workers")
def test_results_that_are_not_wanted_are_given_up_without_a_word(capfd):
    for _ in range(4):
        with closing(on_all(2, pow, ((2, k) for k in range(10_000)))) as results:
            next(results)
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.usefixtures("own_workers")
def test_every_task_is_done_once():
    assert sorted(on_all(2, pow, [(2, k) for k in range(5)])) == [1, 2, 4, 8, 16]


def test_another_backend_of_joblib_is_remote():
    assert not is_remote()
    with parallel_config(backend="threading"):
        assert is_remote()


def test_a_script_that_ends_with_this_process_watches_it_from_its_first_import_on():
    script = ending_with_us("print()")
    assert script.startswith("from mesa_swarm.experiments.worker_pool import end_with; end_with(")
    assert script.endswith("; print()")
