"""Learners and what they count, on readings made by hand and step by step, against twins of their documentation."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import LearningError
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import (
    HebbianLearning,
    Networks,
    PolicyLayer,
    QLearning,
    QPolicy,
    ReflexPolicy,
    SensorLayout,
    WireFittedQ,
    reward,
)
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS, boltzmann, ranges_of, write_inputs
from mesa_swarm.learning.fire_learning import SITUATIONS, SKILLS, LearnFires
from mesa_swarm.learning.fitness import Tally, floreano
from mesa_swarm.learning.learner import is_bounded, set_temperature
from mesa_swarm.learning.wire_learning import WirePolicy, learn_wire_value, propose
from mesa_swarm.robots.reasons import Moment
from support.made_senses import (
    FIRE,
    LOAD,
    NOTHING_WRITTEN,
    ROBOT,
    ROBOTS,
    decided,
    known_to,
    made_drivers,
    made_senses,
    model_of_three_designs,
)

PARTS = ("inner", "inner_bias", "outer", "outer_bias")
FAST = replace(AGENT9, name="fast", max_speed=2.0)


def learning(layer, robots=3, design=FAST, rng=1):
    model = SwarmModel(map="original", rng=rng)
    model.add_robots(design, robots)
    model.control = Subsumption(layer)
    return model


def column(model, name):
    return model.swarm.columns[f"0.{model.control.layers[0].name}.{name}"]


def drawn_by(values, temperature, chance):
    return int(np.searchsorted(np.cumsum(boltzmann(values, temperature)), chance, side="right"))


class Pupil:
    """One robot that learns what to do about fires, by the words of the documentation."""

    def __init__(self, temperature):
        self.skill = self.situation = None
        self.age, self.gain, self.before, self.last, self.temperature = 0, 0.0, -1, -1, temperature

    def step(self, me, table, chance, layer):
        now = situation(me)
        if self.skill is not None:
            self.gain += layer.gamma**self.age * self.earned(me, layer)
            self.age += 1
        self.before = me.fire
        self.last = me.fire if me.fire >= 0 else self.last
        if self.skill is None or now != self.situation or self.age >= layer.hold:
            if self.skill is not None and not layer.frozen:
                target = self.gain + layer.gamma**self.age * table[now].max()
                table[self.situation, self.skill] += layer.alpha * (target - table[self.situation, self.skill])
            self.situation, self.age, self.gain = now, 0, 0.0
            self.skill = drawn_by(table[now], self.temperature, chance)
        if not layer.frozen:
            self.temperature -= layer.beta * (self.temperature - layer.last_temperature)

    def earned(self, me, layer):
        if me.fire >= 0:
            return 0.0 if me.fire in (self.before, self.last) else layer.arrival
        went_out = self.before >= 0 and not me.hot and not me.last_command.any()
        return layer.put_out * went_out - layer.step_cost


def situation(me):
    if me.hot:
        body = "too hot, in the heat" if me.heat > 0 else "too hot, out of the heat"
    else:
        body = "at a fire" if me.fire >= 0 else "free"
    seen = [name for kind, name in ((FIRE, "a fire"), (ROBOT, "a robot")) if kind in me.kind]
    return SITUATIONS.index(f"{body}{', sees ' if seen else ''}{' and '.join(seen)}")


def performed(me, skill):
    """Return what a robot that applies a skill does."""

    def turning(bearing):
        rim = min(abs(bearing) * me.radius, me.max_speed)
        return (-rim, rim) if bearing > 0 else (rim, -rim)

    if skill == "wait" or (skill == "approach" and me.fire >= 0):
        return 0.0, 0.0
    if skill == "back off":
        return -me.max_speed, -me.max_speed
    sought = np.flatnonzero(me.kind == (ROBOT if skill == "follow" else FIRE))
    if len(sought):
        nearest = sought[np.argmin(me.distance[sought])]
        bearing = me.bearing[nearest]
        if skill != "explore" and abs(bearing) > math.radians(10):
            return turning(bearing)
        if skill == "explore" and nearest in me.forward and me.distance[nearest] < 15:
            return turning(math.copysign(math.pi, -bearing if bearing else me.tendency))
    return me.max_speed, me.max_speed


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"shared": True}, {"frozen": True}], ids=["own", "shared", "frozen"])
def test_skills_are_chosen_performed_and_learned_of_as_documented(options):
    given_ = LearnFires(hold=3, alpha=0.3, gamma=0.9, beta=0.02, first_temperature=2, last_temperature=0.5, **options)
    model = model_of_three_designs(Subsumption(given_))
    layer, values = model.control.layers[0], column(model, "values")
    values[:] = np.random.default_rng(1).normal(size=(1 if given_.shared else ROBOTS, *values.shape[1:]))
    tables, senses = values.copy(), None
    pupils = [Pupil(2.0) for _ in range(ROBOTS)]
    for seed in range(15):
        senses, drivers = made_senses(seed, senses), made_drivers(seed)
        chance = copy.deepcopy(model.streams["decide.LearnFires"]).random(ROBOTS)
        command, won = decided(layer, senses, drivers)
        for i, pupil in enumerate(pupils):
            me = known_to(senses, i)
            pupil.step(me, tables[0 if given_.shared else i], chance[i], given_)
            wanted = performed(me, SKILLS[pupil.skill]) if drivers[i] < 0 else [NOTHING_WRITTEN] * 2
            assert command[i] == pytest.approx(wanted, abs=1e-12)
            assert won[i] == (7 if drivers[i] < 0 else drivers[i])
        np.testing.assert_allclose(values, tables[:1] * np.ones((ROBOTS, 1, 1)) if given_.shared else tables)
        assert layer.temperature == pytest.approx([pupil.temperature for pupil in pupils])


def test_the_reason_of_a_skill_is_the_situation_and_the_skill_where_it_is_stored():
    model = model_of_three_designs(Subsumption(LearnFires()))
    layer, senses = model.control.layers[0], made_senses(5)
    for i in range(ROBOTS):
        me = known_to(senses, i)
        columns = {"fire": me.fire, "hot": me.hot, "heat": me.heat}
        parts = me.distance, me.kind, me.sensors, me.bearing, tuple(me.forward), np.zeros(2), True
        where = f": it is {SITUATIONS[situation(me)]}"
        assert layer.reason(Moment(*parts, columns)).words == f"it chose by what it learned{where}"
        for k, skill in enumerate(SKILLS):
            moment = Moment(*parts, {**columns, "0.LearnFires.skill": np.int64(k)})
            assert layer.reason(moment).words == f"it chose to {skill}{where}"


@pytest.mark.parametrize("reward_of", ["state", "next state"])
@pytest.mark.parametrize("shared", [False, True])
def test_wires_are_learned_of_and_chosen_in_every_step_as_documented(shared, reward_of):
    options = {"beta": 0.05, "jitter": 0.5, "wires": 3, "gamma": 0.6, "alpha": 0.5, "eta": 0.4, "shared": shared}
    model = learning(WireFittedQ(**options, critical=0.4, reward_of=reward_of)).run(2)
    seen_near = 0
    for _ in range(30):
        before = {name: column(model, name).copy() for name in (*PARTS, "inputs", "action", "temperature")}
        stream = copy.deepcopy(model.streams["decide.WireFittedQ"])
        model.step()
        chance, errors = stream.random(3), stream.normal(size=(3, 2))
        shapes = ((9, 9, 18), (9, 18), (9, 18), (9,))
        stacks = [
            tuple(before[part][i].reshape(shape).copy() for part, shape in zip(PARTS, shapes, strict=True))
            for i in range(3)
        ]
        hidden, ends, values = np.empty((9, 18)), np.empty((3, 2)), np.empty(3)
        for i in range(3):
            stack, now = stacks[0 if shared else i], column(model, "inputs")[i]
            propose(stack, 0, now, 0, hidden, ends, values)
            nearest = (before["inputs"][i] if reward_of == "state" else now).min()
            paid = reward("c", nearest, *before["action"][i], 0.4)
            seen_near += nearest < 0.4
            target, used = paid + 0.6 * values.max(), before["action"][i : i + 1]
            assert column(model, "reward")[i] == pytest.approx(paid)
            assert learn_wire_value(stack, 0, before["inputs"][i], 0, hidden, ends, values, used, target, 0.2)
            propose(stack, 0, now, 0, hidden, ends, values)
            temperature = before["temperature"][i] - 0.05 * (before["temperature"][i] - 0.2)
            wheels = ends[drawn_by(values, temperature, chance[i])] + temperature * 0.5 * errors[i]
            assert column(model, "temperature")[i] == pytest.approx(temperature)
            assert column(model, "action")[i] == pytest.approx(np.clip(wheels, -1, 1), abs=1e-12)
            assert model.swarm.command[i] == pytest.approx(2.0 * np.clip(wheels, -1, 1), abs=1e-12)
        for k, part in enumerate(PARTS):
            for i in range(3):
                learned = stacks[0 if shared else i][k]
                np.testing.assert_allclose(column(model, part)[i].reshape(learned.shape), learned, atol=1e-12)
    assert column(model, "lessons").tolist() == [31, 31, 31]
    assert seen_near


@pytest.mark.slow
def test_commands_are_shares_of_the_greatest_speed():
    model = learning(QLearning()).run(30)
    assert (model.swarm.command == 2.0 * ACTIONS[column(model, "action")]).all()
    policy = model.control.layers[0].policy()
    model = learning(HebbianLearning()).run(30)
    assert (model.swarm.command == 2.0 * column(model, "command")).all()
    driven = learning(PolicyLayer(policy=policy, greedy=True)).run(1)
    assert (driven.swarm.command == 2.0 * policy.act(driven.swarm.distance)).all()


@pytest.mark.parametrize("self_adjusting", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_a_temperature_follows_time_or_the_share_of_steps_that_ended_near_something(seed, self_adjusting):
    rng = np.random.default_rng(seed)
    distance, bumps = rng.choice([-1.0, 0.0, 0.5, 0.6], (20, 2), p=[0.5, 0.1, 0.1, 0.3]), rng.uniform(0, 0.1, 20)
    temperature = rng.uniform(0.2, 2, 20)
    bumped = ((distance >= 0) & (distance <= 0.5)).any(axis=1)
    recent = 0.9 * bumps + 0.1 * bumped
    heated = 0.2 + 0.8 * np.minimum(1, recent / 0.05)
    wanted = heated if self_adjusting else temperature - 0.3 * (temperature - 0.2)
    for i in range(20):
        set_temperature(distance, i, temperature, bumps, (0.3, 1.0, 0.2), (0.05, 0.1, 0.5, 0.0), self_adjusting)
    np.testing.assert_allclose(bumps, recent)
    np.testing.assert_allclose(temperature, wanted)


@pytest.mark.parametrize("typed", [False, True])
def test_inputs_are_readings_as_shares_of_the_range_and_of_which_kind_they_are(typed):
    senses = made_senses(2)
    distance, ranges = np.where(senses.distance < 0, -1.0, 2.0 * senses.distance), ranges_of(senses.sensors)
    for i in range(ROBOTS):
        d = senses.design[i]
        inputs = np.full((2, 36 if typed else 9), NOTHING_WRITTEN)
        nearest = write_inputs(distance, senses.kind, ranges, i, d, inputs, 1)
        near = (distance[i] >= 0) & (ranges[d] > 0)
        shares = np.where(near, np.minimum(distance[i] / np.where(near, ranges[d], 1.0), 1.0), 1.0)
        kinds = [senses.kind[i] == kind for kind in (ROBOT, FIRE, LOAD)] if typed else []
        assert inputs[1] == pytest.approx(np.concatenate([shares, *kinds]))
        assert nearest == pytest.approx(shares.min())
        assert (inputs[0] == NOTHING_WRITTEN).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_tally_adds_up_products_speeds_collisions_and_squares(seed):
    rng, n, senses = np.random.default_rng(seed), ROBOTS, made_senses(3)
    ranges = ranges_of(senses.sensors)
    tally = Tally(n, (10, 20, 410, 210), ranges, square=50)
    sums, visited = np.zeros((n, 3)), np.zeros((4, 8), bool)
    for step in range(3):
        columns = {
            "distance": senses.distance,
            "design": senses.design,
            "command": rng.choice([-1.0, 0.0, 0.25, 1.0], (n, 2)),
            "max_speed": rng.choice([0.0, 1.0, 2.0], n),
            "collided": rng.random(n) < 0.3,
            "position": rng.choice([-5.0, 10.0, 60.0, 160.0, 209.0, 360.0, 409.0, 500.0], (n, 2)),
        }
        tally.add(columns)
        for i in range(n):
            left, right = columns["command"][i] / (columns["max_speed"][i] or 1.0)
            reach = ranges[senses.design[i]]
            near = (senses.distance[i] >= 0) & (reach > 0)
            nearest = (1 - senses.distance[i][near] / reach[near]).max(initial=0.0)
            sums[i] += floreano(left, right, nearest), (left + right) / 2, columns["collided"][i]
            x, y = columns["position"][i]
            visited[min(max(int((y - 20) // 50), 0), 3), min(max(int((x - 10) // 50), 0), 7)] = True
        np.testing.assert_allclose(tally.sums, sums, atol=1e-12)
        assert (tally.visited == visited).all()
        assert tally.steps == step + 1
    means = tally.means()
    assert means["covered"] == visited.mean()
    assert [means[name] for name in ("floreano", "ahead", "collisions")] == pytest.approx(sums.mean(axis=0) / 3)


@pytest.mark.slow
def test_what_actions_and_wires_are_worth_is_what_the_networks_return_for_the_last_readings():
    for learner in (QLearning(), QLearning(actions=4, encoding="typed"), WireFittedQ(wires=3)):
        model = learning(learner)
        layer = model.control.layers[0]
        model.sense()
        assert layer.worth(0) == []
        model.run(20)
        policy, (distance, kind) = layer.policy(), (model.swarm.distance, model.swarm.kind)
        for row in range(3):
            worth = layer.worth(row)
            if isinstance(learner, QLearning):
                names, values = ACTION_NAMES[: learner.actions], policy.values(distance, kind)[row]
            else:
                actions, values = (part[row] for part in policy.proposals(distance, kind))
                names = [f"wheels {left:+.2f} {right:+.2f}" for left, right in actions]
            assert [name for name, _ in worth] == list(names)
            assert [value for _, value in worth] == pytest.approx(values.tolist())


def test_the_reason_of_a_choice_is_the_action_and_the_nearest_reading():
    model = learning(QLearning())
    model.watch()
    seen = set()
    for _ in range(60):
        model.step()
        for row, robot in enumerate(model.robots):
            why = model.explain(robot)
            name = ACTION_NAMES[column(model, "action")[row]]
            distance, kind = model.swarm.distance[row], model.swarm.kind[row]
            near = np.flatnonzero(kind >= 0)
            seen.add(bool(len(near)))
            assert why.reason.startswith(f"it chose {name}, by what it learned and by chance, with ")
            if len(near):
                nearest = int(near[np.argmin(distance[near])])
                assert why.sensors == (nearest,)
                assert f" {distance[nearest]:.1f} (" in why.reason
            else:
                assert why.sensors == ()
                assert why.reason.endswith("with nothing in sight")
    assert seen == {True, False}


def test_the_reason_of_a_policy_is_all_that_it_sees():
    policy = learning(QLearning()).run(2).control.layers[0].policy()
    model = learning(PolicyLayer(policy=policy))
    model.watch()
    seen = set()
    for _ in range(60):
        model.step()
        for row, robot in enumerate(model.robots):
            why, near = model.explain(robot), np.flatnonzero(model.swarm.kind[row] >= 0).tolist()
            seen.add(bool(near))
            assert list(why.sensors) == near
            assert why.reason.startswith("its policy acts on ")
            assert why.reason.endswith("nothing in sight") == (not near)
            assert why.reason.count("(") == len(near)
    assert seen == {True, False}


def test_readings_without_kinds_are_of_obstacles_and_what_is_not_seen_is_nothing():
    readings = np.array([[0.0, -1.0, 3.0, 0.5, -1.0, 50.0, 0.0, 1.0, 2.0]])
    distance, kind = SensorLayout.of(AGENT9).check_readings(readings, None)
    assert (distance == readings).all()
    assert kind.tolist() == [[0, -1, 0, 0, -1, 0, 0, 0, 0]]


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ])
@pytest.mark.parametrize("rows", [(0, 1, 2), (1, 2), (2,)])
def test_of_several_robots_that_diverge_the_first_is_named(learner, rows):
    model = learning(learner()).run(3)
    column(model, "outer_bias")[list(rows)] = 1e300
    with pytest.raises(LearningError, match=f"robot {model.robots[rows[0]].unique_id} in step 4"):
        model.step()


@pytest.mark.parametrize(("number", "bounded"), [(1e9, True), (math.nextafter(1e9, math.inf), False)])
def test_a_thousand_million_is_the_largest_step_and_weight(number, bounded):
    for sign in (-1, 1):
        assert is_bounded(np.zeros((2, 3)), 1, sign * number) == bounded
        assert is_bounded(np.array([[0.0, 0.0], [0.0, sign * number]]), 1, 0.0) == bounded
        assert is_bounded(np.array([[0.0, sign * number], [0.0, 0.0]]), 1, 0.0)


@pytest.mark.parametrize("learner", [QLearning, WireFittedQ])
@pytest.mark.parametrize(("encoding", "inputs"), [("distance", 9), ("typed", 36)])
def test_first_weights_of_robots_are_within_the_root_of_what_feeds_a_node(learner, encoding, inputs):
    model = learning(learner(encoding=encoding), robots=30).run(1)
    for part, feeding in zip(PARTS, (inputs + 1, inputs + 1, 19, 19), strict=True):
        weights, limit = column(model, part), 1 / math.sqrt(feeding)
        assert 0.95 * limit < weights.max() <= limit
        assert -limit <= weights.min() < -0.95 * limit
        assert len(np.unique(weights)) == weights.size


def test_policies_are_untrained_of_distances_and_moderately_random_unless_they_are_given_otherwise():
    policy = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1))
    assert (policy.actions, policy.encoding, policy.temperature, policy.steps) == (8, "distance", 0.2, 0)
    assert (policy.copies, policy.training, policy.networks.inner.shape) == (1, {}, (8, 9, 18))
    wires = WirePolicy(sensors=policy.sensors, networks=Networks.random(12, inputs=9, rng=np.random.default_rng(1)))
    assert (wires.wires, wires.copies, wires.temperature, wires.steps) == (4, 1, 0.2, 0)
    reflex = ReflexPolicy.of_genome(policy.sensors, np.zeros(22))
    assert (reflex.memory, reflex.squash, reflex.encoding, reflex.steps) == (0, "linear", "distance", 0)
