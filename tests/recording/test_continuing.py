"""Runs that continue with other parameters: the same place, and the parameters of the new ones from there on."""

import copy
from dataclasses import replace

import mesa
import numpy as np
import pytest

from mesa_swarm import AGENT9, Column, Field, Part, Radio, Scale, SwarmModel, disc, process
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, UnstoredStateWarning
from mesa_swarm.control import Avoid, Chance, Explore, Halt, StateMachine, Subsumption, Transition
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.model.mesa_model import add_reporters
from mesa_swarm.model.observers import Observer
from mesa_swarm.model.parameters import Choice, Slider, parameters_of
from mesa_swarm.models.agglomeration import Agglomeration
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.foraging import Foraging
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm.recording import Recording, continued
from mesa_swarm.recording.continuing import Beginning, continue_with, match_robots
from mesa_swarm.robots.imperfections import ROBOTARIUM

# Parameters that matter only when a model is made.
OF_BEGINNING = {
    "best_of_n": {"first_share"},
    "collision_avoidance": {"obstacles", "moving_obstacles"},
    "fire_fighting": {"initial_temperature"},
    "foraging": {"items"},
    "learning_fires": {"first_temperature"},
    "puck_clustering": {"rows"},
    "q_learning": {"first_temperature"},
    "shepherding": {"n_sheep"},
    "task_allocation": {"major_share"},
    "signposts": {"boards"},
}
EVERYWHERE = {"n_robots", "map"}


def another_value(parameter):
    """Return a value other than the default, None if there is none."""
    control = parameter.control
    if isinstance(control, Choice):
        return next((one for one in control.options if one != parameter.default), None)
    if isinstance(control, Slider):  # a quarter of the way to an end
        far = control.maximum if control.maximum > parameter.default else control.minimum
        return parameter.kind(parameter.default + (far - parameter.default) / 4) if parameter.kind is float else far
    return None


def changes_of(model_class):
    values = {name: another_value(one) for name, one in parameters_of(model_class).items()}
    values |= {"join": 5.0} if "join" in values else {}  # it has to be below `leave`
    return {name: value for name, value in values.items() if value is not None}


class Measure(float):
    """A number that carries more."""


class Altered(SwarmModel):
    """A model with an attribute that a run changes."""

    def __init__(self, *, value=None, gain=1.0, **common):
        super().__init__(map="openspace", **common)
        self.value, self.gain = value, gain


@pytest.mark.parametrize(
    ("value", "later"),
    [(b"a", b"ab"), (1j, 2j), (Measure(1), Measure(2)), ([b"a"], [b"b"]), (np.array([{}]), np.array([{1: 2}]))],
    ids=str,
)
def test_bytes_complex_numbers_measures_and_objects_in_arrays_that_a_run_has_changed_stay(value, later):
    model = Altered(value=1.0, rng=1)
    fresh, new = Altered(value=1.0, rng=1), Altered(value=1.0, gain=2.0, rng=1)
    model.value, fresh.value, new.value = later, value, value
    continue_with(new, model, fresh, ("gain",))
    assert np.array_equal(new.value, later)
    assert new.gain == 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_every_parameter_of_the_gallery_changes_at_once_but_those_of_the_beginning(name):
    model_class, waiting = find_model(name), set()
    for parameter, value in changes_of(model_class).items():
        model = model_class(rng=3).run(20)
        position = model.swarm.position.copy()
        new, fresh = model_class(rng=3, **{parameter: value}), model_class(rng=3)
        try:
            continue_with(new, model, fresh, (parameter,))
        except InvalidValueError:
            waiting.add(parameter)
            continue
        assert new.completed == 20
        assert np.array_equal(new.swarm.position, position)
        new.run(5)
    assert waiting - EVERYWHERE == OF_BEGINNING.get(name, set())


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_a_run_that_continues_with_the_same_parameters_is_the_same_to_the_last_bit(name):
    model_class = find_model(name)
    model = model_class(rng=2).run(30)
    new = model_class(rng=2)
    continue_with(new, model, model_class(rng=2), ())
    assert new.run(20).state_hash() == model_class(rng=2).run(50).state_hash()


@pytest.mark.parametrize(
    ("model", "there", "back"),
    [
        (Boids, {"noise": 0.4, "sight": 90.0}, {"noise": 0.0, "sight": 100.0}),
        (FireFighting, {"k1": 0.001, "strategy": "A"}, None),
        (QLearning, {"gamma": 0.1, "slip": 0.5}, None),
        (Agglomeration, {"avoid_distance": 25.0}, None),
    ],
    ids=["boids", "fires", "learning", "agglomeration"],
)
def test_a_change_that_is_taken_back_before_the_next_step_leaves_no_trace(model, there, back):
    defaults = {name: parameters_of(model)[name].default for name in there}
    changed = continued(continued(model(rng=5).run(25), **there), **(defaults if back is None else defaults | {}))
    assert changed.run(25).state_hash() == model(rng=5).run(50).state_hash()


