"""The table of bodies: rows that come and go, against a list of what each body is."""

import pickle
from copy import deepcopy
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT_HEAT, SwarmModel, disc, rectangle
from mesa_swarm.world.bodies import BodyTable, Form
from mesa_swarm.world.statics import CARRIED, DRIVEN, FIRE, FIXED, KINDS, LOAD, MODES, OBSTACLE, PUSHED

USUAL = {"mode": FIXED, "kind": OBSTACLE}
WHAT = [USUAL, {"mode": DRIVEN, "kind": OBSTACLE, "fresh": True}, {"mode": PUSHED, "kind": LOAD, "resistance": 0.5}]
changes = st.lists(st.tuples(st.booleans(), st.integers(0, 30), st.integers(0, 3)), max_size=30)


def add(table, unique_id, which):
    """Append a body of one of four kinds; return its handle, and the values that its row has to have."""
    what = [*WHAT, {**USUAL, "kind": FIRE, "temperature": 0.25}][which]
    body, shape = SimpleNamespace(unique_id=unique_id), disc((unique_id, 2.0), 1.0 + which)
    table.add(body, shape, Form.of(shape) if what["mode"] != FIXED else None, **what)
    place = [float(unique_id), 2.0]
    return body, {**what, "position": place, "aim": place, "radius": 1.0 + which}


def check(table, bodies):
    """Assert that a table has the rows of these bodies, and usual values where nothing was given."""
    assert len(table) == len(bodies)
    for row, (body, values) in enumerate(bodies):
        assert table.agents[row] is body
        assert (body.table, body.row) == (table, row)
        for name, usual in BodyTable.columns.items():
            expected = values.get(name, usual[0] if name != "reach" else getattr(table, name)[row])
            assert np.array_equal(getattr(table, name)[row], expected, equal_nan=True), name
    assert table.others == [body for body, values in bodies if values["kind"] != FIRE]
    numbers = dict(enumerate(table.numbers.tolist()))
    assert [table.others[numbers[row]] for row, (_, v) in enumerate(bodies) if v["kind"] != FIRE] == table.others


@given(changes)
def test_rows_follow_bodies_that_come_and_go_and_one_that_is_gone_keeps_what_it_was(steps):
    table, bodies, count = BodyTable(), [], 0
    for comes, which, kind in steps:
        if comes or not bodies:
            count += 1
            bodies.append(add(table, count, kind))
        else:
            body, values = bodies.pop(which % len(bodies))
            table.drop(body)
            assert body.table is not table
            check(body.table, [(body, values)])
        check(table, bodies)


@given(st.permutations(range(6)))
def test_rows_are_brought_into_the_order_of_the_bodies_unique_ids(order):
    table = BodyTable()
    bodies = [add(table, unique_id, unique_id % 4) for unique_id in order]
    table.sort()
    check(table, sorted(bodies, key=lambda pair: pair[0].unique_id))


@pytest.mark.parametrize("duplicate", [deepcopy, lambda table: pickle.loads(pickle.dumps(table))])
def test_a_copy_has_rows_of_its_own(duplicate):
    table = BodyTable()
    for unique_id in range(9):
        add(table, unique_id, unique_id % 4)
    twin = duplicate(table)
    twin.position[:] = -1.0
    add(twin, 9, 0)
    assert len(table) == 9
    assert table.position[:, 0].tolist() == list(range(9))
    assert twin.position[:, 0].tolist() == [-1.0] * 9 + [9.0]


def test_kinds_that_get_other_codes_are_the_same_kinds_by_name():
    table = BodyTable((*KINDS, "door", "puck"))
    for unique_id, kind in enumerate((4, 5, OBSTACLE)):
        table.add(SimpleNamespace(unique_id=unique_id), disc((0, 0), 1), mode=FIXED, kind=kind)
    table.set_kinds((*KINDS, "sheep", "puck", "door"))
    assert [table.kinds[kind] for kind in table.kind] == ["door", "puck", "obstacle"]


def test_all_bodies_of_a_model_are_rows_of_its_table_in_the_order_of_its_bodies():
    model = SwarmModel(map="openspace_fire", rng=1)
    lamp = model.add_body(disc((100, 100), 5), kind="lamp", mode="fixed", temperature=0.5)
    door = model.add_body(rectangle((200, 100), (210, 150)), kind="door")
    load = model.add_load(disc((300, 100), 10), resistance=0.5)
    model.add_fire((400, 500), radius=10)
    mark = model.add_obstacle(disc((300, 300), 10, contact=False))
    table = model.parts["bodies"].table
    assert table.agents == list(model.bodies)
    assert [table.kinds[kind] for kind in table.kind] == [body.kind for body in model.bodies]
    assert [MODES[mode] for mode in table.mode] == [body.mode for body in model.bodies]
    assert table.position.tolist() == [body.position.tolist() for body in model.bodies]
    assert [body.mode for body in (lamp, door, load, mark)] == ["fixed", "driven", "pushed", "fixed"]
    assert table.contact.tolist() == [body is not mark for body in model.bodies]
    assert np.flatnonzero(~np.isnan(table.temperature)).tolist() == [
        row for row, body in enumerate(model.bodies) if body.kind == "fire" or body is lamp
    ]


def test_a_body_is_carried_as_long_as_a_robot_has_it():
    model = SwarmModel(rng=1)
    (robot,) = model.add_robots(AGENT_HEAT, poses=[(200, 200, 0.0)])
    puck = model.add_body(disc((210, 200), 2), kind="puck")
    model.attach(robot, puck)
    assert puck.mode == "carried"
    assert model.parts["bodies"].table.mode[puck.row] == CARRIED
    assert model.release(robot)
    assert puck.mode == "driven"
