"""Kernels of stages: called in the order of the plan they do what a step does, and the plan names why there is none."""

import math
import pickle
from collections import Counter
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numba import types

from mesa_swarm import (
    AGENT9,
    AGENT_FIRE,
    Emitter,
    Field,
    FieldSensor,
    Lamp,
    LineSensor,
    Map,
    NeighbourSensor,
    ProximitySensor,
    RadiationSensor,
    Radio,
    SwarmModel,
    disc,
    rectangle,
)
from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control import Avoid, Explore, Subsumption, VectorSum, behaviour
from mesa_swarm.control.arbiter import decide_layers
from mesa_swarm.fire import FightFire
from mesa_swarm.fire.burning import Burning
from mesa_swarm.kernels.part import Phase
from mesa_swarm.kernels.plan import call_when_due
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.gallery import find_model
from mesa_swarm.physics.driven_bodies import WORN
from mesa_swarm.physics.stage_kernels import LIST, SETTLE
from mesa_swarm.robots.drive import DifferentialDrive, DirectedSlip, HolonomicDrive, OmniDrive
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from support.doors import with_swinging_doors
from support.pushing import note_returns

ACT = "actuators do what they are set to"
SENSE, MOVE, COUNT = "robots read their sensors", "robots move, and contacts are resolved", "collisions are counted"
HEAR, DECIDE, FIELDS, PROCESSES, HISTORY = (
    "robots hear each other",
    "layers decide",
    "fields diffuse and evaporate",
    "Burning takes place",
    "temperatures of fires are stored",
)
SIGNATURE = (types.int64[::1], types.int64, types.int64, types.int64)
# How often each kernel returned each code.
CODES: Counter = Counter()
KERNELS: list = []


def step_by_kernels(model):
    """Take a step as `EngineModel.step` does, by kernels where stages have them."""
    parts, counted = model.parts, False
    for place in range(len(parts.plan.stages)):
        _, stage = parts.plan.stages[place]  # made anew where Python has changed arrays since
        if stage.phase is Phase.COLLECT and not counted:
            model._completed, counted = model._completed + 1, True
        if stage.kernel is None:
            call_when_due(stage, lambda: model.completed)()
            continue
        kernel = stage.kernel
        KERNELS.append(kernel)
        if model.completed % stage.every == 0 or stage.phase is not Phase.COLLECT:
            while code := kernel.function(kernel.block, model.steps, 0, len(model.swarm)):
                CODES[kernel.function.__name__, code] += 1
                kernel.attend(code)
            if kernel.finish is not None:
                kernel.finish()
    model._collect()


@pytest.fixture
def run(monkeypatch):
    """Return what takes the steps of two equal models, of the second by kernels, and compares them."""

    def run_both(models, steps):
        usual, by_kernels = models
        usual.run(steps)
        with monkeypatch.context() as patched:
            patched.setattr(EngineModel, "step", step_by_kernels)
            for _ in range(steps):
                by_kernels.step()
        assert by_kernels.completed == usual.completed
        assert by_kernels.state_hash() == usual.state_hash()
        rows = [model.datacollector.get_model_vars_dataframe() for model in models]
        assert rows[1].equals(rows[0])

    return run_both


def on_own_map():
    """Return a dense crowd between walls of a map of its own, which gets stuck in corners."""
    walls = [rectangle((56, 0), (64, 40)), rectangle((56, 60), (64, 100)), disc((20, 50), 6)]
    model = SwarmModel(map=Map(bounds=(0, 0, 120, 100), obstacles=walls), rng=3)
    model.add_robots(AGENT9, 14)
    model.control = Subsumption(Explore())
    return model


def with_fields():
    """Return a model with fields, one of which is empty, and one stays as it is."""
    model = find_model("collision_avoidance")(n_robots=10, rng=2)
    for name, diffusion in (("trail", 30.0), ("still", 0.0), ("empty", 1.0)):
        model.add_field(Field(name, cell=20.0, diffusion=diffusion, evaporation=0.01 * (diffusion > 0)))
    for name in ("trail", "still"):
        model.fields[name].deposit((200, 300), 5.0)
    return model


