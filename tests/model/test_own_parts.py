"""Parts of a user's kind, beside every standing one: whatever takes a model through it takes its parts along."""

import copy
import os
import pickle
import subprocess
import sys
import zlib
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.dashboard.notebook_panels import NotebookSession
from mesa_swarm.dashboard.run.inspector import rows_of_parts
from mesa_swarm.kernels.part import HASHED, Column, Part, Shown
from mesa_swarm.recording import Recording
from mesa_swarm.recording.checkpoint import differing_part
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_chunk, packed_frame
from mesa_swarm.viewing.pictures import world_figure
from mesa_swarm.viewing.player import readings_of
from mesa_swarm.viewing.scene import scene_of, scene_of_recording
from support.own_parts import Boards, Whole

OWN = ("odometer", "boards", "roster")
STEPS = 60
# Columns that are read anew for a fingerprint, so that a change by hand does not last.
READ_ANEW = {"distance", "kind", "radiation", "line", "trail", "read.trail"}


def run_with_changes(model, until):
    """Run on to a step; robots come at steps 20 and 40, and one goes at 30, unless that has been done already."""
    while model.completed < until:
        if (model.completed, len(model.swarm)) in ((20, 6), (40, 7)):
            model.add_robots(AGENT9, 2)
        if (model.completed, len(model.swarm)) == (30, 8):
            model.robots[1].remove()
        model.step()
    return model


def same_future(model, other, until=STEPS):
    run_with_changes(model, until)
    run_with_changes(other, until)
    assert differing_part(model, other) == ""
    assert model.state_hash() == other.state_hash()


def columns_of(model):
    """Return the hashed columns of all parts, by "part.column"."""
    return {
        f"{name}.{column}": (part, column)
        for name, part in model.parts.items()
        for column, of in part.columns().items()
        if of.role in HASHED and of.array.size and of.array.dtype.kind in "biuf"
    }


COLUMNS = columns_of(run_with_changes(Whole(rng=3), 12))


def test_the_model_has_columns_of_every_part_that_has_any():
    parts = {name.partition(".")[0] for name in COLUMNS}
    assert {"robots", "fires", "odometer", "boards"} <= parts
    assert {"odometer.driven", "odometer.turned", "boards.places", "boards.strength"} <= set(COLUMNS)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in COLUMNS if name.partition(".")[2] not in READ_ANEW])
def test_a_change_of_each_column_changes_the_fingerprint(name):
    column = COLUMNS[name][1]
    model = run_with_changes(Whole(rng=3), 12)
    before = model.state_hash()
    array = model.parts[name.partition(".")[0]].columns()[column].array
    array.setflags(write=True)
    value = array.flat[0]
    array.flat[0] = not value if array.dtype.kind == "b" else 1 if np.isnan(value) else value + 1
    assert model.state_hash() != before


def test_what_a_part_stores_changes_the_fingerprint():
    model = Whole(rng=3).run(9)
    before = model.state_hash()
    model.parts["roster"].led.append(model.robots[0])
    changed = model.state_hash()
    model.parts["boards"].rate = 0.06
    assert len({before, changed, model.state_hash()}) == 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_recorded_parts_resume_at_any_step_and_verify(tmp_path, seed):
    rng = np.random.default_rng(seed)
    path = tmp_path / "run.arrow"
    model = Whole(rng=seed)
    with model.record(path, checkpoint_every=int(rng.integers(5, 20))):
        run_with_changes(model, STEPS)
    for step in rng.choice(STEPS, 3, replace=False).tolist():
        resumed = Whole.resume(path, step=step)
        assert resumed.completed == step
        assert list(resumed.parts)[-3:] == list(OWN)
        same_future(resumed, copy.deepcopy(model), STEPS)
    assert Whole.verify(path).same


@pytest.mark.slow
@pytest.mark.parametrize("step", [0, 7, 25, 33, 52])
@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model)), lambda model: model.continued()]
)
def test_duplicates_of_parts_have_the_same_future(duplicate, step):
    model = run_with_changes(Whole(rng=2), step)
    untouched = run_with_changes(Whole(rng=2), STEPS)
    same_future(duplicate(model), untouched)


def test_parts_are_taken_over_by_a_run_with_other_parameters():
    model = run_with_changes(Whole(rng=2), 33)
    strength, driven, led = (
        model.parts["boards"].strength.copy(),
        model.parts["odometer"].driven.copy(),
        [robot.unique_id for robot in model.parts["roster"].led],
    )
    other = model.continued(evaporation=0.3)
    ids = [robot.unique_id for robot in other.robots]
    assert other.parts["boards"].strength.tolist() == strength.tolist()
    assert other.parts["odometer"].driven.tolist() == driven.tolist()
    assert [robot.unique_id for robot in other.parts["roster"].led] == led
    assert all(robot in list(other.robots) for robot in other.parts["roster"].led if robot.unique_id in ids)


