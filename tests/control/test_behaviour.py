"""Rules of one's own: compiled where they can be, plain with a warning where not, never wrong in silence."""

import copy
import inspect
import math
import pickle
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, ProximitySensor, RobotDesign, disc
from mesa_swarm.control import PASS, Explore, Subsumption, behaviour
from mesa_swarm.errors import (
    BehaviourError,
    InvalidValueError,
    UncompiledBehaviourWarning,
    UnknownNameError,
)
from scenes import ahead, empty

SEEN = []


@behaviour
def timid(me, distance=20.0):
    """Back away from whatever is ahead."""
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, -me.max_speed
    return PASS


@behaviour
def chatty(me):
    """Cannot be compiled: it appends to a list."""
    SEEN.append(f"{me.radius}")
    return me.max_speed, 0.0


@behaviour
def careless(me, which=99):
    """Read a sensor that is not there."""
    return me.distance[which], 0.0


def facing_a_disc():
    model = empty()
    model.add_obstacle(disc((222, 150), 5))
    return model, model.add_robots(AGENT9, poses=[(200, 150, 0.0)])[0]


def step_with(rule):
    """Return a model after one step of a robot in front of a disc."""
    model, _ = facing_a_disc()
    model.control = None if rule is None else Subsumption(rule)
    model.step()
    return model


def test_a_rule_drives_the_robot_where_it_has_something_to_say_and_passes_otherwise():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid, Explore())
    model.step()
    assert model.swarm.command.tolist() == [[-1.0, -1.0]]
    model.control = Subsumption(timid(distance=5), Explore())
    model.step()
    assert model.swarm.layer.tolist() == [1]


def test_a_compiled_rule_does_what_the_plain_function_does():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid(distance=13.0), Explore())
    for _ in range(20):
        model.step()
        ahead = model.swarm.distance[0, 0]
        assert model.swarm.layer[0] == (0 if 0 <= ahead < 13.0 else 1)


def test_a_rule_that_cannot_be_compiled_runs_as_plain_python_with_one_warning():
    model, _ = facing_a_disc()
    model.control = Subsumption(chatty)
    with pytest.warns(UncompiledBehaviourWarning, match="rule chatty cannot be compiled"):
        model.step()
    model.step()
    assert SEEN[-2:] == ["5.0", "5.0"]
    assert model.swarm.command.tolist() == [[1.0, 0.0]]


def test_the_warning_says_in_one_line_why_and_points_to_the_rule():
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


def test_a_rule_that_returns_nan_is_reported_with_the_robot_the_rule_and_the_step():
    @behaviour
    def late(me):
        return (math.nan if me.distance[me.front] < 10.0 else 0.0), 1.0

    model, robot = facing_a_disc()
    model.control = Subsumption(late, Explore())
    model.run(1)
    robot.position = (203, 150)
    with pytest.raises(
        BehaviourError, match=rf"^rule late failed for robot {robot.unique_id} in step 2: it returned .nan, 1"
    ):
        model.step()


WRONG_RETURNS = {
    "one wheel": (lambda me: 1.0, "returned 1.0"),
    "three wheels": (lambda me: (1.0, 1.0, 1.0), "returned (1.0, 1.0, 1.0)"),
    "one wheel in a tuple": (lambda me: (1.0,), "returned (1.0,)"),
    "nothing": (lambda me: None, "returned None (a branch without return?)"),
    "a text": (lambda me: "ab", "returned 'ab'"),
    "texts": (lambda me: ("1", "2"), "returned ('1', '2')"),
    "complex": (lambda me: (1j, 1.0), "returned (1j, 1.0)"),
    "nested": (lambda me: ((1.0, 2.0), 1.0), "returned ((1.0, 2.0), 1.0)"),
    "yes and no": (lambda me: (True, False), "returned (True, False)"),
    "nan": (lambda me: (math.nan, 1.0), "returned (nan, 1)"),
    "half a PASS": (lambda me: (math.inf, 1.0), "returned (inf, 1)"),
}


@pytest.mark.parametrize("plain", [False, True], ids=["compiled", "plain"])
@pytest.mark.parametrize("name", WRONG_RETURNS)
def test_what_no_wheel_can_do_is_refused_with_robot_rule_step_what_was_got_and_what_is_expected(name, plain):
    function, words = WRONG_RETURNS[name]

    def slow(me):
        SEEN.append(f"{me.radius}")
        return function(me)

    model, robot = facing_a_disc()
    model.control = Subsumption(behaviour(slow if plain else function))
    with pytest.raises(BehaviourError) as caught:
        model.step()
    said = str(caught.value)
    rule = "slow" if plain else "<lambda>"
    assert said.startswith(f"rule {rule} failed for robot {robot.unique_id} in step 1: it {words}; expected two finite")
    assert "\n" not in said


