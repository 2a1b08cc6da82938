"""A model on its page has the bits that it has in Python."""

import json
import math
import re
from functools import cache

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, SwarmModel, count, disc, mean, measure, process, scatter
from mesa_swarm.control import (
    PASS,
    Avoid,
    Chance,
    Explore,
    Halt,
    Seen,
    StateMachine,
    Subsumption,
    Team,
    Transition,
    behaviour,
)
from mesa_swarm.errors import ExportError
from mesa_swarm.live.live_page import LivePage, compile_pages
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.recording.continuing import continued
from support.live_pages import ask_node, hashes_in_node, hashes_in_python

SEEDS, STEPS = (1, 2, 3), (0, 1, 100, 5000)
# Models of the gallery that run on a page, with the settings of a second page, and what is changed at step 100.
MODELS = {
    "agglomeration": ({"n_robots": 20}, {"stop_distance": 20.0}),
    "ant_trails": ({"n_robots": 20, "ratio": 1.5}, {"leaving": 0.1}),
    "best_of_n": ({"n_robots": 20, "rule": "voter"}, {"exploring": 100.0}),
    "boids": ({"n_robots": 30, "alignment_weight": 0.5}, {"cohesion_weight": 0.1}),
    "chain_formation": ({"n_robots": 20}, {}),
    "collision_avoidance": ({"n_robots": 30, "turn_interval": 40}, {"distance": 10.0}),
    "cooperative_transport": ({"n_robots": 12, "load": "box"}, {"resistance": 1.0}),
    "fire_fighting": ({"strategy": "A", "n_robots": 20}, {"k1": 0.001}),
    "flocking": ({"n_robots": 20}, {}),
    "foraging": ({"n_robots": 20, "thresholds": "no", "items": 40}, {}),
    "learning_fires": ({"n_robots": 20, "controller": "own", "round_steps": 800}, {"gamma": 0.5}),
    "perimeter": ({"n_robots": 12}, {}),
    "puck_clustering": ({"n_robots": 8, "rows": 2}, {"many": 5}),
    "q_learning": ({"n_robots": 10}, {"gamma": 0.5}),
    "shepherding": ({"n_robots": 2, "n_sheep": 20, "neighbours": 10}, {}),
    "signposts": ({"n_robots": 30, "moves": 200}, {"evaporation": 0.05}),
    "task_allocation": ({"n_robots": 20}, {"demand": 2.0}),
}


@cache
def page_of(name, settings=()):
    model_class = find_model(name)
    return model_class, LivePage(model_class(rng=1, **dict(settings)), SEEDS)


def check_page(name, settings, seeds, folder):
    model_class, page = page_of(name, tuple(settings.items()))
    for seed in seeds:
        expected = hashes_in_python(model_class(rng=seed, **settings), STEPS)
        assert ask_node(page, hashes_in_node(STEPS, seed), folder) == expected


def test_fire_fighting_on_a_page_has_the_fingerprints_of_python(tmp_path):
    check_page("fire_fighting", {}, SEEDS, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("changed", [False, True])
def test_a_model_of_the_gallery_has_the_fingerprints_of_python(name, changed, tmp_path):
    check_page(name, MODELS[name][0] if changed else {}, SEEDS, tmp_path)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "fire_fighting" else pytest.mark.slow) for name in MODELS]
)
def test_a_parameter_that_is_changed_on_the_way_changes_what_it_changes_in_python(name, tmp_path):
    model_class, page = page_of(name)
    for parameter, value in MODELS[name][1].items():
        model = continued(model_class(rng=1).run(100), **{parameter: value})
        body = (
            f'model.step(100); model.set("{parameter}", {value}); model.step(200); return [model.steps, model.hash()]'
        )
        assert ask_node(page, body, tmp_path) == [300, model.run(200).state_hash()]


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_every_parameter_of_a_page_at_its_end_is_that_of_a_new_run(name, tmp_path):
    model_class, page = page_of(name)
    for parameter, value, values, _ in page.changes.values():
        other = values[-1] if values[-1] != value else values[0]
        text = f'"{other}"' if isinstance(other, str) else other
        body = f'model.set("{parameter.name}", {text}); model.reset(); model.step(50); return model.hash()'
        expected = model_class(rng=1, **{parameter.name: other}).run(50).state_hash()
        assert ask_node(page, body, tmp_path) == expected, parameter.name


