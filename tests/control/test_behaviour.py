"""Custom rules: compiled where they can be, plain with a warning where not, copied with their model."""

import copy
import math
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT9
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, UncompiledBehaviourWarning, UnknownNameError
from mesa_swarm.control import PASS, Explore, Subsumption, behaviour
from support.rules import SEEN, facing_a_disc, slowly, step_with, timid, wander
from support.scenes import ahead, empty


@behaviour
def chatty(me):
    """Cannot be compiled: it appends to a list."""
    SEEN.append(f"{me.radius}")
    return me.max_speed, 0.0


def test_a_rule_drives_the_robot_where_it_is_active_and_passes_otherwise():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid, Explore())
    model.step()
    assert model.swarm.command.tolist() == [[-1.0, -1.0]]
    model.control = Subsumption(timid(distance=5), Explore())
    model.step()
    assert model.swarm.layer.tolist() == [1]


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
def test_a_compiled_rule_does_what_the_plain_function_does():
    ways = []
    for rule in (timid, behaviour(slowly(timid.rule.function))):
        model, _ = facing_a_disc()
        model.control = Subsumption(rule, Explore())
        ways.append([(*model.run(1).swarm.command[0].tolist(), model.swarm.layer[0]) for _ in range(20)])
    assert ways[0] == ways[1]
    assert {layer for *_, layer in ways[0]} == {0, 1}


def test_a_rule_that_cannot_be_compiled_runs_as_plain_python_with_one_warning():
    model, _ = facing_a_disc()
    model.control = Subsumption(chatty)
    with pytest.warns(UncompiledBehaviourWarning, match="rule chatty cannot be compiled"):
        model.step()
    model.step()
    assert SEEN[-2:] == ["5.0", "5.0"]
    assert model.swarm.command.tolist() == [[1.0, 0.0]]


def test_the_warning_gives_the_reason_in_one_line_and_points_to_the_rule():
    def slow(me):
        SEEN.append(f"{me.radius}")
        return me.max_speed, 0.0

    with pytest.warns(UncompiledBehaviourWarning) as warned:
        step_with(behaviour(slow))
    (warning,) = warned
    assert (warning.filename, warning.lineno) == (__file__, slow.__code__.co_firstlineno)
    assert "\n" not in str(warning.message)
    assert f"(line {slow.__code__.co_firstlineno + 1})" in str(warning.message)


def test_the_warning_is_itself_where_warnings_are_errors():
    with pytest.raises(UncompiledBehaviourWarning, match="cannot be compiled"):
        step_with(behaviour(lambda me: (float(f"{me.radius}"), 0.0)))


# ---- copies


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_model_with_rules_goes_on_in_a_copy_as_it_does(duplicate):
    model, _ = facing_a_disc()
    model.control = Subsumption(timid(distance=13.0), wander, ahead)
    model.run(3)
    twin = duplicate(model)
    other = duplicate(twin)
    assert model.run(20).state_hash() == twin.run(20).state_hash() == other.run(20).state_hash()
    assert twin.control.layers[0].parameters == {"distance": 13.0}
    assert twin.control.layers[0].rule is timid.rule


@pytest.mark.slow
def test_a_model_with_rules_goes_on_in_another_process(tmp_path):
    model = empty()
    model.add_robots(AGENT9, poses=[(50, 50, 0.0)])
    model.control = Subsumption(ahead(speed=0.5))
    stored = tmp_path / "model.pickle"
    stored.write_bytes(pickle.dumps(model.run(2)))
    code = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb')).run(3).state_hash())"
    places = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]
    command = [sys.executable, "-c", f"import sys; sys.path[:0] = {places}; {code}", str(stored)]
    printed = subprocess.run(command, capture_output=True, text=True, check=True)
    assert printed.stdout.strip() == model.run(3).state_hash()


def test_a_rule_that_pickle_cannot_find_by_its_name_is_refused_in_one_line_but_can_be_copied():
    def local(me):
        return PASS

    model, _ = facing_a_disc()
    for rule in (local, lambda me: PASS):
        model.control = Subsumption(behaviour(rule))
        with pytest.raises(BehaviourError, match=r"cannot be pickled.*; define it at the top level of a module$"):
            pickle.dumps(model)
        copy.deepcopy(model).run(2)


# ---- parameters


def test_parameters_have_the_type_that_the_rule_was_written_for():
    @behaviour
    def choosy(me, sensor=0, eager=True, share=1.0):
        if eager and me.distance[sensor] >= 0:
            return share * me.max_speed, 0.0
        return PASS

    assert choosy(sensor=2.0, share=1).parameters == {"sensor": 2, "eager": True, "share": 1.0}
    assert [type(v) for v in choosy(sensor=2.0, share=1).parameters.values()] == [int, bool, float]
    assert step_with(choosy).swarm.layer.tolist() == [0]
    assert step_with(choosy(eager=False)).swarm.layer.tolist() == [-1]
    with pytest.raises(InvalidValueError, match="choosy's eager is 1; expected True or False"):
        choosy(eager=1)
    with pytest.raises(InvalidValueError, match="share is True"):
        choosy(share=True)


def test_a_behaviour_shows_its_name_and_parameters():
    assert repr(timid(distance=5)) == "<Behaviour timid(distance=5.0)>"


@pytest.mark.parametrize("wrong", [5, "timid", max, AGENT9, lambda: PASS, lambda me, *, near: PASS, lambda *me, x: 1])
def test_what_is_not_a_rule_is_refused(wrong):
    with pytest.raises(InvalidValueError, match=r"expected a function of me|expected me as|without a default"):
        behaviour(wrong)


async def waits(me):
    return PASS


def yields(me):
    yield PASS


async def waits_and_yields(me):
    yield PASS


@pytest.mark.parametrize("wrong", [waits, yields, waits_and_yields])
def test_a_rule_that_does_not_return_at_once_is_refused(wrong):
    with pytest.raises(InvalidValueError, match=f"rule {wrong.__name__} is async or yields; expected a function that"):
        behaviour(wrong)


def test_a_rule_is_compiled_once_for_all_its_variants():
    model, _ = facing_a_disc()
    for distance in (5, 6.0, np.float32(7)):
        model.control = Subsumption(timid(distance=distance))
        model.step()
    assert timid(distance=1).rule is timid.rule


def test_a_rule_may_ask_for_less_than_full_speed_and_is_limited_to_it():
    @behaviour
    def racer(me):
        return 9.0 * me.max_speed, -9.0 * me.max_speed

    model, _ = facing_a_disc()
    model.control = Subsumption(racer)
    model.step()
    assert model.swarm.command.tolist() == [[1.0, -1.0]]


def test_parameters_without_a_number_are_refused():
    with pytest.raises(InvalidValueError, match="without a default"):
        behaviour(lambda me, distance: PASS)
    with pytest.raises(InvalidValueError, match="distance"):
        timid(distance=math.nan)
    with pytest.raises(UnknownNameError, match="did you mean 'distance'"):
        timid(distanse=3)


def test_robots_for_which_no_layer_is_active_stop():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid(distance=1))
    model.step()
    assert model.swarm.command.tolist() == [[0.0, 0.0]]
    assert model.swarm.layer.tolist() == [-1]
    assert np.array_equal(model.swarm.position, [[200, 150]])
