"""Models are the same with every version of Mesa: steps, seeds, events, simulators, scenarios, copies."""

import copy
import pickle
from functools import partial
from random import Random

import mesa
import numpy as np
import pytest

from mesa_swarm import AGENT9, Recording, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RecordingError, UnknownNameError, UnobservedStepError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import CollisionAvoidance
from mesa_swarm.model.observers import Observer
from mesa_swarm.models.fire_fighting import FireFighting

HAS_EVENTS = hasattr(mesa.Model, "schedule_event")
with_events = pytest.mark.skipif(not HAS_EVENTS, reason="Mesa 3.3 has events in simulators only")
try:
    from mesa.experimental.devs import ABMSimulator, DEVSimulator
except ImportError:
    ABMSimulator = DEVSimulator = None
with_simulators = pytest.mark.skipif(ABMSimulator is None, reason="Mesa 4 has no simulators")
old_simulators = pytest.mark.filterwarnings("ignore:(ABM|DEV)Simulator is deprecated:FutureWarning")
try:
    from mesa.experimental.scenarios import Scenario
except ImportError:
    Scenario = None
with_scenarios = pytest.mark.skipif(Scenario is None, reason="Mesa 3.3 has no scenarios")


class Crowd(SwarmModel):
    """Three robots that explore."""

    def __init__(self, *, n_robots: int = 3, distance: float = 15.0, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, n_robots)
        self.control = Subsumption(Avoid(distance=distance), Explore())

    def turn(self):
        """Turn the first robot by hand."""
        self.robots[0].heading = 1.0


class Notes(Observer):
    """Writes down what it is called for."""

    def __init__(self):
        self.calls = []

    def before_step(self, model):
        self.calls.append(("before", model.steps, model.completed))

    def after_step(self, model, step):
        self.calls.append(("after", model.steps, step))

    def between_steps(self, model):
        self.calls.append(("between", model.steps, model.completed))


# ---- steps


def test_steps_are_counted_before_anything_of_a_step_and_observers_are_called_around_it():
    model, notes = Crowd(rng=1), Notes()
    model.observers.append(notes)
    model.step()
    model.run(1)
    assert notes.calls == [
        *(("before", 1, 0), ("after", 1, 1), ("between", 1, 1)),
        *(("before", 2, 1), ("after", 2, 2), ("between", 2, 2)),
    ]
    assert (model.steps, model.completed) == (2, 2)


def test_a_step_that_failed_was_counted_and_the_next_one_is_taken():
    class Failing(Crowd):
        fails = True

        def step(self):
            if self.fails:
                raise RuntimeError("it broke")
            super().step()

    model = Failing(rng=1)
    with pytest.raises(RuntimeError, match="it broke"):
        model.step()
    model.fails = False
    model.run(2)
    assert (model.steps, model.completed) == (3, 2)


def test_a_step_beside_the_models_own_raises_if_something_observes_it_and_changes_nothing():
    model = Crowd(rng=1)
    model.observers.append(Notes())
    before = model.state_hash()
    with pytest.raises(UnobservedStepError, match=r"call model\.step\(\)") as error:
        Crowd.step(model)
    assert len(str(error.value)) <= 300
    assert (model.state_hash(), model.observers[0].calls) == (before, [])
    assert model.run(1).completed == 1


def test_a_step_beside_the_models_own_is_taken_if_nothing_observes_it():
    model = Crowd(rng=1)
    Crowd.step(model)
    assert model.state_hash() == Crowd(rng=1).run(1).state_hash()


@pytest.mark.parametrize("every", [1, 2, 10])
def test_a_recording_that_would_miss_steps_ends_with_an_error_and_is_whole_up_to_there(tmp_path, every):
    class Twice(Crowd):
        double = False

        def step(self):
            super().step()
            if self.double:
                super().step()

    model, path = Twice(rng=1), tmp_path / "run.arrow"
    recorder = model.record(path, every=every)
    model.run(10)
    model.double = True
    with pytest.raises(RecordingError, match="step 12 was not taken by") as error:
        model.run(20)
    assert len(str(error.value)) <= 300
    assert (recorder.closed, len(model.observers)) == (True, 0)
    assert Recording(path).steps.tolist() == list(range(every, 11, every))


def test_every_step_of_a_run_is_in_its_recording(tmp_path):
    with (model := Crowd(rng=1)).record(tmp_path / "run.arrow"):
        model.run(50)
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 51))
    assert Crowd.verify(tmp_path / "run.arrow").same


# ---- seeds


@pytest.mark.parametrize("seed", [0, 7, np.int64(7)])
def test_a_whole_number_seeds_both_generators_of_a_model(seed):
    model = SwarmModel(rng=seed)
    assert model.random.random() == Random(int(seed)).random()
    assert model.rng.random() == np.random.default_rng(seed).random()


