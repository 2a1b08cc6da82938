"""Processes, `model.state` and shared arrays in checkpoints: hashed, stored, resumed, one array in two places."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, Process, SwarmModel
from mesa_swarm.base.errors import RecordingError, UnstoredStateWarning
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire import Spreading
from mesa_swarm.model.scattering import scatter
from mesa_swarm.recording import Recording
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.container import Packer
from support.scenes import blind


class Evaporation(Process):
    """A process that shares an array with its model."""

    trail: np.ndarray
    rng: np.random.Generator

    def __init__(self, trail, rng):
        self.trail, self.rng = trail, rng

    def step(self, model):
        self.trail *= 0.9
        self.trail[self.rng.integers(len(self.trail))] += 1.0


class Deposit:
    """A layer that shares the array as well, and returns it as its state."""

    name = "Deposit"

    def __init__(self, trail):
        self.trail = trail

    def bind(self, swarm, prefix, rng):
        return

    def decide(self, senses, command, layer, index):
        self.trail[0] += len(layer)


class Taken(Deposit):
    """The same, restored in place by methods of its own."""

    def checkpoint(self):
        return {"trail": self.trail}

    def restore(self, state):
        self.trail[:] = state["trail"]


class Trails(SwarmModel):
    """A model whose trail is seen from five places."""

    def __init__(self, *, layer="plain", rng=None):
        super().__init__(rng=rng)
        self.add_robots(blind(), 3)
        self.trail = np.zeros(8)
        self.begin, self.pair = self.trail[:4], {"a": [self.trail]}
        self.state["trail"] = self.trail
        self.state["steps"] = 0
        self.evaporation = self.add_process(Evaporation(self.trail, self.streams["rain"]))
        deposit = {"plain": Deposit, "taken": Taken}[layer](self.trail)
        self.control = Subsumption(deposit, Explore())

    def step(self):
        super().step()
        self.state["steps"] += 1
        self.trail[-1] += 1
        self.begin[1] += 2


@pytest.mark.parametrize("layer", ["plain", "taken"])
def test_an_array_that_is_seen_from_five_places_remains_one_when_resumed(tmp_path, layer):
    model = Trails(layer=layer, rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10) as recorder:
        model.run(35)
    assert (recorder.why_no_checkpoint, recorder.checkpoints) == ("", (0, 10, 20, 30))
    again = Trails.resume(tmp_path / "run.arrow", step=24)
    places = [again.state["trail"], again.evaporation.trail, again.pair["a"][0], again.control.layers[0].trail]
    assert all(place is again.trail for place in places)
    assert np.shares_memory(again.begin, again.trail)
    assert again.processes == (again.evaporation,)
    again.run(11)
    assert again.state_hash() == model.state_hash()
    assert again.state["steps"] == 35
    assert (again.trail == model.trail).all()
    assert Trails.verify(tmp_path / "run.arrow").same


def test_arrays_that_were_separated_during_the_run_stay_separate():
    model = Trails(rng=1).run(3)
    model.state["trail"] = model.trail.copy()
    again = restore(Trails(rng=1), checkpoint_of(model))
    assert again.evaporation.trail is again.trail
    assert again.state["trail"] is not again.trail
    assert again.run(5).state_hash() == model.run(5).state_hash()


def test_views_of_one_array_remain_views_of_it():
    grid = np.arange(24.0).reshape(4, 6)
    values = [grid, grid[1:3, ::2], grid.T, grid[::-1], np.asfortranarray(grid), grid[:0]]
    packer = Packer()
    again = Packer(packer.arrays)
    content = packer.pack(values)
    views = again.unpack(content)
    for value, view in zip(values, views, strict=True):
        assert (view == value).all()
        assert view.shape == value.shape
    views[0][2, 3] = -1
    grid[2, 3] = -1
    for value, view in zip(values, views, strict=True):
        assert (view == value).all()
    assert len(packer.arrays) == 3


def test_a_stored_view_that_reaches_beyond_its_array_is_refused():
    for view in (
        [0, [9], [8]],
        [8, [4], [8]],
        [-8, [2], [8]],
        [0, [2, 2], [32, 8]],
        [0, [1 << 40], [0]],
        [0, ["x"], [8]],
    ):
        with pytest.raises(RecordingError, match="cannot be decoded"):
            Packer([np.zeros(4)]).unpack({"array": 0, "view": view})


def test_a_view_of_another_type_is_refused_in_one_line():
    grid, packer = np.zeros(4), Packer()
    packer.pack(grid, "a")
    with pytest.raises(RecordingError, match=r"^b is a view of an array with another type or shape, which"):
        packer.pack(grid.view(np.int64), "b")


def test_a_view_of_a_column_is_a_view_of_the_column_when_resumed(tmp_path):
    model = Trails(rng=1)
    model.places = model.swarm.columns["position"][:, 0]
    again = restore(Trails(rng=1), checkpoint_of(model.run(2)))
    assert np.shares_memory(again.places, again.swarm.columns["position"])
    assert (again.places == model.places).all()


def test_what_is_changed_by_hand_in_declared_state_is_an_intervention(tmp_path):
    model = Trails(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        model.run(5)
        model.state["steps"] = 100
        model.run(5)
        model.evaporation.trail[3] = 9.0
        model.run(5)
    found = Recording(tmp_path / "run.arrow").interventions
    assert [one.step for one in found] == [5, 10]
    assert found[0].what == ("state of steps",)
    assert found[1].what == ("state of trail", "process 1 (Evaporation)")
    assert Trails.verify(tmp_path / "run.arrow").same
    assert Trails.resume(tmp_path / "run.arrow", step=13).run(2).state_hash() == model.state_hash()


def test_a_process_that_no_constructor_adds_is_made_of_its_class_in_the_models_own_module(tmp_path):
    model = Trails(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
        model.add_process(Evaporation(np.zeros(2), model.streams["rain"]))
        model.run(3)
    again = Trails.resume(tmp_path / "run.arrow")
    assert [type(process) for process in again.processes] == [type(process) for process in model.processes]
    assert again.processes[-1].rng is again.streams["rain"]
    assert again.run(3).state_hash() == model.run(3).state_hash()
    assert Trails.resume(tmp_path / "run.arrow", layer="taken").processes[-1].trail.shape == (2,)


def test_a_process_of_a_class_of_elsewhere_is_refused_in_one_line_with_what_to_do():
    class Elsewhere(Process):
        def step(self, model):
            pass

    model = Trails(rng=1)
    model.add_process(Elsewhere())
    with pytest.raises(RecordingError, match=r"is not one .* add the process in the constructor, or define"):
        restore(Trails(rng=1), checkpoint_of(model))


def test_a_process_that_was_removed_is_removed_again():
    model = Trails(rng=1)
    model.remove_process(model.evaporation)
    model.evaporation = None
    again = restore(Trails(rng=1), checkpoint_of(model.run(2)))
    assert again.processes == ()
    assert again.run(3).state_hash() == model.run(3).state_hash()


class Closed:
    """A process with something that cannot be stored."""

    def __init__(self):
        self.friend = object()

    def step(self, model):
        return


def test_a_process_that_cannot_be_stored_is_named():
    model = SwarmModel(rng=1)
    model.add_process(Closed())
    with pytest.raises(RecordingError, match=r"^process Closed's friend is <object .* give its class checkpoint\(\)"):
        checkpoint_of(model)


class Vague(Process):
    """A process that does not declare its attribute."""

    def __init__(self):
        self.level = 1.0

    def step(self, model):
        self.level += 1.0


class Stray:
    """A class with a step that does not derive from `Process`."""

    def step(self, model):
        return


@pytest.mark.parametrize(
    ("process", "reason"),
    [
        (Vague, "attribute 'level' of Vague is not declared by its class; annotate it there, as in level: float = 0.0"),
        (Stray, "process Stray is not one that the model's constructor adds, and its class does not derive from"),
    ],
)
def test_a_process_added_by_hand_that_would_not_be_made_again_is_named_when_its_state_is_due(process, reason, tmp_path):
    model = Trails(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=3) as recorder:
        model.run(2)
        model.add_process(process())
        model.run(3)
        assert reason in recorder.why_no_checkpoint
    with pytest.raises(RecordingError, match="after step 2, changed by hand: set of processes"):
        Trails.resume(tmp_path / "run.arrow")


def test_processes_of_the_package_are_made_again_in_models_that_are_assembled(tmp_path):
    model = SwarmModel(map="original", rng=1)
    scatter(model, 3, size=15, speed=0.5)
    model.add_fire((400, 300), radius=20)
    spreading = model.add_process(Spreading(rate=0.03, most=5))
    model.add_robots(AGENT9, 5)
    model.control = Subsumption(Avoid(distance=15), Explore())
    path = tmp_path / "run.arrow"
    with model.record(path, checkpoint_every=10):
        model.run(15)
        scatter(model, 1, size=8, speed=0.2)
        model.run(5)
    assert SwarmModel.verify(path).same
    again = SwarmModel.resume(path, step=17).run(3)
    assert again.state_hash() == model.state_hash()
    assert [process for process in again.processes if isinstance(process, Spreading)] == [spreading]


def test_a_state_that_is_no_longer_stored_is_named_once_while_recording(tmp_path):
    class Tide:
        level = 0.0

        def step(self, model):
            """Rise."""
            self.level += 1.0

    model = Trails(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=5):
        model.run(3)
        model.add_process(Tide())
        with pytest.warns(
            UnstoredStateWarning, match="after step 3 cannot be stored in its recording: process Tide"
        ) as caught:
            model.run(12)
    assert len(caught) == 1


def test_such_processes_of_the_constructor_are_stored_and_resumed(tmp_path):
    class Constructed(Trails):
        def __init__(self, *, rng=None):
            super().__init__(rng=rng)
            self.add_process(Vague()), self.add_process(Stray())

    model = Constructed(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=3) as recorder:
        model.run(5)
    assert recorder.why_no_checkpoint == ""
    again = Constructed.resume(tmp_path / "run.arrow")
    assert again.processes[1].level == 6.0
    assert again.state_hash() == model.state_hash()
