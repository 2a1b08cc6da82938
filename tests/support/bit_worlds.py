"""Twenty worlds that together have all that a world can have, for `same_bits`; each function returns a new model.

All of it uses public names only, so that it runs with the code of other versions as well.
"""

import math
from dataclasses import replace

import mesa
import numpy as np

from mesa_swarm import (
    AGENT3,
    AGENT9,
    AGENT_FIRE,
    Carried,
    DifferentialDrive,
    DirectedSlip,
    Emitter,
    Field,
    FieldSensor,
    Gripper,
    HolonomicDrive,
    Lamp,
    LineSensor,
    Map,
    NeighbourSensor,
    OmniDrive,
    Radio,
    RobotDesign,
    all_round,
    disc,
    polygon,
    rectangle,
    scatter,
)
from mesa_swarm.control import (
    Avoid,
    Chance,
    Explore,
    Follow,
    Gather,
    Halt,
    OnMark,
    Seen,
    StateMachine,
    Subsumption,
    Transition,
    VectorSum,
)
from mesa_swarm.fire import FightFire, Spreading
from mesa_swarm.learning import QLearning, TableQLearning
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from support.bit_parts import (
    Bell,
    Compass,
    Drift,
    Kite,
    Ledger,
    Planned,
    Spray,
    Tide,
    Weary,
    Wolf,
    flees,
    floats,
    grips,
    ploughs,
    rams,
    remembers,
    smells,
    steers,
    talks,
    whirls,
)

STEPS = 1000
# The steps after which columns are compared, where it is not `STEPS`.
STEPS_OF = {"one_drawn_by_the_slow_engine": 200, "a_crowd_of_two_thousand": 300}
BLIND = RobotDesign(name="blind", radius=5.0)


def room(width, height, *obstacles):
    return Map(name="room", bounds=(0.0, 0.0, width, height), obstacles=obstacles)


def machine():
    """Return a state machine of three states with three kinds of conditions."""
    moves = [
        Transition(source="go", target="wait", condition=Chance(probability=0.02)),
        Transition(source="wait", target="go", condition=Chance(probability=0.05)),
        Transition(source="go", target="gather", condition=Seen(kind="robot", within=40)),
        Transition(source="gather", target="go", condition=Chance(probability=0.03)),
    ]
    states = {"go": (Avoid(distance=15), Explore()), "wait": (Halt(),), "gather": (Avoid(), Gather(), Explore())}
    return StateMachine(states, moves)


# ---- fires


def fires_by_strategy_a():
    return FireFighting(n_robots=10, strategy="A", rng=11)


def fires_by_strategy_b_with_errors():
    return FireFighting(n_robots=10, strategy="B", noise=0.2, slip=0.1, imperfections=0.3, rng=12)


# ---- rules and arbiters


def own_rules():
    model = Planned(map="original", rng=13)
    model.add_robots(AGENT9, 10)
    model.control = Subsumption(Avoid(distance=12), Weary(20.0), remembers(every=9), Explore(turn_interval=50))
    return model


def a_team_of_three_arbiters():
    model = Planned(rng=14)
    model.add_robots(AGENT9, 4, group="scouts")
    model.add_robots(AGENT9, 4)
    model.add_robots(AGENT3, 4)
    weights = VectorSum(Avoid(), Explore(), weights=(2, 1))
    model.control = {"scouts": machine(), AGENT9: Subsumption(Avoid(), remembers, Explore()), AGENT3: weights}
    model.plan[400] = (change_group,)
    return model


def change_group(model):
    model.robots[5].group = "scouts"
    model.robots[0].tendency = "left"


def learners():
    model = Planned(map="sparse", rng=15)
    model.add_robots(AGENT9, 3, group="networks")
    model.add_robots(AGENT9, 5)
    model.control = {"networks": Subsumption(QLearning()), AGENT9: Subsumption(Avoid(distance=3), TableQLearning())}
    return model


# ---- loads


