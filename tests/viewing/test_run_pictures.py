"""Pictures of a run show the run's own numbers: stages, traces, an ethogram."""

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_rgba

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import PASS, Subsumption, behaviour
from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.palette import LIGHT
from mesa_swarm.viewing.pictures import png
from mesa_swarm.viewing.run_pictures import (
    MOST_TRACES,
    ethogram,
    ethogram_figure,
    stages,
    trace,
)

AGGLOMERATION, AVOIDANCE = find_model("agglomeration"), find_model("collision_avoidance")


def discs_of(axes):
    """Return where the robots' discs are drawn."""
    (discs,) = [c for c in axes.collections if isinstance(c, EllipseCollection) and c.get_label() == "robots"]
    return discs.get_offsets()


def traces_of(axes):
    """Return the lines that are drawn below the robots and above everything else."""
    return [c for c in axes.collections if isinstance(c, LineCollection) and c.get_zorder() == 4.5]


# ---- stages


def test_stages_show_where_the_robots_were_at_each_of_the_steps():
    figure = stages(AGGLOMERATION(n_robots=5, rng=1), steps=(0, 20, 50))
    assert [axes.get_title() for axes in figure.axes] == [f"Agglomeration, step {k}" for k in (0, 20, 50)]
    for axes, steps in zip(figure.axes, (0, 20, 50), strict=True):
        assert (discs_of(axes) == AGGLOMERATION(n_robots=5, rng=1).run(steps).swarm.position).all()


def test_a_model_that_has_been_run_may_be_shown_from_where_it_is():
    model = AGGLOMERATION(n_robots=5, rng=1).run(30)
    figure = stages(model, steps=(30, 40))
    assert model.steps == 40
    for axes, step in zip(figure.axes, (30, 40), strict=True):
        assert axes.get_title() == f"Agglomeration, step {step}"
        assert (discs_of(axes) == AGGLOMERATION(n_robots=5, rng=1).run(step).swarm.position).all()


def test_a_model_that_stops_early_is_shown_as_it_stopped():
    class Short(SwarmModel):
        def step(self):
            super().step()
            self.running = self.steps < 7

    figure = stages(Short(rng=1), steps=(0, 5, 10, 20))
    assert [axes.get_title() for axes in figure.axes] == ["Short, step 0", "Short, step 5", "Short, step 7"]


def perceived_lines(model, **options):
    (axes,) = stages(model, steps=(0,), **options).axes
    return [
        c for c in axes.collections if isinstance(c, LineCollection) and c.get_zorder() != 7 and len(c.get_segments())
    ]


def test_a_line_leads_from_each_robot_that_sees_others_to_where_it_perceives_their_centroid():
    def three():
        model = SwarmModel(rng=1)
        model.add_robots(AGENT9, poses=[(100, 100, 0.0), (130, 100, 0.0), (600, 400, 0.0)])
        return model

    (lines,) = perceived_lines(three())
    (segment,) = lines.get_segments()  # the second looks away from the first, the third sees no robot
    assert segment == pytest.approx(np.array([[100, 100], [125, 100]]))
    assert perceived_lines(three(), perceived=False) == []
    assert "perceived" not in frame_of(three()).columns


@pytest.mark.parametrize("steps", [(), (20, 10), (10, 10), (-1,), (2.5,)])
def test_stages_that_do_not_ascend_are_refused_before_anything_is_run(steps):
    model = AGGLOMERATION(n_robots=5, rng=1)
    with pytest.raises(InvalidValueError, match="step"):
        stages(model, steps=steps)
    assert model.steps == 0


def test_a_step_that_is_past_is_refused():
    with pytest.raises(InvalidValueError, match="step is 5; expected a whole number at least 10"):
        stages(AGGLOMERATION(n_robots=5, rng=1).run(10), steps=(5, 20))


# ---- traces


@pytest.mark.parametrize(("every", "points"), [(1, 61), (5, 13), (7, 10)])
def test_a_trace_goes_from_the_start_through_every_so_many_places_to_the_end(every, points):
    figure = trace(AVOIDANCE(n_robots=3, rng=1), steps=60, every=every)
    (lines,) = traces_of(figure.axes[0])
    segments = np.array(lines.get_segments())
    assert segments.shape == (points - 1, 2, 2)
    assert (segments[1:, 0] == segments[:-1, 1]).all()
    model = AVOIDANCE(n_robots=3, rng=1)
    places = [model.swarm.position[0].copy()]
    while model.steps < 60:
        places.append(model.run(min(every, 60 - model.steps)).swarm.position[0].copy())
    assert (segments[:, 0] == places[:-1]).all()
    assert (segments[-1, 1] == places[-1]).all()


@pytest.mark.parametrize(("asked", "there", "drawn"), [(1, 3, 1), (2, 3, 2), (8, 3, 3), (8, 8, 8)])
def test_as_many_robots_are_traced_as_asked_for_each_in_a_colour_of_its_own(asked, there, drawn):
    model = AVOIDANCE(n_robots=there, rng=1)
    lines = traces_of(trace(model, steps=20, robots=asked).axes[0])
    ends = np.array([line.get_segments()[-1][1] for line in lines])
    assert (ends == model.swarm.position[:drawn]).all()
    colours = {tuple(line.get_colors()[0][:3]) for line in lines}
    assert len(lines) == len(colours) == drawn


def test_tracing_leaves_what_is_watched_alone():
    model = AVOIDANCE(n_robots=3, rng=1)
    snapshots = model.watch(last=None)
    trace(model, steps=20)
    assert model.watched is snapshots
    assert len(snapshots) == 20


def test_the_title_has_the_number_of_steps_traced():
    assert trace(AVOIDANCE(rng=1).run(30), steps=20).axes[0].get_title() == "CollisionAvoidance, 20 steps"