def in_touch():
    """Return a world in which robots hear of fires, and go where others fight them; one beacon stands in a corner."""
    model = SwarmModel(map="openspace_fire", rng=5, communication=Radio(range=200, occlusion=True, beacons=[(20, 20)]))
    model.add_obstacle(rectangle((300, 200), (320, 400)))
    model.add_robots(AGENT_FIRE, 12)
    model.control = Subsumption(Avoid(fires="never"), FightFire(), Explore())
    return model


@behaviour
def count_voices(me):
    me.send.count = me.heard.n
    me.send.vector[1] = me.heard.range[0]
    return 0.6, 0.9 - 0.1 * me.heard.n


def talking():
    """Return a world in which messages are lost by chance and stopped by a wall, and by a door that moves."""
    radio = Radio(range=90, occlusion=True, loss_probability=0.3, message={"count": 1, "vector": 2}, most=3)
    model = SwarmModel(map=Map(bounds=(0, 0, 300, 200)), rng=2, communication=radio)
    model.add_obstacle(rectangle((100, 60), (110, 120)))
    model.add_process(DoorKeeper(model.add_body(rectangle((200, 60), (210, 100)), kind="door").unique_id))
    model.add_robots(AGENT9, 15)
    model.control = Subsumption(Avoid(), count_voices)
    return model


class DoorKeeper:
    """A process that moves a door back and forth."""

    def __init__(self, door):
        self.door = door

    def step(self, model):
        door = next(body for body in model.bodies if body.unique_id == self.door)
        door.position = (205.0, 80.0 + 15.0 * math.sin(model.steps / 9))


def uncertain(**named):
    """Return a world with a door, fires and marks, and robots with sensors that err, are slow, or of other kinds."""
    eyes = [
        replace(sensor, error_probability=0.3, error_magnitude=0.2, hold=1 + k % 3, period=1 + k % 4)
        for k, sensor in enumerate(AGENT9.sensors)
    ]
    others = LineSensor(mount=(3, 0)), RadiationSensor(range=60), ProximitySensor(mount=(9, 0), range=20)
    model = SwarmModel(map=Map(bounds=(0, 0, 300, 200)), rng=2, **named)
    model.add_obstacle(rectangle((10, 10), (80, 90), contact=False))
    model.add_obstacle(rectangle((100, 60), (110, 120)))
    model.add_fire((150, 150), radius=10)
    model.add_process(DoorKeeper(model.add_body(rectangle((200, 60), (210, 100)), kind="door").unique_id))
    model.add_robots(replace(AGENT9, sensors=(*eyes, *others)), 15)
    model.control = Subsumption(Avoid(), Explore())
    return model


def pushing():
    """Return a narrow world in which robots push loads about a door that moves, and cannot give way to some."""
    model = SwarmModel(map=Map(bounds=(0, 0, 220, 180)), rng=3)
    model.add_obstacle(rectangle((100, 60), (110, 120)))
    for place in ((150, 40), (160, 120), (70, 70)):
        model.add_load(disc(place, 7), resistance=0.4)
    model.add_load(rectangle((180, 80), (195, 90)), resistance=0.7)
    model.add_process(DoorKeeper(model.add_body(rectangle((200, 60), (210, 100)), kind="door").unique_id))
    model.add_robots(AGENT9.with_slip(probability=0.2, magnitude=0.5), 70)
    model.control = Subsumption(Explore())
    return model


@behaviour
def go_aside(me):
    return 0.5, 0.3


@behaviour
def turn_on_three(me):
    return 0.5, 0.4, -0.3


def driving(**named):
    """Return a world of robots on wheels, rollers and omni-wheels, of limited acceleration, which slip."""
    slippery = replace(AGENT9, directed_slip=DirectedSlip(forward=0.1, turn=0.3)).with_slip(
        probability=0.2, magnitude=0.5
    )
    drives = DifferentialDrive(acceleration=0.05), HolonomicDrive(), OmniDrive(acceleration=0.1)
    rules = Explore(), go_aside, turn_on_three
    model = SwarmModel(map=Map(bounds=(0, 0, 220, 180)), rng=3, **named)
    designs = [replace(slippery, name=f"robot {k}", drive=drive) for k, drive in enumerate(drives)]
    for design in designs:
        model.add_robots(design, 9)
    model.control = {design: Subsumption(rule) for design, rule in zip(designs, rules, strict=True)}
    return model


