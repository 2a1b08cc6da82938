"""A rule's loops end or are refused, compiled or not; and its memory takes only what fits."""

import inspect
import itertools
import math
import re
import subprocess
import sys
import types
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit, vectorize
from numba.core.errors import NumbaExperimentalFeatureWarning

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import BehaviourError, UncompiledBehaviourWarning
from mesa_swarm.control import PASS, Explore, Subsumption, behaviour
from mesa_swarm.control.limits import MOST_LOOPS, calls_itself, find_uncounted

FIRST = {"n": 0, "x": 0.0, "on": False, "whole": [0, 0], "real": [0.0, 0.0]}


def driven(rule, robots=2):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(rule, Explore())
    return model


def run(rule, steps=1, plain=False):
    model = driven(rule)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model.run(steps)
    assert bool([one for one in caught if one.category is UncompiledBehaviourWarning]) == plain
    return model


def refused(rule, match):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UncompiledBehaviourWarning)
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)  # of functions as arguments
        with pytest.raises(BehaviourError, match=match) as caught:
            driven(rule).run(1)
    assert len(str(caught.value)) <= 300
    return str(caught.value)


# ---- loops without end


@njit
def spin(x):
    """Never return, for numbers above 0."""
    while x > 0.0:
        x += 1.0
    return x


@njit
def spin_within(x):
    """Call what never returns."""
    return spin(x) + 1.0


@njit
def counts_up(x):
    """Yield without end."""
    while True:
        x += 1.0
        yield x


tools = types.ModuleType("tools")
tools.spin = spin


def while_loop(me):
    n = 0
    while n >= 0:
        n += 1
    return 0.0, 0.0


def while_true_pass(me):
    while True:
        pass


def for_loop(me):
    n = 0
    for k in range(10**12):
        n += k
    return float(n), 0.0


def nested_loops(me):
    n = 0
    for _ in range(2000):
        for k in range(2000):
            n += k
    return float(n), 0.0


def comprehension(me):
    return float(len([k for k in range(10**9)])), 0.0


def called(me):
    return spin(1.0), 0.0


def called_by_another(me):
    return spin_within(1.0), 0.0


def called_in_a_module(me):
    return tools.spin(1.0), 0.0


def called_in_a_loop(me):
    total = 0.0
    for _ in range(2000):
        for k in range(400):
            total += k
        total += ended(300)
    return total, 0.0


@njit
def ended(n):
    """Take some iterations."""
    total = 0.0
    for k in range(n):
        total += k
    return total


def of_a_generator(me):
    total = 0.0
    for x in counts_up(1.0):
        total += x
    return total, 0.0


def of_an_inner_function(me):
    def inner(x):
        while x > 0.0:
            x += 1.0
        return x

    return inner(1.0), 0.0


@njit
def spin_on(x):
    """Never return either."""
    while x > 0.0:
        x += 2.0
    return x


@njit
def applied(function, x):
    """Call a function that is given."""
    return function(x)


WAYS = (spin, spin_on)


def called_in_a_tuple(me):
    return WAYS[0](1.0), 0.0


def called_as_an_argument(me):
    return applied(spin, 1.0), 0.0


def called_as_an_argument_of_a_module(me):
    return applied(tools.spin, 1.0), 0.0


def called_by_another_name(me):
    way = spin if me.radius > 1.0 else spin_on
    return way(1.0), 0.0


def of_an_inner_function_as_an_argument(me):
    def inner(x):
        while x > 0.0:
            x += 1.0
        return x

    return applied(inner, 1.0), 0.0


WITH_LOOPS = {part.py_func.__name__: part.py_func for part in (spin, spin_on, ended, counts_up)}
ENDLESS = [while_loop, while_true_pass, for_loop, nested_loops, comprehension, called, called_by_another]
ENDLESS += [called_in_a_module, called_in_a_loop, of_a_generator, of_an_inner_function]
ENDLESS += [called_in_a_tuple, called_as_an_argument, called_as_an_argument_of_a_module, called_by_another_name]
ENDLESS += [of_an_inner_function_as_an_argument]


@pytest.mark.slow
@pytest.mark.parametrize("rule", ENDLESS, ids=lambda rule: rule.__name__)
def test_a_loop_without_end_is_refused_with_the_rule_the_line_and_the_robot(rule):
    text = refused(
        behaviour(rule), rf"^rule {rule.__name__} failed for robot 5 in step 1: it looped more than 1,000,000"
    )
    name, line = re.search(r"in (\w+), line (\d+);", text).groups()
    source, first = inspect.getsourcelines(WITH_LOOPS.get(name, rule))
    # In a loop without a condition the line is that of its body.
    begins = ("for ", "while ", "pass", "x += 1.0", "return float(len([k for k")
    assert source[int(line) - first].strip().startswith(begins)


# The same in plain Python, and what only that can do.
def plain_while(me):
    text = [None, "x"]
    while text:
        pass
    return 0.0, 0.0


def plain_for(me):
    return float(sum(1 for _ in itertools.count())), len({}) * 1.0


def plain_iterator(me):
    for text in iter(str, "x"):
        str(text)
    return 0.0, 0.0


