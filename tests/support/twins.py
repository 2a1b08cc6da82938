"""Ways in which a run can go on, changes by hand in between, and all that two runs are compared by."""

import copy
import pickle
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import mesa
import numpy as np

from mesa_swarm import Field, Radio, Recording, SwarmModel, disc
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.robots.imperfections import ROBOTARIUM
from support.twin_models import Tide, Wolf

# ---- what is compared


def traces_of(model: SwarmModel) -> dict[str, object]:
    """Return the hash, unique_ids, rows, events and random streams of a model by name."""
    collector = model.datacollector
    return {
        "hash": model.state_hash(),
        "steps": (model.steps, model.completed),
        "ids": sorted((type(agent).__name__, agent.unique_id) for agent in model.agents),
        "next id": mesa.Agent(copy.deepcopy(model)).unique_id,
        "rows": {name: list(map(repr, values)) for name, values in collector.model_vars.items()},
        "rows of agents": {step: [repr(row) for row in rows] for step, rows in collector._agent_records.items()},
        "events": model.events.rows(),
        "history": (list(model.fires.history._steps), [repr(row.tolist()) for row in model.fires.history._rows]),
        "streams": {name: state["state"] for name, state in model.streams.state().items()},
        "generators": (model.rng.bit_generator.state, model.random.getstate()),
        "kinds": model.kinds,
        "groups": model.swarm.groups,
        "agents": {agent.unique_id: plain_of(agent) for agent in model.agents if not hasattr(agent, "_stored_apart")},
        "intervals": (model.collect_every, model.fires.history.every),
        "speeds": model.swarm.max_speed.tolist(),
        "failures": [robot.failures for robot in model.robots],
        "attributes": {name: repr(value) for name, value in vars(model).items() if is_shown(name, value)},
    }


def plain_of(agent) -> dict[str, str]:
    return {name: repr(value) for name, value in vars(agent).items() if isinstance(value, (int, float, str))}


def is_shown(name: str, value: object) -> bool:
    """Return whether an attribute can be compared by its text."""
    own = not name.startswith("_") or name == "_turn_angle"
    return own and isinstance(value, (int, float, str, list, dict, np.ndarray)) and " at 0x" not in repr(value)


# ---- ways


class Run(NamedTuple):
    """A run of a model: `before` steps, perhaps changes by hand, and `after` steps."""

    model_class: type[SwarmModel]
    seed: int
    before: int
    after: int
    edits: int = 0
    named: dict = {}  # noqa: RUF012 - never changed

    def begun(self) -> SwarmModel:
        return self.model_class(**self.named, rng=self.seed)

    def edited(self, model: SwarmModel) -> SwarmModel:
        """Return the model after some changes by hand, drawn by the seed."""
        rng = np.random.default_rng([self.seed, 5])
        for place in rng.permutation(len(EDITS))[: self.edits].tolist():
            EDITS[place](model, rng)
        return model

    def halfway(self) -> SwarmModel:
        return self.edited(self.begun().run(self.before))


def plain(run, folder):
    return run.halfway().run(run.after)


def deep_copied(run, folder):
    return copy.deepcopy(run.halfway()).run(run.after)


def pickled(run, folder):
    return pickle.loads(pickle.dumps(run.halfway())).run(run.after)