def test_a_page_begins_anew_as_often_as_one_likes(tmp_path):
    body = "return [0, 1, 2].map(() => { model.reset(); model.step(60); return model.hash(); });"
    first, *others = ask_node(page_of("fire_fighting")[1], body, tmp_path)
    assert others == [first, first]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "fire_fighting" else pytest.mark.slow) for name in MODELS]
)
def test_the_rows_of_measures_are_those_of_the_data_collector(name, tmp_path):
    model_class, page = page_of(name)
    model = model_class(rng=2).run(600)
    body = """
    model.reset({ seed: 2 });
    model.step(600);
    return [model.start.rows.names, model.series.steps.length, model.series.values];
    """
    names, count, values = ask_node(page, body, tmp_path)
    assert count == model.steps
    found = dict(zip(names, values, strict=True))
    assert found.keys() >= set(model.datacollector.model_vars)
    for reporter, numbers in found.items():
        expected = [None if math.isnan(number) else number for number in model.datacollector.model_vars[reporter]]
        assert numbers == expected


@behaviour(memory={"steps": 0.0})
def lapse(me):
    """Fail in the thirtieth step."""
    me.memory.steps += 1.0
    if me.memory.steps == 30:
        raise ValueError("the thirtieth step")
    return 0.0, 0.0


@behaviour(memory={"shy": 0.0})
def keep_off(me, near=12.0, share=0.5):
    """Back away from what is ahead, sometimes, and remember how often."""
    if 0 <= me.distance[me.front] < near and me.chance < share:
        me.memory.shy += 1.0
        return -me.max_speed, -me.max_speed
    return PASS


def assembled(seed):
    model = SwarmModel(map="original", rng=seed)
    model.add_robots(AGENT9, 15)
    model.control = Subsumption(keep_off(near=14.0), Avoid(distance=10), Explore(turn_interval=40))
    return model


@pytest.mark.slow
def test_a_model_put_together_by_hand_goes_on_from_where_it_stands(tmp_path):
    model = assembled(3).run(7)
    page = LivePage(model)
    assert page.is_assembled
    expected = hashes_in_python(model, (7, 8, 100, 5000))
    steps = "[7, 8, 100, 5000]"
    body = f"return {steps}.map((step) => {{ model.step(step - model.steps); return [model.steps, model.hash()]; }})"
    assert ask_node(page, body, tmp_path) == expected


def test_a_robot_that_is_moved_on_the_page_is_where_its_handle_puts_it_in_python(tmp_path):
    model = find_model("fire_fighting")(rng=1).run(50)
    model.swarm.agents[4].position = (300.0, 250.0)
    body = """
    model.step(50);
    const [x, y] = model.column("position");  // of another robot
    const found = [model.move(4, 300, 250), model.move(4, -5, 10), model.move(4, x, y)];
    model.step(100);
    return [found, model.hash()];
    """
    assert ask_node(page_of("fire_fighting")[1], body, tmp_path) == [[True, False, False], model.run(100).state_hash()]


def test_fires_that_are_put_out_and_lit_on_the_page_are_as_their_handles_leave_them_in_python(tmp_path):
    model = find_model("fire_fighting")(rng=1).run(50)
    model.fires[1].put_out()
    model.run(100)
    model.fires[1].put_out()
    model.fires[1].light()
    model.fires[0].put_out()
    model.fires[2].light()
    body = """
    model.step(50);
    model.burn(1, false); model.burn(1, false);
    model.step(100);
    model.burn(1, false); model.burn(1); model.burn(0, false); model.burn(2);
    model.step(200);
    const complain = (place) => { try { model.burn(place); } catch (error) { return error.message; } return ""; };
    return [model.hash(), [7, -1, 0.5].map(complain)];
    """
    found, complaints = ask_node(page_of("fire_fighting")[1], body, tmp_path)
    assert found == model.run(200).state_hash()
    assert complaints == [f"fire is {place}; expected 0 to 6" for place in (7, -1, 0.5)]