def test_a_branch_that_no_robot_has_come_to_is_refused_too():
    def three_when_hot(me):
        if me.hot:
            return 1.0, 1.0, 1.0
        return PASS

    def writes_when_hot(me):
        if me.hot:
            me.distance[0] = 5.0
        return PASS

    def misspelt_when_hot(me):
        if me.hot:
            return me.maxspeed, 0.0
        return PASS

    with pytest.raises(BehaviourError, match="step 1: it does not return two wheel speeds in every branch"):
        step_with(behaviour(three_when_hot))
    with pytest.raises(BehaviourError, match="step 1: it changes what it sees"):
        step_with(behaviour(writes_when_hot))
    with pytest.raises(BehaviourError, match=r"step 1: it uses an unknown field of me 'maxspeed'.* mean 'max_speed'"):
        step_with(behaviour(misspelt_when_hot))


@pytest.mark.parametrize("plain", [False, True], ids=["compiled", "plain"])
def test_an_error_of_the_rule_is_reported_with_the_robot_and_kept_as_its_cause(plain):
    def careful(me, slow=plain):
        if slow:
            SEEN.append("")
        if me.radius > 4.5:
            raise ValueError("too wide\nfor this")
        return PASS

    model, _ = facing_a_disc()
    model.remove_robots(model.robots)
    model.add_robots(RobotDesign(radius=4.0), poses=[(50, 50, 0.0)])
    (wide,) = model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(behaviour(careful))
    with pytest.raises(
        BehaviourError, match=rf"robot {wide.unique_id} in step 1: it raised ValueError: too wide for"
    ) as caught:
        model.step()
    assert isinstance(caught.value.__cause__, ValueError)


@pytest.mark.parametrize("which", [99, 9, -2])
def test_a_rule_that_reads_a_sensor_that_is_not_there_is_reported_instead_of_reading_elsewhere(which):
    with pytest.raises(BehaviourError, match="IndexError: there is no") as caught:
        step_with(careless(which=which))
    assert isinstance(caught.value.__cause__, IndexError)


def slowly(function):
    """Return the same rule in a form that Numba refuses."""

    def slow(me):
        SEEN.append(f"{me.radius}")
        return function(me)

    return slow


@pytest.mark.filterwarnings("ignore::mesa_swarm.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("form", [lambda f: f, slowly], ids=["compiled", "plain"])
class TestWhatARuleSees:
    def test_cannot_be_changed(self, form):
        def greedy(me):
            me.distance[0] = 5.0
            return PASS

        def sorting(me):
            me.radiation.sort()
            return PASS

        def adding(me):
            me.kind[:2] += 1
            return PASS

        for rule in (greedy, sorting, adding):
            model = step_with(None)
            before = model.swarm.distance.copy()
            model.control = Subsumption(behaviour(form(rule)))
            with pytest.raises(BehaviourError, match="in step 2: it") as caught:
                model.step()
            assert "\n" not in str(caught.value)
            assert np.array_equal(model.swarm.distance, before)

    def test_is_nothing_where_there_is_no_such_sensor(self, form):
        def looks_ahead(me):
            nothing = me.distance[me.front] == -1 and me.kind[me.front] == -1 and math.isnan(me.bearing[me.front])
            dark = me.radiation[-1] == 0 and not me.line[-1]
            return (1.0 if nothing else 0.0), (1.0 if dark else 0.0)

        rear = RobotDesign(sensors=(ProximitySensor(bearing_degrees=180, range=90),))
        model = empty()
        model.add_robots(rear, poses=[(20, 150, 0.0)])
        model.control = Subsumption(behaviour(form(looks_ahead)))
        model.step()
        assert model.swarm.distance[0, 0] == pytest.approx(15)  # the border behind it
        assert model.swarm.command.tolist() == [[1.0, 1.0]]

    def test_has_as_many_entries_as_its_own_design_has_sensors(self, form):
        def counts(me):
            total = 0
            for s in range(len(me.distance)):
                if me.kind[s] >= -1 and -4.0 < me.bearing[s] < 4.0:
                    total += 1
            return total / 10.0, len(me.radiation) / 10.0

        model = empty()
        model.add_robots(AGENT3, poses=[(50, 50, 0.0)])
        model.add_robots(AGENT9, poses=[(150, 50, 0.0)])
        model.control = Subsumption(behaviour(form(counts)))
        model.step()
        assert model.swarm.command.tolist() == [[0.3, 0.0], [0.9, 0.0]]

    def test_is_computed_with_like_any_array(self, form):
        def nearest(me):
            doubled = (me.distance * 2.0)[-1] == 2.0 * me.distance[8]
            return (0.5 if doubled else 0.0), (0.5 if me.distance.max() == max(me.distance) else 0.0)

        model, _ = facing_a_disc()
        model.control = Subsumption(behaviour(form(nearest)))
        model.step()
        assert model.swarm.command.tolist() == [[0.5, 0.5]]


# ---- chance


def wander_of(rule, *others, seed=1, steps=5):
    """Return the commands of three robots in every step."""
    model = empty(rng=seed)
    model.add_robots(AGENT9, poses=[(50, 50, 0.0), (150, 50, 0.0), (250, 50, 0.0)])
    model.control = Subsumption(*others, rule)
    commands = []
    for _ in range(steps):
        model.step()
        commands.append(model.swarm.command.copy())
    return np.array(commands)


@behaviour
def wander(me):
    """Drive with one wheel at random speed, which is the same however often it is asked for."""
    return me.chance, me.chance


def test_chance_is_new_for_every_robot_and_step_and_the_same_for_the_same_seed():
    left, right = np.moveaxis(wander_of(wander), -1, 0)
    assert np.array_equal(left, right)
    assert len(np.unique(left)) == left.size
    assert ((left >= 0) & (left < 1)).all()
    assert np.array_equal(wander_of(wander)[..., 0], left)
    assert not np.array_equal(wander_of(wander, seed=2)[..., 0], left)


def test_chance_does_not_depend_on_other_layers():
    assert np.array_equal(wander_of(wander, timid(distance=0)), wander_of(wander))
    with_noise = wander_of(wander, timid(distance=0), Explore(turn_interval=1, speed=0), steps=1)
    assert with_noise.shape == (1, 3, 2)


def test_chance_is_drawn_only_for_rules_that_ask_for_it():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid, wander)
    model.run(3)
    states = model.streams.state()
    assert states["decide.wander"] != states["decide.timid"]
    fresh = np.random.Generator(np.random.PCG64(1))
    timid_stream, wander_stream = (model.streams[f"decide.{name}"] for name in ("timid", "wander"))
    assert has_drawn(wander_stream)
    assert not has_drawn(timid_stream)
    assert not has_drawn(fresh)


