"""Hostile ledgers: mutated, torn and forged with right checksums; nothing raw comes out, and no good line is lost."""

import json
from functools import cache
from pathlib import Path
from zlib import crc32

import numpy as np
import pyarrow
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.experiments.ledger import Ledger, Outcome
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.sweep import done_before, run_experiment
from mesa_swarm.model.gallery import find_model
from support.hostile import attack

pytestmark = pytest.mark.slow
FIRE = find_model("fire_fighting")
SETTINGS = {"n_robots": 1, "map": "openspace_fire"}


def forged(content):
    text = content if isinstance(content, bytes) else json.dumps(content).encode()
    return b"%08x %s\n" % (crc32(text), text)


@cache
def experiment():
    return checked_experiment(FIRE, seeds=2, steps=1, settings=SETTINGS)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a ledger of two runs of this experiment, and the table that belongs to it."""
    folder = tmp_path_factory.mktemp("whole")
    table = run_experiment(experiment(), RunFiles(folder)).path.read_bytes()
    return (folder / "ledger.jsonl").read_bytes(), table


VALUES = [None, True, -1, 0.5, 10**30, float("nan"), "text", "x" * 5000, "a\nb", "\ud800", [], {}, [1], {"a": 1}]
VALUES += [{"rng": 1.0}, {"error": 2.0}, {"a": "b"}, {"a": [1, [2]]}, {"a": {"b": 1}}, {"": None}, {"a": 10**400}]


def contents(line, rng, number):
    """Yield forged contents of a line: other values, names too few or too many, and no objects at all."""
    entry = json.loads(line.partition(b" ")[2])
    yield from (b"", b"null", b"[]", b"[" * 100_000, b"{" * 100_000, b'"\xff"', b"1" * 5000, b'{"key": NaN}')
    yield json.dumps(entry).encode("utf-16")
    for _ in range(number):
        changed = dict(entry)
        for _ in range(rng.integers(1, 3)):
            name = str(rng.choice([*entry, "more"]))
            if rng.random() < 0.2:
                changed.pop(name, None)
            else:
                changed[name] = VALUES[rng.integers(len(VALUES))]
        yield json.dumps(changed).encode()


def mutated(content, rng):
    """Return bytes with a few of them changed, cut out, doubled or put in."""
    for _ in range(rng.integers(1, 4)):
        a, b = sorted(rng.integers(0, len(content) + 1, 2).tolist())
        kind = rng.integers(5)
        if kind == 0 and content:
            content = content[:a] + rng.bytes(1) + content[a + 1 :]
        elif kind == 1:
            content = content[:a] + content[b:]
        elif kind == 2:
            content = content[:b] + content[a:b] + content[b:]
        elif kind == 3:
            content = content[:a] + rng.bytes(rng.integers(1, 30)) + content[a:]
        else:
            content = content[:a]
    return content


def tried(tmp_path, whole):
    ledger_bytes, table = whole
    lines = ledger_bytes.splitlines(keepends=True)

    def work(content):
        folder = Path(tmp_path)
        path = folder / "ledger.jsonl"
        path.write_bytes(content)
        try:
            done_before(experiment(), folder)
            assert path.read_bytes() == content
            made = run_experiment(experiment(), RunFiles(folder))
        except SwarmError:
            assert path.read_bytes() == content  # what is refused stays as it is
            raise
        after = path.read_bytes()
        assert all(line in after for line in lines if content.startswith(line) or b"\n" + line in content)
        if "x" not in made.frame().columns and made.done_before == 0:
            assert made.path.read_bytes() == table

    return work


def test_a_sweep_goes_on_from_any_ledger_or_refuses_it(tmp_path, whole, tally, amount):
    rng, lines = np.random.default_rng(1), whole[0].splitlines(keepends=True)
    forgeries = [
        (f"forged {k}", forged(content) + lines[1])
        for k, content in enumerate(contents(lines[0], rng, amount(40, 4000)))
    ]
    mutations = [(f"mutated {k}", mutated(whole[0], rng)) for k in range(amount(40, 6000))]
    foreign = [(f"foreign {k}", rng.bytes(rng.integers(0, 200)) + b"\n" * (k % 2)) for k in range(amount(20, 500))]
    foreign += [("no line ends", b"\0" * 50_000_000), ("long line", b"00000000 " + b"[" * 20_000_000)]
    foreign += [("many ends", b"\n" * 2_000_000), ("long good line", forged({"a": "x" * 9_000_000}) + lines[1])]
    for area, inputs in (("forged", forgeries), ("mutated", mutations), ("foreign", foreign)):
        results = attack(tried(tmp_path, whole), inputs, refusals=SwarmError, cpu=5, memory=500)
        tally(f"ledgers: {area}").add(results)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_table_of_very_many_results_takes_time_and_memory_with_the_size_of_the_ledger_only(
    tmp_path, whole, tally, threads
):
    work = tried(tmp_path, whole)

    def with_threads(content):
        pyarrow.set_cpu_count(threads)
        work(content)

    lines = whole[0].splitlines(keepends=True)
    entry = json.loads(lines[0].partition(b" ")[2])
    wide = [(n, forged({**entry, "results": {str(k): k for k in range(n)}}) + lines[1]) for n in (5_001, 30_000)]
    for number, content in wide:
        inputs, seconds = [(f"{number} results", content)], 2 + number / 5_000
        results = attack(with_threads, inputs, refusals=SwarmError, cpu=seconds, memory=1000)
        tally("ledgers: wide").add(results)


def test_what_is_cut_off_anywhere_is_written_again(tmp_path, tally, amount):
    keys = [f"{k:032x}" for k in range(3)]
    path = tmp_path / "whole"
    with Ledger(path) as ledger:
        for number, key in enumerate(keys):
            ledger.append(key, Outcome(steps=number, results={"a": 0.5}))
    content = path.read_bytes()
    area = tally("ledgers: torn")
    for cut in range(9, len(content), amount(7, 1)):
        torn = tmp_path / "torn"
        torn.write_bytes(content[:cut])
        with Ledger(torn) as ledger:
            for number, key in enumerate(keys):
                if key not in ledger:
                    ledger.append(key, Outcome(steps=number, results={"a": 0.5}))
        area.check(f"cut at {cut}", torn.read_bytes() == content)
