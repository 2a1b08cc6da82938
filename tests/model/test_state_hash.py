"""The fingerprint differs wherever steps may, and nowhere else."""

import copy
import linecache
import pickle
from dataclasses import dataclass, replace
from types import ModuleType, SimpleNamespace

import mesa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT3,
    AGENT9,
    Actuator,
    Emitter,
    Field,
    Map,
    Process,
    Radio,
    RobotDesign,
    SwarmModel,
    disc,
    polygon,
    rectangle,
)
from mesa_swarm.control import (
    PASS,
    Avoid,
    Chance,
    Explore,
    Halt,
    Seen,
    StateMachine,
    Subsumption,
    Transition,
    VectorSum,
    behaviour,
)
from mesa_swarm.control.source import normal_source, what_is_read
from mesa_swarm.fire import FightFire, SeekHeat, design_constants
from mesa_swarm.learning import QLearning
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.model.observers import Observer
from mesa_swarm.robots.imperfections import ROBOTARIUM

NEAR = 10.0
LASTING = replace(design_constants(), k1=0.001)
SQUARE = [(300, 300), (320, 300), (320, 320), (300, 320)]
# A step does not depend on where the robot's own random streams stand: one robot at a given place suffices.
POSE = [(400.0, 300.0, 0.0)]


@behaviour
def timid(me, distance=20.0):
    """Back away from what is ahead."""
    if 0 <= me.distance[me.front] < distance + NEAR:
        return -me.max_speed, -me.max_speed
    return PASS


@behaviour(memory={"n": 0})
def counting(me):
    me.memory.n += 1
    return PASS


@behaviour(memory={"n": 5})
def counting_from_five(me):
    me.memory.n += 1
    return PASS


class Own:
    """A layer with a number of its own."""

    name = "Own"

    def __init__(self, gain):
        self.gain = gain

    def bind(self, swarm, prefix, rng):
        self.swarm = swarm

    def decide(self, senses, command, layer, index):
        free = layer < 0
        command[free] = self.gain
        layer[free] = index


class Tide(Process):
    """A process without state."""

    def step(self, model):
        return


class Ebb(Tide):
    """Another one."""


def world(change=lambda model: None, **named):
    model = SwarmModel(map="openspace", rng=1, **named)
    model.add_robots(AGENT9, poses=POSE, tendency="left")
    model.control = Subsumption(Avoid(distance=15), Explore())
    change(model)
    return model


def controlled(*layers):
    return lambda model: setattr(model, "control", Subsumption(*layers))


def machine(probability=0.1, order=1):
    states = {"go": (Avoid(), Explore()), "stay": Halt()}
    moves = [
        Transition(source="go", target="stay", condition=Seen(kind="robot", within=15)),
        Transition(source="stay", target="go", condition=Chance(probability=probability)),
    ]
    return StateMachine(states, moves[::order])


def add_fire(model, **named):
    model.add_fire((100, 100), **{"radius": 20, **named})


def fires_with(constants):
    def change(model):
        add_fire(model)
        model.fire_constants = constants

    return change


