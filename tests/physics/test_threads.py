"""Threads share the rows of a step: the same bits for any number of them, and errors and other users are safe."""

import copy
import os
import pickle
import signal
import threading

import pytest

from mesa_swarm import AGENT9, AGENT_FIRE, ProximitySensor, RobotDesign, SwarmModel, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.kernels.crew import HELPING
from mesa_swarm.model.gallery import find_model
from mesa_swarm.physics import engine
from mesa_swarm.physics.threads import ROW_THREADS, VARIABLE, RowCrew, RowThread, RowThreads
from mesa_swarm.robots.imperfections import ROBOTARIUM
from support.scenes import empty


@pytest.fixture(autouse=True)
def shared(monkeypatch):
    """Share worlds of any size among three processors, whatever the machine has."""
    monkeypatch.setattr(engine, "FEWEST_ROWS", 1)
    monkeypatch.setattr(engine, "FEWEST_WAKING", 1)
    monkeypatch.setattr("mesa_swarm.physics.threads.count_processors", lambda: 3)


def wanderers(model, n, design=AGENT9):
    """Return the model with n robots that avoid and explore."""
    model.add_robots(design, n)
    model.control = Subsumption(Avoid(distance=15), Explore(turn_interval=30))
    return model


def crowded():
    """Return a world in which all robots drive into a heap."""
    model = empty(200, 150, rng=3)
    model.add_robots(RobotDesign(radius=4, max_speed=3), 120)
    model.swarm.columns["command"][:] = 3.0
    return model


def imperfect():
    eyes = AGENT9.with_slip(probability=0.2, magnitude=0.5).with_proximity(error_probability=0.2, error_magnitude=0.1)
    model = wanderers(SwarmModel(map="original", rng=5), 40, eyes)
    model.add_robots(AGENT_FIRE, 5)
    model.add_fire((400, 300), radius=20)
    model.imperfections = ROBOTARIUM.at(0.5)
    return model


def doors():
    """Return a world with a body that is driven through the robots."""
    model = wanderers(empty(400, 300, rng=4), 60)
    model.add_body(rectangle((190, 100), (200, 200)), kind="door", mode="driven")
    return model


def without_sensors():
    model = empty(200, 150, rng=6)
    model.add_robots(RobotDesign(radius=5), 60)
    model.swarm.columns["command"][:] = (1.0, 0.7)
    return model


def of_gallery(name, **parameters):
    return lambda: find_model(name)(rng=7, **parameters)


WORLDS = {
    "crowded": crowded,
    "imperfect": imperfect,
    "doors": doors,
    "without sensors": without_sensors,
    **{
        name: of_gallery(name)
        for name in ("fire_fighting", "cooperative_transport", "ant_trails", "puck_clustering", "flocking")
    },
}


def run(world, threads):
    """Return the fingerprints after some steps."""
    model = WORLDS[world]()
    model.threads = threads
    hashes = []
    for _ in range(4):
        for body in [body for body in model.bodies if body.kind == "door"]:
            model.move_bodies([body], [(body.position[0] + 3.0, body.position[1] + 1.0, 0.2)])
        hashes.append(model.run(10).state_hash())
    return hashes


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS)
def test_a_run_has_the_same_bits_for_any_number_of_threads(world):
    one = run(world, 1)
    assert all(run(world, threads) == one for threads in (2, 3, 8))


def test_pairs_for_which_there_is_no_room_are_listed_again():
    model = empty(200, 150, rng=1)
    model.add_robots(RobotDesign(radius=5, sensors=(ProximitySensor(range=10),)), poses=[(100, 75, 0.1)] * 60)
    model.threads = 2
    model.sense()
    pairs = model.parts.robots.engine._crowd.pairs
    assert sorted(map(tuple, pairs.tolist())) == [(i, j) for i in range(60) for j in range(i + 1, 60)]


def test_two_models_that_step_at_the_same_time_have_the_bits_that_each_has_alone():
    models = [wanderers(SwarmModel(rng=seed, threads=3), 50) for seed in (1, 2)]
    alone = [wanderers(SwarmModel(rng=seed), 50).run(150).state_hash() for seed in (1, 2)]
    sessions = [threading.Thread(target=model.run, args=(150,)) for model in models]
    for session in sessions:
        session.start()
    for session in sessions:
        session.join()
    assert [model.state_hash() for model in models] == alone


# ---- parameters


@pytest.mark.parametrize("given", ["0", "two", "-1", "1.5", "1000"])
def test_an_environment_variable_that_is_no_number_of_threads_is_refused(monkeypatch, given):
    monkeypatch.setenv(VARIABLE, given)
    with pytest.raises(InvalidValueError, match=rf"{VARIABLE} is '{given}'; expected a whole number, 1 to 256"):
        SwarmModel()
    assert SwarmModel(threads=2).threads == 2


