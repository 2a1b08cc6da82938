"""Plain Mesa agents of a user's model in checkpoints: matched by unique_id and class, made and removed again."""

import numpy as np
import pytest
from mesa import Agent
from mesa.agent import AgentSet
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import AGENT9, Recording, SwarmModel, disc
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from support.scenes import blind


class Sheep(Agent):
    """An agent with a place, a friend, and a parent."""

    def __init__(self, model, place, parent=None):
        super().__init__(model)
        self.place = np.array(place, float)
        self.parent, self.age = parent, 0

    def step(self):
        self.age += 1
        self.place += self.model.streams["sheep"].uniform(-1, 1, 2)


class Wolf(ContinuousSpaceAgent):
    """An agent in the model's space."""

    def __init__(self, model, position):
        super().__init__(model.space, model)
        self.position = position


class Flock(SwarmModel):
    """A model whose sheep are born and die."""

    def __init__(self, *, n_sheep=3, rng=None):
        super().__init__(rng=rng)
        self.add_robots(blind(), 2)
        self.sheep = AgentSet([Sheep(self, (100, 100 + 10 * k)) for k in range(n_sheep)], random=self.random)
        self.wolf = Wolf(self, (50.0, 60.0))

    def step(self):
        super().step()
        for sheep in self.sheep:
            sheep.step()
        self.wolf.position += (1.0, 0.5)
        if self.steps % 4 == 0:
            self.sheep.add(Sheep(self, (200, 200), parent=next(iter(self.sheep))))
        if self.steps % 6 == 0:
            eldest = next(iter(self.sheep))
            self.sheep.discard(eldest)
            eldest.remove()


class Prowler(Agent):
    """An agent that moves by changing its arrays and lists in place."""

    def __init__(self, model):
        super().__init__(model)
        self.position, self.seen, self.known = np.array([400.0, 300.0]), [], {}

    def step(self):
        self.position += 0.4


class Hunt(SwarmModel):
    """A model with a body that follows such an agent."""

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.prowler = Prowler(self)
        self.add_body(disc((400, 300), 6), kind="wolf", agent=self.prowler)
        self.add_robots(AGENT9, 20)
        self.control = Subsumption(Avoid(distance=15), Explore())


CHANGES_IN_PLACE = {
    "array": lambda agent: agent.step(),
    "element": lambda agent: agent.position.__setitem__(0, 100.0),
    "list": lambda agent: agent.seen.append(1),
    "dict": lambda agent: agent.known.update(a=1),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES_IN_PLACE)