# Each of these worlds differs from all others, and from the plain one, in what its steps may do.
DIFFERENT = {
    "plain": lambda model: None,
    "a disc": lambda model: model.add_obstacle(disc((182, 189), 39)),
    "a larger disc": lambda model: model.add_obstacle(disc((182, 189), 40)),
    "a disc elsewhere": lambda model: model.add_obstacle(disc((183, 189), 39)),
    "a mark": lambda model: model.add_obstacle(disc((182, 189), 39, contact=False)),
    "a rectangle": lambda model: model.add_obstacle(rectangle((300, 300), (320, 330))),
    "a square": lambda model: model.add_obstacle(polygon(SQUARE)),
    "a square with a hole": lambda model: model.add_obstacle(
        polygon(SQUARE, holes=[[(305, 305), (310, 305), (310, 310)]])
    ),
    "a post": lambda model: model.add_body(disc((182, 189), 39), mode="fixed", kind="post"),
    "a driven body": lambda model: model.add_body(disc((182, 189), 39)),
    "a load": lambda model: model.add_load(disc((182, 189), 39), resistance=1),
    "a heavier load": lambda model: model.add_load(disc((182, 189), 39), resistance=2),
    "a square load": lambda model: model.add_load(polygon(SQUARE), resistance=1),
    "a fire": add_fire,
    "a larger fire": lambda model: add_fire(model, radius=21),
    "a cooler fire": lambda model: add_fire(model, temperature=0.5),
    "fires that last": fires_with(LASTING),
    "fires from afar": lambda model: (add_fire(model), setattr(model, "extinguish_range", 20.0)),
    "two robots": lambda model: model.add_robots(AGENT9, poses=[(200, 200, 0.0)]),
    "another robot": lambda model: model.add_robots(AGENT3, poses=[(200, 200, 0.0)]),
    "a robot with longer sight": lambda model: model.add_robots(
        replace(AGENT3, sensors=tuple(replace(sensor, range=99.0) for sensor in AGENT3.sensors)),
        poses=[(200, 200, 0.0)],
    ),
    "a robot with a battery": lambda model: model.add_robots(replace(AGENT3, battery=1e6), poses=[(200, 200, 0.0)]),
    "a robot of a group": lambda model: model.add_robots(AGENT3, poses=[(200, 200, 0.0)], group="scouts"),
    "a field": lambda model: model.add_field(Field("trail", cell=50.0)),
    "a field that spreads": lambda model: model.add_field(Field("trail", cell=50.0, diffusion=0.1)),
    "an emitter": lambda model: (
        model.add_field(Field("trail", cell=50.0)),
        model.add_robots(replace(AGENT3, actuators=(Emitter(field="trail"),)), poses=[(200, 200, 0.0)]),
    ),
    "a radio": lambda model: setattr(model, "communication", Radio(range=50)),
    "a longer radio": lambda model: setattr(model, "communication", Radio(range=60)),
    "imperfect": lambda model: setattr(model, "imperfections", ROBOTARIUM),
    "less imperfect": lambda model: setattr(model, "imperfections", ROBOTARIUM.at(0.5)),
    "a tide": lambda model: model.add_process(Tide()),
    "an ebb": lambda model: model.add_process(Ebb()),
    "a declared value": lambda model: model.state.update(delivered=1),
    "no control": lambda model: setattr(model, "control", None),
    "farther": controlled(Avoid(distance=16), Explore()),
    "backwards": controlled(Explore(), Avoid(distance=15)),
    "only avoiding": controlled(Avoid(distance=15)),
    "of another name": controlled(Avoid(distance=15), Explore(name="Walk")),
    "a sum": lambda model: setattr(model, "control", VectorSum(Avoid(), Explore(), weights=(2, 1))),
    "another sum": lambda model: setattr(model, "control", VectorSum(Avoid(), Explore(), weights=(1, 2))),
    "a machine": lambda model: setattr(model, "control", machine()),
    "a busier machine": lambda model: setattr(model, "control", machine(0.2)),
    "a machine in another order": lambda model: setattr(model, "control", machine(order=-1)),
    "a rule": controlled(timid, Explore()),
    "a more timid rule": controlled(timid(distance=30), Explore()),
    "a rule that counts": controlled(counting, Explore()),
    "a rule that counts from 5": controlled(counting_from_five, Explore()),
    "a layer of mine": controlled(Own(1.0)),
    "a faster layer of mine": controlled(Own(2.0)),
    "a fighter": controlled(FightFire(strategy="A"), Explore()),
    "a seeker": controlled(SeekHeat(), Explore()),
    "a learner": controlled(QLearning(), Explore()),
    "a slower learner": controlled(QLearning(alpha=0.01), Explore()),
    "a team": lambda model: setattr(model, "control", {AGENT9: Subsumption(Avoid(distance=15), Explore())}),
}