def plain_comprehension(me):
    return float(len({str(k) for k in itertools.repeat("x")})), 0.0


def plain_with_a_compiled_function(me):
    str({})
    return spin(1.0), 0.0


def plain_with_a_plain_function(me):
    return wait_for_ever("x"), 0.0


def wait_for_ever(text):
    while text:
        text += ""
    return 0.0


PLAIN = [plain_while, plain_for, plain_iterator, plain_comprehension, plain_with_a_compiled_function]
PLAIN += [plain_with_a_plain_function]


@pytest.mark.slow
@pytest.mark.parametrize("rule", PLAIN, ids=lambda rule: rule.__name__)
def test_a_loop_without_end_of_a_plain_rule_is_refused_too(rule):
    refused(behaviour(rule), "it looped more than 1,000,000 times in one step, in .*, line")
    assert sys.gettrace() is None


def test_a_plain_rule_that_calls_itself_without_end_is_refused():
    @behaviour
    def again(me):
        return deeper(1), 0.0

    def deeper(n):
        return deeper(n + 1)

    refused(again, "RecursionError|looped more than")


# ---- loops that end


@pytest.mark.parametrize("robots", [1, 3])
def test_each_robot_has_the_whole_budget_in_each_step(robots):
    @behaviour
    def busy(me):
        n = 0
        for k in range(999_000):
            n += k % 3
        return PASS if n > 0 else (0.0, 0.0)

    driven(busy, robots).run(3)


def test_the_budget_is_a_million_iterations_and_not_one_more():
    @behaviour
    def counted(me, times=10):
        for _ in range(times):
            pass
        return PASS

    driven(counted(times=MOST_LOOPS)).run(1)
    refused(counted(times=MOST_LOOPS + 1), "looped more than 1,000,000 times")


def test_a_rule_with_loops_computes_what_it_did_without_limits():
    @behaviour
    def nearest(me):
        best, least = 0, 1e9
        for s in range(len(me.distance)):
            if 0 <= me.distance[s] < least:
                best, least = s, me.distance[s]
        while best > 4:
            best -= 1
        return (float(best) / 10, 1.0)

    def twin(distance):
        seen = [(reading, s) for s, reading in enumerate(distance) if reading >= 0]
        return min(min(seen, default=(0, 0))[1], 4) / 10

    model = driven(nearest, robots=12)
    for _ in range(20):
        model.sense()
        readings = model.swarm.distance.copy()
        model.step()
        assert model.swarm.command[:, 0].tolist() == [twin(row) for row in readings.tolist()]


def test_a_rule_that_calls_itself_runs_as_plain_python_and_its_warning_names_the_function():
    with pytest.warns(UncompiledBehaviourWarning, match="factorial calls itself"):
        driven(behaviour(uses_factorial)).run(1)
    assert calls_itself(uses_factorial) == "factorial"
    assert calls_itself(called) is None


@njit
def factorial(n):
    """Return n!."""
    return 1 if n < 2 else n * factorial(n - 1)


@pytest.mark.slow
def test_iterations_are_counted_and_not_how_often_loops_begin_or_functions_are_called():
    @behaviour
    def nested(me):
        n = 0
        for _ in range(300_000):
            for k in range(2):
                n += k
        return PASS if n else (0.0, 0.0)

    @behaviour
    def empty(me):
        n = 1
        for _ in range(600_000):
            for k in range(0):
                n += k
        return PASS if n else (0.0, 0.0)

    driven(nested).run(1)
    driven(empty).run(1)


def twice(k):
    return 2 * k


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
def test_a_plain_rule_may_call_a_function_in_each_of_its_iterations():
    @behaviour
    def calling(me):
        last = {}
        for k in range(600_000):
            last["k"] = twice(k)
        return PASS

    driven(calling, 1).run(1)


def swallows(me):
    last = {}
    while True:
        try:
            for k in range(10):
                last["k"] = k
        except Exception:
            pass


@pytest.mark.slow
def test_a_plain_rule_that_swallows_errors_is_refused_too():
    refused(behaviour(swallows), r"looped more than 1,000,000 times in one step, in swallows, line \d+")


def uses_factorial(me):
    return (0.0, 1.0) if factorial(4) == 24 else PASS


def test_what_cannot_be_counted_in_a_plain_rule_is_named():
    @vectorize(["float64(float64)"])
    def squared(x):
        return x * x

    def mixed(me):
        str({})
        return squared(1.0) + tools.spin(-1.0), 0.0

    assert find_uncounted(mixed) == ["squared", "tools.spin"]
    with pytest.warns(UncompiledBehaviourWarning, match="loops in squared, tools.spin are not counted"):
        driven(behaviour(mixed)).run(1)


TABLE = {"spin": spin}


@pytest.mark.parametrize("name", ["TABLE", "WAYS", "tools.spin"])
def test_what_a_plain_rule_may_loop_in_is_named_before_it_begins(name):
    space = {"TABLE": TABLE, "WAYS": WAYS, "tools": tools, "reached": []}
    called = {"TABLE": 'TABLE["spin"]', "WAYS": "WAYS[0]", "tools.spin": "tools.spin"}[name]
    exec(f"def unbounded(me):\n    str({{}})\n    reached.append(1)\n    return {called}(-1.0), 0.0\n", space)
    with pytest.raises(UncompiledBehaviourWarning, match=f"loops in {name} are not counted, and may not end"):
        driven(behaviour(space["unbounded"])).run(1)  # warnings are errors here
    assert not space["reached"]


