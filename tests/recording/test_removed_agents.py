"""Models that still refer to what they have removed: it is stored and restored as removed."""

import pytest
from mesa import Agent

from mesa_swarm import AGENT9, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import RemovedRobotError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.state_hash import written_state_hash
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.checkpoint import checkpoint_of, restore


class Sheep(Agent):
    """A plain Mesa agent."""

    def __init__(self, model, weight):
        super().__init__(model)
        self.weight = weight


class Shepherd(SwarmModel):
    """A model whose lists hold everything that was ever there."""

    def __init__(self, *, distance=15.0, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 4)
        self.control = Subsumption(Avoid(distance=distance), Explore())
        self.pucks = [self.add_body(disc((100 * k, 100), 5), kind="puck") for k in (1, 2, 3)]
        self.crates = [self.add_body(disc((100 * k, 200), 5), mode="pushed", resistance=0.5) for k in (1, 2)]
        self.walls = [self.add_body(rectangle((100 * k, 300), (100 * k + 20, 310)), mode="fixed") for k in (1, 2)]
        self.fire = self.add_fire((600, 100), radius=12)
        self.sheep = [Sheep(self, weight) for weight in (10, 20)]
        self.first, self.scout = self.pucks[0], self.robots[0]
        self.pucks[0].owner, self.sheep[0].friend = self.scout, self.sheep[0]
        self.state["taken"] = 0

    def step(self):
        super().step()
        if self.steps == 4:
            for gone in (self.pucks[0], self.crates[0], self.walls[0], self.fire, self.sheep[0], self.scout):
                gone.remove()
            self.state["taken"] += 1


@pytest.fixture
def model():
    return Shepherd(rng=2).run(6)


def check(again, model):
    assert written_state_hash(again) == written_state_hash(model)
    assert again.pucks[0] is again.first
    assert again.pucks[0].owner is again.scout
    assert again.sheep[0].friend is again.sheep[0]
    assert again.sheep[0] not in again.agents
    assert [one.weight for one in again.sheep] == [10, 20]
    for mine, other in zip(again.walls + again.crates, model.walls + model.crates, strict=True):
        assert mine.position.tolist() == other.position.tolist()
        assert mine.unique_id == other.unique_id
    assert again.crates[0].resistance == 0.5
    assert [puck.kind for puck in again.pucks] == ["puck"] * 3
    for gone in (again.pucks[0], again.crates[0], again.walls[0], again.fire, again.scout):
        assert repr(gone).endswith("removed>")
        with pytest.raises(RemovedRobotError):
            gone.remove()
    for gone in (again.pucks[0], again.scout, again.fire):
        with pytest.raises(RemovedRobotError):
            _ = gone.position
    assert again.pucks[1].position.tolist() == [200, 100]


def test_what_was_removed_is_restored_as_removed(model):
    check(restore(Shepherd(rng=2), checkpoint_of(model)), model)


def test_such_a_run_is_recorded_with_checkpoints_verified_and_resumed(tmp_path):
    model = Shepherd(rng=2)
    with model.record(tmp_path / "run.arrow", checkpoint_every=5) as recorder:
        model.run(12)
    assert recorder.checkpoints == (0, 5, 10)
    assert verify(Recording(tmp_path / "run.arrow"), Shepherd).same
    check(Shepherd.resume(tmp_path / "run.arrow"), model)
    check(Shepherd.resume(tmp_path / "run.arrow", distance=16.0), model)


def test_a_removed_body_stays_one_object_in_the_next_checkpoint(model):
    again = restore(Shepherd(rng=2), checkpoint_of(model))
    check(restore(Shepherd(rng=2), checkpoint_of(again)), model)
    assert again.run(3).state_hash() == model.run(3).state_hash()


class Remembering(SwarmModel):
    """Keeps what it has removed: a lamp, a fire, and a puck that a robot carried."""

    def __init__(self, *, rng=None, distance=15.0, kind="puck"):
        super().__init__(map="openspace", rng=rng)
        self.kept = [
            self.add_body(disc((100, 100), 5), kind="lamp", mode="fixed", temperature=0.9),
            self.add_fire((400, 400), radius=12),
            self.add_body(disc((300, 100), 5), kind=kind),
        ]
        (robot,) = self.add_robots(AGENT9, poses=[(280, 100, 0.0)])
        self.attach(robot, self.kept[2])
        self.run(2)
        for body in self.kept:
            body.remove()

    def seen(self):
        """Return what handles of removed bodies have."""
        lamp, fire, puck = self.kept
        place = fire.table.position[fire.row].tolist(), float(fire.table.radius[fire.row])
        return (
            lamp.temperature,
            lamp.position.tolist(),
            place,
            puck.mode,
            puck.carrier,
            puck.table.pose_of(puck.row)[:2],
        )


def test_handles_of_removed_bodies_have_what_they_had_after_a_resume():
    model = Remembering(rng=1)
    assert model.seen() == (0.9, [100.0, 100.0], ([400.0, 400.0], 12.0), "driven", None, (280.0, 100.0))
    again = restore(Remembering(rng=1), checkpoint_of(model.run(2)))
    assert again.seen() == model.seen()
    assert model.continued(distance=10.0).seen() == model.seen()