@pytest.mark.slow
def test_worlds_whose_steps_may_differ_have_different_hashes():
    hashes: dict[str, list[str]] = {}
    for name, change in DIFFERENT.items():
        hashes.setdefault(world(change).state_hash(), []).append(name)
    assert [names for names in hashes.values() if len(names) > 1] == []


@pytest.mark.parametrize("steps", [0, 30])
def test_an_obstacle_out_of_reach_is_seen_by_the_hash_before_and_after_steps(steps):
    plain, other = world().run(steps), world(DIFFERENT["a disc"]).run(steps)
    assert plain.swarm.position.tolist() == other.swarm.position.tolist()
    assert plain.state_hash() != other.state_hash()


@pytest.mark.parametrize("named", [{"map": Map(name="hall", bounds=(0, 0, 801, 600))}, {"turn_angle_degrees": 50.0}])
def test_the_bounds_of_the_map_and_the_angle_of_contact_count(named):
    assert SwarmModel(rng=1, **named).state_hash() != SwarmModel(rng=1).state_hash()


class Loud(Observer):
    """An observer."""


NOT_SEEN = {
    "threads": {"threads": 3},
    "the engine": {"engine": "shapely"},
    "how often is collected": {"collect_every": 7, "history_every": 3},
    "reporters": {"model_reporters": {"n": lambda model: 1}, "agent_reporters": {"x": lambda agent: agent.unique_id}},
    "constants of fires without fires": {"fire_constants": LASTING, "extinguish_range": 3.0},
}


@pytest.mark.parametrize("named", NOT_SEEN.values(), ids=NOT_SEEN)
def test_what_changes_no_step_does_not_count(named):
    assert world(**named).run(5).state_hash() == world().run(5).state_hash()


@pytest.mark.parametrize(
    "change",
    [
        lambda model: model.observers.append(Loud()),
        lambda model: model.watch(last=3),
        lambda model: setattr(model, "datacollector", mesa.DataCollector()),
        lambda model: setattr(model, "note", "a text of the user's"),
        lambda model: model.add_obstacle(disc((182, 189), 39)).remove(),
        lambda model: model.rng.random(3),
    ],
    ids=["an observer", "watching", "a data collector", "an attribute", "a body that went", "draws"],
)
def test_what_changes_no_step_does_not_count_when_it_is_done_by_hand(change):
    model = world()
    before = model.state_hash()
    change(model)
    assert model.state_hash() == before


def test_the_order_in_which_designs_came_does_not_count():
    one, other = (SwarmModel(rng=1) for _ in range(2))
    for design, model in ((AGENT3, one), (AGENT9, one), (AGENT9, other), (AGENT3, other)):
        model.add_robots(design, 1).pop().remove()
    for model in (one, other):
        model.add_robots(AGENT9, poses=POSE, tendency="left")
        model.add_robots(AGENT3, poses=[(200, 200, 0.0)], tendency="left")
    assert one.state_hash() == other.state_hash()