def failing():
    """Return a world of robots of which sensors and wheels fail, and which break down."""
    model = uncertain()
    model.imperfections = Imperfections(
        sensing=Imperfection(error=0.1, dropout=0.05, outliers=0.05, hold=2, period=2),
        sensor_failure=0.01,
        wheel_failure=0.01,
        failure=0.002,
        battery=50,
    )
    return model


@behaviour
def follow_trail(me):
    me.act.trail = 0.3
    turn = min(0.1 * me.trail[0], 0.4) if me.trail[0] > 0.0 else 0.0
    near = me.neighbour[0] < 20 or me.guard[0] < 30
    return (0.5, -0.5) if near else (0.5 - turn, 0.5 + turn)


def smelling(**named):
    """Return a world of robots that leave trails and smell them, and see neighbours and bodies behind a wall or not."""
    model = SwarmModel(map=Map(bounds=(0, 0, 220, 180)), rng=3, **named)
    model.add_obstacle(rectangle((100, 60), (110, 120)))
    model.add_field(Field("trail", cell=5.0, diffusion=0.5, evaporation=0.01))
    model.add_process(DoorKeeper(model.add_body(disc((205, 80), 4), kind="guard").unique_id))
    antennae = FieldSensor(field="trail", mount=(5, 3)), FieldSensor(field="trail", mount=(5, -3))
    eyes = NeighbourSensor(range=50, k=2, occluded=True, lamp=True), NeighbourSensor(range=80, k=1, kind="guard")
    actuators = Emitter(field="trail", mount=(-3, 1), rate=2.0), Lamp()
    model.add_robots(replace(AGENT9, sensors=(*antennae, *eyes), actuators=actuators), 12)
    model.add_robots(replace(AGENT9, sensors=(*AGENT9.sensors, *antennae[:1], *eyes), actuators=actuators), 6)
    model.control = Subsumption(follow_trail)
    return model


# Of each world its model, and the stages that have kernels.
WORLDS = {
    "avoidance": (lambda: find_model("collision_avoidance")(n_robots=40, rng=1), {SENSE, DECIDE, MOVE, COUNT}),
    "radiation": (lambda: find_model("fire_fighting")(rng=1), {SENSE, DECIDE, MOVE, COUNT, PROCESSES, HISTORY}),
    "radio": (in_touch, {SENSE, HEAR, DECIDE, MOVE, COUNT, PROCESSES, HISTORY}),
    "errors of sensors": (uncertain, {SENSE, DECIDE, COUNT}),
    "imperfections": (lambda: uncertain(imperfections=0.8, noise=0.1, slip=0.2), {SENSE, MOVE, COUNT}),
    "failures": (failing, {SENSE, MOVE, COUNT}),
    "drives": (driving, {SENSE, MOVE, COUNT}),
    "imperfect drives": (lambda: driving(imperfections=0.6), {SENSE, MOVE, COUNT}),
    "loads": (pushing, {SENSE, DECIDE, MOVE, COUNT}),
    "messages": (talking, {HEAR, COUNT}),
    "own devices": (lambda: smelling().run(1), {SENSE, ACT, MOVE, COUNT, FIELDS}),
    "imperfect devices": (lambda: smelling(imperfections=0.05).run(1), {SENSE, ACT, MOVE, COUNT, FIELDS}),
    "trails": (lambda: find_model("ant_trails")(rng=1), {MOVE, COUNT, FIELDS}),
    "fields": (with_fields, {SENSE, DECIDE, MOVE, COUNT, FIELDS}),
    "own map": (on_own_map, {SENSE, DECIDE, MOVE, COUNT}),
}


def stages_with_kernels(model):
    return {stage.name for _, stage in model.plan.stages if stage.kernel is not None}


