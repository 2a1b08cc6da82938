"""SeekHeat: towards the hottest fire that is felt, beside a twin of plain Python."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, RadiationSensor, RobotDesign, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire import FightFire, SeekHeat
from mesa_swarm.maps.map import Map
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.robots.snapshots import DECISIONS
from support.made_senses import ROBOTS, made_senses

BEARINGS = (0, 60, -60)
SEEKER = RobotDesign(
    name="seeker",
    sensors=(
        *AGENT9.sensors,
        *(RadiationSensor(bearing_degrees=b, range=80, field_of_view_degrees=60) for b in BEARINGS),
    ),
)


def between_two_fires(*layers, rng=1):
    """Return a model with a hot fire on the left and a cooler, nearer one on the right of a robot that heads up."""
    model = SwarmModel(map=Map(name="field", bounds=(0, 0, 400, 300)), rng=rng)
    model.add_fire((155, 150), radius=15, temperature=0.9)
    model.add_fire((240, 150), radius=15, temperature=0.3)
    model.remove_process(model.processes[0])
    model.add_robots(SEEKER, poses=[(200, 120, np.pi / 2)])
    model.control = Subsumption(Avoid(fires="never"), *layers, FightFire(strategy="B"), Explore())
    return model


def at_fire(model, steps=300):
    """Return the fire whose edge the robot is nearest to in the end."""
    model.run(steps)
    return int(np.argmin(np.hypot(*(model.fires.position - model.swarm.position[0]).T) - model.fires.radius))


def test_a_robot_goes_to_the_hotter_fire_and_without_the_layer_to_the_nearer():
    assert at_fire(between_two_fires(SeekHeat())) == 0
    assert at_fire(between_two_fires()) == 1


def test_what_is_not_hotter_than_the_least_is_ignored():
    model = between_two_fires(SeekHeat(least=0.95)).run(1)
    assert model.swarm.layer[0] != 1
    assert between_two_fires(SeekHeat(least=0.5)).run(1).swarm.layer[0] == 1


def test_robots_that_are_hot_or_extinguish_are_left_to_the_layers_below():
    model = between_two_fires(SeekHeat())
    model.swarm.columns["fire"][:] = 0
    assert model.run(1).swarm.layer[0] == 2
    model.swarm.columns["fire"][:] = -1
    model.swarm.columns["hot"][:] = True
    assert model.run(1).swarm.layer[0] != 1


def test_among_others_a_robot_without_radiation_sensors_never_seeks():
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(AGENT9, 5)
    model.add_robots(SEEKER, 5)
    model.control = Subsumption(SeekHeat(), Explore())
    assert (model.run(20).swarm.layer[:5] == 1).all()


def test_without_any_radiation_sensor_it_is_refused_in_one_line_and_without_robots_it_is_not():
    model = SwarmModel(map="openspace_fire", rng=1)
    model.control = Subsumption(SeekHeat(), Explore())
    model.run(1).add_robots(AGENT9, 5)
    with pytest.raises(
        InvalidValueError, match=r"^SeekHeat feels .*; add RadiationSensor\(\) to their sensors"
    ) as caught:
        model.step()
    assert "\n" not in str(caught.value)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.5]))
@settings(max_examples=25)
def test_each_robot_turns_to_the_sensor_that_a_twin_of_plain_python_names(seed, least):
    rng, senses = np.random.default_rng(seed), made_senses(seed)
    bearing = np.radians([[0.0, 60.0, -60.0], [-45.0, 45.0, 5.0], [180.0, 90.0, -90.0]])
    felt = rng.choice([0.0, 0.25, 0.5, 1.0], (ROBOTS, 3))
    senses = replace(senses, radiation=felt, radiation_bearing=bearing)
    command, layer = np.zeros((ROBOTS, 2)), np.full(ROBOTS, -1)
    SeekHeat(least=least).decide(senses, command, layer, 0)
    for i in range(ROBOTS):
        own = bearing[senses.design[i]]
        chosen = max(range(3), key=lambda q: (felt[i, q], -abs(own[q]), -q))
        active = not senses.hot[i] and senses.fire[i] < 0 and felt[i, chosen] > least
        assert (layer[i] == 0) == active
        if active:
            turn = np.sign(command[i, 1] - command[i, 0])
            assert turn == (0 if abs(own[chosen]) < np.radians(10) else np.sign(own[chosen]))


def test_it_is_explained_by_the_temperature_that_is_felt():
    model = between_two_fires(SeekHeat())
    model.watch()
    assert str(model.run(1).explain(model.robots[0])).endswith("SeekHeat: it feels a fire")
    model.watch(columns=(*DECISIONS, "radiation"))
    assert str(model.run(1).explain(model.robots[0])).endswith("it feels a fire of temperature 0.90")


def test_a_recorded_run_is_resumed(tmp_path):
    model = FireFighting(n_robots=4, choice="hottest", spread=0.002, rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(60)
    assert FireFighting.verify(tmp_path / "run.arrow").same
    assert FireFighting.resume(tmp_path / "run.arrow", step=30).run(30).state_hash() == model.state_hash()


@pytest.mark.parametrize("wrong", [{"least": -0.1}, {"least": np.nan}, {"critical_angle_degrees": 200}, {"name": ""}])
def test_wrong_values_are_refused_in_one_line(wrong):
    with pytest.raises(InvalidValueError) as caught:
        SeekHeat(**wrong)
    assert "\n" not in str(caught.value)