@pytest.mark.parametrize(
    ("model", "changes"),
    [
        (Boids, [{"memory": 5.0}, {"cohesion_weight": 0.0, "sight": 90.0}, {}, {"memory": 5.0}]),
        (FireFighting, [{"k1": 0.001}, {"strategy": "A"}, {"k1": 0.001}]),
        (QLearning, [{"gamma": 0.1}, {"slip": 0.5}, {"gamma": 0.1}]),
    ],
    ids=["boids", "fires", "learning"],
)
def test_a_beginning_is_continued_again_and_again_as_a_new_model_is(model, changes):
    beginning = Beginning(lambda: model(n_robots=12, rng=5))
    found = [beginning.continued(**named).run(20).state_hash() for named in changes]
    assert found == [continued(model(n_robots=12, rng=5), **named).run(20).state_hash() for named in changes]


class MadeBoids(Boids):
    """Counts how often it is made."""

    made = 0

    def __init__(self, *, memory=10.0, rng=None):
        super().__init__(n_robots=5, memory=memory, rng=rng)
        MadeBoids.made += 1


def test_a_beginning_makes_one_model_for_each_that_continues_it(monkeypatch):
    monkeypatch.setattr(MadeBoids, "made", 0)
    beginning = Beginning(lambda: MadeBoids(rng=1))
    for memory in (2.0, 3.0, 4.0):
        beginning.continued(memory=memory)
    assert MadeBoids.made == 2 + 3


def test_a_beginning_that_is_no_longer_what_it_was_is_made_anew():
    made = []
    beginning = Beginning(lambda: made.append(Boids(n_robots=5, rng=1)) or made[-1])
    before = beginning.continued(memory=2.0).state_hash()
    made[0].swarm.columns["position"][0] += 1.0
    assert beginning.continued(memory=2.0).state_hash() == before
    assert len(made) == 2


def test_a_beginning_refuses_what_belongs_to_the_beginning_of_a_run_and_unknown_names():
    beginning = Beginning(lambda: FireFighting(n_robots=5, rng=1))
    with pytest.raises(InvalidValueError, match="initial_temperature' belongs to the beginning of a run"):
        beginning.continued(initial_temperature=0.5)
    with pytest.raises(UnknownNameError, match="noize"):
        beginning.continued(noize=0.1)


def test_a_change_has_an_effect_from_the_next_step_on():
    model = Boids(rng=1).run(20)
    plain = Boids(rng=1).run(40).state_hash()
    assert model.continued(cohesion_weight=0.0).run(20).state_hash() != plain


def test_what_belongs_to_the_beginning_is_refused_and_the_run_goes_on():
    model = FireFighting(rng=1).run(10)
    with pytest.raises(InvalidValueError, match="'initial_temperature' belongs to the beginning of a run"):
        model.continued(initial_temperature=0.5)
    assert model.run(10).state_hash() == FireFighting(rng=1).run(20).state_hash()


def test_a_parameter_that_there_is_not_is_named():
    with pytest.raises(UnknownNameError, match="did you mean 'noise'"):
        Boids(rng=1).continued(noize=0.1)


class Stock(SwarmModel):
    """A model with an attribute that the run uses up."""

    def __init__(self, *, stock: int = 10, price: float = 1.0, rng=None) -> None:
        super().__init__(rng=rng)
        self.stock, self.price = stock, price

    def step(self) -> None:
        super().step()
        self.stock -= 1


def test_an_attribute_that_the_run_has_changed_does_not_follow_its_parameter_silently():
    model = Stock(rng=1).run(3)
    with pytest.raises(InvalidValueError, match="belongs to the beginning"):
        model.continued(stock=50)
    assert model.continued(price=2.0).price == 2.0


class Heard(Observer):
    def __init__(self):
        self.steps, self.what = [], []

    def after_step(self, model, step):
        self.steps.append(step)

    def replaced(self, old, new, what):
        self.what += what


def test_observers_continue_with_the_model_that_takes_the_place_of_another():
    heard, model = Heard(), Boids(rng=1)
    model.observers.append(heard)
    new = model.run(2).continued(noise=0.1, slip=0.1)
    new.run(2)
    assert (heard.steps, heard.what) == ([1, 2, 3, 4], ["parameter noise", "parameter slip"])
    assert list(model.observers) == []