class Tuned(SwarmModel):
    """A model with one parameter that a layer reads, and one that nothing reads."""

    def __init__(self, *, distance: float = 15.0, title: str = "", gain: float = 1.0, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_robots(AGENT9, 4)
        self.control = Subsumption(Avoid(distance=distance), Explore())


@pytest.mark.slow
@given(st.floats(0, 10), st.text(max_size=5), st.integers(0, 20))
def test_going_on_with_a_parameter_that_nothing_reads_keeps_the_hash(gain, title, steps):
    model = Tuned(rng=1).run(steps)
    before = model.state_hash()
    assert model.continued(gain=gain, title=title).state_hash() == before


def test_going_on_with_a_parameter_that_a_layer_reads_changes_the_hash():
    model = Tuned(rng=1).run(3)
    assert model.continued(distance=20.0).state_hash() != model.state_hash()
    assert Tuned(rng=1).run(3).continued(distance=15).state_hash() == model.state_hash()


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_reading_copying_and_making_again_keep_the_hash_of_each_model(name):
    model, again = (find_model(name)(rng=1).run(5) for _ in range(2))
    before = model.state_hash()
    model.sense()
    twins = [model, again, copy.deepcopy(model), pickle.loads(pickle.dumps(model))]
    assert {twin.state_hash() for twin in twins} == {before}


def test_what_a_learner_has_learned_counts():
    models = [world(controlled(QLearning(), Explore())).run(50) for _ in range(2)]
    weights = models[1].swarm.columns["0.QLearning.outer"]
    assert models[0].state_hash() == models[1].state_hash()
    weights[0] += 1e-12
    assert models[0].state_hash() != models[1].state_hash()


# ---- sources


def rule_of(text, name="rule"):
    """Return a function of this source, as it stands in a notebook."""
    file = f"<cell {hash(text)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    space = {"PASS": PASS, "NEAR": NEAR}
    exec(compile(text, file, "exec"), space)
    return space[name]


PLAIN = "def rule(me, distance=20.0):\n    if me.distance[0] < distance:\n        return 0.0, 1.0\n    return PASS\n"
SAME = [
    PLAIN,
    PLAIN.replace(":\n", ":  # why\n"),
    PLAIN.replace("    return PASS", "\n\n    return   PASS  # below"),
    PLAIN.replace("0):\n", '0):\n    """Turn.\n\n    More.\n    """\n'),
    PLAIN.replace("    ", "  "),
    PLAIN.replace("me.distance[0] < distance", "me.distance[ 0 ]<distance"),
]


def test_comments_layout_and_docstrings_are_not_part_of_a_source():
    assert len({normal_source(rule_of(text)) for text in SAME}) == 1


@pytest.mark.parametrize(("old", "new"), [("<", "<="), ("0.0, 1.0", "1.0, 0.0"), ("distance[0]", "distance[1]")])
def test_any_other_change_of_a_source_counts(old, new):
    one, other = (world(controlled(behaviour(rule_of(text)), Explore())) for text in (PLAIN, PLAIN.replace(old, new)))
    assert one.state_hash() != other.state_hash()


def test_a_number_around_a_rule_counts_as_its_source_does():
    text = PLAIN.replace("< distance", "< NEAR")
    one, other = rule_of(text), rule_of(text + "\n")
    other.__globals__["NEAR"] = NEAR + 1
    hashes = [world(controlled(behaviour(rule), Explore())).state_hash() for rule in (one, other)]
    assert hashes[0] != hashes[1]


def test_a_function_that_a_rule_calls_counts():
    text = "def near(x):\n    return x < 5\n\ndef rule(me):\n    return (0.0, 1.0) if near(me.distance[0]) else PASS\n"
    hashes = []
    for limit in ("5", "6"):
        rule = rule_of(text.replace("5", limit))
        hashes.append(world(controlled(behaviour(rule), Explore())).state_hash())
    assert hashes[0] != hashes[1]


READERS = {
    "a module": ("places.NEAR", {"places": ModuleType("places")}),
    "a tuple in a module": ("places.FAR[0]", {"places": ModuleType("places")}),
    "a class": ("Places.near", {"Places": type("Places", (), {})}),
    "a namespace": ("space.near", {"space": SimpleNamespace()}),
    "a list": ("listed[0]", {"listed": [5]}),
    "a dict": ('named["near"]', {"named": {"near": 5}}),
}


def set_number(holder, number):
    """Give whatever a rule reads its number."""
    if isinstance(holder, list):
        holder[0] = number
    elif isinstance(holder, dict):
        holder["near"] = number
    else:
        holder.NEAR = holder.near = number
        holder.FAR = (number, 3)


@pytest.mark.parametrize("where", READERS)
def test_a_number_that_a_rule_reads_of_anything_counts_as_it_is_when_the_rule_gets_its_robots(where):
    words, space = READERS[where]
    (holder,) = space.values()
    rule = rule_of(PLAIN.replace("< distance", f"< {words}"))
    rule.__globals__.update(space)
    hashes = []
    for number in (5, 6, 5):
        set_number(holder, number)
        hashes.append(world(controlled(behaviour(rule), Explore())).state_hash())
    assert hashes[0] == hashes[2] != hashes[1]


def test_a_default_of_a_function_that_a_rule_calls_counts():
    text = "def near(x, limit=LIMIT):\n    return x < limit\n\n"
    text += "def rule(me):\n    return (0.0, 1.0) if near(me.distance[0]) else PASS\n"
    hashes = set()
    for limit in (5, 6):
        space = {"PASS": PASS, "LIMIT": limit}
        exec(text, space)
        hashes.add(world(controlled(behaviour(space["rule"]), Explore())).state_hash())
    assert len(hashes) == 2


def world_of_one(rule):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(400, 300, 0.0)])
    model.control = Subsumption(rule)
    return model