def copied_twice(run, folder):
    half = copy.deepcopy(run.halfway()).run(run.after // 2)
    return pickle.loads(pickle.dumps(copy.deepcopy(half))).run(run.after - run.after // 2)


def in_two_threads(run, folder):
    return in_threads(run, 2)


def in_three_threads(run, folder):
    return in_threads(run, 3)


def in_threads(run, number):
    model = run.begun()
    model.threads = number
    model = run.edited(model.run(run.before)).run(run.after)
    model.threads = 1
    return model


def continued(run, folder):
    return run.halfway().continued().run(run.after)


def continued_without_effect(run, folder):
    """Go on with another value of a parameter that nothing reads; models of the gallery have none."""
    return run.halfway().continued(**without_effect(run)).run(run.after)


def continued_twice(run, folder):
    model = run.halfway().continued().run(run.after // 2)
    return model.continued().run(run.after - run.after // 2)


def without_effect(run) -> dict:
    return {"gain": 7.5} if "gain" in parameters_of(run.model_class) else {}


def recorded(run, folder):
    """Record a run, and return the number of its last step and the path."""
    path = folder / "run.arrow"
    model = run.begun()
    with model.record(path, checkpoint_every=1 + run.seed % 9, overwrite=True) as recorder:
        run.edited(model.run(run.before)).run(run.after)
        assert recorder.why_no_checkpoint == ""
    return path


def somewhere(run) -> int:
    """Return a step at random, at which the run is taken up again."""
    return int(np.random.default_rng([run.seed, 6]).integers(run.before + run.after + 1))


def resumed(run, folder):
    return taken_up(run, folder, somewhere(run))


def resumed_where_it_was_changed(run, folder):
    return taken_up(run, folder, run.before)


def resumed_without_effect(run, folder):
    return taken_up(run, folder, somewhere(run), **without_effect(run))


def resumed_and_continued(run, folder):
    return taken_up(run, folder, run.before).continued()


def taken_up(run, folder, step, **changes):
    """Resume a recording, which is verified as well, and repeat the changes by hand if these come later."""
    path = recorded(run, folder)
    verdict = run.model_class.verify(path)
    assert verdict.same, verdict
    model = run.model_class.resume(path, step=step, **changes)
    if step < run.before or (step == run.before and not Recording(path).interventions):
        model = run.edited(model.run(run.before - step)) if run.edits else model
    return model.run(run.before + run.after - model.completed)


WAYS = {
    way.__name__: way
    for way in (
        *(plain, deep_copied, pickled, copied_twice, in_two_threads, in_three_threads),
        *(continued, continued_without_effect, continued_twice),
        *(resumed, resumed_where_it_was_changed, resumed_without_effect, resumed_and_continued),
    )
}


def trace(run: Run, way: str, folder: Path) -> dict[str, object]:
    """Return what is compared, at the end of a run that went on in one of `WAYS`; also called in another process."""
    return traces_of(WAYS[way](run, folder))


# ---- changes by hand


def move_robot(model, rng):
    x_min, y_min, x_max, y_max = model.map.bounds
    model.robots[0].position = np.clip(rng.uniform(20, 500, 2), (x_min + 10, y_min + 10), (x_max - 10, y_max - 10))


def turn_robot(model, rng):
    model.robots[-1].heading += 1.0


def slow_robot(model, rng):
    model.robots[0].max_speed = 0.5 * model.robots[0].design.max_speed


def rename_group(model, rng):
    if model.control is None or not hasattr(model.control, "keys"):
        model.robots[0].group = "late"


def warm_robot(model, rng):
    model.robots[0].temperature = 3.0


def turn_tendency(model, rng):
    model.robots[0].tendency = "left" if model.robots[0].tendency == "right" else "right"


def remove_robot(model, rng):
    if len(model.robots) > 1:
        model.robots[0].remove()


def add_robot(model, rng):
    robot = model.robots[0]
    model.add_robots(robot.design, 1, group=robot.group)


def fail_robot(model, rng):
    model.robots[0].fail("stop")


def fail_sensor(model, rng):
    model.robots[-1].fail("sensor", index=0)


def add_obstacle(model, rng):
    place = rng.uniform(50, 500, 2)
    if is_large(model):
        model.add_obstacle(disc(place, 7))


def is_large(model):
    """Whether bodies may be added where the changes below have them; not to models with small maps of their own."""
    return model.map.width >= 600


def add_and_remove_body(model, rng):
    if is_large(model):
        model.add_body(disc((550, 40), 5), kind="visitor").remove()


def remove_obstacle(model, rng):
    fixed = [body for body in model.obstacles if body.mode == "fixed"]
    if fixed:
        fixed[-1].remove()


def add_body(model, rng):
    place = rng.uniform(50, 500, 2)
    if is_large(model):
        model.add_body(disc(place, 5), kind="late")


def move_body(model, rng):
    for body in model.bodies:
        if body.mode == "driven" and body.agent is None and body.carrier is None:
            body.position += (1.0, 0.5)


def move_load(model, rng):
    for load in model.loads:
        load.move_to((load.position[0] + 2.0, load.position[1], 0.3))


def harden_load(model, rng):
    for load in model.loads:
        load.resistance = 1.25


def add_fire(model, rng):
    place = rng.uniform(50, 500, 2)
    if is_large(model):
        model.add_fire(place, radius=8)


def put_out(model, rng):
    for fire in list(model.fires)[:1]:
        fire.put_out()


def cool_fire(model, rng):
    for fire in list(model.fires)[-1:]:
        if not fire.out:
            fire.temperature = 0.4


def remove_fire(model, rng):
    for fire in list(model.fires)[:1]:
        fire.remove()


def change_control(model, rng):
    if not hasattr(model.control, "keys"):
        model.control = Subsumption(Avoid(distance=11), Explore(turn_interval=20))


def drop_control(model, rng):
    model.control = None


def change_constants(model, rng):
    model.fire_constants = replace(model.fire_constants, k1=0.0007)


def change_radio(model, rng):
    if model.communication is None:
        model.communication = Radio(range=80)


def change_imperfections(model, rng):
    model.imperfections = ROBOTARIUM.at(0.3)


def change_intervals(model, rng):
    model.collect_every = 2


def change_attribute(model, rng):
    model.note, model.extinguish_range = [1, 2, {"a": None}], 12.5


def add_process(model, rng):
    model.add_process(Tide(0.3))


def remove_process(model, rng):
    for process in model.processes[-1:]:
        if isinstance(process, Tide):
            model.remove_process(process)


def declare_state(model, rng):
    model.state["by hand"] = [1.5, "x"]


def add_event(model, rng):
    model.event("by hand", robot=model.robots[0], value=2.5)


def add_agent(model, rng):
    mesa.Agent(model).energy = 5


def move_wolf(model, rng):
    for wolf in list(model.agents_by_type.get(Wolf, ())):
        wolf.position += (3.0, -2.0)
        wolf.meals += 10


def remove_wolf(model, rng):
    for wolf in list(model.agents_by_type.get(Wolf, ()))[:1]:
        wolf.remove()


def add_field(model, rng):
    if "late" not in model.fields:
        model.add_field(Field("late", cell=80.0)).deposit((100, 100), 3.0)


def deposit(model, rng):
    for field in model.fields.values():
        field.deposit((150, 150), 2.0)


def draw(model, rng):
    model.rng.random(3), model.random.random(), model.streams["mine"].random()
    model.note = ["drawn"]  # draws alone are not detected, see docs/limits.md


def add_reporter(model, rng):
    model.datacollector._new_model_reporter("late", "completed")
    model.datacollector.model_vars["late"] = [None] * len(model.datacollector.model_vars["collisions"])


EDITS = [
    *(move_robot, turn_robot, slow_robot, rename_group, warm_robot, turn_tendency, remove_robot, add_robot),
    *(fail_robot, fail_sensor, add_obstacle, add_and_remove_body, remove_obstacle, add_body, move_body, move_load),
    *(harden_load, add_fire, put_out, cool_fire, remove_fire, change_control, drop_control, change_constants),
    *(change_radio, change_imperfections, change_intervals, change_attribute, add_process, remove_process),
    *(declare_state, add_event, add_agent, move_wolf, remove_wolf, add_field, deposit, draw),
]


def differing(one: dict, other: dict) -> dict[str, tuple]:
    """Return what differs between two traces, shortened."""
    names = [name for name in one if one[name] != other[name]]
    return {name: (repr(one[name])[:300], repr(other[name])[:300]) for name in names}
