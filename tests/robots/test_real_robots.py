"""Real robots: their designs at any scale, and what a scale shows."""

import io
import math
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, E_PUCK, I_SWARM, KILOBOT, REAL_ROBOTS, RealRobot, Recording, Scale, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RecordingError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.dashboard.page.series import Series
from mesa_swarm.dashboard.run.charts import OVER_TIME, ChosenChart, TimeContent
from mesa_swarm.models.collision_avoidance import DESIGNS, CollisionAvoidance
from mesa_swarm.recording.provenance import scenery_of
from mesa_swarm.recording.schema import checked_scenery
from mesa_swarm.robots.real_robots import length_unit
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.pictures import step_text, world_figure
from mesa_swarm.viewing.run_pictures import ethogram
from mesa_swarm.viewing.scene import scene_of

SCALES = st.builds(Scale, units_per_metre=st.floats(1e-3, 1e6), seconds_per_step=st.floats(1e-3, 200))


@pytest.mark.parametrize("robot", REAL_ROBOTS.values(), ids=REAL_ROBOTS)
def test_a_real_robot_is_as_wide_and_as_fast_as_one_of_the_thesis_at_its_own_scale(robot):
    design = robot.design()
    assert (design.radius, design.max_speed) == (5.0, 1.0)
    assert robot.design(scale=robot.scale).radius == pytest.approx(5.0)
    assert DESIGNS[robot.name] == design
    assert len(design.sensors) == len(robot.sensors) > 0


@given(SCALES)
def test_a_design_has_the_lengths_and_speeds_of_the_robot_at_any_scale(scale):
    design = E_PUCK.design(scale=scale)
    assert scale.metres(2 * design.radius) == pytest.approx(E_PUCK.diameter)
    assert scale.metres(design.max_speed) / scale.seconds_per_step == pytest.approx(E_PUCK.max_speed)
    assert [scale.metres(s.range) for s in design.sensors] == pytest.approx([s.range for s in E_PUCK.sensors])


@given(SCALES, st.floats(1e-2, 1e6))
def test_a_ruler_is_a_round_length_and_at_most_a_quarter_of_the_width(scale, width):
    length, text = scale.ruler(width)
    assert width / 10 * (1 - 1e-9) <= length <= width / 4 * (1 + 1e-9)
    number, name = text.split()
    size = {"km": 1e3, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6}[name]
    assert float(number) * size == pytest.approx(scale.metres(length))
    assert re.fullmatch(r"[125]0*", f"{float(number):.0f}") or scale.metres(length) < 1e-6
    assert length_unit(scale.metres(length))[0] == name


def test_designs_keep_what_else_is_given_and_what_they_mount():
    assert E_PUCK.design(name="mine", slip_probability=0.5).slip_probability == 0.5
    assert KILOBOT.design().sensors[0].mount == (0.0, 0.0)
    assert [s.bearing_degrees for s in I_SWARM.design().sensors] == [0.0, 90.0, 180.0, 270.0]


@pytest.mark.parametrize("wrong", [0, -1, math.nan, math.inf, "1", None, 1e10])
def test_a_wrong_scale_is_refused_in_one_line(wrong):
    with pytest.raises(InvalidValueError, match=r"^units_per_metre is [^\n]*; expected a finite number"):
        Scale(units_per_metre=wrong, seconds_per_step=1)
    with pytest.raises(InvalidValueError, match=r"^seconds_per_step is [^\n]*; expected a finite number"):
        Scale(units_per_metre=1, seconds_per_step=wrong)
    with pytest.raises(InvalidValueError, match=r"^diameter is"):
        RealRobot(name="mine", diameter=wrong, max_speed=1.0)


def test_what_is_not_a_scale_is_refused_by_models_and_designs():
    model = SwarmModel(rng=1)
    for give in (lambda: SwarmModel(scale=100), lambda: setattr(model, "scale", 100), lambda: E_PUCK.design(scale=100)):
        with pytest.raises(InvalidValueError, match=r"^scale is 100; expected Scale\(units_per_metre="):
            give()
    with pytest.raises(InvalidValueError, match="expected a tuple of ProximitySensor"):
        RealRobot(name="mine", diameter=1, max_speed=1, sensors=[3])
    assert model.scale is None


def exploring(scale=None):
    """Return a model of ten robots, perhaps with a scale."""
    model = SwarmModel(map="original", rng=3, scale=scale)
    model.add_robots(AGENT9, 10)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


