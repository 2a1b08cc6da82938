"""Teams: each design or named group of robots has its own arbiter, and no layer decides on robots of another."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, HolonomicDrive, OmniDrive, SwarmModel, all_round, omni_speeds
from mesa_swarm.base.errors import InvalidValueError, LearningError
from mesa_swarm.control import (
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Gather,
    HeadOn,
    MatchVelocity,
    Perimeter,
    Separate,
    Subsumption,
    Team,
    VectorSum,
    behaviour,
)
from mesa_swarm.dashboard.page.series import layer_names
from mesa_swarm.learning.policy import PolicyLayer
from mesa_swarm.learning.q_learning import QLearning, QPolicy
from mesa_swarm.recording import verify
from mesa_swarm.recording.provenance import scenery_of
from support.scenes import ahead, empty

GLIDER = all_round(12, name="glider", drive=HolonomicDrive())
OMNI = replace(AGENT3, name="omni", drive=OmniDrive())
ROAM = Subsumption(Avoid(distance=15), Explore(turn_interval=10))
FLOCK = VectorSum(Separate(), Cohere(), Cruise())


@behaviour
def spin(me):
    """Turn on the spot with three wheels."""
    return omni_speeds(0.0, 0.0, 0.1, me.radius)


def mixed(**options):
    """Return a world of two groups of one design and robots of two other designs."""
    model = empty(rng=3, **options)
    model.add_robots(AGENT9, 4, group="scouts")
    model.add_robots(AGENT9, 4, group="workers")
    model.add_robots(GLIDER, 3)
    model.add_robots(OMNI, 2)
    model.control = {"scouts": ROAM, "workers": Subsumption(Avoid(distance=30), Explore(speed=0.5)), GLIDER: FLOCK,
                     OMNI: Subsumption(spin)}  # fmt: skip
    return model


def two(first, second, **options):
    """Return a world in which the robots of group a and those of group b, one after the other, have their arbiters."""
    model = empty(rng=3, **options)
    for k in range(8):
        model.add_robots(AGENT9, 1, group="ab"[k % 2])
    model.control = {"a": first, "b": second}
    return model


def test_each_robot_is_driven_by_the_arbiter_of_its_group_or_of_its_design():
    model = two(Subsumption(ahead(speed=0.5)), Subsumption(ahead))
    model.run(1)
    assert model.swarm.command[:, 0].tolist() == [0.5, 1.0] * 4
    assert model.swarm.layer.tolist() == [0, 1] * 4
    assert [robot.group for robot in model.robots] == ["a", "b"] * 4
    model.control = {AGENT9: Subsumption(ahead), "b": Subsumption(ahead(speed=0.25))}
    model.run(1)
    assert model.swarm.command[:, 0].tolist() == [1.0, 0.25] * 4


@pytest.mark.parametrize(
    "arbiter",
    [
        Subsumption(Gather(), Avoid(), Explore()),
        Subsumption(Avoid(), MatchVelocity(), Explore()),
        Subsumption(Perimeter(), Avoid(), Explore()),
        VectorSum(Avoid(), Gather(), Explore(), weights=[2, 1, 0.5]),
    ],
    ids=["gather", "match", "perimeter", "sum"],
)
def test_equal_arbiters_for_all_groups_move_robots_as_one_arbiter_does(arbiter):
    team = two(arbiter, arbiter)
    alone = two(arbiter, arbiter)
    alone.control = arbiter
    for model in (team, alone):
        model.run(150)
    assert team.swarm.position.tolist() == alone.swarm.position.tolist()
    count = len(arbiter.layers)
    assert np.where(team.swarm.layer >= 0, team.swarm.layer % count, -1).tolist() == alone.swarm.layer.tolist()


def test_a_layer_that_ignores_what_others_drive_still_drives_only_its_own_robots():
    class Bully:
        """A layer that takes all robots."""

        name = "Bully"

        def bind(self, swarm, prefix, rng):
            """Remember nothing."""

        def decide(self, senses, command, layer, index):
            """Take all."""
            command[:], layer[:] = -1.0, index

    model = two(Subsumption(Bully()), Subsumption(ahead))
    model.run(1)
    assert model.swarm.command[:, 0].tolist() == [-1.0, 1.0] * 4
    model = two(VectorSum(Bully()), VectorSum(ahead))
    model.run(1)
    assert model.swarm.command[:, 0].tolist() == [-1.0, 1.0] * 4


def test_what_an_arbiter_draws_does_not_depend_on_the_other_one():
    one, other = two(ROAM, Subsumption(ahead)), two(ROAM, Subsumption(ahead, Explore(turn_interval=3), HeadOn()))
    for model in (one, other):
        model.run(100)
    assert one.swarm.position.tolist() == other.swarm.position.tolist()


@pytest.mark.slow
def test_robots_of_several_drives_share_a_world():
    model = mixed()
    model.run(30)
    assert model.swarm.command.shape == (13, 3)
    assert (model.swarm.command[:11, 2] == 0).all()
    assert model.robots[12].command == pytest.approx([0.5] * 3)
    assert set(model.swarm.layer[8:11].tolist()) <= {4, 5, 6}


def test_control_is_a_mapping_of_the_same_keys_to_copies_that_belong_to_the_model():
    arbiter = Subsumption(QLearning())
    model = empty()
    model.add_robots(AGENT9, 2)
    model.add_robots(AGENT9, 2, group="old hands")
    model.control = {AGENT9: arbiter, "old hands": ROAM}
    assert isinstance(model.control, Team)
    assert list(model.control) == [AGENT9, "old hands"]
    assert model.control[AGENT9] is not arbiter
    model.run(50)
    lessons = model.swarm.columns["0.AGENT9.QLearning.lessons"]
    assert lessons.tolist() == [49, 49, 0, 0]
    model.control = {**model.control, "old hands": None}
    assert model.swarm.columns["0.AGENT9.QLearning.lessons"].tolist() == [49, 49, 0, 0]


def test_robots_whose_arbiter_is_none_stand_still():
    model = two(None, Subsumption(ahead))
    before = model.swarm.position.copy()
    model.run(3)
    assert (model.swarm.position[::2] == before[::2]).all()
    assert model.swarm.layer.tolist() == [-1, 0] * 4


def test_a_robot_that_moves_to_another_group_is_driven_by_its_arbiter():
    model = two(Subsumption(ahead(speed=0.5)), Subsumption(ahead))
    model.run(1)
    before = model.state_hash()
    model.robots[0].group = "b"
    assert model.state_hash() != before
    model.run(1)
    assert model.swarm.command[:2, 0].tolist() == [1.0, 1.0]
    with pytest.raises(InvalidValueError, match="robots of the design AGENT9 in the group c have no arbiter"):
        model.robots[0].group = "c"
    with pytest.raises(InvalidValueError, match="AGENT9 have no arbiter; control has one for the group a, the group b"):
        model.robots[0].group = ""
    assert model.robots[0].group == "b"


def test_robots_may_come_and_go():
    model = two(Subsumption(ahead(speed=0.5)), Subsumption(ahead))
    model.run(2)
    model.remove_robots(list(model.robots)[:3])
    model.add_robots(AGENT9, 1, group="a")
    model.run(1)
    assert model.swarm.command[:, 0].tolist() == [1.0, 0.5, 1.0, 0.5, 1.0, 0.5]


def test_the_robots_that_a_control_is_not_for_are_not_added():
    model = two(ROAM, ROAM)
    before = model.state_hash()
    with pytest.raises(InvalidValueError, match="robots of the design glider have no arbiter"):
        model.add_robots(GLIDER, 1)
    with pytest.raises(InvalidValueError, match=r"Avoid commands .* the design glider"):
        model.add_robots(GLIDER, 1, group="a")
    with pytest.raises(InvalidValueError, match=r"^group is 'a\\nb'"):
        model.add_robots(AGENT9, 1, group="a\nb")
    assert model.state_hash() == before
    assert model.swarm.groups == ("a", "b")


REFUSED = {
    "nothing": ({}, "control has no arbiters"),
    "a number": ({3: ROAM}, "control has the key 3"),
    "an empty name": ({"": ROAM}, "group of control is ''"),
    "a layer": ({"a": Explore(), "b": ROAM}, "control of a is Explore"),
    "a class": ({"a": Subsumption, "b": ROAM}, "control of a is <class"),
    "a team": ({"a": Team({"b": ROAM}), "b": ROAM}, "control of a is <Team of b>"),
    "no arbiter for some": ({"a": ROAM}, "robots of the design AGENT9 in the group b have no arbiter"),
    "layers of another drive": ({"a": ROAM, "b": FLOCK}, "Separate commands speeds forward"),
    "too many layers": ({"a": Subsumption(*[Explore()] * 40), "b": Subsumption(*[Explore()] * 40)}, "80 layers in all"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_team_is_refused_in_one_line_and_nothing_is_changed(name):
    control, words = REFUSED[name]
    model = two(ROAM, ROAM)
    before, team = model.run(2).state_hash(), model.control
    with pytest.raises(InvalidValueError) as caught:
        model.control = control
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 300
    assert model.control is team
    assert model.state_hash() == before


def test_names_of_layers_begin_with_the_group_where_several_arbiters_have_them():
    model = mixed()
    names = ("scouts: Avoid", "scouts: Explore", "workers: Avoid", "workers: Explore", "Separate", "Cohere", "Cruise")
    assert model.control.names == (*names, "spin")
    assert scenery_of(model)["layers"] == list(model.control.names) == list(layer_names(model))
    model.watch()
    model.run(1)
    shown = {model.explain(robot).layer for robot in model.robots}
    assert shown <= set(model.control.names)
    assert {"scouts: Explore", "workers: Explore", "spin"} <= shown
    assert "its share of the sum" in model.explain(model.robots[8]).reason


def test_designs_of_one_name_are_numbered():
    team = Team({replace(AGENT9, radius=4.0): ROAM, AGENT9: ROAM})
    assert team.names == ("AGENT9 1: Avoid", "AGENT9 1: Explore", "AGENT9 2: Avoid", "AGENT9 2: Explore")


def test_a_team_is_recorded_resumed_and_verified(tmp_path):
    model = empty(rng=3)
    model.add_robots(AGENT9, 4, group="scouts")
    model.add_robots(AGENT9, 4)
    model.add_robots(GLIDER, 3)
    model.control = {"scouts": ROAM, AGENT9: Subsumption(Explore(turn_interval=5)), GLIDER: FLOCK}
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        model.run(25)
        again = SwarmModel.resume(tmp_path / "run.arrow")
        assert list(again.control) == list(model.control)
        model.robots[0].group = ""
        model.run(10)
    assert again.swarm.groups == ("scouts",)
    assert [robot.group for robot in again.robots] == ["scouts"] * 4 + [""] * 7
    assert SwarmModel.resume(tmp_path / "run.arrow").state_hash() == model.state_hash()
    assert verify(tmp_path / "run.arrow", SwarmModel).same


def test_a_team_that_its_class_makes_of_rules_is_resumed(tmp_path):
    model = Rules(rng=2)
    with model.record(tmp_path / "run.arrow", checkpoint_every=5):
        model.run(12)
    assert Rules.resume(tmp_path / "run.arrow").state_hash() == model.state_hash()
    assert verify(tmp_path / "run.arrow", Rules).same


class Rules(SwarmModel):
    """A model of a team that is driven by custom rules."""

    def __init__(self, *, rng: int | None = None) -> None:
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 3, group="fast")
        self.add_robots(OMNI, 3)
        self.control = {"fast": Subsumption(ahead), OMNI: Subsumption(spin)}


def test_a_policy_drives_its_group_beside_robots_of_other_sensors():
    policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    model = empty(rng=3)
    model.add_robots(AGENT9, 2)
    model.add_robots(AGENT3, 2, group="trained")
    model.control = {"trained": Subsumption(PolicyLayer(policy=policy, explore=True)), AGENT9: ROAM}
    model.run(20)
    assert model.swarm.layer[2:].tolist() == [0, 0]
    with pytest.raises(LearningError, match="trained with 3 proximity sensors and AGENT9 has 9"):
        model.control = {"trained": ROAM, AGENT9: Subsumption(PolicyLayer(policy=policy, explore=True))}


def test_a_team_is_copied_and_used_in_other_models():
    team = Team({"a": ROAM, "b": Subsumption(ahead)})
    one, other = two(ROAM, ROAM), two(ROAM, ROAM)
    one.control, other.control = team, team
    one.run(20)
    other.run(20)
    assert one.state_hash() == other.state_hash()
    assert repr(one.control) == "<Team of a, b>"