@pytest.mark.slow
@pytest.mark.parametrize(("make", "kernels"), WORLDS.values(), ids=WORLDS)
def test_kernels_in_the_order_of_the_plan_are_a_step_whatever_arrays_are_replaced(make, kernels, run):
    models = make(), make()
    assert stages_with_kernels(models[1]) >= kernels
    run(models, 30)
    for model in models:
        x, y = model.robots[0].position
        model.add_robots(model.robots[0].design, poses=[(x, y, 0.5), (x + 1, y, 0.0)])  # overlap: they are moved
    run(models, 10)
    for model in models:
        model.remove_robots(list(model.robots)[1:3])
        model.add_obstacle(disc(tuple(model.robots[0].position + 30), 5))
    run(models, 10)
    copies = [deepcopy(model) for model in models]
    run(copies, 10)
    run([pickle.loads(pickle.dumps(model)) for model in models], 10)
    run(models, 10)
    assert models[1].state_hash() == copies[0].state_hash()


def test_kernels_follow_when_fields_are_added_and_removed_and_walls_change(run):
    models = with_fields(), with_fields()
    run(models, 3)
    for model in models:
        wall = model.add_obstacle(rectangle((255, 200), (265, 400)))
        model.remove_field("still")
        model.add_field(Field("late", diffusion=5.0)).deposit((300, 100), 2.0)
    run(models, 5)
    for model in models:
        list(model.obstacles)[-1].remove()
        model.fields["empty"].deposit((250, 300), 1.0)
    assert wall.space is None
    run(models, 5)


def test_kernels_follow_when_constants_change_and_what_burns_is_put_out_added_and_removed(run):
    models = [find_model("fire_fighting")(rng=4) for _ in range(2)]
    run(models, 20)
    for model in models:
        model.fires[0].put_out()
        model.fire_constants = replace(model.fire_constants, k1=2 * model.fire_constants.k1)
    run(models, 20)
    for model in models:
        model.fires[1].remove()
        model.add_fire((120, 130), radius=15, temperature=0.001)
        model.extinguish_range = 500.0
    run(models, 60)
    assert any(fire.out for fire in models[1].fires)


def test_a_kernel_that_lacks_room_for_pairs_gets_it_and_goes_on(run):
    models = [SwarmModel(map=Map(bounds=(0, 0, 400, 400)), rng=1) for _ in range(2)]
    for model in models:
        places = [(x, y, 0.1 * x) for x in range(40, 360, 12) for y in range(40, 360, 12)]
        model.add_robots(AGENT9, poses=places)
        model.control = Subsumption(Explore())
    CODES.clear()
    run(models, 3)
    assert CODES["sense_robots", LIST] > 0


def test_a_step_that_lacks_room_for_pairs_after_a_piece_goes_on_with_the_next(run):
    models = [SwarmModel(map=Map(bounds=(0, 0, 400, 400)), rng=1) for _ in range(2)]
    for model in models:
        headings = np.linspace(-3, 3, 60).tolist()
        places = [(200 - 190 * np.cos(heading), 200 - 190 * np.sin(heading), heading) for heading in headings]
        model.add_robots(replace(AGENT9, max_speed=180.0), poses=places)
        model.swarm.columns["command"][:] = 180.0
        model.sense()
    crowd = models[1].parts.robots.engine._crowd
    crowd.near = crowd.near._replace(room=np.empty((1, 2), np.int64))
    crowd._pairs.replace(crowd.near)
    CODES.clear()
    run(models, 1)
    assert CODES["move_robots", LIST] > 0


@pytest.mark.slow
def test_python_makes_tables_anew_when_loads_have_gone_far_but_is_not_asked_which_bodies_loads_stop(run):
    CODES.clear()
    run((pushing(), pushing()), 120)
    assert CODES["end_ways", WORN] > 0
    assert {code for function, code in CODES if function == "move_robots_and_movers"} <= {LIST, SETTLE}


def test_no_step_in_which_loads_stop_doors_that_a_process_sends_is_interrupted(run):
    CODES.clear()
    models = [with_swinging_doors(1) for _ in range(2)]
    run(models, 60)
    assert CODES.keys() <= {("move_robots_and_movers", SETTLE), ("end_ways", WORN)}
    assert models[1].movers.blocked.any()


