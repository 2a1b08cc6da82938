"""Fields of a model: what they conserve, what stops them, what they read, what they refuse."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, Emitter, Field, FieldSensor, RobotDesign, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.maps.map import Map
from mesa_swarm.world.fields import ScalarField

EMPTY = Map(name="empty", bounds=(0, 0, 200, 150))


def world(*shapes, field=None):
    model = SwarmModel(map=EMPTY, rng=1)
    for shape in shapes:
        model.add_obstacle(shape)
    return model, model.add_field(field or Field("trail", cell=5.0, diffusion=2.0))


def random_shapes(seed):
    rng = np.random.default_rng(seed)
    for _ in range(int(rng.integers(0, 5))):
        x, y, size = rng.uniform((0, 0, 0.5), (200, 150, 40))
        yield disc((x, y), size) if rng.random() < 0.5 else rectangle((x, y), (x + size, y + rng.uniform(0.5, 60)))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.floats(0, 500), st.floats(3, 60), st.booleans())
def test_without_evaporation_nothing_is_lost_whatever_is_built_meanwhile(seed, diffusion, cell, walls):
    rng = np.random.default_rng(seed)
    shapes = list(random_shapes(seed))
    model, field = world(*shapes[:2], field=Field("f", cell=cell, diffusion=diffusion, walls=walls))
    field.deposit(rng.uniform((0, 0), (200, 150), (20, 2)), rng.random(20))
    before = field.total
    model.run(2)
    for shape in shapes[2:]:
        model.add_obstacle(shape)
    model.run(2)
    for obstacle in list(model.obstacles):
        obstacle.remove()
    model.run(2)
    assert field.total == pytest.approx(before, rel=1e-12)
    assert field.values.min() >= 0


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_blocked_cells_hold_nothing(seed):
    model, field = world()
    field.values = np.ones(field.values.shape)
    for shape in random_shapes(seed):
        model.add_obstacle(shape)
    model.run(3)
    assert field.values[field.blocked].sum() == 0
    assert field.total == pytest.approx(30 * 40, rel=1e-12)


def test_evaporation_takes_its_share_of_all_in_each_step():
    model, field = world(field=Field("f", diffusion=3.0, evaporation=0.05))
    field.deposit((70, 70), 8.0)
    model.run(40)
    assert field.total == pytest.approx(8.0 * 0.95**40, rel=1e-12)


@pytest.mark.parametrize("diffusion", [0.01, 1.0, 300.0])
def test_the_variance_grows_by_twice_the_diffusion_in_each_step(diffusion):
    model = SwarmModel(map=Map(name="wide", bounds=(0, 0, 2000, 2010)), rng=1)
    field = model.add_field(Field("f", cell=10.0, diffusion=diffusion))
    field.deposit((1005, 1005), 1.0)
    model.run(10)
    x = (np.arange(200) + 0.5) * 10 - 1005
    assert field.values.shape == (201, 200)
    assert (field.values.sum(axis=0) * x**2).sum() == pytest.approx(2 * diffusion * 10, rel=1e-6)


def test_a_wall_of_no_more_than_a_hair_stops_it():
    model, field = world(polygon([(101.3, -1), (101.4, -1), (97.2, 151), (97.1, 151)]))
    field.deposit((20, 75), 1.0)
    model.run(2000)
    right = np.arange(40) * 5 + 2.5 > 103
    assert field.values[:, right].sum() == 0
    assert field.values[:, :19].min() > 0
    assert field.at([(110, 75)]) == [0]


def test_it_does_not_stop_at_loads_and_robots_or_where_walls_are_not_asked_for():
    model = SwarmModel(map=EMPTY, rng=1)
    model.add_load(rectangle((90, 0), (110, 150)), resistance=100.0)
    field = model.add_field(Field("f", diffusion=20.0))
    field.deposit((20, 75), 1.0)
    assert model.run(300).fields["f"].at((180, 75))[0] > 0
    other, through = world(rectangle((90, 0), (110, 150)), field=Field("f", diffusion=20.0, walls=False))
    through.deposit((20, 75), 1.0)
    assert other.run(300).fields["f"].at((180, 75))[0] > 0


def test_what_is_deposited_beside_a_wall_enters_the_nearest_free_cell():
    _, field = world(rectangle((50, 0), (60, 150)))
    field.deposit([(51, 77), (59, 77)], [1.0, 2.0])
    assert field.values[15, 9] == 1
    assert field.values[15, 12] == 2
    assert field.at([(51, 77), (59, 77)]).tolist() == [1, 2]
    assert (field.gradient([(51, 77), (59, 77)]) == 0).all()


def test_a_world_that_is_all_obstacle_loses_nothing():
    model, field = world()
    field.deposit((20, 20), 1.0)
    model.add_obstacle(rectangle((-1, -1), (201, 151)))
    model.run(2)
    assert field.total == pytest.approx(1.0)


@settings(deadline=None, max_examples=60)
@given(st.floats(-20, 220), st.floats(-20, 170), st.integers(0, 100))
def test_readings_are_means_of_cells_and_see_nothing_behind_walls(x, y, seed):
    _, field = world(*random_shapes(seed), rectangle((100, 0), (104, 150)))
    field.values = np.full(field.values.shape, 2.0)
    assert field.at((x, y))[0] == pytest.approx(2)
    np.testing.assert_allclose(field.gradient((x, y)), 0, atol=1e-12)
    left = np.arange(40) * 5 < 100
    field.values = np.where(left, 5.0, 1.0) * np.ones((30, 1))
    if not 95 < x < 105:
        assert field.at((x, y))[0] == pytest.approx(5 if x < 100 else 1)


def test_the_gradient_in_a_centre_is_the_central_difference():
    _, field = world()
    values = field.values = np.random.default_rng(1).random(field.values.shape)
    expected = [(values[7, 10] - values[7, 8]) / 10, (values[8, 9] - values[6, 9]) / 10]
    np.testing.assert_allclose(field.gradient((47.5, 37.5))[0], expected)


def test_readings_are_exact_where_the_field_is_linear():
    _, field = world()
    rows, columns = np.mgrid[0:30, 0:40]
    field.values = 3 + 0.5 * (columns + 0.5) * 5 + 0.25 * (rows + 0.5) * 5
    places = np.random.default_rng(1).uniform((7.5, 7.5), (192.5, 142.5), (100, 2))
    np.testing.assert_allclose(field.at(places), 3 + 0.5 * places[:, 0] + 0.25 * places[:, 1], rtol=1e-13)
    np.testing.assert_allclose(field.gradient(places), np.tile([0.5, 0.25], (100, 1)), rtol=1e-10)


def test_taking_away_gives_no_more_than_there_is_in_the_order_of_asking():
    _, field = world()
    field.deposit((12, 12), 5.0)
    assert field.withdraw([(12, 12), (13, 13), (100, 100), (14, 14)], [2, 2, 1, 2]).tolist() == [2, 2, 0, 1]
    assert field.total == 0


def test_the_peak_is_the_largest_value_ever():
    model, field = world(field=Field("f", evaporation=0.5))
    field.deposit([(12, 12), (12, 12)], 2.0)
    model.run(3)
    field.deposit((100, 100), 1.0)
    assert field.peak == 4


def test_the_view_of_the_values_is_read_only_and_follows_the_field():
    model, field = world()
    view = field.values
    field.deposit((12, 12), 1.0)
    model.run(1)
    assert view.sum() == pytest.approx(1)
    with pytest.raises(ValueError, match="read-only"):
        view[0, 0] = 1


def test_fields_are_part_of_the_fingerprint_and_absent_ones_are_not():
    plain, (model, field) = SwarmModel(map=EMPTY, rng=1), world()
    empty = model.state_hash()
    assert plain.state_hash() != empty
    field.deposit((12, 12), 1.0)
    assert model.state_hash() != empty
    field.withdraw((12, 12), 1.0)
    assert model.state_hash() == empty


@pytest.mark.parametrize("again", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_copies_go_on_alike_and_apart(again):
    model, field = world(disc((80, 80), 20))
    model.add_robots(AGENT3, 5)
    field.deposit((12, 12), 1.0)
    twin = again(model.run(2))
    twin.add_obstacle(disc((30, 30), 10))
    twin.fields["trail"].deposit((12, 12), 1.0)
    assert field.total == pytest.approx(1.0)
    assert not field.blocked[5, 5]
    assert twin.fields["trail"].blocked[5, 5]
    assert again(model).run(5).state_hash() == model.run(5).state_hash()


def test_fields_are_found_by_name_in_the_order_in_which_they_were_added():
    model = SwarmModel(map=EMPTY, rng=1)
    names = ["zebra", "ant", "wolf"]
    for name in names:
        model.add_field(Field(name))
    assert list(model.fields) == names
    assert [field.name for field in model.fields.values()] == names
    assert model.fields.get("bee") is None
    with pytest.raises(UnknownNameError, match=r"unknown field 'ent'; did you mean 'ant'"):
        model.fields["ent"]


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"name": "two words"}, "expected an identifier"),
        ({"name": 3}, "expected one line of text"),
        ({"cell": 0.0}, "cell is 0; expected"),
        ({"cell": float("nan")}, "cell is nan; expected"),
        ({"diffusion": -1.0}, "diffusion is -1; expected"),
        ({"evaporation": 1.5}, "evaporation is 1.5; expected"),
        ({"walls": "no"}, "walls is 'no'; expected True or False"),
        ({"cell": 1e-3}, "use a cell of at least 0.0247"),
        ({"cell": 1e-300}, "use a cell of at least 0.0247"),
        ({"diffusion": 1e6}, "use a diffusion of at most 1.25e"),
    ],
)
def test_a_wrong_declaration_is_refused_in_one_line(given, reason):
    model = SwarmModel(map=EMPTY, rng=1)
    with pytest.raises(SwarmError, match=reason) as caught:
        model.add_field(Field(**{"name": "trail", **given}))
    assert "\n" not in str(caught.value)
    assert not model.fields


@pytest.mark.parametrize("cell", [0.0248, 0.5])
def test_the_cell_and_the_diffusion_that_a_refusal_advises_are_accepted(cell):
    Field("trail", cell=cell).shape((0, 0, 200, 150))
    with pytest.raises(InvalidValueError, match="a cell of at least") as caught:
        Field("trail", cell=cell, diffusion=1e4).sub_steps(cell, cell)
    *_, advised = str(caught.value).split()
    Field("trail", cell=float(advised), diffusion=1e4).sub_steps(float(advised), float(advised))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda field: field.deposit((12, np.nan)),
        lambda field: field.deposit((-1, 12)),
        lambda field: field.deposit([(12, 12), (12, 151)]),
        lambda field: field.deposit((12, 12), -1.0),
        lambda field: field.deposit((12, 12), 1e16),
        lambda field: field.deposit([(12, 12), (13, 13)], [1.0, np.nan]),
        lambda field: field.deposit([(12, 12), (13, 13)], [1.0]),
        lambda field: field.deposit("here"),
        lambda field: field.deposit([(1, 2, 3)]),
        lambda field: field.withdraw((12, 12), -1.0),
        lambda field: field.at((np.inf, 0)),
        lambda field: field.gradient([1, 2, 3]),
        lambda field: setattr(field, "values", np.zeros((3, 3))),
        lambda field: setattr(field, "values", np.full((30, 40), -1.0)),
        lambda field: setattr(field, "values", "many"),
    ],
)
def test_wrong_values_are_refused_in_one_line_and_change_nothing(wrong):
    _, field = world()
    field.deposit((100, 100), 3.0)
    before = field.values.copy()
    with pytest.raises(InvalidValueError, match="expected") as caught:
        wrong(field)
    assert "\n" not in str(caught.value)
    assert (field.values == before).all()


def test_two_fields_of_one_name_and_things_that_are_no_fields_are_refused():
    model, field = world()
    with pytest.raises(InvalidValueError, match="has a field trail already"):
        model.add_field(Field("trail", cell=20.0))
    with pytest.raises(InvalidValueError, match="expected a Field such as"):
        model.add_field("trail")
    assert model.fields["trail"] is field


def test_no_positions_are_no_mistake():
    _, field = world()
    field.deposit([], 1.0)
    assert field.at([]).shape == (0,)
    assert field.gradient(np.empty((0, 2))).shape == (0, 2)


def test_a_field_serves_without_a_model():
    field = ScalarField(Field("gas", cell=1.0, diffusion=0.1), (0, 0, 10, 10))
    field.deposit((5.5, 5.5), 1.0)
    field.advance()
    assert field.total == pytest.approx(1.0)


def test_driven_bodies_and_fires_stop_nothing_and_marks_neither():
    model = SwarmModel(map=EMPTY, rng=1)
    field = model.add_field(Field("f", cell=5.0, diffusion=20.0))
    model.add_body(rectangle((90, 0), (110, 150)), kind="door")
    model.add_obstacle(rectangle((120, 0), (130, 150), contact=False))
    field.deposit((20, 75), 1.0)
    assert not field.blocked.any()
    assert model.run(300).fields["f"].at((180, 75))[0] > 0
    assert model.add_body(disc((20, 20), 10), kind="post", mode="fixed") is not None
    assert field.blocked.any()


def test_walls_are_made_anew_only_when_other_shapes_stand():
    model, field = world(disc((80, 80), 20))
    field.deposit((12, 12), 1.0)
    model.run(1)
    before = field.sides
    body = model.add_body(disc((150, 100), 5), kind="door")
    body.position = (151, 100)
    model.run(2)
    assert field.sides is before
    model.add_obstacle(disc((30, 100), 10))
    assert field.sides is not before


@pytest.mark.parametrize("part", [{"sensors": (FieldSensor(field="trail"),)}, {"actuators": (Emitter(field="trail"),)}])
def test_a_field_that_a_robot_needs_is_removed_only_after_the_robot(part):
    model, field = world()
    robots = model.add_robots(RobotDesign(name="ant", **part), poses=[(50, 50, 0.0), (90, 90, 0.0)])
    with pytest.raises(InvalidValueError, match=r"field trail is used by \w+ trail of 2 robots; remove these robots"):
        model.remove_field("trail")
    assert model.fields["trail"] is field
    model.remove_robots(robots)
    assert model.remove_field("trail") is field
    assert model.run(2).fields.get("trail") is None


def test_a_removed_field_has_its_last_values_and_refuses_all_else():
    model, field = world()
    field.deposit((50, 50), 3.0)
    model.remove_field("trail")
    assert (field.total, field.removed) == (3.0, True)
    for use in (
        lambda: field.deposit((50, 50), 1.0),
        lambda: field.withdraw((50, 50), 1.0),
        lambda: field.at((50, 50)),
        lambda: field.gradient((50, 50)),
        lambda: setattr(field, "values", field.values),
    ):
        with pytest.raises(InvalidValueError, match=r"field trail was removed; expected one of model\.fields"):
            use()


@pytest.mark.parametrize("name", ["tail", "", None, 3])
def test_a_field_that_is_not_there_cannot_be_removed(name):
    model, _ = world()
    with pytest.raises(UnknownNameError, match="unknown field"):
        model.remove_field(name)
    assert list(model.fields) == ["trail"]


def test_a_model_is_the_same_as_before_a_field_was_added_and_removed():
    model, twin = SwarmModel(map=EMPTY, rng=1), SwarmModel(map=EMPTY, rng=1)
    model.add_field(Field("trail")).deposit((50, 50), 1.0)
    model.remove_field("trail")
    assert model.state_hash() == twin.state_hash()
    assert model.add_field(Field("trail")).total == 0
