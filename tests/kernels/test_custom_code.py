"""Machine code of custom functions on disk: never stale, stored once, and refused where it cannot be known."""

import math
import os
import subprocess
import sys
from types import FunctionType

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels import code_files, custom_code
from mesa_swarm.kernels.custom_code import rename_function, store_on_disk
from mesa_swarm.kernels.custom_functions import compile_custom
from mesa_swarm.kernels.digests import digest_function

BODY = "def f(x, k=2):\n    return {}\n"


def made(text, **around):
    """Return the function of a text, with names around it."""
    space = {"__name__": "mine", "np": np, "math": math, **around}
    exec(BODY.format(text), space)
    return space["f"]


def stored(function):
    """Return a compiled function whose code is stored, and its digest."""
    digest = digest_function(function)
    return store_on_disk(compile_custom(rename_function(function, digest)), digest)


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """An empty folder for machine code."""
    for module in (code_files, custom_code):
        monkeypatch.setattr(module, "list_folders", lambda: (tmp_path,))
    return tmp_path / "custom"


def test_the_same_function_made_twice_has_one_digest():
    assert digest_function(made("x + k")) == digest_function(made("x + k"))
    assert digest_function(made("x + k")) is not None


NUMBERS = st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=3), st.tuples(st.integers()))


@given(NUMBERS, NUMBERS)
def test_digests_are_equal_exactly_if_the_values_that_are_used_are(one, other):
    same = repr(one) == repr(other)
    assert (digest_function(made("x + near", near=one)) == digest_function(made("x + near", near=other))) == same
    assert digest_function(made("x", near=one)) == digest_function(made("x", near=other))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (made("x + k"), made("x - k")),
        (made("x + 1"), made("x + 2")),
        (made("x + 1"), made("x + 1.0")),
        (made("x < 0.0"), made("x < -0.0")),
        (made("np.sin(x)"), made("np.cos(x)")),
        (made("max(x, 1)"), made("max(x, 1)", max=math.sin)),
        (made("x + a[0]", a=np.zeros(3)), made("x + a[0]", a=np.zeros(4))),
        (made("x + a[0]", a=np.zeros(3)), made("x + a[0]", a=np.array([0.0, 0.0, 1e-300]))),
        (made("x + a", a=np.float32(1)), made("x + a", a=np.float64(1))),
        (made("(lambda y: y + 1)(x)"), made("(lambda y: y + 2)(x)")),
        (
            made("wrapped(x)", wrapped=wrap_angle),
            made("wrapped(x)", wrapped=wrap_angle.py_func.__globals__["math"].sin),
        ),
    ],
)
def test_functions_that_do_other_things_have_other_digests(one, other):
    assert None not in (digest_function(one), digest_function(other))
    assert digest_function(one) != digest_function(other)


def test_defaults_and_what_is_closed_over_are_part_of_the_digest():
    def closing(near):
        return lambda x: x + near

    assert digest_function(closing(1)) != digest_function(closing(2))
    other = made("x + k")
    other.__defaults__ = (3,)
    assert digest_function(other) != digest_function(made("x + k"))
    assert digest_function(other, "more") != digest_function(other)


class Odd:
    """Something that raises an error whatever is asked of it."""

    def __getattr__(self, name):
        raise RuntimeError(name)


@pytest.mark.parametrize(
    "value",
    [{}, Odd(), Odd, object(), sys, made("x"), [{}], np.array([None])],
    ids=range(8),
)
def test_a_function_is_not_stored_if_it_is_not_known_when_something_that_it_uses_changes(value):
    function = made("near(x)", near=value)
    assert digest_function(function) is None
    assert rename_function(function, None) is function


def test_code_is_stored_and_found_by_another_dispatcher_which_compiles_nothing(folder):
    first, again = stored(made("x + near", near=3)), stored(made("x + near", near=3))
    assert (first(1), again(1)) == (4, 4)
    assert not first.stats.cache_hits
    assert again.stats.cache_hits
    assert len(list(folder.glob("*.nbc"))) == 1


def test_code_of_another_value_is_another(folder):
    assert [stored(made("x + near", near=near))(1) for near in (3, 4, 3)] == [4, 5, 4]
    assert len(list(folder.glob("*.nbc"))) == 2


def test_functions_of_one_name_do_not_meet_in_one_process(folder):
    functions = [made(f"x + {k}") for k in range(5)]
    assert [stored(function)(10) for function in functions] == [10, 11, 12, 13, 14]
    assert [stored(function)(10) for function in functions[::-1]] == [14, 13, 12, 11, 10]


def test_compiled_functions_of_a_user_that_it_calls_are_part_of_the_digest():
    one, other = (made("near(x)", near=numba.njit(made(f"x + {k}"))) for k in (1, 2))
    assert digest_function(one) == digest_function(made("near(x)", near=numba.njit(made("x + 1"))))
    assert digest_function(one) != digest_function(other)
    within = [made("far(x)", far=numba.njit(made("near(x)", near=numba.njit(made(f"x + {k}"))))) for k in (1, 2)]
    assert digest_function(within[0]) != digest_function(within[1])


