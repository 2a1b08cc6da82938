"""Hostile job files: wrong values, huge grids, deep nesting, odd names; a JobError of one line, in little time."""

import os
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm.base.errors import JobError
from mesa_swarm.experiments.jobs import read_job
from support.hostile import attack

pytestmark = pytest.mark.slow
GOOD = """name = "first"
model = "fire_fighting"
map = "openspace_fire"
robots = 2
steps = 5
seeds = [3, 4]
measure = ["fires out"]
record = { file = "runs/{name}_{seed}.arrow", every = 2 }
[parameters]
leave = 100.0
[grid]
strategy = ["A", "B"]
"""
SAMPLED = """model = "fire_fighting"
steps = 5
[sample]
kind = "sobol"
points = 4
[sample.ranges]
n_robots = [1, 3]
leave = [50.0, 100.0]
"""
VALUES = [
    "",
    "nan",
    "inf",
    "-1",
    "1e400",
    "9" * 400,
    "9" * 5000,
    "true",
    '"x"',
    '""',
    '"../../etc/passwd"',
    '"/etc/passwd"',
]
VALUES += [
    "[]",
    "[[1], [2]]",
    "{}",
    "{ a = 1 }",
    "1979-05-27",
    "07:32:00",
    '"\\u0000"',
    '"a\\nb"',
    f'"{"x" * 5000}"',
    "0.5",
]
VALUES += [
    "[1, 1]",
    "[nan, nan]",
    "[1, 10000000000]",
    "2147483648",
    '["A", "A"]',
    '"~/x"',
    '"con.arrow"',
    "[" * 3000 + "]" * 3000,
]
LONG = ", ".join(map(str, range(100_000)))


def changed(text, rng):
    """Return a job with values, keys, lines or letters changed."""
    lines = text.splitlines()
    for _ in range(rng.integers(1, 4)):
        k = int(rng.integers(len(lines)))
        kind = rng.integers(6)
        key, equals, _ = lines[k].partition("=")
        if kind <= 2 and equals:
            lines[k] = f"{key}= {VALUES[rng.integers(len(VALUES))]}"
        elif kind == 3:
            lines[k] = lines[int(rng.integers(len(lines)))]
        elif kind == 4:
            lines.pop(k) if len(lines) > 1 else None
        else:
            at = int(rng.integers(len(lines[k]) + 1))
            lines[k] = lines[k][:at] + chr(int(rng.integers(1, 0x250))) + lines[k][at:]
    return "\n".join(lines)


HEAD = 'model = "fire_fighting"\nsteps = 1\n'
HANDMADE = {
    "a million points": f"{HEAD}[grid]\nk1 = [{', '.join(f'0.{k:04}1' for k in range(1000))}]\n"
    f"k2 = [{', '.join(f'0.{k:04}1' for k in range(1000))}]",
    "a million points, often": "".join(
        f"[[run]]\n{HEAD}[run.grid]\nk1 = [{', '.join(f'0.{k:04}1' for k in range(1000))}]\n"
        f"k2 = [{', '.join(f'0.{k:04}1' for k in range(1000))}]\n"
        for _ in range(40)
    ),
    "10 ** 30 points": f"{HEAD}[grid]\n"
    + "\n".join(f"{name} = [{', '.join(f'0.{k:04}1' for k in range(1000))}]" for name in ("k1", "k2", "k3", "leave")),
    "100,000 values": f"{HEAD}[grid]\nleave = [{LONG}]",
    "100,000 seeds": f"{HEAD}seeds = [{LONG}]",
    "100,000 recordings": f'{HEAD}seeds = [{LONG}]\nrecord = "a_{{seed}}.arrow"',
    "recordings of many runs": "".join(
        f'[[run]]\nname = "r{k}"\n{HEAD}seeds = 10000\nrecord = "{{name}}_{{seed}}.arrow"\n' for k in range(40)
    ),
    "most seeds": f"{HEAD}seeds = 100000000",
    "a large sample": f'{HEAD}[sample]\nkind = "latin_hypercube"\npoints = 1000000\n'
    "[sample.ranges]\nleave = [1.0, 2.0]",
    "large samples": "".join(
        f'[[run]]\n{HEAD}[run.sample]\nkind = "sobol"\npoints = 524288\n[run.sample.ranges]\nleave = [1.0, 2.0]\n'
        for _ in range(50)
    ),
    "100,000 ranges": f'{HEAD}[sample]\nkind = "sobol"\npoints = 4\n[sample.ranges]\n'
    + "\n".join(f"a{k} = [0, 1]" for k in range(50_000)),
    "2,000 runs": f"[[run]]\n{HEAD}" * 2000,
    "deep lists": f"{HEAD}[parameters]\na = {'[' * 100_000}",
    "deep tables": f"{HEAD}[{'.'.join('a' * 200_000)}]\n",
    "deep keys": f"{HEAD}{'.'.join('a' * 200_000)} = 1\n",
    "deep inline tables": f"{HEAD}parameters = {'{ a = ' * 50_000}",
    "many keys": HEAD + "\n".join(f"a{k} = 1" for k in range(80_000)),
    "many tables": HEAD + "\n".join(f"[a.b{k}]" for k in range(80_000)),
    "long key": f"{HEAD}{'a' * 500_000} = 1",
    "not UTF-8": b"\xff\xfe\x00",
    "too large": "#" * 1_000_001,
    "nothing": "",
    "null": "\0" * 1000,
    "a job as its own map": HEAD + 'map = "job.toml"',
    "a pipe as map": HEAD + 'map = "pipe"',
    "a link as map": HEAD + 'map = "link.toml"',
    "a folder as map": HEAD + 'map = "folder"',
    "most robots": HEAD + "robots = 2147483647",
}


@pytest.fixture
def read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "secret.toml").write_text("password = 'zanzibar'")
    (tmp_path / "link.toml").symlink_to(tmp_path / "secret.toml")

    def work(content, name="job.toml"):
        path = Path(tmp_path, name)
        path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
        try:
            job = read_job(path)
        except JobError as error:
            assert "zanzibar" not in str(error)
            raise
        finally:
            path.unlink()
        assert all(len(experiment) for experiment in job.experiments)

    return work


def test_a_job_is_read_or_refused_in_one_line(read, tally, amount):
    read(GOOD)  # loads and compiles what all of them use
    rng = np.random.default_rng(1)
    mutations = [(f"mutated {k}", changed((GOOD, SAMPLED)[k % 2], rng)) for k in range(amount(120, 5000))]
    for area, inputs in (("hand-made", list(HANDMADE.items())), ("mutated", mutations)):
        tally(f"jobs: {area}").add(attack(read, inputs, refusals=JobError, cpu=5, memory=500))


NAMES = ["a\nb.toml", "x" * 250 + ".toml", "\udcff.toml", "'.toml", "\x1b[31m.toml", "job", "-job.toml"]


def test_a_job_may_have_any_name(read, tally):
    inputs = [(f"name {k}", name) for k, name in enumerate(NAMES)]
    results = attack(lambda name: read("steps = 'x'", name), inputs, refusals=JobError, cpu=5, memory=500)
    tally("jobs: names").add(results)
