"""Resuming with another parameter where the run itself has added and removed what is in its world."""

import pytest
from mesa import Agent

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.state_hash import written_state_hash


class Counter:
    """A process that counts."""

    def __init__(self, every):
        self.every, self.count = every, 0

    def step(self, model):
        self.count += model.steps % self.every == 0


class Visitor(Agent):
    """An agent of its own."""

    visits = 0


class Doors(SwarmModel):
    """A model that opens and closes doors, and whose robots, fires and visitors come and go."""

    def __init__(self, *, distance=15.0, n_doors=3, gap=8.0, every=2, rng=None):
        super().__init__(map="openspace_fire", rng=rng)
        self.add_robots(AGENT9, 4)
        self.gap, self.opened = gap, 0
        self.doors = [self.add_obstacle(disc((200 + 60 * k, 150), gap)) for k in range(n_doors)]
        self.guest = Visitor(self)
        self.counter = self.add_process(Counter(every))
        self.state["turns"] = 0
        self.control = Subsumption(Avoid(distance=distance), Explore())

    def step(self):
        super().step()
        self.state["turns"] += 1
        self.guest.visits += 1
        self.doors.pop(0).remove()
        self.opened += 1
        self.doors.append(self.add_obstacle(disc((200 + self.steps % 400, 150), self.gap)))
        self.event("opened", value=self.opened)
        if self.steps == 5:
            self.robots[1].remove()
        if self.steps == 10:
            self.add_robots(AGENT9, poses=[(300, 400, 1.0)])
            self.add_fire((600, 200), radius=12)
            Visitor(self)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path, model = tmp_path_factory.mktemp("doors") / "run.arrow", Doors(rng=1)
    with model.record(path, checkpoint_every=8):
        model.run(14)
    return path, model


def seen(model):
    return [(one.unique_id, one.shape.position.tolist()) for one in model.obstacles]


def test_a_model_that_changes_its_own_world_resumes_with_another_parameter(recorded):
    path, model = recorded
    same, changed = Doors.resume(path), Doors.resume(path, distance=25.0)
    assert changed.control.layers[0].distance == 25.0
    assert seen(changed) == seen(same) == seen(model)
    assert [robot.unique_id for robot in changed.robots] == [robot.unique_id for robot in model.robots]
    assert written_state_hash(changed) == written_state_hash(model)
    assert changed.doors == [
        one for one in changed.obstacles if one.unique_id in {door.unique_id for door in same.doors}
    ]
    assert (changed.opened, changed.state["turns"], changed.counter.count) == (14, 14, 7)
    assert len(changed.events) == 14
    assert [fire.radius for fire in changed.fires] == [fire.radius for fire in model.fires]
    assert [agent.visits for agent in changed.agents if isinstance(agent, Visitor)] == [14, 0]


def test_with_the_same_value_of_a_parameter_the_run_is_the_uninterrupted_one(recorded):
    path, model = recorded
    for step in (4, 9, 12):
        again = Doors.resume(path, step=step, distance=15.0)
        while again.steps < 14:
            again.step()
        assert again.state_hash() == model.state_hash()


def test_only_what_the_parameter_is_about_changes(recorded):
    path, _ = recorded
    changed = Doors.resume(path, gap=5.0, every=3)
    assert (changed.gap, changed.counter.every, changed.counter.count) == (5.0, 3, 7)
    changed.step()
    radii = {door.shape.radius for door in changed.doors}
    assert radii == {8.0, 5.0}


def test_a_parameter_that_makes_another_world_is_refused_in_one_line(recorded):
    path, _ = recorded
    with pytest.raises(InvalidValueError, match="makes a world with 9 obstacles instead of the 7 recorded") as caught:
        Doors.resume(path, n_doors=5)
    assert "\n" not in str(caught.value)