def discs_pushed_along_walls():
    walls = rectangle((90, 0), (96, 60)), polygon([(150, 100), (180, 110), (160, 140)])
    model = Planned(map=room(220.0, 150.0, *walls), rng=16)
    for k in range(5):
        model.add_load(disc((30.0 + 36.0 * k, 80.0), 6.0 + k), resistance=0.1 + 0.2 * k)
    model.add_robots(all_round(12, range=60.0), 10)
    model.control = Subsumption(ploughs(aside=0.8), rams)
    return model


def polygons_pushed_against_each_other():
    model = Planned(map=room(200.0, 160.0, disc((100.0, 80.0), 8.0)), rng=17)
    model.add_load(rectangle((20, 40), (50, 60)), resistance=0.3)
    model.add_load(rectangle((54, 40), (64, 80)), resistance=0.2)
    model.add_load(polygon([(120, 30), (150, 35), (135, 60)]), resistance=0.4)
    model.add_load(polygon([(60, 110), (90, 110), (90, 120), (70, 120), (70, 135), (60, 135)]), resistance=0.9)
    model.add_load(disc((150.0, 120.0), 9.0), resistance=0.1)
    model.add_robots(all_round(12, range=60.0), 10)
    model.control = Subsumption(ploughs(aside=0.8), rams)
    return model


def loads_between_doors():
    walls = rectangle((70, 0), (75, 50)), rectangle((70, 100), (75, 150))
    model = Planned(map=room(170.0, 150.0, *walls), rng=18)
    model.add_load(rectangle((30, 60), (44, 90)), resistance=0.5)
    model.add_load(disc((100.0, 75.0), 10.0), resistance=0.6)
    model.add_load(rectangle((110, 20), (140, 26)), resistance=0.3)
    model.add_body(rectangle((70, 51), (75, 61)), kind="door")
    model.add_body(rectangle((140, 100), (144, 130)), kind="door")
    model.add_robots(BLIND, 4)
    model.add_robots(all_round(12, range=60.0), 5, group="ploughs")
    model.control = {BLIND: Subsumption(rams(often=0.03)), "ploughs": Subsumption(ploughs(aside=0.8), rams)}
    model.each = (swing_doors,)
    model.plan[500] = (shift_loads,)
    return model


def swing_doors(model):
    """Let the first door slide, and the second turn about its centre."""
    now = model.completed
    first, second = model.movers.agents[:2]
    first.position = (72.5, 75.0 - 18.0 * math.cos(0.02 * now))
    second.heading = 0.6 * math.sin(0.03 * now)


def shift_loads(model):
    load = model.loads[2]
    load.resistance = 0.15
    model.loads[0].resistance = 0.25


# ---- driven bodies


def doors_and_bodies_that_wander():
    model = Planned(map=room(260.0, 200.0), rng=19)
    for y in (40.0, 120.0):
        model.add_body(rectangle((80, y), (86, y + 40)), kind="door")
    scatter(model, 6, size=12.0, gap=6.0, speed=0.4)
    scatter(model, 3, size=10.0, gap=6.0)
    model.add_robots(AGENT9, 12)
    model.control = Subsumption(Avoid(distance=10), Explore(turn_interval=80))
    model.each = (move_doors,)
    return model


def move_doors(model):
    turn = math.sin(0.01 * model.completed)
    for k, door in enumerate(model.movers.agents[:2]):
        door.move_to((83.0 + 20.0 * turn, 60.0 + 80.0 * k, turn))


def bodies_that_follow_agents():
    model = Planned(rng=20)
    for place in ((120.0, 150.0), (500.0, 400.0)):
        model.add_body(disc(place, 6.0), kind="wolf", agent=Wolf(model, place))
    model.add_body(rectangle((290, 290), (310, 300)), kind="kite", agent=Kite(model, (300.0, 295.0)))
    mesa.Agent(model).visits = 0
    eyes = NeighbourSensor(range=120, k=2), NeighbourSensor(range=100, k=1, kind="wolf", occluded=True)
    model.add_robots(replace(AGENT9, name="watcher", sensors=(*AGENT9.sensors, *eyes)), 10)
    model.control = Subsumption(Avoid(), flees, Explore())
    model.each = (let_agents_step,)
    model.plan = {step: (bear_a_cub,) for step in range(100, 1000, 150)} | {620: (lose_a_wolf,)}
    return model