@pytest.mark.parametrize("make", [lambda: np.random.SeedSequence(5), lambda: [3, 4], lambda: np.random.default_rng(5)])
def test_another_seed_seeds_pythons_generator_by_the_first_draw_of_numpys(make):
    model, twin = SwarmModel(rng=make()), np.random.default_rng(make())
    assert model.random.random() == Random(int(twin.integers(2**31 - 1))).random()
    if isinstance(make(), np.random.Generator):
        assert model.streams.seed.entropy == twin.integers(2**63)
    assert model.rng.random() == twin.random()


@pytest.mark.parametrize("make", [SwarmModel, FireFighting, partial(TaskWorld, task=CollisionAvoidance())])
@pytest.mark.parametrize("rng", [np.random.RandomState(1), Random(1), np.random, True, 1.0, "1", -1, np.array(1)])
def test_what_is_no_seed_is_refused_where_it_enters(make, rng):
    with pytest.raises(InvalidValueError, match=r"^rng is .*; expected a whole number of at least 0, a SeedSequence"):
        make(rng=rng)


@pytest.mark.skipif(not mesa.__version__.startswith("4"), reason="other versions take every generator of NumPy's")
@pytest.mark.parametrize("kind", [np.random.MT19937, np.random.Philox])
def test_a_generator_that_mesa_4_cannot_read_is_refused_in_one_line(kind):
    with pytest.raises(InvalidValueError, match=f"rng is of {kind.__name__}, of which Mesa 4"):
        SwarmModel(rng=np.random.Generator(kind(1)))


# ---- events and simulators


def hand_made():
    model = Crowd(rng=1).run(5)
    model.turn()
    return model.run(5).state_hash()


@with_events
@pytest.mark.parametrize("go_on", ["run_for", "run_until", "step", "run"])
@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UnstoredStateWarning")
def test_an_event_between_two_steps_is_as_a_change_by_hand_and_no_step_is_missed(go_on, tmp_path):
    model = Crowd(rng=1)
    model.schedule_event(model.turn, at=5.5)
    with model.record(tmp_path / "run.arrow"):
        if go_on == "step":
            for _ in range(10):
                model.step()
        else:
            getattr(model, go_on)(10)
    assert (model.steps, model.completed, model.time) == (10, 10, 10)
    assert model.state_hash() == hand_made()
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 11))


@with_events
def test_recurring_events_occur_between_steps():
    model, seen = Crowd(rng=1), []

    def note():
        seen.append((model.time, model.steps))

    model.schedule_recurring(note, mesa.time.Schedule(interval=2.0, start=1.5))
    assert model.run(6).state_hash() == Crowd(rng=1).run(6).state_hash()
    assert seen == [(1.5, 1), (3.5, 3), (5.5, 5)]


@with_simulators
@old_simulators
def test_a_simulator_of_steps_takes_the_same_steps(tmp_path):
    model, simulator, seen = Crowd(rng=1), ABMSimulator(), []

    def note():
        seen.append(model.steps)

    simulator.setup(model)
    simulator.schedule_event_absolute(note, 4)
    with model.record(tmp_path / "run.arrow", checkpoint_every=0):
        simulator.run_for(6)
        simulator.run_until(10)
    assert (model.steps, model.completed, seen) == (10, 10, [4])
    assert model.state_hash() == Crowd(rng=1).run(10).state_hash()
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 11))


@with_simulators
@old_simulators
def test_a_simulator_of_events_takes_steps_as_events_in_mesa_3_3_and_none_in_mesa_3_5():
    model, simulator = Crowd(rng=1), DEVSimulator()
    simulator.setup(model)
    for time in (0.5, 0.7, 2.0):
        simulator.schedule_event_absolute(model.step, time)
    simulator.run_until(3.0)
    assert model.steps == model.completed == (0 if HAS_EVENTS else 3)
    assert model.state_hash() == Crowd(rng=1).run(model.steps).state_hash()


# ---- scenarios


@with_scenarios
def test_a_scenario_sets_the_parameters_and_the_seed_and_stays_the_models(tmp_path):
    class Large(Scenario):
        n_robots: int = 5
        noise: float = 0.1

    scenario = Large(rng=1, distance=20.0)
    model = Crowd(scenario=scenario)
    with model.record(tmp_path / "run.arrow"):
        model.run(20)
    assert model.state_hash() == Crowd(n_robots=5, distance=20.0, noise=0.1, rng=1).run(20).state_hash()
    assert model.scenario is scenario
    assert model.robots[0].scenario.n_robots == 5
    assert Crowd.verify(tmp_path / "run.arrow").same


@with_scenarios
def test_a_class_that_reads_a_scenario_itself_hands_it_on_for_the_seed_and_what_its_base_knows():
    class Own(SwarmModel):
        def __init__(self, scenario):
            super().__init__(scenario=scenario)
            self.add_robots(AGENT9, scenario.n_robots)

    scenario = Scenario(rng=4, n_robots=2, slip=0.2)
    model = Own(scenario=scenario)
    assert (len(model.robots), model.imperfections.slip_probability, model.scenario) == (2, 0.2, scenario)
    assert model.streams.seed.entropy == 4


