"""What steps are worth, when tasks are done, and who drives whom."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, SwarmModel, disc
from mesa_swarm.analysis import coverage
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.environments import CollisionAvoidance, ExtinguishFires, FindFires, VectorSwarmEnv
from mesa_swarm.environments.scores import cells_in_reach
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.fire import FireConstants
from mesa_swarm.learning import reward
from mesa_swarm.maps.map import FireSpot
from support.task_worlds import rewarded, world_of

# One fire of area 4 in the middle of a hall.
HALL = Map(name="hall", bounds=(0, 0, 300, 200), fires=[FireSpot(position=(150, 100), radius=20)])
QUENCHED = FireConstants(k1=1e-9, k2=1.001, k3=0.0, k4=0.0, leave=10.0, join=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("reward_of", ["state", "next state"])
@pytest.mark.parametrize("kind", ["a", "b", "c"])
@pytest.mark.parametrize("gap", [2.0, 15.0, 24.0, 45.0])
@pytest.mark.parametrize("wheels", [(1.0, 1.0), (0.5, -1.0), (0.0, 1.0)])
def test_driving_may_be_worth_what_the_thesis_pays_for_the_nearest_reading_before_or_after(
    kind, gap, wheels, reward_of
):
    design = replace(AGENT9, max_speed=2.0)
    task = CollisionAvoidance(map="openspace", design=design, reward=kind, critical=0.5, reward_of=reward_of)
    world = world_of(task, [(780 - 5 - gap, 300, 0.0)])
    world.sense()
    nearest = {"state": nearest_of(world)}
    paid = np.empty(1)
    world.advance(np.array([wheels]), paid)
    nearest["next state"] = nearest_of(world)
    assert paid[0] == pytest.approx(reward(kind, nearest[reward_of], *wheels, 0.5))


def nearest_of(world):
    seen = world.swarm.distance[0] / 50
    return seen[seen >= 0].min(initial=1.0)


def test_driving_is_worth_the_forward_speed_and_a_collision_costs():
    task = CollisionAvoidance(map="openspace", design=replace(AGENT9, max_speed=2.0), collision_cost=3.0)
    world = world_of(task, [(100, 100, 0.0), (200, 100, 0.0), (300, 100, 0.0), (400, 100, 0.0), (409, 109, 0.0)])
    assert rewarded(world, [(1, 1), (1, -1), (0, 0.5), (0, 0), (-1, -1)]) == [1.0, 0.0, 0.25, 0.0, -1.0]
    assert rewarded(world_of(task, [(400, 100, 0.0), (411, 100, np.pi)]), [(1, 1), (0, 0)]) == [1 - 3, -3]
    assert not world.finished


def test_finding_is_worth_something_once_for_each_robot_and_fire():
    task = FindFires(map=HALL, arrival=7.0, step_cost=0.5)
    # Within 10 of the edge: the centre within 10 + 20 + 5 of the fire's.
    world = world_of(task, [(150 - 35.5, 100, 0.0), (40, 40, 0.0)])
    still, at_fire = (0, 0), (1, 1)
    assert rewarded(world, [still, still]) == [-0.5, -0.5]
    assert not world.finished
    assert rewarded(world, [at_fire, still]) == [6.5, -0.5]
    assert world.finished
    assert rewarded(world, [(-1, -1), still]) == [-0.5, -0.5]
    assert rewarded(world, [at_fire, still]) == [-0.5, -0.5]


def test_what_is_searched_for_stays_as_it_is():
    world = world_of(FindFires(map=HALL), [(150 - 30, 100, 0.0)])
    for _ in range(200):
        rewarded(world, [(0, 0)])
    assert world.fires.temperature.tolist() == [1.0]
    assert world.swarm.temperature.tolist() == [0.0]


def test_putting_out_is_worth_something_to_those_that_fought_the_fire():
    task = ExtinguishFires(map=HALL, fire_constants=QUENCHED, put_out=5.0, work=0.25, step_cost=0.0)
    world = world_of(task, [(150 - 30, 100, 0.0), (150 + 30, 100, 0.0), (40, 40, 0.0)])
    still = [(0, 0)] * 3
    # Two robots take k2 n / A, a little more than 1/2, a step.
    assert rewarded(world, still) == [0.25, 0.25, 0.0]
    assert not world.finished
    assert rewarded(world, still) == [5.0, 5.0, 0.0]
    assert world.finished
    assert rewarded(world, still) == [0.0, 0.0, 0.0]


def test_a_fire_goes_out_as_in_the_model_that_has_no_learner():
    task = ExtinguishFires(map=HALL)
    poses = [(120, 100, 0.0), (180, 100, 0.0)]
    world, model = world_of(task, poses), SwarmModel(map=HALL, rng=1)
    model.add_robots(task.design, poses=poses)
    for _ in range(50):
        rewarded(world, [(0, 0)] * 2)
        model.step()
    assert np.array_equal(world.fires.temperature, model.fires.temperature)
    assert np.array_equal(world.swarm.temperature, model.swarm.temperature)


def test_rules_drive_the_robots_that_are_not_commanded_as_they_would_without_a_learner():
    poses = [(100, 100, 0.0), (500, 300, 2.0), (600, 500, 1.0)]
    task = CollisionAvoidance(map="openspace")
    world, model = world_of(task, poses, commanded=1), SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=poses[1:], tendency=["left" if t > 0 else "right" for t in world.swarm.tendency[1:]])
    model.control = Subsumption(Avoid(), Explore())
    for _ in range(200):
        rewarded(world, [(0, 0)])
        model.step()
    assert np.array_equal(world.swarm.position[1:], model.swarm.position)
    assert world.swarm.position[0].tolist() == [100, 100]


def test_robots_that_are_not_commanded_put_fires_out_but_are_not_judged():
    task = ExtinguishFires(map=HALL, fire_constants=QUENCHED)
    world = world_of(task, [(40, 40, 0.0), (120, 100, 0.0), (180, 100, 0.0)], commanded=1)
    assert [rewarded(world, [(0, 0)]) for _ in range(2)] == [[-0.01], [-0.01]]
    assert world.finished


def test_a_fire_that_others_found_is_not_found():
    world = world_of(FindFires(map=HALL), [(40, 40, 0.0), (120, 100, 0.0)], commanded=1)
    rewarded(world, [(0, 0)])
    assert world.swarm.fire.tolist() == [-1, 0]
    assert not world.finished


def test_a_learner_can_be_asked_why():
    world = world_of(CollisionAvoidance(map="openspace"), [(100, 100, 0.0)])
    world.watch()
    rewarded(world, [(1, 1)])
    assert "commanded from outside" in str(world.explain(world.robots[0]))


def test_millions_of_steps_take_no_memory():
    world = world_of(FindFires(map=HALL), [(40, 40, 0.0)])
    rewarded(world, [(0, 0)])
    assert not any(world.datacollector.model_vars.values())
    assert len(world.fires.history.steps) == 0


def test_a_policy_that_is_a_rule_does_what_the_rule_does_as_a_layer():
    """Drive straight, and turn on the spot before anything nearer than 15 ahead: from observations, and as a layer."""
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=1, map="original", max_steps=400), n_worlds=1)
    seen = env.reset(seed=3)
    world = env.worlds[0]
    model = SwarmModel(map="original", rng=1)
    side = "left" if world.swarm.tendency[0] > 0 else "right"
    model.add_robots(AGENT9, poses=[(*world.swarm.position[0], world.swarm.heading[0])], tendency=side)
    model.control = Subsumption(Avoid(distance=15, turn="stationary"), Explore())
    for _ in range(300):
        near = seen[0, 0, :3] < 15 / 50
        wheels = (1, 1)
        if near[0]:
            wheels = (-1, 1) if side == "left" else (1, -1)
        if near[1]:
            wheels = (1, -1)
        if near[2]:
            wheels = (-1, 1)
        seen = env.step(np.array([[wheels]]))[0]
        model.step()
    assert np.allclose(world.swarm.position, model.swarm.position, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FindFires(map="original"), "map original has no fires; choose one with fires"),
        (lambda: FindFires(arrival=-1), "arrival is -1; expected a finite number at least 0"),
        (lambda: CollisionAvoidance(collision_cost=float("nan")), "collision_cost is nan"),
        (lambda: ExtinguishFires(fire_constants=3), "fire_constants is 3; expected a FireConstants"),
        (lambda: CollisionAvoidance(critical=0), "critical is 0; expected"),
        (lambda: CollisionAvoidance(max_steps=0), "max_steps is 0; expected a whole number at least 1"),
        (lambda: CollisionAvoidance(design="AGENT9"), "design is 'AGENT9'; expected a RobotDesign"),
        (lambda: VectorSwarmEnv("find_fires", n_worlds=1), "task is 'find_fires'; expected a task such as"),
        (lambda: VectorSwarmEnv(CollisionAvoidance(n_robots=3), n_worlds=1, commanded=4), "commanded is 4; expected"),
    ],
)
def test_wrong_tasks_are_refused_by_name(make, message):
    with pytest.raises(InvalidValueError, match=f"^{message}"):
        make()


def test_an_unknown_state_of_which_the_reward_would_be_is_named():
    with pytest.raises(UnknownNameError, match=r"^unknown reward_of 'action'"):
        CollisionAvoidance(reward_of="action")


def test_a_parameter_that_a_task_does_not_have_is_named():
    with pytest.raises(UnknownNameError, match=r"^unknown parameter of FindFires 'n_robot'; did you mean 'n_robots'\?"):
        FindFires.of({"n_robot": 3})


def test_obstacles_may_be_added_to_a_world():
    world = world_of(CollisionAvoidance(map="openspace"), [(100, 100, 0.0)])
    world.add_obstacle(disc((115, 100), 5))
    assert rewarded(world, [(0, 0)]) == [0.0]
    out = np.empty((1, 9))
    world.observe(out)
    assert out[0, 0] == pytest.approx(5 / 50)


BLANK = Map(name="blank", bounds=(0, 0, 400, 400))


def test_collisions_speed_and_coverage_are_measured_of_the_steps_so_far():
    world = world_of(CollisionAvoidance(map=BLANK), [(395, 205, 0.0), (105, 105, 0.0)])
    for wheels in [((1, 1), (1, 1))] * 50 + [((0, 0), (1, -1))] * 50:
        rewarded(world, wheels)
    assert world.measures() == {
        "steps": 100.0,
        "collisions": 250.0,
        "worst robot": 500.0,
        "speed ahead": 0.5,
        "coverage": 7 / 1600,  # x from 106 to 155 in cells of 10, and the cell at the wall
    }


def test_an_episode_without_steps_has_no_means_and_has_covered_nothing():
    measured = TaskWorld(task=CollisionAvoidance(map=BLANK, n_robots=2), rng=1).measures()
    assert [measured.pop(name) for name in ("steps", "coverage")] == [0.0, 0.0]
    assert all(np.isnan(value) for value in measured.values())


def test_measures_are_those_of_numpy_on_the_positions_and_collisions_of_each_step():
    rules = Subsumption(Avoid(), Explore(turn_interval=20))
    world = TaskWorld(task=CollisionAvoidance(n_robots=4, map="original"), control=rules, rng=3)
    reach = cells_in_reach(world, world.swarm.position)
    positions, collided, ahead, reward = [], [], [], np.empty(4)
    for _ in range(300):
        world.advance(None, reward)
        positions.append(world.swarm.position.copy())
        collided.append(world.swarm.collided.copy())
        ahead.append(world.swarm.command.mean(axis=1) / world.swarm.max_speed)
    measured = world.measures()
    assert measured["coverage"] == coverage(np.array(positions), reach, world.map.bounds)
    assert measured["collisions"] == pytest.approx(1000 * np.mean(collided))
    assert measured["worst robot"] == pytest.approx(1000 * np.mean(collided, axis=0).max())
    assert measured["speed ahead"] == pytest.approx(np.mean(ahead))


@pytest.mark.parametrize("commanded", [None, 0])
def test_a_world_that_rules_drive_is_the_model_without_a_learner_rewarded_and_measured(commanded):
    task = CollisionAvoidance(n_robots=3, map="openspace", max_steps=50)
    control = Subsumption(Avoid(), Explore()) if commanded is None else None
    world = TaskWorld(task=task, commanded=commanded, control=control, rng=5)
    model = SwarmModel(map="openspace", rng=5)
    model.add_robots(AGENT9, 3)
    model.control = Subsumption(Avoid(), Explore())
    measured = world.play()
    model.run(50)
    assert np.array_equal(world.swarm.position, model.swarm.position)
    assert (world.commanded, world.rewarded, measured["steps"]) == (0, 3, 50.0)
    assert measured["reward"] == pytest.approx(measured["speed ahead"] - 2 * measured["collisions"] / 1000)


def test_a_function_of_observations_is_measured_as_when_a_learner_steps_it():
    task = CollisionAvoidance(n_robots=3, map="openspace", max_steps=30, actions=4)
    played = TaskWorld(task=task, rng=5).play(lambda seen: np.full(len(seen), 3))
    world, reward = TaskWorld(task=task, rng=5), np.empty(3)
    for _ in range(30):
        world.advance(np.ones((3, 2)), reward)
    assert {**world.measures(), "reward": reward.mean()} == {**played, "reward": pytest.approx(reward.mean())}


def test_a_share_of_the_fires_is_found_and_the_steps_until_all_were_are_counted_once():
    two = Map(name="two", bounds=(0, 0, 400, 200), fires=[FireSpot(position=(x, 100), radius=20) for x in (100, 300)])
    world = world_of(FindFires(map=two), [(100, 132, 0.0), (345, 100, np.pi)])
    rewarded(world, [(0, 0), (0, 0)])
    first = world.measures()
    assert first["fires found"] == 0.5
    assert np.isnan(first["steps until all found"])
    for _ in range(30):
        rewarded(world, [(0, 0), (1, 1)])
    last = world.measures()
    assert (last["fires found"], last["steps until all found"]) == (1.0, 11.0)


def test_fires_that_are_out_are_measured_and_whether_the_largest_is_among_them():
    spots = [FireSpot(position=(100, 100), radius=20), FireSpot(position=(300, 100), radius=30)]
    task = ExtinguishFires(map=Map(name="two", bounds=(0, 0, 400, 200), fires=spots), fire_constants=QUENCHED)
    world = world_of(task, [(70, 100, 0.0)] * 1 + [(130, 100, 0.0), (260, 100, 0.0), (340, 100, 0.0)])
    for _ in range(3):
        rewarded(world, [(0, 0)] * 4)
    assert [world.measures()[name] for name in ("fires out", "largest fire out")] == [0.5, 0.0]
    for _ in range(30):
        rewarded(world, [(0, 0)] * 4)
    measured = world.measures()
    assert [measured[name] for name in ("fires out", "largest fire out")] == [1.0, 1.0]
    assert 3 < measured["steps until all out"] < 33


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda task: TaskWorld(task=task, commanded=2, control=Subsumption(Explore())), "commanded is 2 beside a"),
        (lambda task: TaskWorld(task=task, commanded=16), "commanded is 16; expected"),
        (lambda task: TaskWorld(task=task, rng=1).play(), "policy is None, 15 commanded; expected a policy for them"),
        (lambda task: TaskWorld(task=task, commanded=0, rng=1).play(len), "policy is .*, 0 commanded; expected None"),
    ],
)
def test_what_drives_the_robots_of_a_world_is_unambiguous(make, message):
    with pytest.raises(InvalidValueError, match=f"^{message}"):
        make(CollisionAvoidance())
