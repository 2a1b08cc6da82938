"""The ledger of runs: it gives back what it took, whatever was torn or spoilt."""

import hashlib
import os

import numpy as np
import pytest

from mesa_swarm.errors import SwarmError
from mesa_swarm.experiments.experiment import Outcome
from mesa_swarm.experiments.ledger import Ledger


def key(number):
    return hashlib.blake2b(str(number).encode(), digest_size=16).hexdigest()


def test_what_a_second_try_says_takes_the_place_of_the_error(tmp_path):
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
            ledger.append(key(number), Outcome(steps=int(number)))
        assert all((key(number) in ledger) == (number in set(order[:1500])) for number in range(0, 3_000, 7))
    with Ledger(tmp_path / "l") as ledger:
        assert all(ledger.outcome(key(number)).steps == number for number in order[:1500])
        assert key(order[1500]) not in ledger


@pytest.mark.parametrize("ending", ["00", "0000", "ab00"])
def test_keys_that_end_in_zeros_are_told_apart(tmp_path, ending):
    keys = ["11" * (16 - len(end) // 2) + end for end in (ending, "00" * 3, "0a", "")]
    with Ledger(tmp_path / "l") as ledger:
        for steps, one in enumerate(dict.fromkeys(keys)):
            ledger.append(one, Outcome(steps=steps))
    with Ledger(tmp_path / "l") as ledger:
        assert [ledger.outcome(one).steps for one in dict.fromkeys(keys)] == list(range(len(set(keys))))


@pytest.mark.parametrize("kept", range(1, 60, 7))
def test_a_torn_line_is_cut_off_and_the_run_done_again(tmp_path, kept):
    with Ledger(tmp_path / "l") as ledger:
        ledger.append(key(1), Outcome(steps=1))
        whole = (tmp_path / "l").stat().st_size
        ledger.append(key(2), Outcome(steps=2))
    os.truncate(tmp_path / "l", whole + kept)
    with Ledger(tmp_path / "l") as ledger:
        assert (key(1) in ledger, key(2) in ledger) == (True, False)
        assert (tmp_path / "l").stat().st_size == whole
        ledger.append(key(2), Outcome(steps=2))
    with Ledger(tmp_path / "l") as ledger:
        assert ledger.outcome(key(2)).steps == 2


def test_a_line_that_the_disk_spoilt_counts_as_never_written(tmp_path):
    with Ledger(tmp_path / "l") as ledger:
        for number in range(3):
            ledger.append(key(number), Outcome(steps=number))
    lines = (tmp_path / "l").read_bytes().splitlines(keepends=True)
    (tmp_path / "l").write_bytes(b"".join([lines[0], lines[1].replace(b'"steps": 1', b'"steps": 7'), lines[2]]))
    with Ledger(tmp_path / "l") as ledger:
        assert [key(number) in ledger for number in range(3)] == [True, False, True]


def test_two_sweeps_cannot_write_to_one_ledger(tmp_path):
    with Ledger(tmp_path / "l"), pytest.raises(SwarmError, match="is being written by another sweep"):
        Ledger(tmp_path / "l")
