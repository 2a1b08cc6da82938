"""A table of discrete states is corrected by equation (7.3), exactly, in the taken action of the last state only."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import PolicyLayer, SensorLayout, TablePolicy, TableQLearning, load_policy, reward, save_policy
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS
from mesa_swarm.learning.table_learning import state_of
from mesa_swarm.models.q_learning import QLearning


def learning(robots=3, design=AGENT9, rng=1, **options):
    model = SwarmModel(map="original", rng=rng)
    model.add_robots(design, robots)
    model.control = Subsumption(TableQLearning(**options))
    return model


def layer_of(model):
    return model.control.layers[0]


def column(model, name):
    return model.swarm.columns[f"0.TableQLearning.{name}"].copy()


def nearest_of(model, row):
    seen = model.swarm.distance[row][model.swarm.distance[row] >= 0] / 50.0
    return seen.min() if len(seen) else 1.0


@pytest.mark.slow
@pytest.mark.parametrize("reward_of", ["state", "next state"])
def test_each_step_corrects_one_entry_of_a_robot_by_the_equation_computed_by_hand(reward_of):
    model = learning(robots=4, alpha=0.3, gamma=0.8, reward_of=reward_of, critical=0.4)
    model.step()
    for _ in range(60):
        before, state, action = column(model, "values"), column(model, "state"), column(model, "action")
        last = column(model, "nearest")
        model.step()
        after, now = column(model, "values"), column(model, "state")
        for i in range(4):
            s, a = state[i], action[i]
            reading = last[i] if reward_of == "state" else column(model, "nearest")[i]
            paid = reward("b", float(reading), *ACTIONS[a], critical=0.4)
            expected = before[i].copy()
            expected[s, a] = 0.7 * before[i, s, a] + 0.3 * (paid + 0.8 * before[i, now[i]].max())
            assert after[i] == pytest.approx(expected, abs=1e-12)


def test_a_first_lesson_far_from_everything_is_worth_alpha_times_its_reward():
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(400, 300, 0)])
    model.control = Subsumption(TableQLearning())
    model.step()
    action = column(model, "action")[0]
    model.step()
    values = layer_of(model).values[0]
    assert values[242, action] == pytest.approx(0.4 * (1.0 if ACTION_NAMES[action] == "forward" else -1.0))
    assert np.count_nonzero(values) == 1


def test_readings_fall_into_bins_of_their_sectors():
    distance = np.full((1, 9), -1.0)
    bearings = np.radians([[s.bearing_degrees for s in AGENT9.proximity]])
    ranges, nearest, edges = np.full((1, 9), 50.0), np.empty(5), np.array([0.1, 0.4])

    def state():
        return state_of(distance, ranges, bearings, 0, 0, edges, 5, nearest)

    assert state() == 242
    distance[0, 0] = 4.9  # straight ahead, nearest bin
    assert state() == 242 - 2
    distance[0, 0] = 5.0  # on the edge, the bin beyond
    assert state() == 242 - 1
    distance[0, 3] = 19.0  # 60 degrees to the left: sector 1, middle bin
    assert state() == 242 - 1 - 3
    distance[0, 4] = 1.0  # to the right: sector 4
    assert state() == 242 - 1 - 3 - 2 * 81
    assert nearest.tolist() == [0.1, 0.38, 1.0, 1.0, 0.02]


@given(
    readings=st.lists(st.one_of(st.just(-1.0), st.floats(0, 60)), min_size=9, max_size=9),
    sectors=st.integers(1, 7),
    edges=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=3, unique=True),
)
def test_every_reading_has_a_state_in_the_table(readings, sectors, edges):
    bearings = np.radians([[s.bearing_degrees for s in AGENT9.proximity]])
    layer = TableQLearning(edges=tuple(sorted(edges)), sectors=sectors)
    state = state_of(
        np.array([readings]), np.full((1, 9), 50.0), bearings, 0, 0, np.array(layer.edges), sectors, np.empty(sectors)
    )
    assert 0 <= state < layer.states


def test_robots_of_other_sensors_and_robots_added_later_learn_too():
    model = learning(robots=2).run(20)
    model.add_robots(AGENT3, 2)
    model.run(20)
    assert column(model, "values").any(axis=(1, 2)).all()


def test_frozen_robots_choose_at_random_and_learn_nothing():
    model = learning(frozen=True).run(50)
    assert not layer_of(model).values.any()
    assert (layer_of(model).temperature == 1.0).all()


def test_the_temperature_falls_as_that_of_networks():
    layer = layer_of(learning(beta=5e-3).run(101))
    assert layer.temperature == pytest.approx(0.2 + 0.8 * 0.995**101)


def test_its_values_and_its_reasons_can_be_read():
    model = learning()
    assert layer_of(model).worth(0) == []
    model.watch()
    model.run(5)
    assert [name for name, _ in layer_of(model).worth(0)] == list(ACTION_NAMES)
    assert (layer_of(model).last_reward <= 1).all()
    assert model.explain(model.robots[0]).reason.endswith(", by its table and by chance")


@pytest.mark.parametrize("options", [{}, {"shared": True, "actions": 4, "edges": (0.2,), "sectors": 3}])
def test_a_saved_table_drives_frozen_elsewhere_as_its_policy_does(options, tmp_path):
    policy = load_policy(save_policy(layer_of(learning(**options).run(60)).policy(), tmp_path / "table.npz"))
    commands = []
    for layer in (TableQLearning(start=policy, frozen=True, name="a", **options), PolicyLayer(policy=policy, name="a")):
        model = SwarmModel(map="openspace", rng=5)
        model.add_robots(AGENT9, 12)
        model.control = Subsumption(layer)
        commands.append(np.array([model.run(1).swarm.command.copy() for _ in range(40)]))
    assert (commands[0] == commands[1]).all()
    assert len(np.unique(commands[0])) > 1
    assert policy.copies == (1 if options else len(learning().robots))


def test_a_table_of_plain_numbers_drives_and_one_of_texts_or_without_sensors_is_refused():
    given = {
        "sensors": SensorLayout.of(AGENT3),
        "values": [[[0, 0, 0, 1], [1, 0, 0, 0]]],
        "edges": (0.2,),
        "sectors": 1,
    }
    assert TablePolicy(**given).act([[5.0, -1.0, -1.0]]).tolist() == [[1.0, 1.0]]
    for name, wrong in (("values", [[["a"] * 4] * 2]), ("values", [[1], [1, 2]]), ("sensors", None)):
        with pytest.raises(InvalidValueError, match=f"^{name} "):
            TablePolicy(**{**given, name: wrong})


def test_a_start_with_other_states_is_refused():
    policy = layer_of(learning().run(5)).policy()
    for wrong in ({"sectors": 3}, {"edges": (0.5,)}, {"actions": 4}):
        with pytest.raises(InvalidValueError, match=r"^start has edges"):
            TableQLearning(start=policy, **wrong)
    with pytest.raises(InvalidValueError, match=r"^start is"):
        TableQLearning(start="mine.npz")


def test_the_model_learns_in_a_table_on_request():
    model = QLearning(n_robots=3, rng=1, memory="table", gamma=0.5).run(20)
    assert isinstance(model.learner, TableQLearning)
    assert (model.learner.gamma, model.learner.critical) == (0.5, 0.08)
    assert math.isfinite(model.results()["collisions per robot and 1,000 steps"])
    with pytest.raises(SwarmError, match="unknown memory"):
        QLearning(memory="tables")