def test_a_driven_run_is_that_of_single_steps_also_where_loads_go_so_far_that_tables_are_made_anew():
    driven, stepped = pushing(), pushing()
    for model in (driven, stepped):
        model.remove_process(model.processes[-1])
    scene = driven.run(1).parts.bodies.scene()
    driven.run(119)
    for _ in range(120):
        stepped.step()
    assert driven.parts.bodies.scene() is not scene
    assert driven.state_hash() == stepped.state_hash()
    assert driven.completed == stepped.completed == 120


def test_a_load_that_robots_cannot_yield_to_returns_and_all_travel_again_without_python(run, monkeypatch):
    models = [SwarmModel(map=Map(bounds=(0, 0, 400, 300)), rng=1) for _ in range(3)]
    for model in models:
        model.add_load(rectangle((340, 100), (380, 200)), resistance=0.5)
        model.add_robots(replace(AGENT9, sensors=()), poses=[(335, y, 0.0) for y in (130, 150, 170)])
        model.add_robots(replace(AGENT9, sensors=(), max_speed=0.0), poses=[(391, 150, 0.0)])
        model.control = Subsumption(Explore())
    CODES.clear()
    run(models[:2], 40)
    assert {code for function, code in CODES if function == "move_robots"} <= {LIST, SETTLE}
    assert models[1].loads[0].position[0] > 360.0
    taken = note_returns(monkeypatch)
    assert models[2].run(40).state_hash() == models[1].state_hash()
    assert taken


@dataclass(frozen=True, kw_only=True)
class Louder(FieldSensor):
    """A sensor of a field that reads otherwise."""

    @staticmethod
    def read(position, heading, mount, amounts, sides, frame, out):
        for i in range(len(out)):
            out[i, 0] = 2.0 + heading[i]


@dataclass(frozen=True, kw_only=True)
class Wasteful(Emitter):
    """An actuator that deposits nothing."""

    def apply(self, model, rows):
        """Do nothing."""


def test_devices_that_do_otherwise_than_those_that_they_derive_from_have_no_kernel():
    model = SwarmModel(rng=1)
    model.add_field(Field("trail"))
    design = replace(AGENT9, sensors=(Louder(field="trail"),), actuators=(Wasteful(field="trail"),))
    (robot,) = model.add_robots(design, poses=[(100, 100, 0.5)])
    model.control = Subsumption(Explore())
    model.run(2).swarm.columns["act.trail"][:] = 1.0
    model.sense()
    assert not {SENSE, ACT} & stages_with_kernels(model)
    assert (robot.trail.tolist(), model.run(1).fields["trail"].total) == ([2.0 + robot.heading], 0.0)


@pytest.mark.parametrize(("value", "words"), [(-1.0, "would deposit -2"), (math.nan, "expected finite numbers")])
def test_a_wrong_amount_is_refused_by_the_kernel_of_actuators_before_anything_is_deposited(value, words):
    model = smelling().run(2)
    before = model.fields["trail"].total
    stage = next(stage for _, stage in model.plan.stages if stage.name == ACT)
    model.swarm.columns["act.trail"][:] = [0.5] * 17 + [value]
    with pytest.raises(BehaviourError, match=words):
        stage.kernel.run(3, len(model.swarm))
    assert model.fields["trail"].total == before


def test_each_kernel_is_compiled_for_one_signature(run):
    models = [find_model("fire_fighting")(rng=1) for _ in range(2)]
    KERNELS.clear()
    run(models, 1)
    arbiters = [kernel.kept[0].kernels[0] for kernel in KERNELS if kernel.function is decide_layers]
    decided = [kernel.function for arbiter in arbiters for kernel in (arbiter, *arbiter.kept[0].kernels)]
    functions = {*decided, *(kernel.function for kernel in KERNELS)}
    names = {function.__name__ for function in functions}
    assert {"avoid", "fight", "go_straight", "sense_robots", "move_robots", "burn_all"} <= names
    for function in functions:
        assert function.signatures == [SIGNATURE]
        assert types.unliteral(function.overloads[SIGNATURE].signature.return_type) == types.int64


