"""Robots that learn what to do about fires: what is paid, what is learned of it, and what skills do."""

import numpy as np
import pytest

from mesa_swarm import AGENT_FIRE, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from mesa_swarm.fire import FireConstants
from mesa_swarm.learning import PolicyLayer, SensorLayout, SkillPolicy
from mesa_swarm.learning.fire_learning import (
    APPROACH,
    BACK_OFF,
    EXPLORE,
    FOLLOW,
    SITUATIONS,
    SKILLS,
    WAIT,
    LearnFires,
    paid,
)
from mesa_swarm.models.learning_fires import LearningFires
from mesa_swarm.world.statics import FIRE

REWARDS = (10.0, 20.0, 0.5)
LASTING = FireConstants(k1=1e-9, k2=1e-12, k3=0.0, k4=0.0, leave=1.0, join=0.0)


def made_to(skill, poses, fire=(300, 300), **options):
    """Return a model whose robots hold one skill best in every situation and choose it without chance."""
    model = SwarmModel(map="openspace", rng=1, fire_constants=LASTING)
    if fire:
        model.add_fire(fire, radius=20)
    model.add_robots(AGENT_FIRE, poses=poses)
    model.control = Subsumption(LearnFires(first_temperature=1e-6, last_temperature=1e-6, alpha=0, **options))
    model.swarm.columns["0.LearnFires.values"][:, :, skill] = 1.0
    return model


@pytest.mark.parametrize(
    ("now", "before", "last", "hot", "stood", "worth"),
    [
        (-1, -1, -1, False, False, -0.5),  # nothing to do with fires
        (2, -1, -1, False, False, 10.0),  # arrives
        (2, 2, 2, False, True, 0.0),  # fights
        (2, -1, 2, False, False, 0.0),  # returns to the same
        (2, 1, 1, False, False, 10.0),  # goes over to another
        (-1, 2, 2, False, True, 19.5),  # it went out
        (-1, 2, 2, True, True, -0.5),  # too hot
        (-1, 2, 2, False, False, -0.5),  # went away
    ],
)
def test_steps_are_paid_for_arriving_and_for_putting_out(now, before, last, hot, stood, worth):
    assert paid(now, before, last, hot, stood, REWARDS) == worth


def test_who_approaches_goes_to_the_fire_and_stands_there():
    model = made_to(APPROACH, [(240, 300, 0.4)]).run(60)
    assert model.swarm.fire[0] == 0
    assert not model.swarm.command.any()
    assert not model.total_collisions


def test_who_explores_turns_away_from_a_fire_and_touches_nothing():
    model = made_to(EXPLORE, [(240, 300, 0.0)]).run(60)
    assert not model.total_collisions
    assert abs(model.swarm.heading[0]) > 0.5


@pytest.mark.parametrize("pose", [(228, 300, 0.0), (255, 300, np.pi / 2)], ids=["ahead and far", "near and beside"])
def test_who_explores_drives_on_unless_a_fire_is_both_ahead_and_near(pose):
    model = made_to(EXPLORE, [pose]).run(1)
    assert (model.swarm.kind[0] == FIRE).any()
    assert model.swarm.command[0].tolist() == [1.0, 1.0]


def test_who_waits_stands_and_who_backs_off_drives_backwards():
    assert not made_to(WAIT, [(240, 300, 0.0)]).run(5).swarm.command.any()
    assert (made_to(BACK_OFF, [(240, 300, 0.0)]).run(5).swarm.command == -1.0).all()


def test_who_follows_turns_to_the_nearest_robot():
    model = made_to(FOLLOW, [(400, 300, 0.0), (400, 330, np.pi)], fire=None).run(30)
    assert model.swarm.heading[0] > 1.0


def test_one_experience_changes_one_value_by_alpha_times_the_discounted_reward():
    model = made_to(APPROACH, [(240, 300, 0.0)], hold=10, gamma=0.9, step_cost=1.0)
    layer = model.control.layers[0]
    layer.alpha = 0.5
    before = layer.values
    model.run(11)
    situation = SITUATIONS.index("free, sees a fire")
    changed = layer.values - before
    earned = -sum(0.9**k for k in range(10)) + 0.9**10 * 1.0
    assert changed[0, situation, APPROACH] == pytest.approx(0.5 * (earned - 1.0))
    assert np.count_nonzero(changed) == 1