@pytest.mark.slow
@pytest.mark.parametrize("where", ["global", "closure", "module"])
def test_a_constant_that_is_changed_before_the_first_step_counts_and_so_does_its_hash(where):
    cfg = ModuleType("cfg")
    cfg.GAIN = gain = 0.1
    space = {"PASS": PASS, "GAIN": 0.1, "cfg": cfg}

    def of_closure(me):
        return gain * me.max_speed, me.max_speed

    words = "GAIN" if where == "global" else "cfg.GAIN"
    exec(f"def rule(me):\n    return {words} * me.max_speed, me.max_speed\n", space)
    rule = behaviour(of_closure if where == "closure" else space["rule"])
    plain, changed = world_of_one(rule), world_of_one(rule)
    before = (plain.state_hash(), plain.run(3).robots[0].heading)
    space["GAIN"] = cfg.GAIN = gain = 0.9
    after = (changed.state_hash(), changed.run(3).robots[0].heading)
    assert all(one != other for one, other in zip(before, after, strict=True))


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
def test_a_plain_rule_reads_its_constants_in_every_step_and_its_hash_has_them():
    space = {"PASS": PASS, "GAIN": 0.1}
    exec("def rule(me):\n    str({})\n    return GAIN * me.max_speed, me.max_speed\n", space)
    model, other = world_of_one(behaviour(space["rule"])), world_of_one(behaviour(space["rule"]))
    model.run(2), other.run(2)
    hashed = model.state_hash()
    assert hashed == other.state_hash()
    space["GAIN"] = 0.9
    assert model.state_hash() != hashed
    assert model.step() or model.robots[0].heading != pytest.approx(other.robots[0].heading * 1.5)


def test_a_copy_of_a_model_whose_rule_has_begun_keeps_its_constants():
    space = {"PASS": PASS, "GAIN": 0.1}
    exec("def rule(me):\n    return GAIN * me.max_speed, me.max_speed\n", space)
    model = world_of_one(behaviour(space["rule"])).run(2)
    twin = copy.deepcopy(model)
    space["GAIN"] = 0.9
    assert twin.state_hash() == model.state_hash()
    assert twin.run(5).state_hash() == model.run(5).state_hash()


def test_a_rule_goes_by_its_constants_as_they_are_at_its_first_step_and_so_does_its_hash():
    space = {"PASS": PASS, "GAIN": 0.1}
    exec("def rule(me):\n    return GAIN * me.max_speed, me.max_speed\n", space)
    turning, ends = behaviour(space["rule"]), []
    for gain in (0.1, 0.9, 0.1):
        space["GAIN"] = gain
        model = SwarmModel(map="openspace", rng=1)
        model.add_robots(AGENT9, poses=[(400, 300, 0.0)])
        model.control = Subsumption(turning)
        begun = model.state_hash()
        model.step()
        space["GAIN"] = 0.5  # too late for this model
        ends.append((begun, model.run(9).robots[0].heading, model.state_hash()))
    assert ends[0] == ends[2]
    assert all(one != other for one, other in zip(ends[0], ends[1], strict=True))


