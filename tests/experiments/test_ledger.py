"""The ledger of runs: it gives back what it took, whatever was torn or spoilt."""

import hashlib
import json
import os
import threading
from contextlib import contextmanager
from fractions import Fraction
from functools import partial
from threading import Event
from zlib import crc32

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments.ledger import Ledger, Outcome
from support.forks import forked
from support.waiting import PATIENCE


def ended(steps):
    """Return the outcome of a run of this many steps."""
    return Outcome(steps=steps, results={})


def key(number):
    return hashlib.blake2b(str(number).encode(), digest_size=16).hexdigest()


def test_the_outcome_of_a_second_try_replaces_the_error(tmp_path):
    path, good = tmp_path / "ledger.jsonl", Outcome(steps=1, state_hash="", results={})
    with Ledger(path) as ledger:
        ledger.append(key(1), Outcome(error="it broke"))
        ledger.append(key(2), good)
    with Ledger(path, retry_failed=True) as ledger:
        assert (key(1) in ledger, key(2) in ledger) == (False, True)
        ledger.append(key(1), good)
        assert ledger.outcome(key(1)) == good
    with Ledger(path) as ledger:
        assert ledger.outcome(key(1)) == good


def test_the_ledger_gives_back_what_it_took_whatever_the_order(tmp_path):
    order = np.random.default_rng(1).permutation(3_000)
    with Ledger(tmp_path / "l") as ledger:
        ledger._file.flush()
        for number in order[:1500]:
            ledger.append(key(number), ended(int(number)))
        assert all((key(number) in ledger) == (number in set(order[:1500])) for number in range(0, 3_000, 7))
    with Ledger(tmp_path / "l") as ledger:
        assert all(ledger.outcome(key(number)).steps == number for number in order[:1500])
        assert key(order[1500]) not in ledger


