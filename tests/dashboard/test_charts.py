"""Charts: when numbers are sent, what is sent, and the files that are handed over."""

import io
import math

import numpy as np
import pandas as pd
import pytest

from mesa_swarm.dashboard.page.robot_columns import RobotValues
from mesa_swarm.dashboard.page.series import Series
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import Downloads, pieces_of
from mesa_swarm.dashboard.run.charts import (
    HISTOGRAM,
    MOST_POINTS,
    MOST_SHOWN,
    OVER_TIME,
    PHASE_PLOT,
    ChartBoard,
    Charting,
    ChosenChart,
    TimeContent,
    message_of,
)
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.swarm_model import SwarmModel
from support.clock import Clock
from support.waiting import threads, wait_until


def over_time(series: Series, key: str) -> TimeContent:
    return TimeContent.of(series, ChosenChart(OVER_TIME, key))


@pytest.fixture
def charting():
    """A board that a session's numbers are sent to, and what was sent; no time passes, however slow the machine."""
    board = ChartBoard()
    board.sent = []
    board.send = lambda content, buffers=(): board.sent.append((content, buffers))
    session = Session("fire_fighting")
    charting = Charting(board, session, clock=Clock(100.0))
    yield charting
    charting.close()
    session.close()


def curves_sent(charting) -> list[dict]:
    return [content for content, _ in charting.board.sent if content["kind"] == "curves"]


def last_steps(charting) -> list[float]:
    content, buffers = next(one for one in reversed(charting.board.sent) if one[0]["kind"] == "curves")
    points = content["charts"][0]["points"]
    return np.frombuffer(buffers[0], "<f8")[points : 2 * points].tolist()


def keys_shown(charting) -> list[str]:
    return [ChosenChart.of(one["id"]).what for one in charting.board.shown]


def asks(charting, request: str, kind: str, what: str, against: str = "", **more) -> None:
    charting.act({"do": request, "value": ChosenChart(kind, what, against).text, **more})


def test_nothing_is_sent_to_a_hidden_page(charting):
    for _ in range(3):
        charting.session.step()
    assert curves_sent(charting) == []
    charting.act({"do": "look", "value": True})
    assert last_steps(charting) == [1, 2, 3]


def test_numbers_wait_until_the_last_ones_were_drawn(charting):
    charting.act({"do": "look", "value": True})
    for _ in range(3):
        charting.session.step()
    assert len(curves_sent(charting)) == 1
    charting.act({"do": "drawn"})
    assert len(curves_sent(charting)) == 2
    assert last_steps(charting) == [1, 2, 3]
    charting.act({"do": "drawn"})
    assert len(curves_sent(charting)) == 2, "there is nothing new"


def test_charts_are_brought_up_to_date_at_least_twice_a_second_while_it_is_played(charting):
    session, clock, sent = charting.session, Clock(100.0), []
    charting.ready = True  # stands in for a canvas that is ready
    charting.clock = clock
    charting.board.send = lambda content, buffers=(): sent.append(clock.now)
    charting.act({"do": "look", "value": True})
    # The state of playing comes from the loop; this one takes the steps.
    session.loop = clock.loop(
        lambda stop: session._play_step(stop) and clock.now < 105.0,
        lambda: (session.show(), charting.act({"do": "drawn"})),
    )
    session.play()
    wait_until(lambda: not threads("play"))
    gaps = np.diff(sent)
    assert len(gaps) > 8
    assert 0.4 <= gaps.min() <= gaps.max() < 0.5


def test_an_earlier_step_that_is_looked_at_is_marked(charting):
    charting.act({"do": "look", "value": True})
    for _ in range(4):
        charting.session.step()
        charting.act({"do": "drawn"})
    charting.act({"do": "drawn"})
    assert curves_sent(charting)[-1]["looked_at"] is None
    charting.session.back()
    assert curves_sent(charting)[-1]["looked_at"] == 3


def test_a_reset_sends_empty_charts(charting):
    charting.act({"do": "look", "value": True})
    charting.session.step()
    charting.act({"do": "drawn"})
    charting.session.reset()
    charting.act({"do": "drawn"})
    assert last_steps(charting) == []