def test_a_model_has_as_many_threads_as_the_environment_variable_states_unless_it_is_given_others(monkeypatch):
    monkeypatch.setenv(VARIABLE, "3")
    assert SwarmModel().threads == 3
    assert SwarmModel(threads=1).threads == 1
    assert SwarmModel(engine="shapely").threads == 3


@pytest.mark.parametrize("threads", [0, -2, 1.5, "two", 257, True])
def test_a_wrong_number_of_threads_is_refused_and_the_old_one_stays(threads):
    model = SwarmModel(threads=2)
    with pytest.raises(InvalidValueError, match="threads is"):
        model.threads = threads
    assert model.threads == 2


# ---- processes


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_process_that_was_forked_makes_its_own_threads():
    model = wanderers(SwarmModel(rng=1, threads=3), 30)
    expected = wanderers(SwarmModel(rng=1), 30).run(10).state_hash()
    model.run(5)
    ends = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(ends[1], model.run(5).state_hash().encode())
        os._exit(0)
    os.close(ends[1])
    with os.fdopen(ends[0]) as pipe:
        assert pipe.read() == expected
    os.waitpid(child, 0)


# ---- what may go wrong while threads help


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_has_a_crew_of_its_own_and_goes_on_in_the_same_way(copied):
    model = wanderers(SwarmModel(rng=1, threads=3), 50).run(20)
    other = copied(model)
    assert other.parts.robots.engine.crew is not model.parts.robots.engine.crew
    assert (
        other.run(30).state_hash()
        == model.run(30).state_hash()
        == wanderers(SwarmModel(rng=1), 50).run(50).state_hash()
    )


def test_threads_may_be_changed_between_steps():
    model = wanderers(SwarmModel(rng=1), 50)
    for threads in (2, 1, 8, 3):
        model.threads = threads
        model.run(10)
    assert model.state_hash() == wanderers(SwarmModel(rng=1), 50).run(40).state_hash()


def interrupting(method):
    """Return a method that does the same, and presses Ctrl-C when it is called and when it is done."""

    def call(self, *arguments):
        signal.raise_signal(signal.SIGINT)
        result = method(self, *arguments)
        signal.raise_signal(signal.SIGINT)
        return result

    return call


@pytest.mark.skipif(os.name != "posix", reason="signals are raised otherwise")
@pytest.mark.parametrize(
    ("kind", "name"), [(RowThread, "start_job"), (RowThread, "wait_for_job"), (RowThreads, "_helpers")]
)
def test_ctrl_c_while_threads_are_begun_or_ended_is_raised_when_all_is_done(monkeypatch, kind, name):
    model = wanderers(SwarmModel(rng=1, threads=3), 50).run(5)
    before = signal.getsignal(signal.SIGINT)
    with monkeypatch.context() as patched:
        patched.setattr(kind, name, interrupting(getattr(kind, name)))
        with pytest.raises(KeyboardInterrupt):
            model.run(20)
    assert signal.getsignal(signal.SIGINT) is before
    assert not ROW_THREADS._lock.locked()
    crew = model.parts.robots.engine.crew
    with crew:
        assert crew._size[HELPING] == 2
    steps = model.steps
    assert model.run(50 - steps).state_hash() == wanderers(SwarmModel(rng=1), 50).run(50).state_hash()


def test_a_thread_that_cannot_serve_keeps_no_step_from_its_end(monkeypatch):
    def broken(*_arguments):
        raise MemoryError("no room")

    model = wanderers(SwarmModel(rng=1, threads=3), 50).run(5)
    with monkeypatch.context() as patched:
        patched.setattr("mesa_swarm.physics.threads.serve", broken)
        with pytest.raises(MemoryError, match="no room"):
            model.run(20)
    assert not ROW_THREADS._lock.locked()
    assert model.run(50 - model.steps).state_hash() == wanderers(SwarmModel(rng=1), 50).run(50).state_hash()


def test_a_crew_that_is_at_work_may_be_asked_again():
    crew = RowCrew()
    crew.parts = 3
    with crew:
        with crew:
            assert crew._size[HELPING] == 2
        assert crew._size[HELPING] == 2
    assert crew._size[HELPING] == 0
    assert not ROW_THREADS._lock.locked()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_process_that_is_forked_while_threads_help_begins_without_them_and_listens_to_ctrl_c():
    crew, handler = RowCrew(), signal.getsignal(signal.SIGINT)
    crew.parts = 3
    with crew:
        child = os.fork()
        if child == 0:
            with crew:
                helps = crew._size[HELPING] == 2
            os._exit(0 if helps and signal.getsignal(signal.SIGINT) is handler else 1)
        assert signal.getsignal(signal.SIGINT) is not handler
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert signal.getsignal(signal.SIGINT) is handler
