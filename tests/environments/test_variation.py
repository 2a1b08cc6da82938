import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare

from mesa_swarm import AGENT3, AGENT9, Map
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.environments import CollisionAvoidance, Conditions, FindFires, Variation, VectorSwarmEnv
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.robots.imperfections import MEASURED, ROBOTARIUM

OWN = Map.load("original")


def any_map(rng: np.random.Generator) -> Map:
    return random_map(int(rng.integers(100)), obstacles=2)


def drawn(variation: Variation, seeds=range(300)) -> list[Conditions]:
    return [variation.draw(np.random.default_rng(seed), map=OWN, n_robots=4) for seed in seeds]


@given(
    least=st.integers(1, 50),
    more=st.integers(0, 50),
    speed=st.tuples(st.floats(0.01, 1), st.floats(1, 50)),
    dial=st.tuples(st.floats(0, 0.5), st.floats(0.5, 1)),
    seed=st.integers(0, 2**64),
)
def test_what_is_drawn_is_within_its_limits(least, more, speed, dial, seed):
    variation = Variation(n_robots=(least, least + more), speed=speed, imperfection=dial)
    (found,) = drawn(variation, [seed])
    assert least <= found.n_robots <= least + more
    assert speed[0] <= found.speed <= speed[1]
    assert dial[0] <= found.imperfection <= dial[1]
    assert found.map is OWN


def test_maps_and_numbers_of_robots_are_drawn_uniformly():
    found = drawn(Variation(maps=("original", "sparse", "openspace"), n_robots=(2, 6)), range(3000))
    for values in ([one.map.name for one in found], [one.n_robots for one in found]):
        assert chisquare(np.unique(values, return_counts=True)[1]).pvalue > 1e-4
    assert {one.n_robots for one in found} == {2, 3, 4, 5, 6}


def test_what_is_varied_more_changes_nothing_else():
    some, more = Variation(maps=("sparse", "original")), Variation(maps=("sparse", "original"), speed=(0.5, 2.0))
    assert [one.map.name for one in drawn(some)] == [one.map.name for one in drawn(more)]
    assert len({one.speed for one in drawn(more)}) == 300


def test_nothing_is_varied_by_default():
    assert set(drawn(Variation())) == {Conditions(map=OWN, n_robots=4)}


@pytest.mark.slow
def test_a_function_draws_maps_without_end():
    task = CollisionAvoidance(n_robots=2, max_steps=1, variation=Variation(maps=any_map))
    env, twin = (VectorSwarmEnv(task, n_worlds=3) for _ in range(2))
    names = set()
    env.reset(seed=1), twin.reset(seed=1)
    for _ in range(5):
        assert [world.map for world in env.worlds] == [world.map for world in twin.worlds]
        names |= {world.map.name for world in env.worlds}
        env.step(np.ones((3, 2, 2))), twin.step(np.ones((3, 2, 2)))
    assert len(names) > 8


def test_many_worlds_have_many_maps_numbers_of_robots_and_speeds():
    variation = Variation(
        maps=("original", "sparse"), n_robots=(2, 5), speed=(0.5, 2), imperfection=(0.2, 0.8), imperfections=ROBOTARIUM
    )
    env = VectorSwarmEnv(CollisionAvoidance(max_steps=3, variation=variation), n_worlds=12)
    seen = env.reset(seed=1)
    assert seen.shape == (12, 5, 9)
    assert {world.map.name for world in env.worlds} == {"original", "sparse"}
    assert {len(world.swarm) for world in env.worlds} == {2, 3, 4, 5}
    for world, present, conditions, rows in zip(env.worlds, env.present, env.conditions, seen, strict=True):
        assert present.tolist() == [i < len(world.swarm) for i in range(5)]
        assert world.map is conditions.map
        assert world.imperfections == ROBOTARIUM.at(conditions.imperfection)
        assert world.swarm.max_speed == pytest.approx(conditions.speed * env.task.design.max_speed)
        own = np.empty((len(world.swarm), 9), np.float32)
        world.observe(own)
        assert np.array_equal(rows[: len(own)], own)
        assert not rows[len(own) :].any()


@pytest.mark.slow
def test_actions_of_absent_robots_change_nothing_and_are_worth_nothing():
    task = CollisionAvoidance(max_steps=20, variation=Variation(n_robots=(1, 4)))
    env, twin = (VectorSwarmEnv(task, n_worlds=6) for _ in range(2))
    env.reset(seed=2), twin.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(50):
        absent, actions = ~env.present, rng.uniform(-1, 1, (6, 4, 2))
        others = np.where(absent[:, :, None], 0.5, actions)
        (*one, infos), (*other, _) = env.step(actions), twin.step(others)
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
        assert not one[1][absent].any()
        assert not infos["collided"][absent].any()
        if "final_obs" in infos:
            assert not infos["final_obs"][absent].any()
            assert not infos["returns"][absent].any()
    assert not env.present.all()