def test_what_is_changed_in_place_in_an_agent_is_noted_so_that_the_recording_verifies_and_resumes(tmp_path, change):
    model = Hunt(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(5)
        CHANGES_IN_PLACE[change](model.prowler)
        model.run(7)
    path = tmp_path / "run.arrow"
    assert [one.what for one in Recording(path).interventions] == [("place or attributes of other agents",)]
    assert "all 12 rows to step 12 are the same; changed by hand" in str(Hunt.verify(path))
    assert Hunt.resume(path, step=9).run(3).state_hash() == model.state_hash()


def test_an_agent_that_is_stepped_in_a_loop_of_the_users_is_noted_in_each_step(tmp_path):
    model = Hunt(rng=1)
    with model.record(tmp_path / "run.arrow"):
        for _ in range(6):
            model.prowler.step()
            model.step()
    assert len(Recording(tmp_path / "run.arrow").interventions) == 6
    assert Hunt.verify(tmp_path / "run.arrow").same


def seen(model):
    flock = [
        (one.unique_id, one.age, one.place.tolist(), one.parent and one.parent.unique_id)
        for one in model.agents
        if isinstance(one, Sheep)
    ]
    return flock, [sheep.unique_id for sheep in model.sheep], model.wolf.position.tolist()


@pytest.mark.parametrize("step", [3, 5, 17, 29])
def test_agents_of_a_users_own_go_on_from_a_checkpoint_as_they_did(step):
    model = Flock(rng=1)
    while model.steps < step:
        model.step()
    for sheep in model.sheep:
        if sheep.parent is not None and sheep.parent not in model.agents:
            sheep.parent = None
    again = restore(Flock(rng=1), checkpoint_of(model))
    assert seen(again) == seen(model)
    for _ in range(9):
        model.step()
        again.step()
    assert seen(again) == seen(model)
    assert again.state_hash() == model.state_hash()


def test_a_recording_of_such_a_model_has_checkpoints_and_resumes(tmp_path):
    model = Flock(rng=2)
    with model.record(tmp_path / "run.arrow", checkpoint_every=3) as recorder:
        model.run(5)
    assert (recorder.why_no_checkpoint, recorder.checkpoints) == ("", (0, 3))
    assert seen(Flock.resume(tmp_path / "run.arrow", step=5)) == seen(model)


def test_a_reference_to_an_agent_of_another_model_is_named():
    model = Flock(rng=1)
    second = list(model.sheep)[1]
    second.parent = next(iter(Flock(rng=2).sheep))
    with pytest.raises(RecordingError, match=f"Sheep {second.unique_id}'s parent refers to an agent that is not in"):
        checkpoint_of(model)


def test_an_attribute_that_cannot_be_stored_is_named_with_its_agent():
    model = Flock(rng=1)
    sheep = next(iter(model.sheep))
    sheep.thought = object()
    with pytest.raises(RecordingError, match=f"^Sheep {sheep.unique_id}'s thought is <object"):
        checkpoint_of(model)


def test_an_agent_of_another_class_is_refused_in_one_line():
    class Goat(Sheep):
        pass

    class Goats(Flock):
        def __init__(self, *, rng=None):
            super().__init__(n_sheep=2, rng=rng)
            self.sheep.add(Goat(self, (1, 1)))

    model = Flock(n_sheep=2, rng=1)
    model.sheep.add(Sheep(model, (1, 1)))
    with pytest.raises(RecordingError, match=r"is of Goat in the model, of 'Sheep' in the recording$"):
        restore(Goats(rng=1), checkpoint_of(model))


def test_a_class_that_is_not_loaded_is_named():
    model = Flock(rng=1)
    model.sheep.add(Sheep(model, (1, 1)))
    checkpoint = checkpoint_of(model)
    for one in checkpoint.facts["things"]["others"]:
        one[1] = "farm.animals"
    with pytest.raises(RecordingError, match=r"of class 'Sheep' cannot be made: import it from 'farm.animals'"):
        restore(Flock(n_sheep=0, rng=1), checkpoint)


class Seen(SwarmModel):
    """A model whose agents are seen by robots, as bodies that they move."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 3)
        self._join((100.0, 100.0))

    def _join(self, position):
        wolf = Wolf(self, position)
        self.add_body(disc(position, 5), kind="wolf", agent=wolf)

    def step(self):
        super().step()
        for wolf in self.agents_by_type[Wolf]:
            wolf.position += (1.5, 0.5)
        if self.steps == 4:
            self._join((300.0, 200.0))


def test_bodies_that_agents_move_follow_them_from_a_checkpoint_on():
    model = Seen(rng=1).run(7)
    again = restore(Seen(rng=1), checkpoint_of(model))
    assert again.run(6).state_hash() == model.run(6).state_hash()
    assert [body.agent.unique_id for body in again.movers.agents] == [
        one.agent.unique_id for one in model.movers.agents
    ]
    assert (again.movers.position == model.movers.position).all()


# ---- agents that are changed by hand between two steps


class Den(SwarmModel):
    """A wolf, whose body robots see, and sheep that have none."""

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.wolf = Wolf(self, (120.0, 150.0))
        self.add_body(disc((120, 150), 6), kind="wolf", agent=self.wolf)
        self.lamb = Sheep(self, (10, 10))
        self.add_robots(AGENT9, 3)
        self.control = Subsumption(Avoid(), Explore())


def moved(model):
    model.wolf.position += (40.0, -20.0)


def turned(model):
    model.wolf.heading = 1.0


def removed(model):
    model.wolf.remove()


def born(model):
    cub = Wolf(model, (300.0, 300.0))
    model.add_body(disc((300, 300), 4), kind="cub", agent=cub)


def aged(model):
    model.lamb.age = 9


def left(model):
    model.lamb.remove()


def came(model):
    Sheep(model, (5, 5))


NOTED = {
    **dict.fromkeys((moved, turned, aged), "place or attributes of other agents"),
    **dict.fromkeys((removed, left, came), "set of other agents"),
    born: "set of robots, obstacles or fires",
}


@pytest.mark.slow
@pytest.mark.parametrize("change", NOTED, ids=lambda change: change.__name__)
def test_a_change_of_an_agent_by_hand_is_noted_and_the_recording_is_verified_and_resumed(change, tmp_path):
    model = Den(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(4)
        change(model)
        model.run(8)
    (intervention,) = Recording(tmp_path / "run.arrow").interventions
    assert intervention.step == 4
    assert NOTED[change] in intervention.what
    verdict = Den.verify(tmp_path / "run.arrow")
    assert verdict.same, verdict
    for step in (2, 4, 7, 12):
        again = Den.resume(tmp_path / "run.arrow", step=step)
        assert again.completed == step
        if step >= 4:
            assert again.run(12 - step).state_hash() == model.state_hash()


def test_agents_that_change_in_the_step_or_are_only_read_are_not_noted(tmp_path):
    model = Flock(rng=1)
    with model.record(tmp_path / "run.arrow"):
        for _ in range(14):
            model.run(1)
            model.wolf.position, [sheep.age for sheep in model.sheep], model.space.agent_positions
    assert Recording(tmp_path / "run.arrow").interventions == ()


def test_a_body_whose_agent_was_removed_is_removed_in_the_next_step_after_a_restore_too():
    model, other = Den(rng=1).run(3), Den(rng=1)
    model.wolf.remove()
    restore(other, checkpoint_of(model))
    assert [body.kind for body in other.bodies].count("wolf") == 1
    assert [body.kind for body in other.run(1).bodies].count("wolf") == 0
    assert model.run(1).state_hash() == other.state_hash()