@pytest.mark.slow
def test_another_process_finds_the_same_fingerprint():
    program = "from support.own_parts import Whole; print(Whole(rng=5).run(30).state_hash())"
    here = Path(__file__).parents[1]
    paths = {"PYTHONPATH": os.pathsep.join(map(str, (here.parent, here)))}
    ask = partial(subprocess.run, env={**os.environ, **paths}, capture_output=True, text=True, check=True)
    found = [ask([sys.executable, "-c", program]).stdout for _ in range(2)]
    assert [text.strip() for text in found] == [Whole(rng=5).run(30).state_hash()] * 2


@pytest.mark.slow
def test_a_part_that_forgets_an_array_is_found_by_a_resumed_run(tmp_path):
    model = Whole(rng=1, forgetful=True)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        run_with_changes(model, STEPS)
    resumed = Whole.resume(tmp_path / "run.arrow", step=30)
    with pytest.raises(AssertionError, match="forgetful"):
        same_future(resumed, model)
    assert not Whole.verify(tmp_path / "run.arrow").same


def test_a_part_that_forgets_a_column_cannot_be_taken_over_unnoticed():
    model = run_with_changes(Whole(rng=1, forgetful=True), 33)
    with pytest.raises(AssertionError):
        same_future(model.continued(evaporation=0.01), run_with_changes(Whole(rng=1, forgetful=True), 33))


# ---- recorded, drawn, inspected


@pytest.fixture
def recording(tmp_path):
    model = Whole(rng=1)
    model.history = []
    with model.record(tmp_path / "run.arrow", exact=True):
        while model.completed < STEPS:
            run_with_changes(model, model.completed + 1)
            model.history.append((model.parts["odometer"].driven.copy(), model.parts["boards"].strength.copy()))
    return model.history, Recording(tmp_path / "run.arrow")


def test_columns_of_robots_are_recorded_by_the_names_of_part_and_column(recording):
    history, recording = recording
    assert len(recording) == STEPS
    for frame, (driven, _) in zip(recording, history, strict=True):
        assert frame["odometer.driven"].tolist() == driven.tolist()
        assert frame["odometer.turned"].shape == (len(driven), 2)
    table = recording.to_pandas()
    assert {"odometer.driven", "odometer.turned_0", "odometer.turned_1"} <= set(table.columns)
    assert table["odometer.driven"].tolist() == np.concatenate([driven for driven, _ in history]).tolist()


def test_discs_and_values_of_parts_are_recorded(recording):
    history, recording = recording
    for frame, (_, strength) in zip(recording, history, strict=True):
        assert frame["shown"]["radius"].tolist() == (5.0 * strength).tolist()
        assert frame["shown"]["x"].tolist() == [200.0, 500.0]
        assert frame["fields.boards"][:, 0].tolist() == strength.tolist()
    assert len(recording.to_pandas("shown")) == 2 * STEPS
    scene = scene_of_recording(recording)
    assert scene.parts == (("boards", "#aa3311"),)
    assert [entry.label for entry in scene.legend(recording[3])].count("boards") == 2


def test_columns_and_discs_can_be_named(tmp_path):
    model = Whole(rng=1)
    with model.record(tmp_path / "run.arrow", columns=["position", "odometer.driven"]):
        model.run(12)
    recording = Recording(tmp_path / "run.arrow")
    assert recording.columns == ("position", "odometer.driven")
    assert recording["odometer.driven"].shape == (12, 6)
    with pytest.raises(UnknownNameError, match="did you mean"):
        model.record(tmp_path / "other.arrow", columns=["odometer.drivn"])