def test_options_are_of_one_episode_and_do_not_move_the_stream():
    task = CollisionAvoidance(n_robots=3, max_steps=2)
    env, twin = (VectorSwarmEnv(task, n_worlds=2) for _ in range(2))
    env.reset(seed=1, options={"map": "openspace", "imperfection": 1.0})
    twin.reset(seed=1)
    assert [world.map.name for world in env.worlds] == ["openspace"] * 2
    assert env.worlds[0].imperfections == MEASURED
    for _ in range(2):
        observations = env.step(np.zeros((2, 3, 2)))[0]
        others = twin.step(np.zeros((2, 3, 2)))[0]
    assert np.array_equal(observations, others)  # of the next episodes
    assert env.worlds[0].state_hash() == twin.worlds[0].state_hash()


def test_each_world_can_have_options_of_its_own():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=3), n_worlds=2)
    env.reset(seed=1, options=[{"map": "sparse"}, {"n_robots": 1}])
    assert [(world.map.name, len(world.swarm)) for world in env.worlds] == [("sparse", 3), ("original", 1)]
    for wrong in ([{}], "map"):
        with pytest.raises(InvalidValueError, match=r"^options (has 1 dicts for 2 worlds|is 'map'; expected a dict)"):
            env.reset(options=wrong)


def test_all_episodes_are_the_same_bits_for_the_same_seed_though_all_varies():
    variation = Variation(maps=any_map, n_robots=(1, 4), speed=(0.5, 2), imperfection=(0, 1))
    task = CollisionAvoidance(max_steps=7, variation=variation)
    hashes = []
    for n_worlds in (3, 2):
        env = VectorSwarmEnv(task, n_worlds=n_worlds)
        env.reset(seed=4)
        for _ in range(20):
            env.step(np.full((n_worlds, 4, 2), 0.5))
        hashes.append([world.state_hash() for world in env.worlds[:2]])
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"maps": "original"}, "maps is 'original'; expected a sequence of maps"),
        ({"n_robots": (5, 2)}, "most of n_robots is 2; expected a whole number at least 5"),
        ({"n_robots": 3}, r"n_robots is 3; expected a pair \(least, most\)"),
        ({"speed": (0, 1)}, "least of speed is 0; expected"),
        ({"imperfection": (0, 2)}, "most of imperfection is 2; expected"),
        ({"imperfections": 1}, r"imperfections is 1; expected Imperfections\(...\)"),
    ],
)
def test_wrong_variations_are_refused(wrong, message):
    with pytest.raises(InvalidValueError, match=f"^{message}"):
        Variation(**wrong)


def test_a_team_of_several_designs_has_a_fixed_number_of_robots():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=4, design=(AGENT9, AGENT3)), n_worlds=1)
    env.reset(options={"n_robots": 4, "speed": 0.5})
    assert env.worlds[0].swarm.max_speed.tolist() == [0.5] * 4
    with pytest.raises(InvalidValueError, match=r"^option n_robots is 3; expected 4, the number of the team"):
        env.reset(options={"n_robots": 3})


def test_a_task_refuses_what_some_episode_could_not_be():
    with pytest.raises(InvalidValueError, match=r"^map sparse has no fires"):
        FindFires(variation=Variation(maps=("openspace_fire", "sparse")))
    with pytest.raises(InvalidValueError, match=r"^variation is 3; expected Variation\(...\)$"):
        FindFires(variation=3)
    with pytest.raises(InvalidValueError, match=r"^maps returned 'sparse'; expected a Map$"):
        VectorSwarmEnv(CollisionAvoidance(variation=Variation(maps=lambda rng: "sparse")), n_worlds=1).reset()
    env = VectorSwarmEnv(FindFires(n_robots=2), n_worlds=1)
    with pytest.raises(InvalidValueError, match=r"^map sparse has no fires"):
        env.reset(options={"map": "sparse"})
    with pytest.raises(UnknownNameError, match=r"^unknown option 'noise'; .*known: map, n_robots, speed, imperf"):
        env.reset(options={"noise": 1})
    with pytest.raises(InvalidValueError, match=r"^option speed is 0; expected"):
        env.reset(options={"speed": 0})
