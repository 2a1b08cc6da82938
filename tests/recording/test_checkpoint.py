import json
import random
from collections import deque
from dataclasses import replace

import mesa
import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, Radio, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.control import Align, Avoid, Cohere, Cruise, Explore, Separate, Subsumption, VectorSum, behaviour
from mesa_swarm.control.behaviour import PASS
from mesa_swarm.fire import FireConstants
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.collected_data import MOST_STEPS, set_clock
from mesa_swarm.recording.container import from_bytes, to_bytes
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import DifferentialDrive, HolonomicDrive
from support.pace import work_within


def stored(model):
    """Return a checkpoint of a model that went through bytes."""
    return from_bytes(to_bytes(checkpoint_of(model)))


def assert_goes_on_alike(model, again, steps=50):
    assert again.steps == model.steps
    for _ in range(steps):
        assert again.state_hash() == model.state_hash()
        model.step()
        again.step()
    assert again.state_hash() == model.state_hash()
    ours, theirs = (it.datacollector.get_model_vars_dataframe() for it in (again, model))
    assert ours.equals(theirs)
    assert (again.running, again.total_collisions) == (model.running, model.total_collisions)
    assert again.random.random() == model.random.random()
    assert again.rng.random() == model.rng.random()


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_every_model_goes_on_bit_by_bit_from_a_checkpoint(name):
    model = find_model(name)(rng=3).run(60)
    assert_goes_on_alike(model, restore(find_model(name)(rng=3), stored(model)))


@pytest.mark.slow
def test_the_shapely_engine_goes_on_bit_by_bit_too():
    model = SwarmModel(map="openspace_fire", rng=3, engine="shapely")
    model.add_robots(AGENT9, 4)
    model.control = Subsumption(Avoid(distance=15), Explore(turn_interval=10))
    model.run(20)
    again = SwarmModel(map="openspace_fire", rng=3, engine="shapely")
    assert_goes_on_alike(model, restore(again, stored(model)), 15)


def test_a_checkpoint_alone_decides_whatever_the_seed_of_the_new_model():
    model = FireFighting(rng=3).run(40)
    assert_goes_on_alike(model, restore(FireFighting(rng=99), stored(model)))


ON_WHEELS = DifferentialDrive(), VectorSum(Avoid(distance=15), Explore(turn_interval=20), weights=(2, 1))
ON_ROLLERS = HolonomicDrive(), VectorSum(Separate(distance=15), Align(), Cohere(), Cruise(), weights=(2, 1, 1, 1))


def changed_by_hand(drive=ON_WHEELS[0], control=ON_WHEELS[1]):
    """Return a model that no constructor makes."""
    model = SwarmModel(map="openspace_fire", rng=5)
    noisy = replace(AGENT9, drive=drive)
    noisy = noisy.with_proximity(error_probability=0.3, error_magnitude=0.2, hold=7, period=3)
    model.add_robots(noisy.with_slip(probability=0.2, magnitude=0.5), 6)
    small = RobotDesign(name="small", drive=drive, sensors=AGENT3.sensors, radius=4)
    model.add_robots(small, 3)
    model.control = control
    model.run(10)
    model.robots[1].remove()
    model.fires[2].remove()
    model.obstacles[0].remove()
    model.add_obstacle(disc((100.1, 500.7), 12.3))
    model.add_obstacle(polygon([(300, 60), (340.3, 60), (330, 99.9)]))
    model.add_obstacle(
        polygon([(20, 20), (60, 20), (60, 60), (20, 60)], [[(30, 30), (40, 30), (40, 40)]], contact=False)
    )
    model.add_load(rectangle((600, 100), (630.7, 120.1)), resistance=0.4)
    model.add_fire((500, 500), area=3.3)
    model.add_robots(replace(AGENT3, drive=drive), poses=[(590, 110, 0.0), (570, 110, 0.1)], tendency="left")
    model.communication = Radio(range=150, loss_probability=0.3)
    model.fire_constants = FireConstants(0.001, 0.02, 0.08, 0.25, 250, 150)
    model.fires[0].temperature = 0.7
    return model


@pytest.mark.slow
@pytest.mark.parametrize("driven", [ON_WHEELS, ON_ROLLERS], ids=["on wheels", "on rollers"])
@pytest.mark.parametrize("steps", [0, 1, 30])
def test_a_model_that_was_changed_by_hand_goes_on_bit_by_bit(steps, driven):
    model = changed_by_hand(*driven).run(steps)
    again = restore(SwarmModel(map="openspace_fire", rng=5), stored(model))
    assert [agent.unique_id for agent in again.agents] == [agent.unique_id for agent in model.agents]
    assert [body.shape for body in again.obstacles] == [body.shape for body in model.obstacles]
    assert again.swarm.designs == model.swarm.designs
    assert_goes_on_alike(model, again)
    assert again.fires.history.temperature.tobytes() == model.fires.history.temperature.tobytes()
    assert model.add_obstacle(disc((700, 500), 5)).unique_id == again.add_obstacle(disc((700, 500), 5)).unique_id