def test_a_part_that_is_removed_while_it_is_recorded_leaves_no_values(tmp_path):
    model = Whole(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(5)
        model.remove_part("odometer")
        model.remove_part("boards")
        model.run(5)
    recording = Recording(tmp_path / "run.arrow")
    assert np.isnan(recording.at(8)["odometer.driven"]).all()
    assert not len(recording.at(8)["shown"])
    assert len(recording.at(3)["shown"]) == 2
    assert Whole.verify(tmp_path / "run.arrow").same


def test_parts_without_recordable_columns_are_left_out_unless_named(tmp_path):
    class Names(Part):
        name = "names"

        def columns(self):
            return {"texts": Column(np.array(["a"] * 6), "robots"), "wide": Column(np.zeros((6, 9)), "robots")}

        def replace(self, name, array):
            return None

    model = Whole(rng=1)
    model.add_part(Names())
    with model.record(tmp_path / "run.arrow", rerun=False, checkpoint_every=0):
        model.run(2)
    assert not any(name.startswith("names") for name in Recording(tmp_path / "run.arrow").columns)
    with model.record(tmp_path / "run.arrow", columns=["names.wide"], overwrite=True, checkpoint_every=0):
        model.run(2)
    assert Recording(tmp_path / "run.arrow")["names.wide"].shape == (2, 6, 9)


def test_frames_of_a_model_and_of_its_recording_draw_the_same_discs(recording, tmp_path):
    _, recording = recording
    model = run_with_changes(Whole(rng=1), 25)
    frame, scene = frame_of(model), scene_of(model)
    replayed = scene_of_recording(recording)
    assert scene.discs(frame).tolist() == replayed.discs(recording.at(25)).tolist()
    figure = world_figure({"now": model})
    assert [one for one in figure.axes[0].collections if one.get_label() == "parts"]
    assert "boards" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_discs_are_packed_for_browsers(recording):
    _, recording = recording
    model = run_with_changes(Whole(rng=1), 25)
    scene = scene_of(model)
    content = packed_frame(frame_of(model, PACKED_FROM), scene)
    discs = scene.discs(frame_of(model)).astype("<f4")
    assert content.endswith(np.array([2], "<i4").tobytes() + discs.tobytes())
    assert scene.world()["parts"] == [["boards", "#aa3311"]]
    chunk = zlib.decompress(packed_chunk([recording.at(25)], scene_of_recording(recording)))
    assert discs.tobytes() in chunk


@pytest.mark.slow
def test_films_animations_and_pages_show_discs(recording, tmp_path):
    path = recording[1].path
    export(path, tmp_path / "run.svg", animate=True)
    assert (tmp_path / "run.svg").read_text().count('class="part"') == 2
    export(path, tmp_path / "run.html")
    assert "#aa3311" in (tmp_path / "run.html").read_text()
    export(path, tmp_path / "run.png", steps=[25])


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        ("boards", "expected an object of"),
        (Shown(""), "expected a name"),
        (Shown("a", colour="red"), "expected a colour"),
        (Shown("a", discs=np.zeros(3)), "expected rows of x, y and radius"),
        (Shown("a", values=np.zeros(3)), "expected rows and columns"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(shown, words):
    model = Whole(rng=1)
    model.parts["boards"].shown = lambda: shown
    with pytest.raises(InvalidValueError, match=f"part boards shows .*{words}"):
        frame_of(model)


def test_discs_without_a_radius_or_a_place_are_not_drawn():
    model = Whole(rng=1)
    model.parts["boards"].strength[:] = [0.0, np.nan]
    assert not len(frame_of(model)["shown"])


def test_the_inspector_lists_columns_and_rows_of_parts_and_the_page_their_texts():
    model = run_with_changes(Whole(rng=1), 25)
    robot, odometer = model.robots[2], model.parts["odometer"]
    facts = dict(rows_of_parts(model, robot))
    assert facts["Odometer driven"] == facts["Ways way"] == f"{odometer.driven[2]:.4g}"
    assert facts["Odometer turned"] == " ".join(f"{n:.4g}" for n in odometer.turned[2])
    assert dict(readings_of(model))["ways"] == f"{odometer.driven.sum():.1f} in all"


# ---- reset


def test_reset_makes_parts_of_the_constructor_anew():
    session = NotebookSession(Whole(n_robots=3, rng=1).run(10))
    former = session.model.parts["odometer"]
    session.reset()
    assert session.error == ""
    assert session.model.completed == 0
    assert list(session.model.parts)[-3:] == list(OWN)
    assert session.model.parts["odometer"] is not former
    assert session.model.parts["odometer"].driven.tolist() == [0.0] * 4


def test_reset_keeps_parts_that_a_plain_model_got_by_hand():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 2)
    model.add_part(Boards(rate=0.5))
    session = NotebookSession(model)
    session.model.run(10)
    strength = session.model.parts["boards"].strength.tolist()
    session.reset()
    assert session.model.parts["boards"].strength.tolist() == [1.0, 1.0]
    assert session.model.parts["boards"].model is session.model
    assert session.model.run(10).parts["boards"].strength.tolist() == strength
