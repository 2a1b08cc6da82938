"""Models that `drive` lets take their steps side by side are, to the last bit, those of single runs."""

import math
from pathlib import Path

import pytest

from mesa_swarm import AGENT9, SwarmModel, drive
from mesa_swarm.errors import BehaviourError, InvalidValueError
from mesa_swarm.models.fire_fighting import FireFighting
from support.driven_models import Counting, Plain, Reaching, Season, Watching, assert_same


def make_models(count):
    return [Plain(n_robots=3 + seed % 5, rng=seed, collect_every=seed % 3) for seed in range(count)]


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
@pytest.mark.parametrize("count", [1, 7, 64])
def test_1_7_and_64_models_in_1_2_3_and_8_threads_are_those_of_single_runs(count, threads):
    models = make_models(count)
    assert drive(models, 120, threads) == models
    for model, single in zip(models, make_models(count), strict=True):
        assert_same(model, single.run(120))


def test_models_of_several_classes_that_python_interrupts_or_steps_are_those_of_single_runs():
    def make():
        seasonal, observed = Plain(rng=1), Plain(rng=2)
        seasonal.add_part(Season())
        observed.observers.append(Watching())
        return [seasonal, observed, Counting(rng=3), FireFighting(rng=4), Reaching(n_robots=30, rng=1)]

    for model, single in zip(drive(make(), 700, threads=2), make(), strict=True):
        assert_same(model, single.run(700))


def test_a_model_stops_in_the_step_in_which_its_condition_holds_and_the_others_go_on():
    reaching, plain = drive([Reaching(n_robots=30, rng=1), Plain(rng=1)], 5000)
    assert reaching.stopped_at == reaching.steps < plain.steps == 5000
    assert drive([reaching, plain], 3)[0].steps == reaching.stopped_at


def test_an_error_of_a_model_is_raised_when_the_others_have_taken_their_steps():
    models, single = make_models(3), make_models(2)[1].run(2)
    models[1].run(2)
    for model in (models[1], single):
        model.swarm.columns["max_speed"][1] = math.nan
    with pytest.raises(BehaviourError) as together:
        drive(models, 40)
    with pytest.raises(BehaviourError) as alone:
        single.run(40)
    assert str(together.value) == str(alone.value)
    assert [(model.steps, model.completed) for model in models] == [
        (40, 40),
        (single.steps, single.completed),
        (40, 40),
    ]


def test_robots_without_room_and_ever_more_pairs_are_attended_to():
    def make():
        models = [SwarmModel(rng=seed) for seed in range(4)]
        for model in models:
            model.add_robots(AGENT9, poses=[(100.0, 100.0, 0.0)] * 12)
            model.swarm.columns["command"][:] = 1.0
        return models

    for model, single in zip(drive(make(), 60, threads=2), make(), strict=True):
        assert_same(model, single.run(60))


def test_recordings_of_models_that_are_driven_together_are_those_of_single_runs(tmp_path):
    def record(folder, run):
        models = make_models(2)
        for seed, model in enumerate(models):
            model.record(folder / f"{seed}.swarm")
        run(models)

    for name in ("together", "alone"):
        (tmp_path / name).mkdir()
    record(tmp_path / "together", lambda models: drive(models, 30))
    record(tmp_path / "alone", lambda models: [model.run(30) for model in models])
    for seed in range(2):
        ways = [SwarmModel.resume(tmp_path / name / f"{seed}.swarm") for name in ("together", "alone")]
        assert ways[0].steps == 30
        assert_same(*ways)


class OwnRun(Plain):
    """A model with a `run` of its own."""

    def run(self, steps, **keywords):
        return super().run(2 * steps, **keywords)


def test_a_run_of_a_class_is_called():
    assert [model.steps for model in drive([OwnRun(rng=1), Plain(rng=1)], 20)] == [40, 20]


def test_no_models_and_no_steps_are_nothing_to_do():
    model = Plain(rng=1)
    assert drive([], 5) == []
    assert drive((model,), 0) == [model]
    assert model.steps == 0


SAME = Plain(rng=1)
WRONG = [
    ((SAME, 5), {}, r"^models is <Plain.*; expected several models, such as \[model, other\]$"),
    ((7, 5), {}, r"^models is 7; expected several models"),
    (([SAME, Path], 5), {}, r"^models has <class .*> at place 1; expected models only$"),
    (([SAME, Plain(rng=2), SAME], 5), {}, r"^models has the same model at places 0 and 2; expected each once$"),
    (([SAME], -1), {}, r"^steps is -1; expected"),
    (([SAME], 5), {"threads": 0}, r"^threads is 0; expected"),
]


@pytest.mark.parametrize(("arguments", "keywords", "line"), WRONG)
def test_wrong_arguments_are_refused_in_one_line(arguments, keywords, line):
    with pytest.raises(InvalidValueError, match=line):
        drive(*arguments, **keywords)
    assert SAME.steps == 0
