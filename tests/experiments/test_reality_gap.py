"""The dial from ideal to imperfect robots, as an experiment and as it is typed."""

import json
from zlib import crc32

import pytest
from PIL import Image

from mesa_swarm import cli
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.cli import compare
from mesa_swarm.experiments import reality_gap as module
from mesa_swarm.experiments.reality_gap import checked_dial, chosen_measure, gap_figure, reality_gap
from mesa_swarm.experiments.runs import simulate
from mesa_swarm.model.gallery import find_model, model_names

SMALL = {"n_robots": 5}


def test_ideal_robots_score_as_they_do_without_a_dial():
    gap = reality_gap("agglomeration", dial=(0, 1), seeds=[4, 5], steps=200, settings=SMALL)
    plain = [find_model("agglomeration")(rng=rng, **SMALL).run(200).results()["groups"] for rng in (4, 5)]
    assert gap.scores[0.0] == plain


@pytest.mark.long
def test_the_number_of_processes_changes_nothing():
    one, two = (reality_gap("boids", dial=(0, 1), seeds=2, steps=20, settings=SMALL, jobs=jobs) for jobs in (1, 2))
    assert one.scores == two.scores


def test_what_was_interrupted_goes_on_and_ends_in_the_same_table(tmp_path, monkeypatch):
    how = {"model": "boids", "dial": (0, 1), "seeds": 2, "steps": 20, "settings": SMALL}
    whole = reality_gap(**how, out=tmp_path)
    ledger = tmp_path / "runs.jsonl"
    ledger.write_bytes(ledger.read_bytes()[:-10])  # the last line is torn
    done = []
    monkeypatch.setattr(module, "simulate", lambda run: done.append(run) or simulate(run))
    assert reality_gap(**how, out=tmp_path).csv() == whole.csv()
    assert len(done) == 1


def test_the_score_is_the_first_result_that_there_is_in_every_run_or_the_one_asked_for():
    gap = reality_gap("cooperative_transport", dial=(0, 1), seeds=1, steps=5)
    assert gap.measure == "way left"
    asked = reality_gap("fire_fighting", dial=(0, 1), seeds=1, steps=5, measure="all fires out at")
    assert asked.scores == {0.0: [None], 1.0: [None]}
    assert len(gap_figure(asked).axes) == 1


def test_the_score_is_the_models_headline_where_every_run_has_it():
    quick = {"initial_temperature": 0.01, "n_robots": 60}
    assert reality_gap("fire_fighting", dial=(0, 1), seeds=1, settings=quick).measure == "all fires out at"
    assert reality_gap("fire_fighting", dial=(0, 1), seeds=1, steps=5, settings=quick).measure == "fires out"


def test_the_parameter_that_a_model_compares_may_be_set():
    gap = reality_gap("fire_fighting", dial=(0, 1), seeds=1, steps=5, settings={"strategy": "A"})
    assert gap.measure == "fires out"


@pytest.mark.parametrize(
    ("more", "error", "words"),
    [
        ({"dial": (0.5,)}, InvalidValueError, "expected at least two rising places"),
        ({"dial": (1, 0)}, InvalidValueError, "expected at least two rising places"),
        ({"preset": "mesured"}, UnknownNameError, "did you mean 'measured'"),
        ({"measure": "group"}, UnknownNameError, "did you mean 'groups'"),
        ({"jobs": 0}, InvalidValueError, "or -1 for one on each core"),
    ],
)
def test_what_is_wrong_is_refused(more, error, words):
    with pytest.raises(error, match=words):
        reality_gap("agglomeration", **{"seeds": 1, "steps": 2, "settings": SMALL, **more})


def test_an_unknown_measure_is_refused_after_the_first_run(monkeypatch):
    made = []

    monkeypatch.setattr(module, "simulate", lambda run: made.append(run) or simulate(run))
    with pytest.raises(UnknownNameError, match="did you mean 'groups'"):
        reality_gap("agglomeration", seeds=3, steps=2, settings=SMALL, measure="group", jobs=1)
    assert len(made) == 1


