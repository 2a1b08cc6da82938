"""Machine code that is damaged, or that cannot be written: each command ends as if nothing were wrong."""

import os
import shutil
import subprocess
import sys
from contextlib import ExitStack
from hashlib import blake2b

import numpy as np
import pytest

from mesa_swarm.kernels.code_files import SEAL_BYTES
from support.disks import read_only, small_disk

pytestmark = pytest.mark.slow

# A model with a rule of a user's, whose machine code is stored too; loops are few, so that compiling is quick.
MODEL = """
from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.control import Subsumption, behaviour

@behaviour
def turn(me):
    return 0.5, -0.5

class Mine(SwarmModel):
    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT3, 2)
        self.control = Subsumption(turn())
"""


def damages(content, rng):
    """Yield, by name, what may be left of a file."""
    yield "empty", b""
    yield "zeros", b"\0" * len(content)
    yield "noise", rng.bytes(len(content))
    yield "first half", content[: len(content) // 2]
    yield "last byte lost", content[:-1]
    yield "seal only", content[:SEAL_BYTES]
    page = max(len(content) // 4096 - 1, 0)
    begin = 4096 * int(rng.integers(page + 1))
    yield "a page of zeros", content[:begin] + b"\0" * min(4096, len(content) - begin) + content[begin + 4096 :]
    place = int(rng.integers(len(content)))
    yield "one bit", content[:place] + bytes([content[place] ^ 1 << int(rng.integers(8))]) + content[place + 1 :]
    yield "an unsealed pickle", content[SEAL_BYTES:]
    yield "another version's", b"\x80\x04\x95\x05\0\0\0\0\0\0\0\x8c\x010\x94."


KINDS = [name for name, _ in damages(b"x" * 9000, np.random.default_rng(1))]


def ended(folder, **more):
    """Run a command; return its status, output and errors."""
    command = [sys.executable, "-m", "mesa_swarm", "run", "./mine.py:Mine", "--steps", "2", "--quiet"]
    settings = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "NUMBA_OPT": "1"} | more
    return subprocess.run(command, cwd=folder, env=settings, capture_output=True, check=False)


def is_sealed(path):
    content = path.read_bytes()
    return content[:SEAL_BYTES] == blake2b(content[SEAL_BYTES:], digest_size=SEAL_BYTES).digest()


@pytest.fixture
def first(tmp_path):
    """Run the command once; return its output, and the files of machine code that it has written."""
    (tmp_path / "mine.py").write_text(MODEL)
    done = ended(tmp_path)
    assert (done.returncode, done.stderr) == (0, b"")
    files = {path: path.read_bytes() for path in sorted((tmp_path / "cache").rglob("*.nbc"))}
    assert any(path.parent.name == "custom" for path in files)
    assert len(files) > 20
    return done.stdout, files


def test_where_all_files_are_damaged_all_are_compiled_anew_and_replaced(tmp_path, first, tally, amount):
    """Each file in each way, if there is time; else each in one of them."""
    output, files = first
    rng, area = np.random.default_rng(1), tally("machine code: all damaged")
    for shift in range(amount(1, len(KINDS))):
        damaged = {path: KINDS[(k + shift) % len(KINDS)] for k, path in enumerate(files)}
        for path, kind in damaged.items():
            path.write_bytes(dict(damages(files[path], rng))[kind])
        done = ended(tmp_path)
        same = (done.returncode, done.stdout, done.stderr) == (0, output, b"")
        for path, kind in damaged.items():
            area.check(f"{path.name} {kind}", same and is_sealed(path), repr((done.returncode, done.stderr[-200:])))


def test_where_one_file_is_damaged_the_result_is_the_same(tmp_path, first, tally, amount):
    """It is replaced, or left where nothing needs it: callers hold copies of small functions."""
    output, files = first
    rng, area = np.random.default_rng(1), tally("machine code: one damaged")
    for k, (path, content) in enumerate([*files.items()][:: amount(len(files) // 3, 1)]):
        kind = KINDS[k % len(KINDS)]
        remains = dict(damages(content, rng))[kind]
        path.write_bytes(remains)
        done = ended(tmp_path)
        same = (done.returncode, done.stdout, done.stderr) == (0, output, b"")
        left = path.read_bytes() == remains
        area.check(
            f"{path.name} {kind}", same and (left or is_sealed(path)), repr((done.returncode, done.stderr[-200:]))
        )
        path.write_bytes(content)


def left_in(folder, files, rng, state):
    """Let a folder of machine code be as a state names it: whole, damaged, half of it, or empty."""
    for k, (path, content) in enumerate(files.items()):
        place = folder / path.name if path.parent.name != "custom" else folder / "custom" / path.name
        place.parent.mkdir(parents=True, exist_ok=True)
        if state == "whole" or (state == "half" and k % 8):
            place.write_bytes(content)
        elif state == "damaged":
            place.write_bytes(content if k % 8 else dict(damages(content, rng))[KINDS[k % len(KINDS)]])


# What the installation has, what the user's cache is, and whether a line reports that nothing can be stored.
STATES = [
    ("whole", "missing", False),
    ("half", "missing", False),
    ("damaged", "missing", False),
    ("half", "whole", False),
    ("damaged", "damaged", False),
    ("half", "a file", True),
    ("damaged", "read-only", True),
    ("half", "full", True),
    ("half", "not defined", True),
    ("damaged", "half", False),
    ("empty", "missing", False),
    ("empty", "whole", False),
    ("empty", "a file", True),
    ("whole", "a file", False),
    ("whole", "not defined", False),
]


def test_a_read_only_installation_is_used_whatever_is_left_of_it_and_of_the_users_cache(tmp_path, first, tally, amount):
    output, files = first
    (home,) = (tmp_path / "cache").glob("*/*")
    rng, area = np.random.default_rng(1), tally("machine code: read-only installation")
    for number, (installed, own, reported) in enumerate(STATES[:: amount(3, 1)]):
        shutil.rmtree(home)
        home.mkdir()
        left_in(home, files, rng, installed)
        user = tmp_path / f"user_{number}"
        settings = {"XDG_CACHE_HOME": str(user)}
        with ExitStack() as stack:
            if own == "a file":
                user.write_text("")
            elif own == "full":
                stack.enter_context(small_disk(user, 16))
                (user / "filling").write_bytes(b"x" * 12_000)
            elif own == "not defined":
                settings = {"XDG_CACHE_HOME": "relative", "HOME": ""}
            else:
                left_in(
                    user / "mesa_swarm" / home.parent.name / home.name,
                    files,
                    rng,
                    "empty" if own == "read-only" else own,
                )
            if own == "read-only":
                stack.enter_context(read_only(user))
            stack.enter_context(read_only(tmp_path / "cache"))
            done = ended(tmp_path, **settings)
        lines = done.stderr.decode().splitlines()
        good = (done.returncode, done.stdout, len(lines)) == (0, output, int(reported))
        good &= all("machine code cannot be stored" in line for line in lines)
        area.check(f"{installed}, the user's {own}", good, repr((done.returncode, lines)))