@pytest.mark.slow
def test_a_load_that_is_under_way_goes_on_bit_by_bit():
    model = CooperativeTransport(n_robots=8, resistance=0.5, load="box", rng=2).run(900)
    again = restore(CooperativeTransport(n_robots=8, resistance=0.5, load="box", rng=2), stored(model))
    assert model.load.pose[0] > 250
    assert again.load is again.loads[0]
    assert again.load.pose == model.load.pose
    assert_goes_on_alike(model, again)


class Counting:
    """A custom layer that has a plain value and draws random numbers."""

    name = "Counting"

    def __init__(self):
        self.count = 0

    def bind(self, swarm, prefix, rng):
        self._swarm, self._rng = swarm, rng
        self.sum = swarm.remember(f"{prefix}.sum", (), np.float64, 0.0)

    def decide(self, senses, command, layer, index):
        self.count += 1
        free = layer < 0
        command[free] = self._rng.uniform(-1, 1, (int(free.sum()), 2)) * (self.count % 3)
        self.sum[:] += command[:, 0]
        layer[free] = index


class Learner:
    """What learns, with a state of its own."""

    def __init__(self):
        self.table = np.zeros((2, 3))

    def checkpoint(self):
        return {"table": self.table}

    def restore(self, state):
        self.table = state["table"]


@behaviour
def timid(me, distance=20.0):
    """Back away from whatever is ahead."""
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed * me.chance, -me.max_speed
    return PASS


class Own(SwarmModel):
    """A model with attributes, a layer and a learner of its own, and more to do when a step is done."""

    def __init__(self, *, rng=None):
        super().__init__(map="sparse", rng=rng, agent_reporters={"x": lambda agent: float(agent.position[0])})
        self.add_robots(AGENT9, 4)
        self.control = Subsumption(timid, Counting())
        self.learner, self.dice = Learner(), self.streams["dice"]
        self.seen = {"steps": deque(maxlen=5), (1, 2): {3, 4}, "far": np.inf, "nothing": None}
        self.leader, self.after = self.robots[2], 0

    def step(self):
        if self.after:
            self.leader.heading = float(self.learner.table[0, 0])
        super().step()
        self.after += 1
        self.learner.table += self.dice.random((2, 3))
        self.seen["steps"].append(self.after)
        self.leader.badge = self.after


@pytest.mark.slow
def test_attributes_layers_and_learners_of_ones_own_go_on(tmp_path):
    model = Own(rng=1)
    model.record(tmp_path / "run.arrow", checkpoint_every=20)
    model.run(50)
    model.observers[0].close()
    again = Own.resume(tmp_path / "run.arrow", step=45)
    assert again.leader is again.robots[2]
    again.run(5)
    assert_goes_on_alike(model, again, 20)
    assert again.seen == model.seen
    assert again.leader.badge == again.after == 70
    assert again.learner.table.tobytes() == model.learner.table.tobytes()
    assert again.control.layers[1].count == model.control.layers[1].count
    ours, theirs = (it.datacollector.get_agent_vars_dataframe() for it in (again, model))
    assert ours.equals(theirs)


def test_what_cannot_be_stored_is_named():
    model = FireFighting(rng=1)
    for value, message in (
        (object(), "friend is <object"),
        (lambda: 1, "friend is <function"),
        ([[object()]], "friend is"),
    ):
        model.friend = value
        with pytest.raises(RecordingError, match=message):
            checkpoint_of(model)
    model.friend = deque()
    model.friend.append(model.friend)
    with pytest.raises(RecordingError, match="nested more than"):
        checkpoint_of(model)
    model.friend = np.random.Generator(np.random.MT19937(1))
    with pytest.raises(RecordingError, match="use PCG64"):
        checkpoint_of(model)


def test_a_control_with_a_custom_rule_that_was_set_by_hand_is_refused():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(timid)
    with pytest.raises(RecordingError, match=r"checkpoint of step 3 cannot be restored: .*custom rule"):
        restore(SwarmModel(rng=1), checkpoint_of(model.run(3)))


def test_a_state_that_comes_out_otherwise_is_refused():
    checkpoint = stored(FireFighting(rng=1).run(5))
    checkpoint.state_hash = "0" * 32
    with pytest.raises(RecordingError, match="does not match its state hash"):
        restore(FireFighting(rng=1), checkpoint)