def test_none_is_no_scenario_as_for_mesa():
    class Own(SwarmModel):
        def __init__(self, scenario=None, rng=None):
            super().__init__(scenario=scenario, rng=rng)

    assert Own(rng=1).state_hash() == Own(scenario=None, rng=1).state_hash() == SwarmModel(rng=1).state_hash()
    assert Crowd(scenario=None, rng=1, n_robots=2).run(1).state_hash() == Crowd(rng=1, n_robots=2).run(1).state_hash()


@with_scenarios
@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"scenario": "dense"}, InvalidValueError, "expected a Scenario"),
        ({"scenario": {"n_robotz": 3}}, UnknownNameError, "n_robots"),
        ({"scenario": {"n_robots": 3}, "n_robots": 4}, InvalidValueError, "n_robots is given by the scenario and"),
        ({"scenario": {"n_robots": 3}, "rng": 4}, InvalidValueError, "rng is given by the scenario and"),
    ],
)
def test_a_wrong_scenario_is_refused_in_one_line(given, error, words):
    if isinstance(given["scenario"], dict):
        given = {**given, "scenario": Scenario(rng=1, **given["scenario"])}
    with pytest.raises(error, match=words) as raised:
        Crowd(**given)
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) <= 300


@pytest.mark.skipif(not mesa.__version__.startswith("4"), reason="scenarios of Mesa 3.5 have the seed itself")
def test_a_scenario_of_mesa_4_of_which_the_seed_is_unknown_is_refused_in_one_line():
    used, copied = Scenario(rng=1), pickle.loads(pickle.dumps(Scenario(rng=1)))
    used.rng.random()
    for scenario in (used, copied):
        with pytest.raises(InvalidValueError, match="its seed is unknown"):
            Crowd(scenario=scenario)
    assert Crowd(scenario=Scenario(rng=1)).streams.seed.entropy == 1


@pytest.mark.skipif(Scenario is not None, reason="this Mesa has scenarios")
def test_without_scenarios_in_mesa_one_is_refused_in_one_line():
    with pytest.raises(InvalidValueError, match=r"has none; install mesa>=3\.5"):
        Crowd(scenario={"n_robots": 3})


# ---- copies


def twins(model):
    return [copy.deepcopy(model), pickle.loads(pickle.dumps(model))]


def test_copies_of_a_model_with_a_recorder_go_on_without_it(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(5)
        copies = twins(model)
        for twin in copies:
            twin.run(20)
        model.run(20)
    assert [len(twin.observers) for twin in copies] == [0, 0]
    assert {twin.state_hash() for twin in copies} == {model.state_hash()}
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 26))


def test_copies_of_a_watched_model_have_what_was_seen_and_see_their_own_steps():
    model = Crowd(rng=1)
    model.watch(last=None)
    model.run(5)
    for twin in twins(model):
        assert twin.run(3).watched.steps.tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
        assert twin.watched is not model.watched
    assert model.watched.steps.tolist() == [1, 2, 3, 4, 5]


def test_copies_have_rows_that_were_collected_and_collect_their_own():
    model = Crowd(rng=1).run(5)
    for twin in twins(model):
        assert len(twin.run(3).datacollector.get_model_vars_dataframe()) == 8
    assert len(model.datacollector.get_model_vars_dataframe()) == 5


@pytest.mark.parametrize(
    "reporters", [{"model_reporters": {"n": lambda model: 1}}, {"agent_reporters": {"id": "unique_id"}}]
)
def test_a_model_with_reporters_that_python_cannot_pickle_is_copied_by_deepcopy(reporters):
    model = SwarmModel(rng=1, **reporters).run(2)
    with pytest.raises((AttributeError, pickle.PicklingError), match=r"Can't (get|pickle) local object|lambda"):
        pickle.dumps(model)
    assert copy.deepcopy(model).run(2).state_hash() == model.run(2).state_hash()


@with_events
def test_copies_are_not_observed_by_what_mesa_lets_observe_a_model():
    class Listener:
        def __init__(self):
            self.times = []

        def hear(self, message):
            self.times.append(message.additional_kwargs["new"])

    from mesa.experimental.mesa_signals import ObservableSignals  # noqa: PLC0415 - Mesa 3.3 has other names

    model, listener = Crowd(rng=1), Listener()
    model.observe("time", ObservableSignals.CHANGED, listener.hear)
    copies = twins(model.run(2))
    for twin in copies:
        twin.run(3)
    heard = list(listener.times)
    model.run(1)
    assert heard == [1, 2]
    assert len(listener.times) > 2
    assert {twin.state_hash() for twin in copies} == {model.run(2).state_hash()}