def test_a_function_that_calls_a_compiled_one_that_calls_itself_is_not_stored():
    calling = made("near(x - 1) if x > 0 else x", near=None)
    calling.__globals__["near"] = numba.njit(calling)
    assert digest_function(calling) is None


def test_helpers_of_one_name_do_not_meet_whether_they_are_compiled_or_found(folder):
    def calling(k):
        return stored(made("near(x)", near=numba.njit(made(f"x + {k}"))))

    kept = [calling(k) for k in range(4)]
    assert [function(10) for function in kept] == [10, 11, 12, 13]
    again = [calling(k) for k in range(4)][::-1]
    assert [function(10) for function in again] == [13, 12, 11, 10]
    assert all(function.stats.cache_hits for function in again)


@pytest.mark.parametrize("damage", [lambda code: b"damage", lambda code: code[:-1], lambda code: b"\0" * len(code)])
def test_a_damaged_file_is_compiled_again_and_replaced(folder, damage):
    made_before = [stored(made("x + 1"))]  # kept: Numba finds by it what functions of no module need
    made_before[0](1)
    (file,) = folder.iterdir()
    file.write_bytes(damage(file.read_bytes()))
    for hits in (False, True):
        made_before.append(stored(made("x + 1")))
        assert made_before[-1](1) == 2
        assert bool(made_before[-1].stats.cache_hits) == hits
    assert list(folder.iterdir()) == [file]


def test_where_nothing_can_be_written_it_is_compiled_all_the_same(folder, capsys, monkeypatch):
    folder.write_text("")
    monkeypatch.setattr(code_files, "problems", [])
    monkeypatch.setenv(code_files.REPORTED, "")  # is unset again after the test
    monkeypatch.delenv(code_files.REPORTED)
    assert [stored(made("x + 1"))(1), stored(made("x + 2"))(1)] == [2, 3]
    assert capsys.readouterr().err.count("machine code cannot be stored") == 1


def test_code_is_stored_only_if_it_is_accepted_once_it_is_compiled(folder):
    digest = digest_function(made("x"))
    run = store_on_disk(compile_custom(rename_function(made("x"), digest)), digest, lambda: len(run.overloads) > 1)
    run(1)
    assert not folder.exists()
    run(1.0)
    assert len(list(folder.glob("*.nbc"))) == 1


def test_the_oldest_files_are_removed_beyond_the_limit(folder, monkeypatch):
    monkeypatch.setattr(custom_code, "MOST_STORED", 2)
    for k in range(5):
        stored(made(f"x + {k}"))(1)
    assert len(list(folder.iterdir())) == 2
    assert stored(made("x + 4"))(1) == 5


def test_a_renamed_function_does_the_same():
    def function(x, *, k=2):
        return x * k

    copy = rename_function(function, "ab")
    assert isinstance(copy, FunctionType)
    assert (copy(3), copy(3, k=3)) == (6, 9)
    assert copy.__qualname__.endswith("function_ab")


SCRIPT = """
import sys
from dataclasses import dataclass
from numba.core import event
from mesa_swarm import RobotDesign, Sensor, SwarmModel
from mesa_swarm.control import PASS, Subsumption, behaviour
FACTOR = float(sys.argv[1])

@dataclass(frozen=True, kw_only=True)
class Compass(Sensor):
    name: str = "compass"
    @staticmethod
    def read(heading, out):
        out[:, 0] = FACTOR * heading

@behaviour(memory={"count": 0})
def turn(me, limit=2.0):
    me.memory.count += 1
    if me.memory.count > limit:
        return PASS
    return FACTOR * me.max_speed, me.compass[0]

model = SwarmModel(rng=1)
model.add_robots(RobotDesign(sensors=(Compass(),)), 3)
model.control = Subsumption(turn())
with event.install_recorder("numba:compile") as recorded:
    model.run(4)
names = [e.data["dispatcher"].py_func.__name__ for _, e in recorded.buffer if e.is_start]
print(model.state_hash(), len({"read", "turn", "run"} & set(names)))
"""


def run_script(folder, factor):
    command, settings = [sys.executable, "-c", SCRIPT, str(factor)], os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    return subprocess.run(command, env=settings, capture_output=True, text=True, check=True).stdout.split()


@pytest.mark.slow
def test_rules_and_sensors_are_compiled_once_for_all_processes_until_a_value_that_they_use_changes(tmp_path):
    first, compiled = run_script(tmp_path, 0.5)
    assert compiled == "3"
    assert run_script(tmp_path, 0.5) == [first, "0"]
    other, compiled = run_script(tmp_path, 0.25)
    assert (other != first, compiled) == (True, "3")
