"""Bodies that radiate heat and do not burn: lamps."""

import copy
import math

import numpy as np
import pytest

from mesa_swarm import RadiationSensor, RobotDesign, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError

SIDES = (0, 90, 180, 270)
FEELER = RobotDesign(
    name="FEELER",
    radius=5.0,
    sensors=tuple(RadiationSensor(bearing_degrees=side, range=60.0, field_of_view_degrees=80.0) for side in SIDES),
)


class Lit(SwarmModel):
    """A room with three lamps of different modes and shapes."""

    def __init__(self, *, engine="compiled", rng=None):
        super().__init__(map="openspace", engine=engine, rng=rng)
        self.still = self.add_body(disc((150, 100), 8), kind="lamp", mode="fixed", temperature=1.0)
        self.add_body(rectangle((60, 140), (140, 150)), kind="stove", mode="fixed", temperature=0.25)
        self.add_body(
            polygon([(40, 60), (60, 60), (50, 80)]), kind="coal", mode="pushed", resistance=0.4, temperature=0.5
        )
        self.torch = self.add_body(disc((100, 60), 4), kind="torch", temperature=0.75)
        self.add_robots(FEELER, poses=[(100, 100, 0.0)])

    def step(self):
        x, y = self.torch.position
        self.torch.position = (x + 1.0, y + 0.5)
        super().step()


def felt(model):
    model.sense()
    return model.swarm.radiation[0].tolist()


def test_a_radiation_sensor_reads_discs_and_polygons_that_radiate_in_its_sector():
    assert felt(Lit(rng=1)) == [1.0, 0.25, 0.5, 0.75]


def test_both_engines_read_the_same_wherever_bodies_go():
    fast, slow = Lit(rng=1), Lit(engine="shapely", rng=1)
    for _ in range(30):
        assert felt(fast) == felt(slow)
        fast.step()
        slow.step()


def test_a_temperature_may_be_changed_between_steps_and_a_cold_body_does_not_radiate():
    model = Lit(rng=1)
    for temperature in (0.5, 0.0, None, 1.0):
        model.still.temperature = temperature
        assert felt(model)[0] == (temperature or 0.0)
        assert model.still.temperature == temperature


def test_a_lamp_is_seen_as_its_kind_and_does_not_burn():
    model = Lit(rng=1).run(20)
    assert (model.still.temperature, len(model.fires), model.processes) == (1.0, 0, ())
    assert {"lamp", "stove", "coal", "torch"} <= set(model.kinds)


def test_a_lamp_counts_in_the_hash_and_goes_on_in_every_way(tmp_path):
    model, dim = Lit(rng=1), Lit(rng=1)
    dim.still.temperature = 0.5
    assert model.state_hash() != dim.state_hash()
    with model.record(tmp_path / "run.arrow", checkpoint_every=5):
        model.run(7)
        model.still.temperature = 0.125
        model.run(6)
    assert Lit.verify(tmp_path / "run.arrow").same
    for twin in (Lit.resume(tmp_path / "run.arrow", step=9).run(4), copy.deepcopy(model)):
        assert [body.temperature for body in twin.bodies] == [body.temperature for body in model.bodies]
        assert twin.state_hash() == model.state_hash()
    assert model.continued(noise=0.1).obstacle_list[4].temperature == 0.125


@pytest.mark.parametrize("wrong", [-0.1, 1.5, math.nan, "hot", True])
def test_another_temperature_is_refused_in_one_line(wrong):
    model = SwarmModel(rng=1)
    with pytest.raises(InvalidValueError, match=r"^temperature is ") as caught:
        model.add_body(disc((100, 100), 5), temperature=wrong)
    assert "\n" not in str(caught.value)
    assert len(model.bodies) == 4
    with pytest.raises(InvalidValueError, match=r"^temperature is "):
        model.bodies[0].temperature = wrong


def test_a_mark_on_the_ground_does_not_radiate():
    with pytest.raises(InvalidValueError, match=r"^temperature was given for a mark"):
        SwarmModel(rng=1).add_body(disc((100, 100), 5, contact=False), mode="fixed", temperature=0.5)


def test_neither_a_mark_nor_a_body_that_is_gone_is_heated_later():
    model = SwarmModel(rng=1)
    mark, gone = (model.add_obstacle(disc((100, 100), 5, contact=contact)) for contact in (False, True))
    gone.remove()
    with pytest.raises(InvalidValueError, match=r"^temperature was given for a mark"):
        mark.temperature = 0.5
    with pytest.raises(RemovedRobotError):
        gone.temperature = 0.5


def test_the_hash_of_lamps_at_rest_does_not_depend_on_their_order():
    places = {0.5: (100, 100), 0.25: (200, 100)}

    def lit(order, heat):
        model = SwarmModel(rng=1)
        for key in order:
            model.add_body(disc(places[key], 5), mode="fixed", temperature=heat[key])
        return model.state_hash()

    same, other = {0.5: 0.5, 0.25: 0.25}, {0.5: 0.25, 0.25: 0.5}
    assert lit((0.5, 0.25), same) == lit((0.25, 0.5), same) != lit((0.5, 0.25), other)


def test_what_a_robot_carries_does_not_radiate():
    model = SwarmModel(map="openspace", rng=1)
    (robot,) = model.add_robots(FEELER, poses=[(100, 100, 0.0)])
    torch = model.add_body(disc((130, 100), 2), temperature=1.0)
    model.sense()
    assert robot.radiation[0] == 1.0
    model.attach(robot, torch)
    model.sense()
    assert np.count_nonzero(robot.radiation) == 0