def let_agents_step(model):
    for kind in (Wolf, Kite):
        for agent in list(model.agents_by_type.get(kind, ())):
            agent.step()


def bear_a_cub(model):
    place = (250.0 + 0.1 * model.completed, 500.0)
    model.add_body(disc(place, 4.0), kind="wolf", agent=Wolf(model, place))


def lose_a_wolf(model):
    list(model.agents_by_type[Wolf])[1].remove()


def carriers_of_pucks():
    model = Planned(map=room(200.0, 200.0, rectangle((95, 60), (100, 140))), rng=21)
    for k in range(16):
        model.add_body(disc((25.0 + 50.0 * (k % 4), 30.0 + 45.0 * (k // 4)), 3.0), kind="puck")
    gripper = Gripper(kinds=("puck",), reach=6.0, field_of_view_degrees=120)
    sensors = (*all_round(8, range=40.0).sensors, Carried())
    model.add_robots(RobotDesign(name="carrier", sensors=sensors, actuators=(gripper,)), 8)
    model.control = Subsumption(grips, Avoid(distance=6), Explore(turn_interval=60))
    model.plan[300] = (lambda model: model.robots[0].remove(),)
    return model


# ---- fields, radio, errors


def trails_and_walls():
    walls = rectangle((100, 40), (110, 160)), disc((200.0, 80.0), 20.0)
    model = Planned(map=room(300.0, 200.0, *walls), rng=22)
    model.add_field(Field("trail", cell=10.0, diffusion=2.0, evaporation=0.01))
    model.add_field(Field("rain", cell=15.0, diffusion=4.0, walls=False))
    noses = [FieldSensor(field="trail", name=f"{side}_nose", mount=(6, y)) for side, y in (("left", 4), ("right", -4))]
    actuators = (Emitter(field="trail", mount=(-5.0, 0.0), rate=0.7),)
    model.add_robots(RobotDesign(name="ant", sensors=(*AGENT3.sensors, *noses), actuators=actuators), 10)
    model.control = Subsumption(Avoid(), smells, Explore())
    model.each = (let_it_rain,)
    model.plan = {300: (block_trail,), 700: (free_trail,)}
    return model


def let_it_rain(model):
    model.fields["rain"].deposit(tuple(model.rng.uniform(10, 190, 2)), 0.5)


def block_trail(model):
    model.add_obstacle(rectangle((240, 20), (250, 180)))


def free_trail(model):
    model.obstacles[-1].remove()


def talkers_by_radio():
    model = Planned(map="sparse", rng=23)
    message = {"value": 1, "pair": 2}
    model.communication = Radio(
        range=150, occlusion=True, message=message, most=3, loss_probability=0.2, beacons=((100.0, 100.0), (500, 300))
    )
    sensors = (*AGENT9.sensors, NeighbourSensor(range=120, k=2, lamp=True))
    model.add_robots(replace(AGENT9, name="talker", sensors=sensors, actuators=(Lamp(),)), 12)
    model.control = Subsumption(Avoid(), talks, Follow(), Explore())
    return model


def imperfect_robots():
    model = Planned(map="sparse", rng=24)
    model.add_robots(replace(AGENT9, name="charged", battery=600.0), 5)
    model.add_robots(AGENT9.with_proximity(error_probability=0.2, error_magnitude=0.4, hold=3, period=2), 5)
    model.imperfections = Imperfections(
        sensing=Imperfection(error=0.05, dropout=0.03, outliers=0.02, hold=2, period=3),
        driving=Imperfection(error=0.05, dropout=0.02, outliers=0.01, hold=2, lag=2.0),
        battery=900.0,
        failure=2e-4,
        sensor_failure=2e-4,
        wheel_failure=1e-4,
        slip_probability=0.05,
        slip_magnitude=0.4,
    )
    model.control = Subsumption(Avoid(), Explore())
    model.plan = {50: (break_robots,), 500: (mend_robots,)}
    return model


def break_robots(model):
    model.robots[1].fail("stop")
    model.robots[2].fail("wheel", index=1, how="free")
    model.robots[3].fail("sensor", index=0)
    model.robots[6].fail("wheel", index=0)


def mend_robots(model):
    model.robots[1].repair()
    model.robots[2].repair()


def drives_at_the_measured_dial():
    model = Planned(map=room(250.0, 200.0), imperfections=1.0, noise=0.1, slip=0.1, rng=25)
    eyes = AGENT9.sensors
    slow = DifferentialDrive(acceleration=0.05)
    lossy = DirectedSlip(forward=0.1, backward=0.3, sideways=0.2, turn=0.2)
    designs = {
        RobotDesign(name="omni", drive=OmniDrive(acceleration=0.2), sensors=eyes, directed_slip=lossy): whirls,
        RobotDesign(name="float", drive=HolonomicDrive(acceleration=0.1), radius=4.0, sensors=eyes): floats,
        RobotDesign(name="slow", drive=slow, sensors=eyes, max_speed=1.5): rams,
        AGENT9.with_slip(probability=0.1, magnitude=0.3): rams(often=0.05),
    }
    for design in designs:
        model.add_robots(design, 4)
    model.control = {design: Subsumption(rule) for design, rule in designs.items()}
    return model


# ---- custom parts, changes, events


def own_sensors_and_actuators():
    marks = rectangle((50, 0), (60, 200), contact=False), disc((150.0, 100.0), 25.0, contact=False)
    model = Planned(map=room(220.0, 200.0, *marks), rng=26)
    model.state.update(sprayed=np.zeros(2), rung=np.zeros(11))
    sensors = (*AGENT9.sensors, LineSensor(mount=(4.0, 0.0)), LineSensor(mount=(-4.0, 1.0)), Compass(), Drift())
    design = replace(AGENT9, name="painter", sensors=sensors, actuators=(Spray(), Bell()))
    model.add_robots(design, 8)
    on_lines = StateMachine(
        {"go": (Avoid(), steers, Explore()), "rest": Halt()},
        [
            Transition(source="go", target="rest", condition=OnMark()),
            Transition(source="rest", target="go", condition=Chance(probability=0.1)),
        ],
    )
    model.add_robots(replace(design, name="rester"), 3, group="resters")
    model.control = {"resters": on_lines, design: Subsumption(Avoid(), steers, Explore())}
    return model


def all_that_comes_and_goes():
    """Return a world whose robots are at first on top of each other, and in which much is added and removed."""
    model = Planned(map=room(300.0, 250.0), rng=27, collect_every=3, history_every=4)
    model.add_fire((60, 60), radius=12)
    model.add_load(disc((200.0, 120.0), 8.0), resistance=0.5)
    model.add_robots(AGENT_FIRE, poses=[(100 + 2 * (k % 4), 100 + 3 * (k // 4), 0.7 * k) for k in range(16)])
    model.control = Subsumption(FightFire(strategy="A"), Avoid(), Explore())
    model.plan = {
        100: (remove_robots, add_a_fire),
        200: (add_bodies, add_robots),
        350: (move_by_hand,),
        500: (remove_fire, remove_bodies),
        650: (add_robots, change_control),
        800: (remove_robots, add_a_fire),
    }
    return model


def remove_robots(model):
    for robot in [model.robots[0], model.robots[-1], model.robots[3]]:
        robot.remove()


def add_robots(model):
    here = float(model.completed) / 4.0
    model.add_robots(AGENT9, poses=[(40.0 + here / 10.0, 200.0, 0.1), (42.0 + here / 10.0, 203.0, 2.0)])
    model.add_robots(AGENT_FIRE, 2, tendency="left")


def add_a_fire(model):
    model.add_fire((250, 50 + 0.1 * model.completed), radius=10, temperature=0.6)


def remove_fire(model):
    model.fires[0].put_out()
    model.fires[1].remove()


def add_bodies(model):
    model.add_obstacle(disc((150.0, 210.0), 9.0))
    model.add_body(disc((30.0, 150.0), 5.0), kind="visitor")
    model.add_load(rectangle((220, 180), (240, 200)), resistance=0.4)


def remove_bodies(model):
    model.obstacles[-1].remove()
    model.movers.agents[0].remove()
    model.loads[0].remove()


def move_by_hand(model):
    model.robots[2].position = (150.0, 30.0)
    model.robots[3].heading = 1.5
    model.robots[4].max_speed = 0.5
    model.robots[5].temperature = 3.0
    model.loads[0].move_to((205.0, 118.0, 0.3))


def change_control(model):
    model.control = Subsumption(FightFire(strategy="B"), Avoid(distance=11), Explore(turn_interval=20))


def events_states_and_processes():
    model = Planned(map="openspace_fire", rng=28)
    model.state.update(delivered=0, history=np.zeros(3), last=[0.0, "none"])
    model.add_process(Spreading(rate=0.002))
    model.add_process(Tide())
    model.add_process(Ledger())
    model.add_robots(AGENT_FIRE, 10)
    model.control = Subsumption(FightFire(strategy="B"), Avoid(), Explore())
    model.each = (count,)
    return model


def count(model):
    """Change what is declared, and report it now and then."""
    model.state["delivered"] += int(model.collisions) + 1
    model.state["history"][model.completed % 3] += model.streams["mine"].random()
    model.state["last"] = [float(model.swarm.position[0, 0]), str(model.completed)]
    if model.completed % 7 == 0:
        model.event("delivered", robot=model.robots[model.completed % 10], value=model.state["delivered"])


# ---- the other engine, and many robots


def one_drawn_by_the_slow_engine():
    wall = polygon([(70, 40), (90, 45), (75, 80)])
    model = Planned(map=room(150.0, 120.0, wall), engine="shapely", rng=29)
    model.add_load(rectangle((100, 80), (120, 95)), resistance=0.3)
    model.add_fire((30, 90), radius=8)
    model.add_body(rectangle((110, 20), (114, 50)), kind="door")
    model.add_robots(AGENT9, poses=[(93.0, 88.0, 0.0), (105.0, 73.0, 1.6), (104.0, 72.0, 1.4)])
    model.add_robots(AGENT_FIRE, 2)
    model.control = Subsumption(rams(often=0.01))
    model.each = (swing_one_door,)
    return model


def swing_one_door(model):
    model.movers.agents[0].heading = 0.8 * math.sin(0.05 * model.completed)


def a_crowd_of_two_thousand():
    model = Planned(map=room(1000.0, 800.0, disc((300.0, 300.0), 40.0), rectangle((600, 200), (640, 600))), rng=30)
    model.collect_every = 50
    model.add_robots(AGENT3, 2000)
    model.control = Subsumption(Avoid(distance=8), Explore(turn_interval=100))
    return model


WORLDS = {
    build.__name__: build
    for build in (
        *(fires_by_strategy_a, fires_by_strategy_b_with_errors, own_rules, a_team_of_three_arbiters, learners),
        *(discs_pushed_along_walls, polygons_pushed_against_each_other, loads_between_doors),
        *(doors_and_bodies_that_wander, bodies_that_follow_agents, carriers_of_pucks, trails_and_walls),
        *(talkers_by_radio, imperfect_robots, drives_at_the_measured_dial, own_sensors_and_actuators),
        *(all_that_comes_and_goes, events_states_and_processes),
        *(one_drawn_by_the_slow_engine, a_crowd_of_two_thousand),
    )
}