def test_a_recording_notes_the_change_and_can_be_verified_and_resumed(tmp_path):
    model = FireFighting(rng=4)
    with model.record(tmp_path / "run.arrow"):
        model.run(30)
        new = model.continued(k1=0.001, noise=0.2)
        match_robots(new, FireFighting(n_robots=13, rng=4))
        new.run(30)
    recording = Recording(tmp_path / "run.arrow")
    assert [one.step for one in recording.interventions] == [30]
    assert "parameter k1" in str(recording.interventions[0])
    assert len(recording) == 60
    assert FireFighting.verify(recording.path).same
    assert FireFighting.resume(recording.path, step=45).run(15).state_hash() == new.state_hash()


@pytest.mark.parametrize("wanted", [1, 20, 37])
def test_robots_are_added_at_free_places_or_the_last_ones_are_removed(wanted):
    model = Boids(n_robots=20, rng=1).run(5)
    first = [robot.unique_id for robot in model.robots][: min(wanted, 20)]
    match_robots(model, Boids(n_robots=wanted, rng=1))
    assert len(model.robots) == wanted
    assert [robot.unique_id for robot in model.robots][: len(first)] == first
    gaps = np.hypot(*(model.swarm.position[:, None] - model.swarm.position[None]).T)
    np.fill_diagonal(gaps, np.inf)
    assert (gaps > 2 * model.swarm.radius[0] - 1e-6).all()
    model.run(5)


# ---- changes by hand go on


class Watchmen(SwarmModel):
    """Robots of two states, with a parameter that nothing reads and one that a layer reads."""

    def __init__(self, *, gain: float = 1.0, distance: float = 15.0, more: bool = False, rng=None):
        super().__init__(map="openspace", rng=rng, model_reporters={"x": "completed"})
        self.add_robots(AGENT9, 6)
        moves = [
            Transition(source="go", target="wait", condition=Chance(probability=0.3)),
            Transition(source="wait", target="go", condition=Chance(probability=0.05)),
        ]
        states = {"go": (Avoid(distance=distance), Explore()), "wait": Halt()}
        if more:
            states = {"first": Explore(), "wait": Halt(), "go": (Avoid(distance=distance), Explore())}
        self.control = StateMachine(states, moves)


def test_robots_stay_in_their_states_by_name_when_the_change_numbers_states_in_another_way():
    model = Watchmen(rng=1).run(10)
    names = [model.control.state_names[number] for number in model.control.now]
    assert set(names) == {"go", "wait"}
    changed = model.continued(more=True)
    assert [changed.control.state_names[number] for number in changed.control.now] == names


def test_a_change_that_takes_away_a_state_in_which_robots_are_is_refused():
    model = Watchmen(more=True, rng=1)
    model.swarm.columns[model.control.noted[0]][:] = 0
    with pytest.raises(InvalidValueError, match="a machine without the state 'first', in which there are robots"):
        model.run(0).continued(more=False)


BY_HAND = {
    "control": lambda model: setattr(model, "control", Subsumption(Avoid(distance=9), Explore())),
    "no control": lambda model: setattr(model, "control", None),
    "communication": lambda model: setattr(model, "communication", Radio(range=80)),
    "imperfections": lambda model: setattr(model, "imperfections", ROBOTARIUM),
    "fire_constants": lambda model: setattr(model, "fire_constants", replace(model.fire_constants, k1=0.001)),
    "collect_every": lambda model: setattr(model, "collect_every", 3),
    "threads": lambda model: setattr(model, "threads", 2),
    "scale": lambda model: setattr(model, "scale", Scale(units_per_metre=100, seconds_per_step=0.1)),
    "failure": lambda model: model.robots[0].fail("stop"),
    "wheel": lambda model: model.robots[1].fail("wheel", index=1, how="free"),
    "speed": lambda model: setattr(model.robots[0], "max_speed", 0.4),
    "attribute of a robot": lambda model: setattr(model.robots[0], "leader", True),
    "turn angle": lambda model: setattr(model.parts.robots, "turn_angle", 0.3),
    "field": lambda model: model.add_field(Field("design", evaporation=0.1)).deposit([(200.0, 200.0)], 2.0),
    "column": lambda model: model.swarm.remember("mine", (2,), np.float64, 1.5).fill(2.5),
    "process": lambda model: model.add_process(Totals()),
    "object": lambda model: setattr(model, "counter", Counted(model.robots[0])),
}


