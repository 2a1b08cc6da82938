"""Bodies of any kind: how they are added, named, asked to move, seen, and removed."""

import copy
import math

import mesa
import numpy as np
import pytest

from mesa_swarm import AGENT9, Gripper, NeighbourSensor, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import (
    InvalidValueError,
    RemovedRobotError,
    SwarmError,
    UnknownKindWarning,
    UnknownNameError,
)
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.world.bodies import Load, Obstacle
from support.scenes import empty


class Sheep(mesa.Agent):
    """A plain Mesa agent."""

    def __init__(self, model, position):
        super().__init__(model)
        self.position = position


@pytest.fixture
def model():
    return SwarmModel(rng=1)


def test_a_body_is_seen_with_the_code_of_its_kind(model):
    (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    model.add_body(disc((117, 100), 5), kind="wolf")
    model.sense()
    assert robot.distance[0] == pytest.approx(7.0)
    assert robot.kind[0] == model.kind_code("wolf") == 4
    assert model.kinds == ("obstacle", "robot", "fire", "load", "wolf")


def test_kinds_are_numbered_in_the_order_in_which_they_came_and_codes_stay(model):
    for kind in ("wolf", "door", "wolf"):
        model.add_body(disc((100, 100), 5), kind=kind)
    model.bodies[-1].remove()
    model.bodies[-2].remove()
    assert [model.kind_code(kind) for kind in ("wolf", "door")] == [4, 5]


def test_fixed_and_pushed_bodies_are_obstacles_and_loads_with_a_kind(model):
    post = model.add_body(disc((100, 100), 5), kind="post", mode="fixed")
    cart = model.add_body(disc((200, 100), 5), kind="cart", mode="pushed", resistance=0.5)
    mark = model.add_body(disc((300, 100), 5, contact=False), kind="nest", mode="fixed")
    assert type(post) is Obstacle
    assert type(cart) is Load
    assert [body.kind for body in (post, cart, mark)] == ["post", "cart", "nest"]
    (robot,) = model.add_robots(AGENT9, poses=[(186, 100, 0.0)])
    model.sense()
    assert model.kinds[robot.kind[0]] == "cart"
    assert (post.mode, cart.mode, post.blocked) == ("fixed", "pushed", False)
    model.swarm.columns["command"][:] = 1.0
    model.run(15)
    assert cart.position[0] > 200


def test_the_lists_of_a_model_hold_each_body_once(model):
    before = len(model.obstacles)
    door = model.add_body(rectangle((100, 100), (110, 150)), kind="door")
    load = model.add_load(disc((200, 100), 5), resistance=1.0)
    assert model.bodies[-2:] == [door, load]
    assert list(model.obstacles)[before:] == [load]
    assert list(model.loads) == [load]
    assert model.displaced == [door, load]
    assert door in model.agents


def test_before_the_first_step_a_body_is_placed_at_once_and_later_in_the_next_step(model):
    door = model.add_body(rectangle((100, 100), (110, 150)), kind="door")
    door.move_to((300, 200, math.pi / 2))
    assert door.shape.bounds == pytest.approx((275, 195, 325, 205))
    model.step()
    door.position = (301, 200)
    assert door.position.tolist() == [300, 200]
    model.step()
    assert door.position.tolist() == [301, 200]
    assert door.heading == math.pi / 2


def test_a_position_and_a_heading_that_are_set_one_after_the_other_hold_both(model):
    door = model.add_body(rectangle((100, 100), (110, 150)), kind="door")
    model.step()
    door.heading = 0.1
    door.position = (106, 126)
    model.step()
    assert door.pose == (106, 126, 0.1)


def test_a_body_follows_a_plain_mesa_agent_and_goes_with_it(model):
    (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    sheep = Sheep(model, (130.0, 100.0))
    body = model.add_body(disc((0, 0), 5), kind="sheep", agent=sheep)
    assert body.position.tolist() == [130, 100]
    sheep.position = (118.0, 100.0)
    model.step()
    model.sense()
    assert robot.distance[0] == pytest.approx(8.0)
    assert body.agent is sheep
    sheep.remove()
    model.step()
    assert body.space is None
    model.sense()
    assert robot.distance[0] == -1


def test_an_agent_off_the_map_stops_the_step_before_anything_has_changed(model):
    sheep = Sheep(model, (130.0, 100.0))
    model.add_robots(AGENT9, 3)
    model.add_body(disc((0, 0), 5), kind="sheep", agent=sheep)
    model.run(2)
    before = model.state_hash()
    for place in ((math.nan, 1.0), (1e9, 0.0), "here", (1, 2, 3)):
        sheep.position = place
        with pytest.raises(InvalidValueError, match="agent"):
            model.step()
        assert model.state_hash() == before


def test_many_bodies_move_at_once(model):
    flock = [model.add_body(disc((50 + 20 * k, 100), 5), kind="sheep") for k in range(30)]
    model.step()
    poses = np.array([body.pose for body in flock]) + np.array([0.5, 1.0, 0.1])
    model.move_bodies(flock, poses)
    model.step()
    assert np.array([body.pose for body in flock]) == pytest.approx(poses)
    assert model.movers.position == pytest.approx(poses[:, :2])


def test_a_removed_body_is_gone_for_all_and_its_handle_is_useless(model):
    (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    first, second = (model.add_body(disc((x, 100), 5), kind="ball") for x in (115, 300))
    model.step()
    first.remove()
    model.sense()
    assert robot.distance[0] == -1
    second.position = (302, 100)
    model.step()
    assert second.position.tolist() == [302, 100]
    for read in (lambda: first.position, lambda: first.blocked, first.remove, lambda: first.shape):
        with pytest.raises(RemovedRobotError):
            read()
    assert "removed" in repr(first)
    assert "a ball" in repr(second)


def test_the_arena_knows_where_bodies_are(model):
    body = model.add_body(disc((115, 100), 5), kind="ball")
    model.step()
    body.position = (120, 100)
    model.step()
    assert [120, 100] in model.space.agent_positions.tolist()
    assert body.pos.tolist() == [120, 100]


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"shape": "disc"}, "body"),
        ({"shape": disc((100, 100), 5, contact=False)}, "mark"),
        ({"kind": "robot"}, "kind"),
        ({"kind": "two words"}, "kind"),
        ({"kind": 4}, "kind"),
        ({"mode": "flying"}, "mode"),
        (
            {"mode": "pushed"},
            r"^resistance was not given for a pushed body; expected how many .* such as resistance=0.5$",
        ),
        ({"resistance": 1.0}, "resistance"),
        ({"mode": "fixed", "agent": object()}, "agent"),
        ({"agent": object()}, "agent"),
        ({"shape": disc((-100, 100), 5)}, "position"),
        ({"shape": disc((400, 300), 5)}, "overlaps a load"),
    ],
)
def test_a_wrong_body_is_refused_in_one_line_and_nothing_is_added(model, given, reason):
    model.add_load(disc((400, 300), 5), resistance=1.0)
    count, kinds = len(model.agents), model.kinds
    with pytest.raises(SwarmError, match=reason) as caught:
        model.add_body(**{"shape": disc((100, 100), 5), **given})
    assert "\n" not in str(caught.value)
    assert (len(model.agents), len(model.bodies), model.kinds) == (count, count, kinds)