def test_the_user_chooses_and_the_choice_is_kept_for_the_model(charting):
    assert keys_shown(charting) == ["at_fires", "layers", "collisions"]
    for key in ("at_fires", "layers", "collisions"):
        asks(charting, "remove", OVER_TIME, key)
    assert keys_shown(charting) == []
    for what in ("fire_temperature", "nonsense", "fire_temperature"):
        asks(charting, "add", OVER_TIME, what)
    assert keys_shown(charting) == ["fire_temperature"]
    charting.session.choose("flocking")
    assert keys_shown(charting) == ["alignment", "polarization", "layers"]
    charting.session.choose("fire_fighting")
    assert keys_shown(charting) == ["fire_temperature"]


def test_charts_of_every_kind_are_added_and_sent(charting):
    charting.act({"do": "look", "value": True})
    charting.session.step()
    asks(charting, "add", HISTOGRAM, "heading")
    asks(charting, "add", PHASE_PLOT, "Collisions in all", "Layers that drive: Avoid")
    charting.act({"do": "drawn"})
    assert [one["kind"] for one in charting.board.shown] == [OVER_TIME] * 3 + [HISTOGRAM, PHASE_PLOT]
    sent = curves_sent(charting)[-1]["charts"]
    assert [one["id"] for one in sent] == [one["id"] for one in charting.board.shown]
    assert sent[3]["x"]["label"] == "heading (degrees)"
    assert sent[4]["x"]["label"] == "Layers that drive: Avoid (% of robots)"


def test_only_what_there_is_is_added_and_no_more_than_can_be_drawn(charting):
    for kind, what in ((HISTOGRAM, "mood"), (PHASE_PLOT, "Collisions in all"), (OVER_TIME, "../layers")):
        asks(charting, "add", kind, what)
        assert "choose one of the list" in charting.board.fault
    for text in ("[", '["histogram"]', '["pie", "a", "b", ""]', "[1, 2, 3, 4]", "[" * 5000):
        charting.act({"do": "add", "value": text})
        assert charting.board.fault.startswith("chart is ")
    assert len(charting.board.shown) == 3
    for name, _ in charting.board.choices[HISTOGRAM]:
        asks(charting, "add", HISTOGRAM, name)
    assert len(charting.board.shown) == MOST_SHOWN
    assert "remove one first" in charting.board.fault


def test_a_log_axis_is_chosen_and_left_for_a_chart_alone(charting):
    asks(charting, "log", OVER_TIME, "collisions", axis="y")
    asks(charting, "log", OVER_TIME, "layers", axis="x")
    assert [one["log"] for one in charting.board.shown] == ["", "", "y"]
    asks(charting, "log", OVER_TIME, "collisions", axis="y")
    assert [one["log"] for one in charting.board.shown] == ["", "", ""]


def test_a_choice_stored_as_a_key_or_damaged_shows_what_there_is(charting):
    charting.session.chosen_charts["fire_fighting"] = ["layers", "[broken", ChosenChart(HISTOGRAM, "x").text]
    charting.refresh()
    assert keys_shown(charting) == ["layers", "x"]


def test_few_points_are_sent_of_long_runs():
    series, model = Series(), FireFighting(rng=1)
    series.follow(model)
    model.run(1_200)
    charts = [ChosenChart(OVER_TIME, key) for key in ("layers", "collisions")]
    (news, _), (buffer, _) = message_of(series, charts, RobotValues(0), None)
    assert MOST_POINTS / 2 < news["points"] <= MOST_POINTS
    assert news["banded"]
    assert len(buffer) == 8 * news["points"] * (2 + 3 * len(news["names"]))


def test_a_csv_has_the_whole_series_with_units_in_the_header():
    series, model = Series(), FireFighting(rng=2)
    series.follow(model)
    model.run(700)
    table = pd.read_csv(io.BytesIO(over_time(series, "at_fires").csv()))
    assert table["step"].tolist() == list(range(1, 701))
    assert list(table)[1] == "fire 1 (robots)"
    history = model.fires.history
    assert table.to_numpy()[9::10, 1:].tolist() == np.maximum(history.robots[-70:], 0).tolist()
    last = over_time(series, "fire_temperature").csv().decode().splitlines()[-1].split(",")
    assert [float(word) for word in last[1:]] == model.fires.temperature.tolist()