def mutated(value, draw):
    """Return a JSON value with something in it replaced, dropped or doubled."""
    if isinstance(value, dict) and value and draw.random() < 0.9:
        key = draw.choice(sorted(value))
        if draw.random() < 0.1:
            return {name: item for name, item in value.items() if name != key}
        return {**value, key: mutated(value[key], draw)}
    if isinstance(value, list) and value and draw.random() < 0.9:
        place = draw.randrange(len(value))
        new = [] if draw.random() < 0.1 else [mutated(value[place], draw)]
        return [*value[:place], *new, *value[place + 1 :]]
    return draw.choice([None, -1, 0, 2**70, 1e308, float("nan"), "x", [], {}, [[]], {"array": 3}, {"RobotDesign": {}}])


def check_hostile(seed, count):
    model, draw = changed_by_hand().run(3), random.Random(seed)
    checkpoint, refused = checkpoint_of(model), 0
    for _ in range(count):
        bad = from_bytes(to_bytes(checkpoint))
        bad.facts = mutated(json.loads(json.dumps(bad.facts)), draw)
        try:
            restore(SwarmModel(map="openspace_fire", rng=5), bad).run(2)
        except RecordingError as error:
            assert "\n" not in str(error)
            refused += 1
    assert refused > count / 3


@pytest.mark.slow
def test_forged_facts_are_refused_or_do_no_harm():
    check_hostile(1, 60)


@pytest.mark.long
def test_forged_facts_are_refused_or_do_no_harm_in_many_tries():
    check_hostile(2, 2000)


WRONG = {"design": 7, "fire": 70, "layer": 999, "heading": np.nan, "radius": 0.0, "number": 0, "position": 1e300,
         "max_speed": 1e9, "command": np.inf}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_columns_that_compiled_functions_cannot_take_are_refused(name):
    checkpoint = stored(FireFighting(rng=1).run(3))
    parts = checkpoint.facts["parts"]
    tables = [parts[part].get("columns", {}) for part in sorted(parts, key=lambda part: part == "bodies")]
    place = next(table[own]["array"] for table in tables for own in (name, f"robots.{name}") if own in table)
    checkpoint.arrays[place] = checkpoint.arrays[place].copy()
    checkpoint.arrays[place][2:4] = WRONG[name]
    with pytest.raises(RecordingError, match=f"column {name}"):
        restore(FireFighting(rng=1), checkpoint)


def moving_world():
    """Return a model with a fire, a wall, a load and a door, in this order after the border."""
    model = SwarmModel(rng=1)
    model.add_fire((100, 100), radius=10)
    model.add_obstacle(rectangle((200, 100), (220, 120)))
    model.add_load(disc((300, 100), 10), resistance=0.5)
    model.add_body(disc((400, 100), 10))
    return model


@pytest.mark.parametrize(
    ("name", "row", "value"),
    [
        *(("position", row, 1e300) for row in range(4)),
        ("position", 1, 210.5),
        *(("radius", row, value) for row, value in ((0, 0.0), (1, 3.0))),
        *(("temperature", 0, value) for value in (2.0, -0.1, np.nan)),
        *(("heading", 2, np.nan), ("heading", 3, 4.0), ("aim_heading", 3, np.nan), ("aim", 3, -1e9)),
        *(("resistance", 2, value) for value in (0.0, np.nan, np.inf)),
    ],
)
def test_columns_of_bodies_that_compiled_functions_cannot_take_are_refused(name, row, value):
    checkpoint = stored(moving_world().run(2))
    place = checkpoint.facts["parts"]["bodies"]["columns"][name]["array"]
    checkpoint.arrays[place] = checkpoint.arrays[place].copy()
    checkpoint.arrays[place][row - 4] = value
    with pytest.raises(RecordingError, match=r"column .*out-of-range"):
        restore(moving_world(), checkpoint)


@pytest.mark.skipif(not hasattr(mesa.Model, "schedule_event"), reason="Mesa 3.3 has no schedule of its own")
def test_a_single_event_in_the_schedule_is_seen_between_steps_and_while_one_is_taken(tmp_path):
    model = FireFighting(n_robots=2, rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=5) as recorder:
        model.run(4)
        model.schedule_event(model.sense, at=50.0)
        model.run(2)
        assert "schedule has events" in recorder.why_no_checkpoint
    assert recorder.checkpoints == (0,)


@pytest.mark.parametrize("steps", [0, 3, MOST_STEPS])
def test_a_clock_is_set_at_once_and_goes_on_a_step_at_a_time(steps):
    class Noting(SwarmModel):
        def step(self):
            seen.append(self.steps - steps)
            super().step()

    model, seen = Noting(rng=1), []
    with work_within(1):
        set_clock(model, steps)
    assert not seen
    model.run(3)
    assert (seen, model.completed) == ([1, 2, 3], 3)
    assert getattr(model, "time", model.steps) == steps + 3