def test_a_page_begins_with_other_numbers_of_robots_and_its_sliders_act_on_them(tmp_path):
    model_class, page = page_of("fire_fighting")
    (robots,) = {variant.value for variant in page.variants if variant.name == "n_robots"} & {20}
    body = f'model.reset({{ n_robots: {robots} }}); model.step(100); model.set("k1", 0.001); model.step(200);'
    expected = continued(model_class(rng=1, n_robots=robots).run(100), k1=0.001).run(200)
    assert ask_node(page, f"{body} return [model.start.robots, model.hash()]", tmp_path) == [20, expected.state_hash()]


def test_what_a_page_cannot_begin_with_is_refused_and_the_run_goes_on(tmp_path):
    body = """
    model.step(10);
    const complaint = (wanted) => { try { model.reset(wanted); } catch (error) { return error.message; } return ""; };
    const found = [{ n_robots: 7 }, { nonsense: 1 }, { seed: 2, n_robots: 20 }, { seed: 99 }].map(complaint);
    return [...found, model.steps];
    """
    few, unknown, both, seed, steps = ask_node(page_of("fire_fighting")[1], body, tmp_path)
    assert few == "n_robots is 7; this page can begin with 1, 5, 10, 20, 50"
    assert unknown == "nonsense is not a parameter with which this page can begin; expected n_robots"
    assert both == "seed is 2; this page has 1, 2, 3; with n_robots 20 it has 1: export another page for more"
    assert seed == "seed is 99; this page has 1, 2, 3: export another page for more"
    assert steps == 10


@process
def count_steps(model):
    model.state["steps"] = model.steps


@pytest.mark.parametrize(("added", "reason"), [
    (lambda model: model.add_process(count_steps), "count_steps takes place (processes) in Python"),
    (lambda model: scatter(model, 3, speed=0.5), "Wander takes place (processes) in Python"),
])  # fmt: skip
def test_what_is_python_in_a_step_is_refused_in_one_line_that_names_it(added, reason):
    model = assembled(1)
    added(model)
    with pytest.raises(ExportError, match=re.escape(reason)) as caught:
        LivePage(model, ())
    assert "\n" not in str(caught.value)
    assert "@process" in str(caught.value)


def test_pages_of_the_gallery_are_compiled_at_once():
    assert compile_pages(["fire_fighting"]) == ["fire_fighting"]


def test_every_model_of_the_gallery_is_a_page():
    assert MODELS.keys() == set(gallery_names())


@process(events=("passed",))
def report(passed):
    passed[0] = 1.0


@pytest.mark.slow
def test_events_are_those_of_python_and_their_number_and_the_last_ones_are_kept(tmp_path):
    model = assembled(1)
    model.add_process(report)
    body = """
    model.step(6000);
    const { names, counts, last } = model.events;
    return [names, counts, last.length, last.at(-1), model.hash()];
    """
    names, counts, length, last, found = ask_node(LivePage(model), body, tmp_path)
    model.run(6000)
    assert (names, counts) == (["passed"], [6000])
    assert 1000 <= length < 6000
    assert last == {"step": 6000, "name": "passed", "robot": model.swarm.agents[0].unique_id, "value": 1.0}
    assert found == model.state_hash()


@process(events=("passed",))
def report_all(passed):
    passed[:] = 1.0


