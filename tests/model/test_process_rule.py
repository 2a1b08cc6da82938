"""Processes made of functions: compiled ones on arrays that they name, and those of the model."""

import copy
import pickle

import numpy as np
import pytest

from mesa_swarm import AGENT9, Previous, SwarmModel, process
from mesa_swarm.base.errors import UncompiledBehaviourWarning
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import BehaviourError, InvalidValueError, UnknownNameError
from mesa_swarm.model.driving import drive_model


@process(memory={"sums": [0.0, 0.0], "calls": 0}, every=2)
def add_up(position, fires_out, sums, calls, step, chance, share=0.5):
    """Add up positions, and what is drawn."""
    for i in range(position.shape[0]):
        sums[0] += share * position[i, 0]
    sums[1] += chance * step + fires_out.shape[0]
    calls[0] += 1


@process
def warm(temperature, amount=1):
    for i in range(temperature.shape[0]):
        temperature[i] += amount


@process
def fail_late(temperature, step):
    if step == 7:
        temperature[step * 1000] = 1.0


def world(*processes):
    model = SwarmModel(map="openspace_fire", rng=3)
    model.add_robots(AGENT9, 6)
    model.control = Subsumption(Avoid(distance=15), Explore())
    for rule in processes:
        model.add_process(rule)
    return model


def taken(model, steps):
    for _ in range(steps):
        model.step()
    return model


def test_a_compiled_process_takes_no_step_more_slowly_and_does_the_same_in_single_steps():
    one, other = world(add_up(share=0.25), warm(amount=2)), world(add_up(share=0.25), warm(amount=2))
    assert drive_model(one, 30) == 30
    taken(other, 30)
    assert one.processes[1].calls == other.processes[1].calls == 15
    np.testing.assert_array_equal(one.processes[1].sums, other.processes[1].sums)
    assert one.state_hash() == other.state_hash()
    assert one.run(20).state_hash() == taken(other, 20).state_hash()
    assert "add_up takes place every 2 steps" in str(one.plan)


def test_what_it_draws_and_adds_is_what_its_function_does_in_python():
    model, stream = world(add_up), SwarmModel(map="openspace_fire", rng=3).streams["process add_up"]
    sums = np.zeros(2)
    for step in range(1, 13):
        model.step()
        if step % 2 == 0:
            add_up.function(model.swarm.position, model.fires.out, sums, [0], step, stream.random())
    np.testing.assert_array_equal(model.processes[1].sums, sums)