def test_the_table_is_of_each_robot_s_own_or_of_all():
    own, shared = (LearningFires(controller=c, n_robots=4, rng=2).run(1500) for c in ("own", "shared"))
    tables = own.control.layers[1].values
    assert (tables[0] != tables[1]).any()
    tables = shared.control.layers[1].values
    assert tables.any()
    assert (tables == tables[:1]).all()


def test_a_map_without_fires_is_refused():
    with pytest.raises(
        InvalidValueError, match=r"^map original has no fires; choose one with fires, such as openspace"
    ):
        LearningFires(map="original", rng=1)


def test_random_skills_learn_nothing():
    model = LearningFires(controller="random", n_robots=4, rng=2).run(500)
    assert not model.control.layers[1].values.any()


def test_a_round_that_ends_by_the_clock_pays_no_robot_and_lights_all_fires_again():
    model = LearningFires(n_robots=4, round_steps=300, rng=2).run(899)
    assert [lasted for lasted, *_ in model.rounds] == [300, 300]
    assert len(model.fires) == 7
    still = made_to(APPROACH, [(275, 300, 0.0)], step_cost=0.0, arrival=0.0, put_out=100.0)
    still.run(20)
    assert still.swarm.fire[0] == 0
    still.control.layers[0].alpha = 1.0
    still.control.layers[0].begin_again()
    for fire in still.fires:
        fire.remove()
    still.run(60)
    assert still.control.layers[0].values.max() <= 1.0


def test_a_model_of_learners_goes_on_from_a_recording_as_if_it_had_not_stopped(tmp_path):
    whole = LearningFires(n_robots=4, round_steps=200, rng=3)
    with whole.record(tmp_path / "run.arrows", checkpoint_every=250):
        whole.run(500)
    again = LearningFires.resume(tmp_path / "run.arrows")
    assert again.steps == 500
    assert again.run(100).state_hash() == whole.run(100).state_hash()


def test_a_frozen_robot_does_what_its_table_values_most():
    values = np.zeros((2, len(SITUATIONS), len(SKILLS)))
    values[0, :, WAIT], values[1, :, BACK_OFF] = 1.0, 1.0
    policy = SkillPolicy(sensors=SensorLayout.of(AGENT_FIRE), values=values, temperature=1e-6, steps=1)
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT_FIRE, poses=[(200, 200, 0), (400, 200, 0), (200, 400, 0)])
    model.control = Subsumption(LearnFires(start=policy, frozen=True))
    assert model.run(1).swarm.command[:, 0].tolist() == [0.0, -1.0, 0.0]
    assert policy.best(1)["free"] == "back off"
    model.control = Subsumption(LearnFires(start=policy.of_robot(1), frozen=True))
    assert (model.run(1).swarm.command == -1.0).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"values": np.zeros((16, 5))},
        {"values": np.full((1, 16, 5), np.nan)},
        {"values": np.full((1, 16, 5), "a")},
        {"values": [[1.0], [1.0, 2.0]]},
        {"sensors": 3},
        {"temperature": 0},
        {"hold": 0},
        {"steps": -1},
    ],
    ids=str,
)
def test_policies_of_skills_that_could_not_act_are_refused(wrong):
    given = {"sensors": SensorLayout.of(AGENT_FIRE), "values": np.zeros((1, 16, 5)), **wrong}
    with pytest.raises(InvalidValueError, match=rf"^{next(iter(wrong))} "):
        SkillPolicy(**given)


def test_a_policy_of_skills_names_the_layer_that_drives_by_it():
    policy = SkillPolicy(sensors=SensorLayout.of(AGENT_FIRE), values=np.zeros((1, 16, 5)).tolist(), steps=1)
    assert policy.of_robot(0).values.shape == (1, 16, 5)
    with pytest.raises(InvalidValueError, match=r"drive robots by LearnFires\(start=policy, frozen=True\)$"):
        PolicyLayer(policy=policy)


def test_a_start_that_is_no_policy_of_skills_is_refused():
    with pytest.raises(InvalidValueError, match=r"^start is .*; expected a SkillPolicy"):
        LearnFires(start="mine.npz")


def test_every_skill_and_situation_has_a_name():
    assert len(set(SITUATIONS)) == 16
    assert len(set(SKILLS)) == 5