@pytest.mark.slow
def test_more_events_in_a_step_than_a_page_has_room_for_are_an_error_and_not_a_wrong_count(tmp_path):
    model = SwarmModel(map=Map(name="hall", bounds=(0, 0, 1400, 1400)), rng=1)
    model.add_robots(AGENT9, poses=[(20 * (1 + n % 65), 20 * (1 + n // 65), 0) for n in range(4225)])
    model.add_process(report_all)
    body = """
    try { model.step(1); } catch (error) { return error.message; }
    return "no error";
    """
    found = ask_node(LivePage(model), body, tmp_path)
    assert found == "step 1 reported 4225 events, and a page has room for 4096 in a step; run the model in Python"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "settings"), [
    ("fire_fighting", {"noise": 0.1, "slip": 0.1, "n_robots": 12}),
    ("collision_avoidance", {"imperfections": 1.0, "n_robots": 12}),
], ids=str)  # fmt: skip
def test_errors_of_sensors_wheels_and_batteries_are_those_of_python(name, settings, tmp_path):
    check_page(name, settings, (1, 3), tmp_path)


@pytest.mark.slow
def test_teams_and_state_machines_decide_as_in_python(tmp_path):
    def team():
        model = SwarmModel(map="sparse", rng=3)
        model.add_robots(AGENT9, 6, group="patient")
        model.add_robots(AGENT9, 6, group="busy")
        leaving = Transition(source="stay", target="search", condition=Chance(probability=0.05))
        resting = Transition(source="search", target="stay", condition=Seen(kind="robot", within=15))
        states = {"search": (Avoid(distance=12), Explore(turn_interval=20)), "stay": Halt()}
        patient = StateMachine(states=states, transitions=[resting, leaving])
        model.control = Team({"patient": patient, "busy": Subsumption(Avoid(distance=15), Explore(turn_interval=15))})
        return model

    steps = (0, 1, 100, 3000)
    body = (
        f"return {list(steps)}.map((step) => {{ model.step(step - model.steps); return [model.steps, model.hash()]; }})"
    )
    assert ask_node(LivePage(team(), ()), body, tmp_path) == hashes_in_python(team(), steps)


@pytest.mark.slow
def test_rows_of_a_long_run_are_thinned_and_its_last_numbers_are_those_of_its_last_step(tmp_path):
    model_class, page = page_of("boids")
    body = """
    model.step(45003);
    const { steps, values, last, every } = model.series;
    return [steps.length, every, steps.slice(-2), model.start.rows.names, last, values.map((of) => of.length)];
    """
    count, every, steps, names, last, lengths = ask_node(page, body, tmp_path)
    assert (count, every, steps) == (45003 // 4, 4, [44996, 45000])
    assert set(lengths) == {count}
    assert dict(zip(names, last, strict=True))["total_collisions"] == model_class(rng=1).run(45003).total_collisions


@pytest.mark.slow
def test_steps_before_one_that_fails_are_counted_and_the_error_names_the_one_that_fails(tmp_path):
    model = SwarmModel(map="sparse", rng=3)
    model.add_robots(AGENT9, 3)
    model.control = Subsumption(lapse())
    body = """
    model.step(5);
    let words = "";
    try { model.step(100); } catch (error) { words = error.message; }
    return [model.steps, words];
    """
    steps, words = ask_node(LivePage(model, ()), body, tmp_path)
    assert steps == 29
    assert words.startswith("step 30 cannot be taken here")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["boids", "fire_fighting", "puck_clustering", "learning_fires"])
def test_sliders_act_on_every_start_as_in_python(name, tmp_path):
    model_class, page = page_of(name)
    assert page.variants
    calls, expected = [], []
    for variant in page.variants:
        for parameter, present, values, change in page.changes.values():
            stored = list(change.bytes) or values
            other = stored[-1] if stored[-1] != present else stored[0]
            begins, value = json.dumps({variant.name: variant.value}), json.dumps(other)
            calls.append(f"[{begins}, {json.dumps(parameter.name)}, {value}, {json.dumps(present)}]")
            model = continued(model_class(rng=1, **{variant.name: variant.value}), **{parameter.name: other})
            expected.append(model.run(30).state_hash())
    body = f"""
    return [{", ".join(calls)}].map(([begins, name, value, usual]) => {{
      const others = Object.fromEntries(model.about.begins.map(({{ name: one, value: own }}) => [one, own]));
      model.reset({{ seed: 1, ...others, ...begins }});
      model.set(name, value);
      model.step(30);
      const found = model.hash();
      model.set(name, usual);
      return found;
    }});
    """
    assert ask_node(page, body, tmp_path) == expected


DISCS = ((300.0, 250.0, 30.0), (560.0, 180.0, 12.5), (300.0, 430.0, 12.5))
# Bodies move, or fields flow round them, or functions read where they are.
WITHOUT_DISCS = {"ant_trails", "cooperative_transport", "foraging", "puck_clustering", "shepherding"}


def free_place(model, radius):
    """Return a place on the map where a disc of this radius meets no robot."""
    rng, (x0, y0, x1, y1) = np.random.default_rng(1), model.map.bounds
    places = rng.uniform((x0, y0), (x1, y1), (1000, 2))
    gaps = np.linalg.norm(places[:, None] - model.swarm.position, axis=2) - model.swarm.radius
    return places[np.flatnonzero(gaps.min(axis=1) > 1.1 * radius)[0]].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in MODELS if name not in WITHOUT_DISCS])