@pytest.mark.parametrize(
    ("number", "other"), [(7, 7.0), (0.0, -0.0), (1, True), (np.float32(0.1), float(np.float32(0.1)))]
)
def test_constants_that_are_equal_but_of_another_type_or_sign_are_compiled_again(number, other):
    space = {"PASS": PASS, "GAIN": number}
    exec("def rule(me):\n    return 0.1 * GAIN, 0.2\n", space)
    reads = [what_is_read(space["rule"])]
    space["GAIN"] = other
    reads.append(what_is_read(space["rule"]))
    rule = behaviour(space["rule"]).rule
    assert [rule.version_of(read) for read in (*reads, *reads)] == [0, 1, 0, 1]


def test_a_constant_that_is_nan_is_compiled_once():
    space = {"PASS": PASS, "GAIN": np.float64("nan")}
    exec("def rule(me):\n    return 0.1 * GAIN, 0.2\n", space)
    rule = behaviour(space["rule"]).rule
    assert [rule.version_of(what_is_read(space["rule"])) for _ in range(3)] == [0, 0, 0]


@dataclass(frozen=True)
class Rates:
    """A part of a process."""

    growth: float = 1.0


class Holding:
    """A process that holds something."""

    def __init__(self, held):
        self.held = held

    def step(self, model):
        """Do nothing."""


def falling(rate):
    return lambda time: 1.0 - rate * time


PARTS_OF_PROCESSES = {
    "dataclass": (Rates(1.0), Rates(1.0), Rates(2.0)),
    "function": (falling(0.1), falling(0.1), falling(0.2)),
    "namespace": (SimpleNamespace(a=1), SimpleNamespace(a=1), SimpleNamespace(a=2)),
    "list": ([Rates(1.0)], [Rates(1.0)], [Rates(2.0)]),
}


@pytest.mark.parametrize("kind", PARTS_OF_PROCESSES)
def test_what_a_process_holds_counts(kind):
    hashes = []
    for held in PARTS_OF_PROCESSES[kind]:
        model = world()
        model.add_process(Holding(held))
        hashes.append(model.state_hash())
    assert hashes[0] == hashes[1] != hashes[2]


def lamps(brightness):
    class Lit(Actuator):
        name = "lit"
        width = 1

        def apply(self, model, rows):
            """Set a column to a number around the class."""
            model.swarm.columns["temperature"][rows] = brightness

    return Lit()


def test_a_number_that_a_method_of_a_custom_part_reads_counts():
    hashes = []
    for brightness in (0.1, 0.1, 0.2):
        model = SwarmModel(map="openspace", rng=1)
        model.add_robots(RobotDesign(actuators=(lamps(brightness),)), poses=[(400, 300, 0.0)])
        hashes.append(model.state_hash())
    assert hashes[0] == hashes[1] != hashes[2]


@given(st.permutations([disc((100, 100), 9), rectangle((200, 200), (240, 260)), disc((300, 100), 9)]))
def test_the_order_in_which_obstacles_were_created_does_not_count(shapes):
    model, other = (SwarmModel(map="openspace", rng=1) for _ in range(2))
    for shape in shapes:
        model.add_obstacle(shape)
    for shape in sorted(shapes, key=lambda shape: shape.bounds):
        other.add_obstacle(shape)
    assert model.state_hash() == other.state_hash()


def test_a_rule_whose_source_is_unknown_counts_by_its_name():
    space = {"PASS": PASS}
    exec("def typed(me):\n    return PASS\n", space)
    assert normal_source(space["typed"]) == ""
    assert world(controlled(behaviour(space["typed"]), Explore())).state_hash() != world().state_hash()
