import io

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mesa_swarm.experiments.figures import fires_figure, series_figure, window_means
from mesa_swarm.experiments.learning_figures import fire_figure, fire_run, reward_figure
from mesa_swarm.experiments.reality_gap import Gap, gap_figure
from mesa_swarm.learning.reward_lab import reward_profile
from mesa_swarm.maps.map import Map
from mesa_swarm.maps.map_parts import FireSpot
from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.final_state import final_state_of
from mesa_swarm.viewing.palette import LIGHT, fire_colour, rgb
from mesa_swarm.viewing.pictures import draw_world, legend_of, png, world_figure
from mesa_swarm.viewing.scene import scene_of
from mesa_swarm.world.shapes import disc, polygon, rectangle
from mesa_swarm_studies.benchmarks.speed import (
    AREA_PER_ROBOT,
    Goal,
    complexity_figure,
    exponent,
    peer_workload,
    step_table,
)
from mesa_swarm_studies.drawing import world_picture

FIRE = find_model("fire_fighting")
GROUND = tuple(rgb(LIGHT.ground).tolist())


def empty_world(obstacles=(), fires=(), side=100):
    return SwarmModel(map=Map(name="hall", bounds=(0, 0, side, side), obstacles=obstacles, fires=fires), rng=1)


def pixels(model, sectors=False, side=100):
    """The world as an image without frame: `at(x, y)` reads the colour at map coordinates."""
    figure = Figure(figsize=(5, 5), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    draw_world(model, axes, sectors)
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[..., :3]

    def at(x, y):
        return tuple(int(c) for c in image[round((1 - y / side) * 499), round(x / side * 499)])

    return at


def colour(name):
    return tuple(rgb(name).tolist())


def near(seen, wanted):
    return max(abs(a - b) for a, b in zip(seen, wanted, strict=True)) <= 3


def test_obstacles_are_where_they_stand_and_holes_stay_open():
    ring = polygon([(60, 60), (90, 60), (90, 90), (60, 90)], [[(70, 70), (80, 70), (80, 80), (70, 80)]])
    at = pixels(empty_world([disc((25, 25), 10), rectangle((50, 5), (70, 15)), ring]))
    for point in [(25, 25), (25, 33), (33, 25), (52, 7), (68, 13), (65, 65), (85, 75)]:
        assert near(at(*point), colour(LIGHT.obstacle)), point
    for point in [(25, 37), (37, 25), (48, 10), (75, 75), (95, 95)]:
        assert near(at(*point), GROUND), point


def test_ground_marks_do_not_look_like_obstacles():
    at = pixels(empty_world([rectangle((10, 10), (40, 40), contact=False)]))
    assert near(at(25, 25), colour(LIGHT.mark))


def test_a_load_has_its_own_colour_and_is_drawn_where_it_lies_now():
    model = empty_world([rectangle((0, 90), (100, 100))])
    load = model.add_load(rectangle((20, 40), (40, 60)), resistance=1)
    load.move_to((70.0, 50.0, np.pi / 4))
    at = pixels(model)
    for point in [(70, 50), (70, 62), (58, 50)]:
        assert near(at(*point), colour(LIGHT.load)), point
    assert at(30, 50) == at(61, 59) == GROUND
    assert near(at(50, 95), colour(LIGHT.obstacle))
    assert [entry.get_label() for entry in legend_of(model)] == ["obstacle", "load"]


def test_the_front_half_of_a_robot_has_another_colour_than_its_back():
    model = empty_world()
    model.add_robots(AGENT9, poses=[(50, 50, np.pi / 2)])
    at = pixels(model)
    assert near(at(48, 53), colour(LIGHT.robot_front))
    assert near(at(52, 53), colour(LIGHT.robot_front))
    assert near(at(48, 47), colour(LIGHT.robot))
    assert near(at(50, 56), GROUND)
    assert near(at(44, 50), GROUND)


def test_robots_that_are_too_hot_have_another_back():
    model = empty_world()
    model.add_robots(AGENT9, poses=[(50, 50, 0.0)])
    model.swarm.columns["hot"][:] = True
    assert near(pixels(model)(47, 50), colour(LIGHT.robot_hot))


@pytest.mark.parametrize("temperature", [0.01, 0.5, 1.0])
def test_fires_are_coloured_by_their_temperature_and_to_scale(temperature):
    at = pixels(empty_world(fires=[FireSpot((50, 50), 20, temperature)]))
    wanted = colour(fire_colour(temperature))
    assert near(at(50, 65), wanted)
    assert near(at(64, 50), wanted)
    assert near(at(50, 72), GROUND)


def test_the_hotter_the_fire_the_lighter_its_colour_for_any_colour_vision():
    red, green, blue = np.transpose([colour(fire_colour(t)) for t in np.linspace(0, 1, 50)])
    assert (np.diff(0.2126 * red + 0.7152 * green + 0.0722 * blue) > 0).all()


def test_fires_that_are_out_are_pale():
    model = empty_world(fires=[FireSpot((50, 50), 20)])
    model.fires.own["out"][:] = True
    assert near(pixels(model)(50, 65), colour(LIGHT.ashes))


def test_sensor_sectors_are_drawn_only_if_asked_and_reach_as_far_as_the_sensors():
    model = empty_world()
    model.add_robots(AGENT9.with_proximity(range=20), poses=[(50, 50, 0.0)])
    assert near(pixels(model)(73, 50), GROUND)
    at = pixels(model, sectors=True)
    assert not near(at(73, 50), GROUND)
    assert near(at(77, 50), GROUND)


@pytest.mark.slow
def test_a_frame_draws_what_its_model_draws():
    model = FIRE(rng=1).run(50)
    before, state, now = (frame_of(model), scene_of(model)), final_state_of(model), png(world_figure({"now": model}))
    model.run(5)
    assert png(world_figure({"now": before})) == png(world_figure({"now": state})) == now
    assert png(world_figure({"now": model})) != now


def test_the_legend_names_what_is_there_and_nothing_else():
    labels = [entry.get_label() for entry in legend_of(FIRE(rng=1))]
    assert labels[:2] == ["obstacle", "robot, its front pale"]
    assert "fire, out" in labels
    assert legend_of(empty_world()) == []


def test_worlds_stand_side_by_side_with_their_titles():
    figure = world_figure({"one": empty_world(), "two": empty_world()})
    assert [axes.get_title() for axes in figure.axes] == ["one", "two"]
    left, right = (axes.get_position() for axes in figure.axes)
    assert left.y0 == pytest.approx(right.y0)
    assert left.x1 < right.x0


def test_the_history_of_fires_ends_with_the_present():
    model = FIRE(rng=1).run(123)
    history = final_state_of(model).history
    assert history["steps"][-1] == 123
    assert (history["robots"][-1] == np.where(model.fires.out, -1, model.fires.robots)).all()
    assert (history["temperature"][-1] == model.fires.temperature).all()


@pytest.mark.slow
def test_each_strip_shows_the_robots_at_its_fire_and_minus_one_once_it_is_out():
    model = FIRE(rng=1).run(600)
    final = final_state_of(model)
    figure = fires_figure({"B": final, "B again": final})
    strips = figure.axes
    assert len(strips) == 14
    assert model.fires.out.any()
    for i, axes in enumerate(strips[:7]):
        shown = {line.get_label(): line.get_ydata() for line in axes.lines}
        burning, out = shown[f"fire {i + 1}"], shown["out"]
        history = final.history["robots"][:, i]
        assert np.array_equal(np.where(np.isnan(burning), out, burning)[: len(history)], history)
        assert axes.get_ylabel() == f"fire {i + 1}"
    assert strips[6].get_xlabel() == "step"
    assert {axes.get_ylim() for axes in strips} == {strips[0].get_ylim()}
    assert {axes.get_xlim() for axes in strips} == {(0.0, 600.0)}


@pytest.mark.slow
def test_the_block_of_the_first_value_is_above_the_second():
    final = final_state_of(FIRE(rng=1).run(30))
    figure = fires_figure({"A": final, "B": final})
    png(figure)
    tops = [block.bbox.y1 for block in figure.subfigs]
    assert tops[0] > tops[1]


def test_series_show_the_means_of_windows_over_time():
    model = find_model("collision_avoidance")(rng=1).run(80)
    figure = series_figure({"first": final_state_of(model)})
    (line,) = figure.axes[1].lines
    total = model.datacollector.get_model_vars_dataframe()["total_collisions"].to_numpy()
    assert np.array_equal(line.get_ydata(), total.reshape(40, 2).mean(axis=1))
    assert figure.axes[-1].get_xlabel() == "step"


def test_window_means_of_a_short_series_are_the_series():
    middles, means = window_means(np.array([4.0, 6.0]))
    assert middles.tolist() == [1.0, 2.0]
    assert means.tolist() == [4.0, 6.0]


def test_pictures_are_pngs_and_leave_no_state_in_pyplot():
    before = dict(mpl.rcParams)
    content = png(world_figure({"now": empty_world()}))
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    assert mpl.image.imread(io.BytesIO(content)).shape[2] == 4
    assert dict(mpl.rcParams) == before


def test_the_peer_workload_has_the_agreed_density():
    model = peer_workload(100)
    width, height = np.diff(model.space.dimensions, axis=1).ravel()
    body = np.pi * 5.0**2
    assert width * height == pytest.approx(100 * AREA_PER_ROBOT * body)
    assert len(model.obstacles) == 10
    assert {sensor.range for sensor in model.swarm.designs[0].proximity} == {16}
    assert len(model.swarm.designs[0].proximity) == 9


def test_the_same_workload_twice_gives_the_same_state():
    first, second = (peer_workload(50).run(20).state_hash() for _ in range(2))
    assert first == second


def test_the_benchmark_table_shows_which_requirements_are_passed():
    lines = step_table({50: 0.00002, 200: 0.001, 1000: 0.0003, 5000: 0.001, 10_000: 0.006})
    assert [line.split()[3] for line in lines[2:]] == ["yes", "no", "yes", "yes", "no"]
    assert max(map(len, lines)) <= 100
    memory = Goal(what="memory", unit="B", limit=2000)
    assert memory.verdict(3000.0).endswith("3,000 (required: at most 2,000, MISSED)")
    assert memory.verdict(2000.0).endswith("passed)")


def test_the_growth_exponent_is_that_of_a_power_law():
    assert exponent({n: 3 * n**1.02 for n in (200, 10_000)}) == pytest.approx(1.02)


def test_complexity_curves_have_a_panel_each_with_axes_and_legend():
    curves = {"few": {"a": {1: 1e-5, 50: 1e-4}, "b": {1: 2e-5, 50: 3e-4}}, "many": {"c": {10: 1e-5, 3000: 1e-3}}}
    figure = complexity_figure(curves)
    assert [axes.get_title() for axes in figure.axes] == ["few", "many"]
    assert [axes.get_xscale() for axes in figure.axes] == ["linear", "log"]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["a", "b"]
    assert figure.axes[0].lines[1].get_ydata() == pytest.approx([0.02, 0.3])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a$\\frac{$b", "{n$^$}"])
def test_dollars_in_names_are_shown_as_they_are_in_all_pictures(name):
    gap = Gap(model=name, measure=name, preset=name, dial=(0.0, 1.0), seeds=[1], steps=1, scores={0.0: [1], 1.0: [2]})
    profile = reward_profile("a", actions=4, points=11)
    run = fire_run("shared", rng=1, steps=20, round_steps=10, n_robots=2)
    pictures = [
        gap_figure(gap),
        reward_figure({name: (profile, profile)}),
        fire_figure({name: [run]}),
        complexity_figure({name: {name: {10: 0.1, 20: 0.2}}}),
        world_picture(empty_world(), name),
        world_figure({name: empty_world()}),
        fires_figure({name: final_state_of(find_model("fire_fighting")(rng=1).run(60))}),
        series_figure({name: final_state_of(find_model("collision_avoidance")(rng=1).run(60))}),
    ]
    assert all(png(picture)[1:4] == b"PNG" for picture in pictures)


def test_the_legend_names_kinds_of_bodies_that_have_no_colour_of_their_own():
    model = empty_world([rectangle((0, 90), (100, 100))])
    model.add_load(rectangle((20, 40), (40, 60)), resistance=1)
    model.add_body(disc((70, 20), 5), kind="spider")
    model.add_body(disc((20, 20), 5), kind="nest", mode="fixed")
    assert [entry.get_label() for entry in legend_of(model)] == ["obstacle, nest", "load, spider"]