@pytest.mark.parametrize("options", [{"robots": 0}, {"robots": MOST_TRACES + 1}, {"steps": 0}, {"every": 0}])
def test_a_trace_of_nothing_is_refused_before_anything_is_run(options):
    model = AVOIDANCE(n_robots=2, rng=1)
    with pytest.raises(InvalidValueError, match=next(iter(options))):
        trace(model, **{"steps": 20, **options})
    assert model.steps == 0


# ---- ethograms


LAYERS = np.array([[0, 1, -1], [0, 0, -1], [1, 0, 1], [1, 1, 1]])


def image_of(figure):
    """Return the colours of the image, a row a robot, and its extent."""
    (image,) = figure.axes[0].images
    return image.to_rgba(image.get_array()), image.get_extent()


def test_every_robot_and_step_has_the_colour_of_its_layer():
    colours, extent = image_of(ethogram_figure(np.arange(1, 5), LAYERS, ["Avoid", "Explore"]))
    assert extent == [0, 4, 3.5, 0.5]
    names = [LIGHT.no_layer, *LIGHT.layers]
    for step, row in enumerate(LAYERS):
        for robot, layer in enumerate(row):
            assert tuple(colours[robot, step]) == to_rgba(names[layer + 1])


def test_the_shares_of_robots_are_stacked_below():
    figure = ethogram_figure(np.arange(1, 5), LAYERS, ["Avoid", "Explore"])
    stacks = figure.axes[1].collections
    assert [tuple(stack.get_facecolor()[0]) for stack in stacks] == [to_rgba(c) for c in LIGHT.layers[:2]]
    # Between two steps the larger of both is found.
    for step, shares in {0: (1 / 3, 2 / 3), 1: (2 / 3, 2 / 3), 2: (2 / 3, 1), 3: (1 / 3, 1), 4: (0, 1)}.items():
        tops = [max(y for x, y in stack.get_paths()[0].vertices if x == step) for stack in stacks]
        assert tops == pytest.approx(shares)


def test_the_legend_has_no_layer_only_where_there_was_none():
    texts = []
    for layer in (LAYERS, np.maximum(LAYERS, 0)):
        (legend,) = ethogram_figure(np.arange(4), layer, ["Avoid", "Explore"]).legends
        texts.append([text.get_text() for text in legend.get_texts()])
    assert texts == [["Avoid", "Explore", "no layer: it stands"], ["Avoid", "Explore"]]


def test_an_ethogram_of_every_tenth_step_begins_ten_steps_before_its_first():
    model = AVOIDANCE(n_robots=3, rng=1)
    model.watch(last=None, every=10)
    figure = ethogram(model.run(50))
    assert image_of(figure)[1] == [0, 50, 3.5, 0.5]
    assert figure.axes[0].images[0].get_array().shape == (3, 5)


@pytest.mark.parametrize(("robots", "rows"), [(None, 6), (2, 2), (99, 6)])
def test_an_ethogram_shows_the_snapshots_of_the_first_robots(robots, rows):
    model = AVOIDANCE(n_robots=6, map="sparse", rng=1)
    snapshots = model.watch(last=None)
    figure = ethogram(model.run(300), robots=robots)
    shown = np.asarray(figure.axes[0].images[0].get_array())
    assert (shown == snapshots["layer"][:, :rows].T + 1).all()
    assert set(np.unique(shown)) == {1, 2}
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["Avoid", "Explore"]


def test_a_step_alone_and_robots_that_stand_can_be_drawn():
    @behaviour
    def silent(me):
        return PASS if me.max_speed >= 0 else (0.0, 0.0)

    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(silent)
    model.watch()
    assert png(ethogram(model.run(1)))[:4] == b"\x89PNG"


@pytest.mark.parametrize("robots", [0, -1, 1.5])
def test_an_ethogram_of_no_robots_is_refused(robots):
    model = AVOIDANCE(n_robots=2, rng=1)
    model.watch()
    with pytest.raises(InvalidValueError, match="robots is"):
        ethogram(model.run(5), robots=robots)


def test_without_snapshots_the_cure_is_named():
    unwatched = AVOIDANCE(n_robots=2, rng=1).run(2)
    unstepped, headings = AVOIDANCE(n_robots=2, rng=1), AVOIDANCE(n_robots=2, rng=1)
    unstepped.watch()
    headings.watch(columns=("heading",))
    undriven = SwarmModel(rng=1)
    undriven.watch()
    for model, words in (
        (unwatched, r"no steps are stored to draw; call model\.watch\(last=None\)"),
        (unstepped, "no step is stored to draw"),
        (headings.run(2), "not stored: layer; add them"),
        (undriven.run(2), r"model\.control is None"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            ethogram(model)


@pytest.mark.parametrize("n", [1, 3, 60])
def test_the_rows_of_an_ethogram_are_named_by_unique_ids_as_explanations_are(n):
    model = AVOIDANCE(n_robots=n, map="sparse", rng=1)
    model.watch(last=None)
    figure = ethogram(model.run(5))
    figure.draw_without_rendering()
    axis = figure.axes[0].yaxis
    named = {row: label.get_text() for row, label in zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)}
    shown = {row: text for row, text in named.items() if text}
    assert shown == {row: str(model.robots[int(row) - 1].unique_id) for row in shown}
    assert len(shown) >= min(n, 3)


def test_rows_without_ids_are_counted():
    figure = ethogram_figure(np.arange(1, 5), LAYERS, ["Avoid", "Explore"])
    figure.draw_without_rendering()
    assert {label.get_text() for label in figure.axes[0].get_yticklabels()} - {""} == {"1", "2", "3"}