def test_a_disc_on_the_way_of_a_model_of_the_gallery_is_an_obstacle_in_python(name, tmp_path):
    model_class, page = page_of(name)
    model = model_class(rng=1).run(50)
    radius = float(model.swarm.radius.max())
    x, y = free_place(model, radius)
    own = [body for body in model.obstacles if body.shape.is_disc and body.contact]
    model.add_obstacle(disc((x, y), radius))
    found = [model.state_hash(), model.run(300).state_hash()]
    for body in own[:1]:
        body.remove()
    found.append(model.run(300).state_hash())
    body = f"""
    model.step(50);
    const own = model.discs.map(([row]) => row);
    model.addDisc({x}, {y}, {radius});
    const hashes = [model.hash()];
    model.step(300);
    hashes.push(model.hash());
    if (own.length) model.removeDisc(own[0]);
    model.step(300);
    return [own.length, [...hashes, model.hash()]];
    """
    assert ask_node(page, body, tmp_path) == [len(own), found]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(WITHOUT_DISCS))
def test_a_page_on_which_discs_would_go_unnoticed_refuses_them(name, tmp_path):
    body = """
    const complain = (act) => { try { act(); } catch (error) { return error.message; } return ""; };
    return [model.discs, model.spare, complain(() => model.addDisc(1, 1, 1)), complain(() => model.removeDisc(0))];
    """
    discs, spare, *complaints = ask_node(page_of(name)[1], body, tmp_path)
    assert (discs, spare) == ([], None)
    assert all(text.startswith("discs cannot be added or taken away here: bodies move") for text in complaints)


def test_a_disc_where_a_robot_is_or_beyond_what_a_page_has_room_for_is_refused_and_changes_nothing(tmp_path):
    body = """
    const complain = (act) => { try { act(); } catch (error) { return error.message; } return ""; };
    const before = model.hash(), [x, y] = model.column("position");
    const met = [model.addDisc(x + 10, y, 6), model.addDisc(x, y, 1)], wrong = [
      complain(() => model.addDisc(900, 100, 5)), complain(() => model.addDisc(NaN, 100, 5)),
      complain(() => model.addDisc(300, 100, 75.5)), complain(() => model.addDisc(300, 100, 0)),
      complain(() => model.removeDisc(2)), complain(() => model.addDisc("300", 100, 5)),
    ];
    const same = model.hash() === before;
    const rows = Array.from({ length: 8 }, (_, k) => model.addDisc(300 + 20 * k, 100, 5));
    const full = complain(() => model.addDisc(300, 150, 5)), spare = model.spare.left;
    rows.reverse().forEach((row) => model.removeDisc(row));
    return [met, wrong, same, full, spare, model.hash() === before, model.discs.length];
    """
    met, wrong, same, full, spare, again, left = ask_node(page_of("fire_fighting")[1], body, tmp_path)
    assert (met, same, spare, again, left) == ([-1, -1], True, 0, True, 0)
    assert wrong == [
        "place is 900, 100; expected x from 0 to 800 and y from 0 to 600",
        "disc is at NaN, 100 with radius 5; expected three numbers",
        "radius is 75.5; expected a number above 0, at most 75",
        "radius is 0; expected a number above 0, at most 75",
        "disc is 2; expected none: there is no disc",
        "disc is at 300, 100 with radius 5; expected three numbers",
    ]
    assert full == "no more discs: this page has room for 8 besides those of the model; take one of these away first"