def has_drawn(generator):
    """Tell whether a generator is not where its seed put it."""
    seeds = generator.bit_generator.seed_seq
    return np.random.PCG64(seeds).state != generator.bit_generator.state


def test_chance_is_uniform():
    drawn = wander_of(wander, steps=400)[..., 0].ravel()
    counts = np.histogram(drawn, bins=8, range=(0, 1))[0]
    assert abs(counts - 150).max() < 60  # five standard deviations


GENERATOR = np.random.default_rng(1)


def helper():
    return random.random()


def imports_it(me):
    from numpy import random as chances  # noqa: PLC0415

    return chances.random(), 1.0  # noqa: NPY002


OWN_RANDOMNESS = {
    "np.random": lambda me: (np.random.random(), 1.0),  # noqa: NPY002
    "random": lambda me: (random.random(), 1.0),
    "GENERATOR": lambda me: (GENERATOR.random(), 1.0),
    "numpy": imports_it,
}


@pytest.mark.parametrize("name", OWN_RANDOMNESS)
def test_random_numbers_that_the_seed_does_not_govern_are_refused_with_the_cure(name):
    model, _ = facing_a_disc()
    with pytest.raises(BehaviourError, match=f"uses {name}, which .*; use me.chance"):
        model.control = Subsumption(behaviour(OWN_RANDOMNESS[name]))


def test_random_numbers_of_a_helper_are_refused_too():
    inner = GENERATOR.random

    def enclosing(me):
        return inner(), 1.0

    model, _ = facing_a_disc()
    for rule in (enclosing, lambda me: (helper(), 1.0)):
        with pytest.raises(BehaviourError, match="which the model's seed does not govern"):
            model.control = Subsumption(behaviour(rule))


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


def test_a_model_with_rules_goes_on_in_another_process(tmp_path):
    model = empty()
    model.add_robots(AGENT9, poses=[(50, 50, 0.0)])
    model.control = Subsumption(ahead(speed=0.5))
    stored = tmp_path / "model.pickle"
    stored.write_bytes(pickle.dumps(model.run(2)))
    code = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb')).run(3).state_hash())"
    places = [str(Path(inspect.getfile(empty)).parent), str(Path(__file__).parents[2])]
    command = [sys.executable, "-c", f"import sys; sys.path[:0] = {places}; {code}", str(stored)]
    said = subprocess.run(command, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == model.run(3).state_hash()


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


def test_parameters_keep_the_type_that_the_rule_was_written_for():
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


def test_a_rule_knows_all_that_it_is_promised():
    @behaviour
    def curious(me):
        known = me.distance[me.left] + me.distance[me.right] + me.bearing[me.left] + me.tendency + me.radius
        if me.hot or me.extinguishing or me.kind[me.front] > 9:
            return PASS
        return 0.0 * (known + me.temperature + me.heat + me.line.size + me.radiation.size), me.max_speed

    model, _ = facing_a_disc()
    model.control = Subsumption(curious)
    model.step()
    assert model.swarm.command.tolist() == [[0.0, 1.0]]


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


def test_a_rule_works_for_designs_without_any_sensor_of_a_kind():
    model = empty()
    model.add_robots(RobotDesign(sensors=()), poses=[(50, 50, 0.0)])

    @behaviour
    def blind(me):
        return me.max_speed, me.max_speed

    model.control = Subsumption(blind)
    model.step()
    assert model.swarm.position[0] == pytest.approx((51, 50))
