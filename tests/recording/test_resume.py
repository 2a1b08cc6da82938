import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RecordingError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, resume
from support.other_code import other_code


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return the path of a recorded run of 400 steps under strategy A."""
    path = tmp_path_factory.mktemp("recorded") / "run.arrow"
    model = FireFighting(strategy="A", rng=4)
    with model.record(path):
        model.run(400)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("step", [0, 1, 99, 100, 237, 400])
def test_a_run_that_is_resumed_goes_on_as_it_did(path, step):
    again = SwarmModel.resume(path, step=step)
    assert type(again) is FireFighting
    assert again.steps == step
    assert again.run(450 - step).state_hash() == FireFighting(strategy="A", rng=4).run(450).state_hash()


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_a_model_that_takes_over_a_state_goes_on_bit_by_bit(name, tmp_path):
    model = find_model(name)(rng=3)
    with model.record(tmp_path / "run.arrow") as recorder:
        model.run(150)
    same = Recording(recorder.path).provenance["parameters"]
    again = SwarmModel.resume(tmp_path / "run.arrow", step=120, **same)  # as a change that changes nothing
    again.run(30)
    for _ in range(100):
        assert again.state_hash() == model.state_hash()
        model.step()
        again.step()
    ours, theirs = (it.datacollector.get_model_vars_dataframe() for it in (again, model))
    assert ours.index.equals(theirs.index)
    assert (ours["collisions"] == theirs["collisions"]).all()


def test_a_branch_is_the_same_until_the_change_and_another_after_it(path):
    recording, branch = Recording(path), SwarmModel.resume(path, step=200, strategy="B", k2=0.05)
    assert branch.fire_constants.k2 == 0.05
    assert branch.swarm.position.astype("float32").tolist() == recording.at(200)["position"].tolist()
    assert branch.fires.history.steps.tolist() == list(range(10, 201, 10))
    branch.run(200)
    assert branch.steps == 400
    assert branch.state_hash() != FireFighting(strategy="A", rng=4).run(400).state_hash()
    assert branch.state_hash() == FireFighting.resume(path, step=200, strategy="B", k2=0.05).run(200).state_hash()


class Wanderers(SwarmModel):
    """Robots whose layer that remembers may stand second or third."""

    def __init__(self, *, timid=False, rng=None):
        super().__init__(map="original", rng=rng)
        self.add_robots(AGENT9, 5)
        more = (Avoid(distance=5),) if timid else ()
        self.control = Subsumption(Avoid(distance=15), *more, Explore(turn_interval=20))


def test_a_layer_that_another_comes_before_keeps_its_memory(tmp_path):
    model = Wanderers(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(50)
    branch = SwarmModel.resume(tmp_path / "run.arrow", timid=True)
    names = [name for name in model.swarm.columns if name.startswith("1.Explore.")]
    assert names
    for name in names:
        assert branch.swarm.columns[name.replace("1.", "2.", 1)].tolist() == model.swarm.columns[name].tolist()
    branch.run(20)


def test_changes_that_make_another_world_are_refused(path):
    with pytest.raises(InvalidValueError, match="5 robots instead of the 10"):
        SwarmModel.resume(path, step=10, n_robots=5)
    with pytest.raises(UnknownNameError, match="did you mean 'strategy'"):
        SwarmModel.resume(path, step=10, stratgy="B")
    with pytest.raises(InvalidValueError, match="map cannot be changed"):
        SwarmModel.resume(path, step=10, map="sparse")
    with pytest.raises(InvalidValueError, match="at most 400"):
        SwarmModel.resume(path, step=401)


def test_a_run_of_other_code_is_not_resumed_as_if_it_were_the_same(tmp_path):
    model = FireFighting(rng=1)
    with other_code(20, lambda model: setattr(model.robots[3], "heading", 0.5)), model.record(tmp_path / "run.arrow"):
        model.run(40)
    with pytest.raises(RecordingError, match="step 30 is the first that differs"):
        resume(FireFighting, tmp_path / "run.arrow", step=30)
    assert resume(FireFighting, tmp_path / "run.arrow", step=20).steps == 20


def test_a_class_of_another_family_is_refused(path):
    with pytest.raises(RecordingError, match="neither Boids nor a loaded subclass"):
        find_model("boids").resume(path)