def test_memory_and_numbers_belong_to_the_fingerprint_and_to_copies():
    model = world(add_up).run(10)
    for twin in (copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert twin.state_hash() == model.state_hash()
        assert twin.processes[1].memory["sums"] is not model.processes[1].memory["sums"]
        assert twin.run(9).processes[1].sums.tolist() != model.processes[1].sums.tolist()
    assert world(add_up).state_hash() != world(add_up(share=0.75)).state_hash()
    assert model.run(9).state_hash() == twin.state_hash()


def test_two_models_have_memories_of_their_own_of_one_process_with_other_numbers():
    first, second = world(add_up(share=1.0)), world(add_up(share=1.0))
    first.run(4)
    assert (first.processes[1].calls, second.processes[1].calls) == (2, 0)


def test_a_process_that_fails_is_named_with_the_step_in_driven_and_in_single_steps():
    words = []
    for take in (SwarmModel.run, taken):
        model = world(fail_late)
        with pytest.raises(
            BehaviourError, match=r"^process fail_late failed in step 7: it raised IndexError"
        ) as caught:
            take(model, 20)
        words.append((str(caught.value), model.steps, model.completed))
    assert words[0] == words[1]


def test_a_function_of_the_model_is_called_with_it_in_the_steps_that_its_interval_divides():
    calls = []

    @process(every=4)
    def note(model, times=2):
        calls.append((model.steps, times))

    model = world(note(times=3)).run(10)
    assert calls == [(4, 3), (8, 3)]
    assert str(model.plan).endswith("driven: up to 3 steps in one compiled call, then one in Python")


def test_a_function_that_numba_refuses_runs_as_plain_python_with_a_warning():
    @process(memory={"n": 0})
    def listed(n, temperature):
        n[0] += len(sorted(globals(), key=str)[:2]) * len(temperature) // len(temperature)

    model = world(listed)
    with pytest.warns(UncompiledBehaviourWarning, match="process listed cannot be compiled"):
        model.run(3)
    assert model.processes[1].n == 6


def test_columns_that_a_process_may_not_change_are_locked():
    @process
    def push(position):
        position[0, 0] = 1.0

    model = world(push)
    with pytest.warns(UncompiledBehaviourWarning), pytest.raises(BehaviourError, match="read-only"):
        model.run(3)


@pytest.mark.parametrize(
    ("make", "error", "line"),
    [
        (lambda: process(5), InvalidValueError, "^process got 5; expected a function"),
        (lambda: process(every=0)(warm.function), InvalidValueError, "^every is 0"),
        (lambda: process(memory={"a": "x"})(warm.function), InvalidValueError, "^memory a of process warm is 'x'"),
        (lambda: warm(amounts=3), UnknownNameError, "amounts.*amount"),
        (lambda: warm(amount="x"), InvalidValueError, "warm's amount is 'x'"),
    ],
)
def test_wrong_declarations_are_refused_in_one_line(make, error, line):
    with pytest.raises(error, match=line) as caught:
        make()
    assert "\n" not in str(caught.value)


@process(memory={"way": 0.0})
def measure_way(position, previous_position, way):
    for i in range(position.shape[0]):
        way[0] += abs(position[i, 0] - previous_position[i, 0])


def test_a_column_of_a_part_that_has_the_name_of_one_of_the_swarm_is_another_one():
    model = SwarmModel(rng=1)
    (robot,) = model.add_robots(AGENT9, poses=[(100, 300, 0.0)])
    model.control = Subsumption(Explore())
    model.add_part(Previous("position"))
    way = model.add_process(measure_way)
    model.run(10)
    assert way.way == robot.position[0] - 100.0 == 10.0


class Scaled(SwarmModel):
    def __init__(self, *, share=0.5, rng=None):
        super().__init__(map="openspace_fire", rng=rng)
        self.add_robots(AGENT9, 4)
        self.control = Subsumption(Explore())
        self.add_process(add_up(share=share))


def test_a_run_that_continues_with_another_parameter_has_its_number_and_the_memory_of_before(tmp_path):
    model = Scaled(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        model.run(30)
    for more in (Scaled(rng=1).run(20).continued(share=2.0), Scaled.resume(tmp_path / "run.arrow", step=20, share=2.0)):
        assert more.processes[1].numbers == {"share": 2.0}
        assert more.processes[1].calls == 10
        assert more.run(10).processes[1].sums[0] > model.processes[1].sums[0]
    again = Scaled.resume(tmp_path / "run.arrow", step=20).run(10)
    assert again.state_hash() == model.state_hash()


def test_the_temperature_that_a_process_changes_is_that_of_robots():
    model = world(warm(amount=2))
    bodies = model.parts.bodies.table.temperature.copy()
    model.remove_process(model.processes[0])  # what burns
    model.run(3)
    assert (model.swarm.temperature == 6.0).all()
    np.testing.assert_array_equal(model.parts.bodies.table.temperature, bodies)


def test_a_parameter_that_is_no_column_is_refused_when_the_process_is_added():
    @process
    def cool(temprature):
        return

    with pytest.raises(UnknownNameError, match=r"temprature.*temperature"):
        world(cool)


def test_random_numbers_that_the_seed_does_not_govern_are_refused():
    @process
    def roll(temperature):
        temperature[0] = np.random.random()  # noqa: NPY002

    with pytest.raises(BehaviourError, match=r"^process roll uses np.random"):
        world(roll)