@pytest.mark.parametrize("pose", [(1, 2), (math.nan, 1, 0), (1, 1, math.inf), (-5, 10, 0), "pose", None])
def test_a_wrong_pose_is_refused_and_the_body_stays(model, pose):
    body = model.add_body(disc((100, 100), 5))
    model.step()
    with pytest.raises(InvalidValueError):
        body.move_to(pose)
    with pytest.raises(InvalidValueError):
        model.move_bodies([body], [pose])
    with pytest.raises(InvalidValueError):
        body.position = pose if pose is None or pose[:1] == "p" else (math.nan, 1)
    with pytest.raises(InvalidValueError):
        body.heading = math.nan
    model.step()
    assert body.pose == (100, 100, 0)


def test_a_new_body_is_not_placed_on_a_load(model):
    model.add_load(disc((400, 300), 5), resistance=1.0)
    body = model.add_body(disc((100, 100), 5))
    with pytest.raises(InvalidValueError, match="load"):
        body.position = (403, 300)
    assert body.position.tolist() == [100, 100]


def test_bodies_of_another_model_are_not_moved(model):
    body = SwarmModel(rng=1).add_body(disc((100, 100), 5))
    with pytest.raises(InvalidValueError, match="bodies"):
        model.move_bodies([body], [(1, 1, 0)])


def test_an_unknown_kind_has_no_code(model):
    with pytest.raises(UnknownNameError, match="known: obstacle"):
        model.kind_code("dor")


def test_the_poses_of_driven_bodies_are_part_of_the_state_hash():
    hashes = set()
    for x in (100, 101):
        model = SwarmModel(rng=1)
        model.add_body(disc((x, 100), 5))
        hashes.add(model.state_hash())
    assert len(hashes) == 2


