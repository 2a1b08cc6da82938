"""Custom rules that are set by hand while a run is recorded: recordings contain no code."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from support.rules import timid

HAND, LAST = 12, 20


class Timid(SwarmModel):
    def __init__(self, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_robots(AGENT9, 3)
        self.control = Subsumption(timid, Explore())


@pytest.fixture(scope="module")
def ruled(tmp_path_factory):
    """Return a recording in which a custom rule drives after step 12; steps 15 and 20 would have states."""
    path = tmp_path_factory.mktemp("ruled") / "run.arrow"
    model = FireFighting(n_robots=3, rng=1)
    with model.record(path, checkpoint_every=5) as recorder:
        model.run(HAND)
        model.control = Subsumption(timid, Explore())
        model.run(LAST - HAND)
    return Recording(path), recorder


def test_a_control_with_a_custom_rule_is_an_intervention_without_a_state_that_could_not_be_restored(ruled):
    recording, recorder = ruled
    (intervention,) = recording.interventions
    assert (intervention.step, intervention.what[0], intervention.checkpoint) == (HAND, "control", None)
    assert "a custom rule (Behaviour timid distance=20.0), which cannot be recorded" in intervention.why_not
    assert recording.checkpoints == (0, 5, 10)
    assert recorder.why_no_checkpoint == intervention.why_not


@pytest.mark.parametrize("step", [HAND + 1, LAST])
def test_resuming_after_a_custom_rule_was_set_names_the_cause_and_the_cure(ruled, step):
    with pytest.raises(RecordingError, match="after step 12, changed by hand: control") as refusal:
        FireFighting.resume(ruled[0].path, step=step)
    words = str(refusal.value)
    assert "resume from an earlier step and set it again, or record a model whose class has the rule" in words
    assert words.endswith("the nearest steps to resume from are 12")


def test_where_a_custom_rule_was_set_a_run_resumes_and_goes_on_when_it_is_set_again(ruled):
    model = FireFighting.resume(ruled[0].path, step=HAND)
    model.control = Subsumption(timid, Explore())
    assert np.array_equal(model.run(LAST - HAND).swarm.position.astype(np.float32), ruled[0].at(LAST)["position"])


def test_a_rule_that_the_class_has_itself_is_stored_as_ever(tmp_path):
    model = Timid(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=5):
        model.run(HAND)
        model.control = Subsumption(timid(distance=30), Explore())
        model.run(1)
        model.control = Subsumption(timid, Explore())
        model.run(LAST - HAND)
    recording = Recording(tmp_path / "run.arrow")
    assert [one.checkpoint is None for one in recording.interventions] == [True, False]
    assert Timid.resume(recording.path).state_hash() == model.state_hash()