def test_a_chart_that_gets_another_curve_after_the_click_arrives_with_it():
    series, model = Series(), SwarmModel(rng=1)
    series.follow(model)
    model.event("first")
    model.step()
    clicked = over_time(series, "events")
    model.event("second")
    model.step()
    table = pd.read_csv(io.BytesIO(clicked.csv()))
    assert len(table) == 2
    assert len(table.columns) == 3  # the step, and both names


def test_a_csv_of_a_reporter_has_its_numbers_infinity_too_and_gaps_where_there_is_none():
    rows = [1.0, math.inf, None, "3.5", np.ma.masked, 10**400, 1e300, 2]
    series, model = Series(), SwarmModel(rng=1, model_reporters={"x": lambda model: rows[model.steps - 1]})
    series.follow(model)
    model.run(len(rows))
    numbers = pd.read_csv(io.BytesIO(over_time(series, "x").csv()))["X"].tolist()
    assert numbers[:2] + numbers[-2:] == [1.0, math.inf, 1e300, 2.0]
    assert np.isnan(numbers[2:-2]).all()


def test_files_are_handed_over(charting):
    charting.session.step()
    asks(charting, "add", HISTOGRAM, "smallest distance reading")
    asks(charting, "add", PHASE_PLOT, "Collisions in all", "Layers that drive: Avoid")
    for request in ("csv", "png"):
        asks(charting, request, OVER_TIME, "layers")
        asks(charting, request, OVER_TIME, "../layers")
        asks(charting, request, HISTOGRAM, "smallest distance reading")
        asks(charting, request, PHASE_PLOT, "Collisions in all", "Layers that drive: Avoid")
    wait_until(lambda: sum(content["kind"] == "file" for content, _ in charting.board.sent) == 6)
    files = {
        content["name"]: b"".join(buffers) for content, buffers in charting.board.sent if content["kind"] == "file"
    }
    assert files["fire_fighting_layers.csv"].startswith(b"step,Avoid (% of robots)")
    histogram = "fire_fighting_smallest_distance_reading_histogram_step_1"
    phase = "fire_fighting_Collisions_in_all_against_Layers_that_drive_Avoid"
    label = "smallest distance reading (map units)"
    assert files[f"{histogram}.csv"].startswith(f"{label} from,{label} to,robots\n".encode())
    assert files[f"{phase}.csv"].splitlines()[0] == (
        b"step,Layers that drive: Avoid (% of robots),Collisions in all (collisions)"
    )
    for name in ("fire_fighting_layers", histogram, phase):
        assert files[f"{name}.png"].startswith(b"\x89PNG")


def test_a_figure_is_drawn_before_anything_was_measured():
    series = Series()
    series.follow(FireFighting(rng=1))
    assert over_time(series, "layers").figure().axes[0].get_xlabel() == "step"


def test_files_go_in_pieces_as_they_are_asked_for(tmp_path):
    board = ChartBoard()
    sent = []
    board.send = lambda content, buffers: sent.append((content, buffers[0]))
    path = tmp_path / "run.arrow"
    path.write_bytes(bytes(2_500_000))
    downloads = Downloads(board)
    downloads.send("run.arrow", path)
    assert len(sent) == 1
    while not sent[-1][0]["last"]:
        assert downloads.hear({"do": "more", "value": sent[-1][0]["number"]})
    assert [len(piece) for _, piece in sent] == [1_000_000, 1_000_000, 500_000]
    assert not downloads.hear({"do": "drawn"})


def test_an_empty_file_is_one_empty_piece(tmp_path):
    (tmp_path / "empty").write_bytes(b"")
    assert list(pieces_of(tmp_path / "empty", 10)) == [(b"", True)]
    assert list(pieces_of(b"", 10)) == [(b"", True)]