@pytest.mark.slow
def test_the_command_prints_scores_and_writes_picture_and_table(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    line = "reality-gap agglomeration --preset robotarium --seeds 2 --steps 10 --set n_robots=4 --jobs 1 --quiet"
    with pytest.raises(SystemExit) as left:
        cli.main(line.split())
    out = capsys.readouterr().out
    assert not left.value.code
    assert "agglomeration, robotarium robots: 2 paired seeds, at most 10 steps each" in out
    made = tmp_path / "results" / "reality_gap_agglomeration"
    assert (made / "reality_gap.png").read_bytes()[1:4] == b"PNG"
    assert len((made / "reality_gap.csv").read_text().splitlines()) == 1 + 5 * 2


def typed(words: str) -> object:
    with pytest.raises(SystemExit) as left:
        cli.main(words.split())
    return left.value.code


@pytest.mark.slow
def test_without_a_model_all_of_them_are_drawn(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compare, "loaded_models", lambda: (dict.fromkeys(("boids", "flocking", "perimeter")), {}))
    assert not typed("reality-gap --seeds 1 --steps 3 --jobs 1 --quiet --out gaps")
    out = capsys.readouterr().out
    assert [line.split(",")[0] for line in out.splitlines() if "paired seed" in line] == [
        "boids", "flocking", "perimeter",
    ]  # fmt: skip
    assert out.splitlines()[-1] == "gaps/reality_gap.png"
    with Image.open("gaps/reality_gap.png") as all_of_them, Image.open("gaps/boids/reality_gap.png") as one:
        assert all_of_them.height > 1.3 * one.height


@pytest.mark.parametrize("words", ["--set n_robots=4", "--measure groups"])
def test_what_is_meant_for_one_model_is_refused_for_all(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert typed(f"reality-gap {words}") == 2
    assert "is given without a model; name the model that it is for" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(
    "wrong",
    [
        {"results": {"foo": 1.0}},
        {"results": {"way left": 1.0, "arrived at": None}},
        {"results": None, "error": "ValueError: x"},
        {"results": {}},
        {"results": {"arrived at": [1.0], "way left": [1.0, [2.0]]}},
        {"results": {"arrived at": None, "way left": float("inf")}},
        {"results": {"arrived at": None, "way left": 10**300}},
    ],
)
@pytest.mark.parametrize("every", [True, False])
def test_stored_runs_that_cannot_be_of_this_model_are_done_again_and_then_remembered(
    tmp_path, monkeypatch, wrong, every
):
    how = {"model": "cooperative_transport", "dial": (0, 1), "seeds": 2, "steps": 3, "out": tmp_path}
    whole, ledger, done = reality_gap(**how).csv(), tmp_path / "runs.jsonl", []
    lines = [json.loads(line[9:]) for line in ledger.read_bytes().splitlines()]
    for line in lines if every else lines[:1]:
        line.update(wrong)
    texts = [json.dumps(line).encode() for line in lines]
    ledger.write_bytes(b"".join(b"%08x %s\n" % (crc32(text), text) for text in texts))
    monkeypatch.setattr(module, "simulate", lambda run: done.append(run) or simulate(run))
    assert [reality_gap(**how).csv() for _ in range(2)] == [whole] * 2
    assert len(done) == (4 if every else 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", model_names())
def test_the_results_of_a_model_have_the_same_names_before_and_after_a_run(name):
    model = find_model(name)(rng=1)
    before = list(model.results())
    assert list(model.run(3).results()) == before


def test_a_picture_that_fails_costs_no_table(tmp_path, monkeypatch):
    def fail(gap):
        raise RuntimeError("no picture")

    gap = reality_gap("agglomeration", dial=(0, 1), seeds=1, steps=2, settings=SMALL)
    monkeypatch.setattr(module, "gap_figure", fail)
    with pytest.raises(RuntimeError, match="no picture"):
        gap.save(tmp_path)
    assert (tmp_path / "reality_gap.csv").read_text() == gap.csv()


def test_places_of_the_dial_are_floats_and_the_score_is_what_every_run_has():
    assert checked_dial([0, 1]) == (0.0, 1.0)
    assert chosen_measure({0.0: [{"arrived at": None, "way left": 3.0}]}, None) == "way left"