def test_an_agent_that_is_removed_or_of_another_model_or_a_robot_or_body_moves_no_body(model):
    (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    gone = Sheep(model, (300, 300))
    gone.remove()
    other = model.add_body(disc((200, 200), 5))
    before = list(model.bodies)
    for agent in (gone, Sheep(SwarmModel(rng=1), (300, 300)), robot, other):
        with pytest.raises(InvalidValueError, match="expected an agent of this model"):
            model.add_body(disc((400, 400), 5), kind="sheep", agent=agent)
    assert list(model.bodies) == before


def test_move_bodies_refuses_a_single_body_in_one_line(model):
    body = model.add_body(disc((100, 100), 5))
    with pytest.raises(InvalidValueError, match="poses has shape"):
        model.move_bodies(body, (110, 100, 0.0))
    assert body.position.tolist() == [100, 100]


# ---- kinds


def test_a_kind_is_declared_before_there_is_a_body_of_it():
    model = empty()
    assert model.add_kind("wolf") == model.kind_code("wolf") == 4
    assert model.add_kind("wolf") == 4
    assert model.add_kind("robot") == 1
    body = model.add_body(disc((100, 100), 5), kind="wolf")
    assert model.kinds == ("obstacle", "robot", "fire", "load", "wolf")
    assert body.kind == "wolf"


@pytest.mark.parametrize("odd", ["", "two words", 5, None, "1st"])
def test_a_kind_that_is_not_a_name_is_refused(odd):
    with pytest.raises(InvalidValueError, match="expected a name such as"):
        empty().add_kind(odd)


@pytest.mark.parametrize("part", [Gripper(kinds=("pukc",)), NeighbourSensor(kind="pukc", k=1)])
def test_a_misspelt_kind_is_refused_where_robots_are_added_and_at_their_first_step(part):
    design = RobotDesign(actuators=(part,)) if isinstance(part, Gripper) else RobotDesign(sensors=(part,))
    model = empty()
    model.add_robots(design, 1)
    model.add_body(disc((100, 100), 5), kind="puck")
    with pytest.raises(UnknownNameError, match="unknown kind 'pukc'; did you mean 'puck'"):
        model.add_robots(design, 1)
    with pytest.raises(UnknownNameError, match=r"unknown kind 'pukc'; did you mean 'puck'\?.*model.add_kind\('pukc'\)"):
        model.step()
    assert model.completed == 0
    model.add_kind("pukc")
    model.step()


@pytest.mark.parametrize("part", [Gripper(kinds=("puck",)), NeighbourSensor(kind="puck", k=1)])
def test_bodies_of_a_kind_may_be_added_after_the_robots_with_a_part_for_it(part):
    design = RobotDesign(actuators=(part,)) if isinstance(part, Gripper) else RobotDesign(sensors=(part,))
    model = empty()
    model.add_robots(design, 1)
    model.add_body(disc((100, 100), 5), kind="puck")
    model.step()


def test_of_a_kind_without_any_body_there_is_a_warning_until_it_is_declared():
    model = empty()
    model.add_robots(RobotDesign(actuators=(Gripper(kinds=("puck",)),)), 1)
    with pytest.warns(UnknownKindWarning, match=r"a Gripper is for the kind 'puck'.*model.add_kind\('puck'\)"):
        model.step()
    model.add_kind("puck")
    model.add_robots(RobotDesign(actuators=(Gripper(kinds=("puck",)),)), 1)
    model.step()


def test_a_declared_kind_is_copied_stored_and_goes_on(tmp_path):
    model = SwarmModel(rng=1)
    with model.record(tmp_path / "run.arrow", rerun=False):
        model.add_kind("wolf")
        model.add_body(disc((100, 100), 5), kind="door")
        model.run(2)
    assert copy.deepcopy(model).kinds == model.kinds == ("obstacle", "robot", "fire", "load", "wolf", "door")
    assert restore(SwarmModel(rng=1), checkpoint_of(model)).kinds == model.kinds


def test_a_class_that_adds_obstacles_in_its_own_way_is_asked_for_those_of_its_map():
    class Counted(SwarmModel):
        def add_obstacle(self, shape):
            shapes.append(shape)
            return super().add_obstacle(shape)

    shapes = []
    model, plain = Counted(map="original", rng=1), SwarmModel(map="original", rng=1)
    assert shapes == list(model.map.obstacles)
    assert [body.shape for body in model.bodies] == [body.shape for body in plain.bodies]
    assert [body.unique_id for body in model.bodies] == [body.unique_id for body in plain.bodies]