def test_discs_that_come_and_go_on_the_page_are_as_obstacles_in_python(tmp_path):
    model = find_model("fire_fighting")(rng=1).run(50)
    added = [model.add_obstacle(disc(place, radius)) for *place, radius in DISCS]
    found = [model.state_hash(), model.run(300).state_hash()]
    added[0].remove()
    found += [model.state_hash(), model.run(400).state_hash()]
    body = f"""
    model.step(50);
    const rows = {[list(one) for one in DISCS]}.map((one) => model.addDisc(...one)), hashes = [model.hash()];
    model.step(300);
    hashes.push(model.hash());
    model.removeDisc(rows[0]);
    hashes.push(model.hash());
    model.step(400);
    return [...hashes, model.hash()];
    """
    assert ask_node(page_of("fire_fighting")[1], body, tmp_path) == found


@pytest.mark.slow
def test_a_page_of_learners_draws_their_weights_itself_and_has_twenty_seeds_within_400_kb():
    text = LivePage(find_model("q_learning")(rng=1)).text(400_000)
    about = json.loads(re.search(r'id="about">(.*?)</script>', text)[1])
    assert {start["seed"] for start in about["starts"]} == set(range(1, 21))
    assert len(text) <= 400_000


@pytest.mark.slow
def test_discs_of_the_model_that_are_taken_away_leave_as_much_room_as_before_and_large_ones_fit(tmp_path):
    model_class, page = page_of("collision_avoidance")
    model = model_class(rng=1)
    for body in [body for body in model.obstacles if body.shape.is_disc and body.contact]:
        body.remove()
    places = [(x, y) for x in (150.0, 300.0, 500.0, 650.0) for y in (150.0, 450.0)]
    body = f"""
    for (const [row] of model.discs) model.removeDisc(row);
    const left = model.spare.left, added = [];
    for (const [x, y] of {[list(place) for place in places]}) {{
      if (model.addDisc(x, y, model.spare.largest) >= 0) added.push([x, y]);
    }}
    const before = model.hash();
    model.step(300);
    return [left, added, model.spare.largest, before, model.hash()];
    """
    left, added, largest, *hashes = ask_node(page, body, tmp_path)
    for place in added:
        model.add_obstacle(disc(tuple(place), largest))
    assert (left, len(added) > 2) == (8, True)
    assert hashes == [model.state_hash(), model.run(300).state_hash()]


class OfContacts(SwarmModel):
    """Robots of which something asks for numbers of what they met."""

    def __init__(self, rng=None, **named):
        super().__init__(map="sparse", rng=rng, **named)
        self.add_robots(AGENT9, 3)
        self.control = Subsumption(Avoid(), Explore())


def test_discs_are_refused_where_functions_or_measures_take_the_numbers_of_bodies():
    @process(memory={"sum": 0.0})
    def add_up(contact_index, sum):
        sum[0] += contact_index[0]

    @measure
    def first_met(contact_index):
        return contact_index[0]

    def has_discs(model):
        return "discs" in LivePage(model, ()).starts[0][1].places

    asked = OfContacts(rng=0)
    asked.add_process(add_up)
    assert has_discs(OfContacts(rng=0))
    assert not has_discs(asked)
    for reporter in (first_met, count("contact_index", above=2), mean("bodies.pushers")):
        assert not has_discs(OfContacts(rng=0, model_reporters={"met": reporter}))


def test_so_many_steps_may_be_taken_at_once_as_fill_the_history_of_fires_more_than_once(tmp_path):
    model_class, page = page_of("fire_fighting")
    model = continued(model_class(rng=1), history_every=1).run(700)
    body = 'model.set("history_every", 1); return [model.step(700), model.hash()];'
    assert ask_node(page, body, tmp_path) == [700, model.state_hash()]


@pytest.mark.slow
def test_an_edit_before_the_first_step_of_learners_is_that_of_python(tmp_path):
    model_class, page = page_of("q_learning")
    model = model_class(rng=1)
    x, y = map(float, model.swarm.position[0])
    found = [model.state_hash()]
    model.add_obstacle(disc(free_place(model, 5.0), 5.0))
    found += [model.state_hash(), model.run(20).state_hash()]
    place = free_place(model_class(rng=1), 5.0)
    body = f"""
    model.addDisc({x}, {y}, 5); model.move(0, {x}, {y});
    const hashes = [model.hash()];
    model.addDisc(...{place}, 5);
    hashes.push(model.hash());
    model.step(20);
    return [...hashes, model.hash()];
    """
    assert ask_node(page, body, tmp_path) == found