SMALL = Scale(units_per_metre=1000, seconds_per_step=0.5)


def test_a_scale_changes_nothing_that_happens():
    assert exploring().run(30).state_hash() == exploring(SMALL).run(30).state_hash()


def test_pictures_have_a_scale_bar_and_axes_in_units_of_length_and_the_time():
    model = exploring(SMALL).run(3)
    axes = world_figure({"world": model}).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (cm)", "y (cm)")
    assert "20 cm" in [text.get_text() for text in axes.texts]
    ticks = axes.get_xticks()
    assert np.diff(ticks) == pytest.approx(100)
    assert axes.xaxis.get_major_formatter()(ticks[-1], 0) == "80"
    bare = world_figure({"world": exploring()}).axes[0]
    assert bare.get_xlabel() == "x (map units)"
    assert not bare.texts


def test_captions_have_the_time_beside_the_step():
    assert step_text(1200, None) == "step 1,200"
    assert step_text(1200, SMALL) == "step 1,200, 10 min 0 s"


def test_charts_and_ethograms_are_in_seconds():
    model = exploring(SMALL)
    series = Series()
    series.follow(model)
    model.watch(last=None)
    model.run(20)
    assert ethogram(model).axes[1].get_xlabel() == "time (s)"
    content = TimeContent.of(series, ChosenChart(OVER_TIME, "collisions"))
    axes = content.figure().axes[0]
    assert axes.get_xlabel() == "time (s)"
    assert axes.lines[0].get_xdata()[-1] == 10.0
    assert pd.read_csv(io.BytesIO(content.csv()))["time (s)"].iloc[-1] == 10.0


def test_recordings_store_the_scale_and_tables_pictures_and_animations_of_them_show_it(tmp_path):
    model = exploring(SMALL)
    with model.record(tmp_path / "run.arrow"):
        model.run(10)
    recording = Recording(tmp_path / "run.arrow")
    table = pd.read_csv(export(recording, tmp_path / "robots.csv", steps=[4])[0])
    assert table["time_s"].tolist() == [2.0] * 10
    assert np.allclose(table["x_m"], table["x"] / 1000)
    export(recording, tmp_path / "moving.svg", animate=True)
    drawing = (tmp_path / "moving.svg").read_text()
    assert '<g class="ruler">' in drawing
    assert ">step 10, 5.0 s<" in drawing
    assert SwarmModel.resume(tmp_path / "run.arrow").scale == SMALL


def test_tables_without_a_scale_have_no_other_columns_than_before(tmp_path):
    model = exploring()
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    names = pd.read_csv(export(tmp_path / "run.arrow", tmp_path / "robots.csv")[0]).columns
    assert not {"time_s", "x_m"} & set(names)
    assert "scale" not in scenery_of(model)


def test_the_scene_for_browsers_has_the_scale_and_a_damaged_one_is_refused():
    scenery = scenery_of(exploring(SMALL))
    assert scene_of(exploring(SMALL)).world()["scale"] == [1000.0, 0.5]
    assert scene_of(exploring()).scale is None
    for wrong in ([0, 1], [1], [1, -1], "x", [1, None], [math.nan, 1]):
        with pytest.raises(RecordingError, match="scale"):
            checked_scenery({**scenery, "scale": wrong})


@pytest.mark.parametrize("name", REAL_ROBOTS)
def test_collision_avoidance_drives_each_real_robot_at_its_scale(name):
    model = CollisionAvoidance(design=name, n_robots=5, rng=2)
    before = model.swarm.position.copy()
    model.run(40)
    assert model.scale == REAL_ROBOTS[name].scale
    assert (np.hypot(*(model.swarm.position - before).T) > 1).all()
    assert CollisionAvoidance(rng=1).scale is None


@pytest.mark.parametrize("take", [lambda scale: SwarmModel(scale=scale), lambda scale: E_PUCK.design(scale=scale)])
def test_a_robot_given_as_a_scale_is_refused_with_its_own_scale_as_the_cure(take):
    with pytest.raises(InvalidValueError, match=r"^scale is RealRobot\(.*; expected .*E_PUCK\.scale") as caught:
        take(E_PUCK)
    assert len(str(caught.value)) <= 300
    with pytest.raises(InvalidValueError) as caught:
        take(3)
    assert "E_PUCK" not in str(caught.value)