@pytest.mark.parametrize("ending", ["00", "0000", "ab00"])
def test_keys_that_end_in_zeros_are_distinguished(tmp_path, ending):
    keys = ["11" * (16 - len(end) // 2) + end for end in (ending, "00" * 3, "0a", "")]
    with Ledger(tmp_path / "l") as ledger:
        for steps, one in enumerate(dict.fromkeys(keys)):
            ledger.append(one, ended(steps))
    with Ledger(tmp_path / "l") as ledger:
        assert [ledger.outcome(one).steps for one in dict.fromkeys(keys)] == list(range(len(set(keys))))


@pytest.mark.parametrize("kept", range(1, 60, 7))
def test_a_torn_line_is_cut_off_and_the_run_done_again(tmp_path, kept):
    with Ledger(tmp_path / "l") as ledger:
        ledger.append(key(1), ended(1))
        whole = (tmp_path / "l").stat().st_size
        ledger.append(key(2), ended(2))
    os.truncate(tmp_path / "l", whole + kept)
    with Ledger(tmp_path / "l") as ledger:
        assert (key(1) in ledger, key(2) in ledger) == (True, False)
        assert (tmp_path / "l").stat().st_size == whole
        ledger.append(key(2), ended(2))
    with Ledger(tmp_path / "l") as ledger:
        assert ledger.outcome(key(2)).steps == 2


def test_a_line_that_the_disk_spoilt_counts_as_never_written(tmp_path):
    with Ledger(tmp_path / "l") as ledger:
        for number in range(3):
            ledger.append(key(number), ended(number))
    lines = (tmp_path / "l").read_bytes().splitlines(keepends=True)
    (tmp_path / "l").write_bytes(b"".join([lines[0], lines[1].replace(b'"steps": 1', b'"steps": 7'), lines[2]]))
    with Ledger(tmp_path / "l") as ledger:
        assert [key(number) in ledger for number in range(3)] == [True, False, True]


def test_two_sweeps_cannot_write_to_one_ledger(tmp_path):
    with Ledger(tmp_path / "l"), pytest.raises(SwarmError, match="is being written by another sweep"):
        Ledger(tmp_path / "l")


def nested(depth):
    """Return lists within lists."""
    return [nested(depth - 1)] if depth else []


GOOD = {"key": key(1), "steps": 3, "state_hash": None, "results": {"a": 1.0}, "error": None}


def forged(content):
    """Return a line with a right checksum."""
    text = content if isinstance(content, bytes) else json.dumps(content).encode()
    return b"%08x %s\n" % (crc32(text), text)


@pytest.mark.parametrize(
    "wrong",
    [
        {name: value for name, value in GOOD.items() if name != "results"},
        {**GOOD, "results": None},
        {**GOOD, "error": "and results"},
        {**GOOD, "more": 1},
        {**GOOD, "key": key(1)[1:]},
        {**GOOD, "key": 7},
        {**GOOD, "steps": "3"},
        {**GOOD, "steps": -1},
        {**GOOD, "steps": 10**30},
        {**GOOD, "state_hash": 5},
        {**GOOD, "results": [1.0]},
        {**GOOD, "results": {"a": "text"}},
        {**GOOD, "results": {"a": 10**400}},
        {**GOOD, "results": {"a": {"b": 1}}},
        {**GOOD, "results": {"a": nested(100)}},
        b'{"a": ' + b"[" * 900 + b"]" * 900 + b"}",
        json.dumps(GOOD).replace("1.0", "[" * 900 + "]" * 900).encode(),
        {**GOOD, "results": {"\ud800": 1}},
        {**GOOD, "results": None, "error": "two\nlines"},
        {**GOOD, "results": None, "error": "long" * 1000},
        [],
        b"null",
        b"not JSON",
        b"\xff\xfe",
        json.dumps(GOOD).encode("utf-16"),
        b"[" * 100_000,
        b"1" * 5000,
        b"",
    ],
)
def test_a_line_with_a_right_checksum_that_is_no_outcome_counts_as_never_written(tmp_path, wrong):
    (tmp_path / "l").write_bytes(forged({**GOOD, "key": key(2)}) + forged(wrong))
    before = (tmp_path / "l").read_bytes()
    with Ledger(tmp_path / "l") as ledger:
        assert (key(1) in ledger, ledger.outcome(key(2)).results) == (False, {"a": 1.0})
        ledger.append(key(1), ended(7))
        assert ledger.outcome(key(1)) == ended(7)
    assert (tmp_path / "l").read_bytes().startswith(before)
    with Ledger(tmp_path / "l") as ledger:
        assert ledger.outcome(key(1)) == ended(7)


FOREIGN = [b"x", b'{"a": 1}\n{"b"', b"a whole line\n", b"\n", b"\0" * 50, b"0123abcd", b"2024"]
FOREIGN += [b"00000000{", b"00000000 [", b"a\n00000000 {", b'0000000g {"key']


@pytest.mark.parametrize("foreign", FOREIGN)
@pytest.mark.parametrize("read_only", [False, True])
def test_a_file_that_is_not_a_ledger_is_refused_by_name_and_stays_as_it_is(tmp_path, foreign, read_only):
    path = tmp_path / "ledger.jsonl"
    path.write_bytes(foreign)
    with pytest.raises(SwarmError, match=r"ledger\.jsonl is not a ledger of runs"):
        Ledger(path, read_only=read_only)
    assert path.read_bytes() == foreign


def test_what_stands_at_the_end_of_a_ledger_and_is_none_of_its_lines_is_not_cut(tmp_path):
    path = tmp_path / "l"
    path.write_bytes(forged(GOOD) + b"a note of mine")
    with Ledger(path) as ledger:
        ledger.append(key(2), ended(2))
        assert ledger.outcome(key(2)) == ended(2)
    assert b"\na note of mine\n" in path.read_bytes()
    with Ledger(path) as ledger:
        assert (key(1) in ledger, key(2) in ledger) == (True, True)


def test_a_ledger_that_is_only_read_is_not_changed_and_locks_no_process_out(tmp_path):
    with Ledger(tmp_path / "l") as writer:
        writer.append(key(1), ended(1))
        with (tmp_path / "l").open("ab") as file:
            file.write(b'00000000 {"key": "torn')
        before = (tmp_path / "l").read_bytes()
        with Ledger(tmp_path / "l", read_only=True) as reader:
            assert key(1) in reader
        assert (tmp_path / "l").read_bytes() == before


def test_what_could_not_be_read_again_is_not_written(tmp_path):
    with Ledger(tmp_path / "l") as ledger, pytest.raises(SwarmError, match="cannot be stored") as refusal:
        ledger.append(key(1), Outcome(results={"a": [0.5] * 2_000_000}))
    assert len(str(refusal.value)) <= 300 + len(str(tmp_path))
    assert (tmp_path / "l").read_bytes() == b""


def test_a_pipe_and_a_folder_are_no_ledgers(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path):
        with pytest.raises(SwarmError, match="is not a file"):
            Ledger(path)


@pytest.mark.parametrize("kept", range(9, 60))
def test_a_first_line_that_is_torn_is_cut_off(tmp_path, kept):
    path = tmp_path / "l"
    path.write_bytes(forged(GOOD)[:kept])
    with Ledger(path, read_only=True) as ledger:
        assert key(1) not in ledger
    assert path.stat().st_size == kept
    with Ledger(path) as ledger:
        assert path.read_bytes() == b""
        ledger.append(key(1), ended(1))
    with Ledger(path) as ledger:
        assert ledger.outcome(key(1)) == ended(1)


def test_refusals_show_a_long_and_odd_path_on_one_short_line(tmp_path):
    folder = tmp_path / ("n\new" + "y" * 200) / ("z" * 200)
    folder.mkdir(parents=True)
    (folder / "note").write_text("mine")
    (folder / "folder").mkdir()

    def stored():
        with Ledger(folder / "new") as ledger:
            ledger.append(key(1), Outcome(results={"a": "text"}))

    def twice():
        with Ledger(folder / "new"):
            Ledger(folder / "new")

    def changed():
        with Ledger(folder / "new") as ledger:
            ledger.append(key(1), ended(1))
            (folder / "new").write_bytes(b"x" * 200)
            ledger.outcome(key(1))

    attempts = (stored, twice, changed, *(partial(Ledger, folder / name) for name in ("note", "folder", "x" * 300)))
    for attempt in attempts:
        with pytest.raises(SwarmError) as refusal:
            attempt()
        assert len(str(refusal.value)) <= 300
        assert len(str(refusal.value).splitlines()) == 1


@pytest.mark.parametrize("odd", [Fraction(1, 2), np.array(1.5), {1, 2}, nested(100), nested(900)])
def test_results_that_are_no_numbers_are_refused_in_one_line_and_not_written(tmp_path, odd):
    with Ledger(tmp_path / "l") as ledger, pytest.raises(SwarmError, match="expected numbers and lists of them"):
        ledger.append(key(1), Outcome(results={"a": odd}))
    assert (tmp_path / "l").read_bytes() == b""


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX")
def test_a_closed_ledger_is_free_though_a_child_that_was_forked_meanwhile_has_it_open(tmp_path):
    with forked_while_open(tmp_path / "l"), Ledger(tmp_path / "l") as ledger:
        ledger.append(key(1), ended(1))
        assert key(1) in ledger


@contextmanager
def forked_while_open(path):
    ledger = Ledger(path)
    with forked():
        ledger.close()
        yield


def test_lines_that_are_written_during_a_sync_share_the_next_one_which_the_end_waits_for(tmp_path, monkeypatch):
    sizes, sync, written = [], os.fsync, Event()

    def slow(number):
        written.wait(PATIENCE)
        sizes.append(os.fstat(number).st_size)
        sync(number)

    monkeypatch.setattr(os, "fsync", slow)
    with Ledger(tmp_path / "l") as ledger:
        for number in range(50):
            ledger.append(key(number), ended(number))
        written.set()
    assert sizes[-1] == (tmp_path / "l").stat().st_size
    assert len(sizes) <= 2


def test_a_disk_that_refuses_a_sync_is_reported_in_one_line_at_the_latest_at_the_end(tmp_path, monkeypatch):
    def refuse(number):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", refuse)
    with (
        pytest.raises(SwarmError, match="cannot be written: No space left on device"),
        Ledger(tmp_path / "l") as ledger,
    ):
        ledger.append(key(1), ended(1))


def test_lines_whose_sync_failed_are_cut_off_so_that_their_runs_are_done_again(tmp_path, monkeypatch):
    sync, refused = os.fsync, Event()

    def refuse(number):
        refused.set()
        raise OSError(28, "No space left on device")

    with Ledger(tmp_path / "l") as ledger:
        ledger.append(key(1), ended(1))
    safe = (tmp_path / "l").read_bytes()
    monkeypatch.setattr(os, "fsync", refuse)
    ledger = Ledger(tmp_path / "l")
    ledger.append(key(2), ended(2))
    refused.wait(PATIENCE)
    with pytest.raises(SwarmError, match="earlier runs are stored"):
        ledger.close()
    assert (tmp_path / "l").read_bytes() == safe
    monkeypatch.setattr(os, "fsync", sync)
    with Ledger(tmp_path / "l") as ledger:
        assert list(ledger) == [key(1)]


def test_an_interrupt_while_a_ledger_waits_for_the_disk_leaves_no_error_of_its_thread(tmp_path, monkeypatch):
    goes_on, sync, errors = Event(), os.fsync, []

    def slow(number):
        goes_on.wait(PATIENCE)
        sync(number)

    monkeypatch.setattr(os, "fsync", slow)
    monkeypatch.setattr(threading, "excepthook", errors.append)
    ledger = Ledger(tmp_path / "l")
    ledger.append(key(1), ended(1))
    thread = ledger._syncing._thread
    monkeypatch.setattr(thread, "join", lambda: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        ledger.close()
    goes_on.set()
    threading.Thread.join(thread, PATIENCE)
    assert not thread.is_alive()
    assert errors == []