PROGRAM = """
import warnings
from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Explore, Subsumption, behaviour
import numba

@behaviour
def first(me, end=5):
    n = 0
    while n != end:
        n += 1
    return 0.1, 0.1

@behaviour
def second(me, end=7):
    n = 0
    while n != end:
        n += 1
    return 0.2, 0.2

compiled = []
numba.core.event.register("numba:compile", type("L", (numba.core.event.Listener,), dict(
    on_start=lambda self, event: compiled.append(event.data["dispatcher"].py_func.__name__), on_end=lambda *_: None))())
for rule in (first, second, first(end=-1), second(end=-1)):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, 1)
    model.control = Subsumption(rule, Explore())
    try:
        model.run(2)
        print("ended")
    except Exception as error:
        print(str(error)[:60])
print(len([name for name in compiled if name in ("first", "second")]))
"""


@pytest.mark.slow
def test_code_that_was_stored_on_disk_counts_as_well(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    outputs = []
    for _ in range(2):
        done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=True, timeout=600)
        outputs.append(done.stdout.splitlines())
    for *lines, _ in outputs:
        assert lines[:2] == ["ended", "ended"]
        assert lines[2].startswith("rule first failed for robot 5 in step 1: it looped more")
        assert lines[3].startswith("rule second failed for robot 5 in step 1: it looped more")
    assert outputs[1][-1] == "0"


# ---- memory


def sets_whole(me, value=0.5):
    me.memory.n = value
    return PASS


def sets_truth(me, value=0.5):
    me.memory.on = value
    return PASS


def sets_item(me, value=0.5):
    me.memory.whole[1] = value
    return PASS


def sets_item_at(me, value=0.5):
    for k in range(2):
        me.memory.whole[k] = value
    return PASS


def sets_by_another_name(me, value=0.5):
    memory = me.memory
    memory.n = value
    return PASS


def sets_slice(me, value=0.5):
    me.memory.whole[:] = me.memory.real + value
    return PASS


SETTERS = {sets_whole: "me.memory.n", sets_by_another_name: "me.memory.n", sets_truth: "me.memory.on"}
SETTERS |= dict.fromkeys((sets_item, sets_item_at, sets_slice), "a number in a list of me.memory")


def made(rule, is_plain):
    """Return a rule with memory; one that Numba refuses, if it has to be plain."""
    if not is_plain:
        return behaviour(memory=FIRST)(rule)

    def plainly(me, value=0.5):
        str({})
        return rule(me, value)

    return behaviour(memory=FIRST)(plainly)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("is_plain", [False, True])
@pytest.mark.parametrize("rule", SETTERS, ids=lambda rule: rule.__name__)
@pytest.mark.parametrize("value", [0.5, -1e-9, math.pi, 1e300])
def test_memory_that_began_as_a_whole_number_or_a_truth_value_refuses_other_numbers(rule, is_plain, value):
    refused(made(rule, is_plain)(value=value), f"it set {SETTERS[rule]} to .*, which does not fit the type")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("is_plain", [False, True])
@pytest.mark.parametrize("rule", SETTERS, ids=lambda rule: rule.__name__)
def test_it_takes_numbers_of_another_type_that_fit(rule, is_plain):
    model = driven(made(rule, is_plain)(value=1.0))
    model.run(2)
    name = "whole" if " " in SETTERS[rule] else SETTERS[rule].rpartition(".")[2]
    column = model.swarm.columns[f"0.{model.control.layers[0].name}.{name}"]
    assert np.all(column.reshape(2, -1)[:, -1] == 1)


@pytest.mark.slow
@given(st.floats(allow_nan=False) | st.integers(-(2**60), 2**60))
def test_a_real_number_takes_every_number(value):
    @behaviour(memory={"x": 0.0})
    def sets(me, value=0.5):
        me.memory.x = value
        return PASS

    if math.isfinite(value):
        model = driven(sets(value=value)).run(1)
        assert model.swarm.columns["0.sets.x"].tolist() == [float(value)] * 2


@pytest.mark.slow
def test_nan_and_infinity_are_refused_by_whole_numbers():
    @behaviour(memory=FIRST)
    def sets_nan(me):
        me.memory.n = math.nan
        return PASS

    @behaviour(memory=FIRST)
    def sets_infinity(me):
        me.memory.whole[0] = math.inf
        return PASS

    refused(sets_nan, "set me.memory.n to nan")
    refused(sets_infinity, "to inf, which does not fit")


def test_what_was_set_before_the_refusal_names_the_first_robot_concerned():
    @behaviour(memory={"n": 0})
    def chances(me):
        me.memory.n = me.chance
        return PASS

    refused(chances, r"^rule chances failed for robot 5 in step 1: it set me\.memory\.n to 0\.\d+")