class Totals:
    """A process of the user's that stores itself."""

    def __init__(self):
        self.totals = np.zeros(2)

    def step(self, model):
        self.totals += model.swarm.position.sum(axis=0)

    def checkpoint(self):
        return {"totals": self.totals}

    def restore(self, state):
        self.totals[:] = state["totals"]


class Counted:
    """An object of the user's that cannot be stored, and refers to the model and a robot."""

    def __init__(self, robot):
        self.robot, self.model, self.seen = robot, robot.model, {frozenset({1}): object()}


def settings_of(model):
    names = ("communication", "imperfections", "fire_constants", "collect_every", "threads", "scale")
    return {name: getattr(model, name) for name in names} | {"layers": getattr(model.control, "names", None)}


@pytest.mark.slow
@pytest.mark.parametrize("change", BY_HAND.values(), ids=BY_HAND)
@pytest.mark.parametrize("named", [{}, {"gain": 3.0}])
def test_what_was_changed_by_hand_goes_on_with_the_run(change, named):
    model = Watchmen(rng=1).run(8)
    change(model)
    twin = copy.deepcopy(model)
    changed = model.continued(**named)
    assert settings_of(changed) == settings_of(twin)
    assert changed.run(12).state_hash() == twin.run(12).state_hash()
    assert [robot.failures for robot in changed.robots] == [robot.failures for robot in twin.robots]
    assert changed.swarm.max_speed.tolist() == twin.swarm.max_speed.tolist()
    assert getattr(changed.robots[0], "leader", None) == getattr(twin.robots[0], "leader", None)


def test_an_object_that_cannot_be_stored_is_copied_with_the_new_models_parts_in_the_place_of_the_old_ones():
    model = Watchmen(rng=1).run(3)
    model.counter = Counted(model.robots[2])
    changed = model.continued()
    assert changed.counter is not model.counter
    assert changed.counter.model is changed
    assert changed.counter.robot is changed.robots[2]
    assert list(changed.counter.seen) == [frozenset({1})]


def test_a_robot_slowed_by_hand_is_no_faster_than_the_new_design_permits():
    class Fast(SwarmModel):
        def __init__(self, *, speed: float = 2.0, rng=None):
            super().__init__(rng=rng)
            self.add_robots(replace(AGENT9, max_speed=speed), 3)

    model = Fast(rng=1).run(2)
    model.robots[0].max_speed = 1.5
    assert model.continued(speed=1.0).swarm.max_speed.tolist() == [1.0, 1.0, 1.0]
    again = Fast(rng=1).run(2)
    again.robots[0].max_speed = 1.5
    assert again.continued(speed=3.0).swarm.max_speed.tolist() == [1.5, 3.0, 3.0]


def test_a_setting_that_was_changed_by_hand_and_that_the_parameter_would_change_is_refused():
    model = FireFighting(rng=1).run(3)
    model.fire_constants = replace(model.fire_constants, k3=9.0)
    with pytest.raises(InvalidValueError, match="belongs to the beginning of a run"):
        model.continued(k1=0.001)
    assert model.continued(strategy="A").fire_constants.k3 == 9.0


def test_an_object_that_cannot_be_copied_is_named_in_one_line():
    model = Watchmen(rng=1).run(3)
    model.file = open(__file__, encoding="utf-8")  # noqa: SIM115
    try:
        with pytest.raises(InvalidValueError, match="file cannot be copied to the model that goes on"):
            model.continued()
    finally:
        model.file.close()


def test_rows_go_on_with_a_reporter_added_by_hand_and_one_that_the_change_adds_has_no_values_before():
    class Reporting(SwarmModel):
        def __init__(self, *, more: bool = False, rng=None):
            names = ("completed", "collisions") if more else ("completed",)
            super().__init__(rng=rng, model_reporters={f"my {name}": name for name in names})

    model = Reporting(rng=1).run(2)
    add_reporters(model.datacollector, {"late": "total_collisions"})
    frame = model.run(1).continued(more=True).run(2).datacollector.get_model_vars_dataframe()
    assert frame["my completed"].tolist() == [1, 2, 3, 4, 5]
    assert frame["late"].isna().tolist() == [True, True, False, False, False]
    assert frame["my collisions"].isna().tolist() == [True, True, True, False, False]


def test_a_run_in_which_a_robot_failed_goes_on_with_more_noise_and_the_robot_stays_as_it_is():
    model = CollisionAvoidance(n_robots=5, rng=1).run(20)
    model.robots[0].fail("stop")
    model = model.continued(noise=0.2)
    before = model.swarm.position[0].copy()
    assert model.run(10).swarm.position[0].tolist() == before.tolist()
    assert model.imperfections.sensing.error == 0.2


