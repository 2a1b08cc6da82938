"""Rules, designs, maps and recordings of a user, written against version 0.1.0, by addresses that it had."""

import pickle
import tempfile
from pathlib import Path

import numpy as np

from mesa_swarm import (
    AGENT3,
    AGENT6,
    AGENT9,
    DifferentialDrive,
    HolonomicDrive,
    LineSensor,
    Map,
    ProximitySensor,
    RadiationSensor,
    Radio,
    Recording,
    RobotDesign,
    all_round,
    disc,
    laser_sensor,
    polygon,
    rectangle,
)
from mesa_swarm.control import PASS, Avoid, Cruise, Explore, Perimeter, Push, Subsumption, VectorSum, behaviour
from mesa_swarm.control.boids import Separate
from mesa_swarm.control.match_velocity import MatchVelocity
from mesa_swarm.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.exports import export
from mesa_swarm.learning import PolicyLayer, QLearning, load_policy, save_policy
from mesa_swarm.model import SwarmModel
from mesa_swarm.recording import record, resume, verify
from mesa_swarm.robots.imperfections import ROBOTARIUM
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.load import Load
from mesa_swarm.world.obstacle import Obstacle


@behaviour
def timid(me, distance=20.0):
    """Back away from whatever is ahead."""
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, -me.max_speed * 0.5
    return PASS


@behaviour
def wander(me, turn=0.2):
    if me.chance < turn:
        return me.max_speed, me.max_speed * 0.3
    return me.max_speed, me.max_speed


class Counter:
    """An observer that is derived from nothing."""

    def __init__(self) -> None:
        self.steps, self.closed = [], 0

    def after_step(self, model, step):
        self.steps.append(step)

    def close(self):
        self.closed += 1


class Broken(SwarmModel):
    def step(self):
        super().step()
        if self.steps == 3:
            raise ZeroDivisionError("by hand")


def rules() -> None:
    model = SwarmModel(map="original", rng=1, turn_angle_degrees=45.0)
    robots = model.add_robots(AGENT9, 12)
    model.add_robots(AGENT6, poses=[(60, 60, 0.5), (90, 60, 1.0)], tendency=["left", "right"])
    model.control = Subsumption(timid(distance=12), Avoid(distance=15), wander())
    model.sense()
    model.run(60)
    robots[0].position, robots[1].heading = (70, 70), 1.5
    model.step()
    print("rules", model.swarm.position.shape, model.total_collisions, model.state_hash())
    model.watch()
    words = str(model.run(1).explain(model.robots[3]))
    print("explain", words.startswith("step 62: robot "), len(model.watched))
    robots[2].remove()
    try:
        robots[2].heading = 1.0
    except RemovedRobotError:
        print("removed", len(model.agents_by_type[Robot]))
    copied = pickle.loads(pickle.dumps(model))
    print("copied", copied.run(5).state_hash() == model.run(5).state_hash())


def worlds() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "yard.toml"
        path.write_text(Map.load("sparse").to_toml())
        again = Map.load(path)
        print("map", again.name, again.bounds, len(again.obstacles), len(again.fires))
    yard = SwarmModel(map=again, rng=2, communication=Radio(range=80), collect_every=10)
    yard.add_obstacle(polygon([(100, 100), (130, 100), (115, 130)]))
    mark = yard.add_obstacle(rectangle((20, 20), (40, 60), contact=False))
    load = yard.add_load(disc((300, 300), 15), resistance=1.5)
    print("bodies", isinstance(load, Load), isinstance(mark, Obstacle), load.position.tolist(), mark.contact)
    design = RobotDesign(
        name="mine",
        radius=4,
        max_speed=1.5,
        sensors=(ProximitySensor(range=30, error_probability=0.1, error_magnitude=0.2), laser_sensor(), LineSensor()),
        slip_probability=0.2,
        slip_magnitude=0.5,
        drive=DifferentialDrive(),
    )
    yard.add_robots(design, 5)
    yard.add_robots(RobotDesign(name="hot", sensors=(*AGENT3.sensors, RadiationSensor())), 2)
    yard.imperfections = ROBOTARIUM.at(0.5)
    yard.control = Subsumption(Push(), Avoid(), Explore())
    print("yard", yard.run(80).state_hash(), len(yard.datacollector.model_vars["collisions"]))

    flock = SwarmModel(map="openspace", rng=5)
    flock.add_robots(all_round(8, range=60, drive=HolonomicDrive()), 6)
    flock.control = VectorSum(Separate(), Cruise(), weights=(2, 1))
    print("flock", flock.run(40).state_hash())
    edge = SwarmModel(map="openspace", rng=6)
    edge.add_robots(AGENT9, 6)
    edge.control = {"both": Subsumption(MatchVelocity(), Explore()), "edge": Subsumption(Perimeter(), Explore())}[
        "edge"
    ]
    print("edge", edge.run(40).state_hash())


def observers() -> None:
    counter, model = Counter(), Broken(rng=1)
    model.observers.append(counter)
    try:
        model.run(10)
    except ZeroDivisionError:
        print("observed", counter.steps, counter.closed, counter in model.observers)
    model.observers.remove(counter)
    print("forgotten", list(model.observers), model.run(2).steps)


def recordings() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.arrow"
        model = SwarmModel(map="openspace_fire", rng=9)
        model.add_robots(AGENT9, 5)
        model.control = Subsumption(Avoid(distance=15), MatchVelocity(), Explore())
        with record(model, path, every=5, checkpoint_every=20) as recorder:
            model.run(50)
        recording = Recording(path)
        print("recorded", len(recorder), recording.steps.tolist()[-2:], recording.at(30).step)
        print("verified", bool(verify(recording, SwarmModel)), bool(SwarmModel.verify(path)))
        on = resume(SwarmModel, path, step=40)
        print("resumed", on.steps, on.run(10).state_hash() == model.state_hash(), model.state_hash())
        table = Path(folder) / "run.csv"
        export(recording, table)
        print("exported", len(table.read_text().splitlines()) > 10)

        learner = SwarmModel(map="sparse", rng=4)
        learner.add_robots(AGENT9, 3)
        learning = QLearning(reward="b", actions=4, beta=5e-3)
        learner.control = Subsumption(learning)
        learner.run(120)
        save_policy(learner.control.layers[0].policy(), Path(folder) / "q.npz")
        taught = SwarmModel(map="sparse", rng=8)
        taught.add_robots(AGENT9, 3)
        taught.control = Subsumption(PolicyLayer(policy=load_policy(Path(folder) / "q.npz")))
        print("learned", learner.state_hash(), taught.run(30).state_hash())
    try:
        SwarmModel(map="orginal")
    except (InvalidValueError, ValueError) as error:
        print("refused", "original" in str(error), np.isfinite(AGENT9.radius))


if __name__ == "__main__":
    rules()
    worlds()
    observers()
    recordings()