def test_a_parameter_of_a_layer_that_is_set_between_steps_counts_from_the_next_on(run):
    models = [find_model("collision_avoidance")(n_robots=5, rng=1) for _ in range(2)]
    run(models, 2)
    for speed in (0.5, 0.0):
        for model in models:
            model.control.layers[-1].speed = speed
            assert model.plan.stages  # which looks at what was set by hand
        run(models, 3)
    straight = models[1].swarm.layer == len(models[1].control.layers) - 1
    assert (models[1].swarm.command[straight] == 0.0).all()


def test_a_layer_that_commands_nan_is_named_by_an_error_whichever_way_a_step_is_taken(monkeypatch):
    words = []
    for step in (EngineModel.step, step_by_kernels):
        model = find_model("collision_avoidance")(n_robots=5, rng=1)
        model.control.layers[-1].speed = math.nan
        monkeypatch.setattr(EngineModel, "step", step)
        with pytest.raises(BehaviourError, match="commanded NaN to robot") as caught:
            model.step()
        words.append(str(caught.value))
    assert words[0] == words[1]


class OwnAvoid(Avoid):
    """A layer that decides in its own way."""

    def decide(self, senses, command, layer, index):
        command[:], layer[:] = 0.25, index


class SlowBurning(Burning):
    """What burns in each other step."""

    def step(self, model):
        if model.steps % 2:
            super().step(model)


def test_derived_classes_that_do_otherwise_have_no_kernel(run):
    def make():
        model = SwarmModel(map="openspace_fire", rng=1)
        model.add_robots(AGENT9, 5)
        model.control = Subsumption(OwnAvoid(), Explore())
        model.remove_process(model.processes[0])
        model.add_process(SlowBurning())
        return model

    models = make(), make()
    run(models, 5)
    assert not {DECIDE, PROCESSES} & stages_with_kernels(models[1])
    assert (models[1].swarm.command == 0.25).all()


class Geared(DifferentialDrive):
    """A drive of a user's, which goes half as far."""

    def motion(self, wheels, radius, motion):
        super().motion(0.5 * wheels, radius, motion)


def geared(model):
    model.add_robots(replace(AGENT9, drive=Geared()), 1)


def acting(model):
    model.control = VectorSum(OwnAvoid(name="OwnAvoid"), Explore())


# What changes a model, and why which stage has no kernel then.
REASONS = {
    "drives": ({}, geared, {MOVE: "Geared"}),
    "layers of a user's": ({}, acting, {DECIDE: "OwnAvoid"}),
    "twin": ({"engine": "shapely"}, bool, {SENSE: "the Shapely twin", MOVE: "the Shapely twin"}),
}


@pytest.mark.parametrize(("arguments", "change", "reasons"), REASONS.values(), ids=REASONS)
def test_the_plan_names_why_a_stage_has_no_kernel(arguments, change, reasons):
    model = SwarmModel(rng=1, **arguments)
    model.add_robots(AGENT9, 3)
    change(model)
    named = {stage.name: stage.python for _, stage in model.plan.stages if stage.kernel is None}
    assert {name: named.get(name) for name in (SENSE, HEAR, DECIDE, MOVE) if name in named} == reasons
    assert all(reason in str(model.plan) for reason in reasons.values())


def test_a_stage_of_python_that_changes_bodies_within_a_step_is_seen_by_the_next(run):
    def make():
        model = SwarmModel(rng=1)
        model.add_robots(replace(AGENT9, actuators=(Lamp(),)), 5)
        model.control = Subsumption(Avoid(), Explore())
        model.add_process(Builder())
        return model

    run((make(), make()), 12)


class Builder:
    """A process that adds an obstacle in each third step, and takes a robot away in each fifth."""

    def step(self, model):
        if model.steps % 3 == 0:
            model.add_obstacle(disc((40.0 * model.steps, 300), 8))
        if model.steps % 5 == 0:
            model.robots[0].remove()