def test_a_data_collector_that_replaced_the_models_own_goes_on():
    model = Watchmen(rng=1)
    model.datacollector = mesa.DataCollector(model_reporters={"n": "completed"})
    frame = model.run(3).continued().run(2).datacollector.get_model_vars_dataframe()
    assert frame["n"].tolist() == [1, 2, 3, 4, 5]


def test_a_reporter_added_by_hand_keeps_its_values_when_a_recording_is_resumed_and_is_named(tmp_path):
    model = Watchmen(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=4):
        model.run(2)
        add_reporters(model.datacollector, {"late": "completed"})
        model.run(6)
    with pytest.warns(UnstoredStateWarning, match="with a reporter that its constructor does not make .'late'."):
        again = Watchmen.resume(tmp_path / "run.arrow")
    frame = again.run(2).datacollector.get_model_vars_dataframe()
    assert frame["late"].isna().tolist() == [True, True, *[False] * 6, True, True]
    assert frame["x"].tolist() == list(range(1, 11))


class OfKind(SwarmModel):
    """A world with a body of a kind that is a parameter."""

    def __init__(self, *, kind="puck", rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_body(disc((200, 100), 5), kind=kind)
        self.add_robots(AGENT9, 3)


@pytest.mark.parametrize("adds", [False, True])
def test_a_run_goes_on_with_bodies_of_another_kind_though_others_were_added(adds):
    model = OfKind(rng=1).run(2)
    if adds:
        model.add_obstacle(disc((300, 100), 5))
    again = model.run(1).continued(kind="wolf")
    assert [body.kind for body in again.bodies][4:] == ["wolf", *["obstacle"] * adds]
    assert again.kinds[4:] == ("puck", "wolf")
    again.run(2)


@process(memory={"steps": 0})
def count_steps(steps, pace=1.0):
    """Count steps."""
    steps[0] += 1


def test_a_process_of_a_function_that_was_added_by_hand_goes_on_with_its_memory_and_numbers():
    model = CollisionAvoidance(n_robots=4, rng=1)
    model.add_process(count_steps(pace=2.0))
    after = model.run(7).continued(distance=20).run(3)
    assert (after.processes[0].steps, after.processes[0].numbers["pace"]) == (10, 2.0)
    assert model.processes[0].steps == 7


def use_up(energy, limit):
    energy[0] -= limit[0]


class Storing(SwarmModel):
    """A model of which a process remembers two numbers that parameters decide, and changes one."""

    def __init__(self, *, full=10.0, limit=1.0, rng=None):
        super().__init__(rng=rng)
        self.store = self.add_process(process(memory={"energy": full, "limit": limit})(use_up))


def test_what_a_process_remembers_and_a_run_has_not_changed_follows_from_parameters():
    new = continued(Storing(rng=1).run(3), limit=2.0)
    assert (new.store.energy, new.store.limit) == (7.0, 2.0)
    assert new.run(2).store.energy == 3.0
    ready = continued(Storing(rng=1), full=20.0)
    assert ready.store.energy == 20.0


def test_a_change_of_what_a_process_has_changed_itself_is_refused():
    with pytest.raises(InvalidValueError, match="'full' belongs to the beginning of a run"):
        continued(Storing(rng=1).run(3), full=20.0)


def test_robots_of_foraging_that_rest_no_longer_do_with_the_other_parameter():
    model = Foraging(n_robots=6, rng=1).run(20)
    new = continued(model, thresholds="no")
    assert new.nest.energy == model.nest.energy
    assert np.array_equal(new.nest.thresholds, Foraging(n_robots=6, thresholds="no", rng=1).nest.thresholds)


def test_a_beginning_refuses_what_processes_begin_with_since_a_run_may_change_it():
    """A page would write it into a run that has changed it."""
    beginning = Beginning(lambda: Storing(rng=1))
    for change in ({"full": 20.0}, {"limit": 2.0}):
        with pytest.raises(InvalidValueError, match="changes with what processes begin"):
            beginning.continued(**change)


class Tank(Part):
    """A part that begins with what a parameter decides."""

    name = "tank"

    def __init__(self, level=10.0):
        self.level = np.full(1, level)

    def columns(self):
        return {"level": Column(self.level)}


class Filled(SwarmModel):
    def __init__(self, *, level=10.0, rng=None):
        super().__init__(rng=rng)
        self.add_part(Tank(level))


def test_a_change_of_what_a_part_begins_with_is_refused():
    with pytest.raises(InvalidValueError, match="'level' belongs to the beginning of a run"):
        continued(Filled(rng=1).run(3), level=20.0)
