"""Exercises that check themselves: verdicts on answers that are right, wrong, missing and broken."""

import math

import pytest

from mesa_swarm.base.errors import InvalidValueError, check_number
from mesa_swarm.control import PASS, Avoid
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.teaching import (
    Criterion,
    Verdict,
    check_estimate,
    check_function,
    check_model,
    check_rule,
    check_settings,
    picture,
    sized,
)
from mesa_swarm.viewing.run_pictures import trace

CALM = Criterion("total_collisions", at_most=0)


def hall(rng):
    """One robot in front of a wall."""
    model = SwarmModel(rng=rng)
    model.add_robots(AGENT9, poses=[(700, 300, 0.0)])
    return model


def stops(me, distance=20.0):
    """Stand still in front of what is near."""
    if 0 <= me.distance[me.front] < distance:
        return 0.0, 0.0
    return PASS


def passes_on(me):
    """Leave the robot to others."""
    return PASS


def divides(me):
    """Divide by nothing at all."""
    return 1.0 / (me.max_speed - me.max_speed), 0.0


def fails_near(me):
    """Return no speed where something is ahead."""
    return (math.nan, 0.0) if me.distance[me.front] >= 0 else PASS


class TestRules:
    @pytest.mark.parametrize("rule", [stops, Avoid(distance=15)], ids=["function", "layer"])
    def test_a_rule_that_meets_its_criterion_passes(self, rule):
        verdict = check_rule(rule, CALM, world=hall, steps=200, seeds=[1, 2])
        assert verdict.passed, verdict
        assert str(verdict).startswith("All criteria met.")

    def test_a_rule_that_fails_gets_the_criterion_and_the_measured_numbers(self):
        verdict = check_rule(passes_on, CALM, world=hall, steps=200, seeds=[1, 2], hint="look ahead.")
        assert not verdict.passed
        first, second, hint = str(verdict).splitlines()
        assert first == "Not yet."
        assert second.startswith("  total_collisions: required <= 0; measured ")
        assert second.endswith("with seeds 1 and 2; 0 of 2 seeds pass")
        assert hint == "Hint: look ahead."

    def test_an_error_in_a_rule_is_one_sentence(self):
        verdict = check_rule(divides, CALM, world=hall, steps=20, seeds=[1])
        assert not verdict.passed
        assert str(verdict).count("\n") == 0
        assert "Rule divides failed" in str(verdict)

    @pytest.mark.parametrize("place", [1, 2, 3])
    def test_an_error_names_the_robot_by_its_place_among_the_robots(self, place):
        def row(rng):
            model = SwarmModel(map="original", rng=rng)
            model.add_robots(AGENT9, poses=[(750 if k == place else 700, 200 + 100 * k, 0.0) for k in (1, 2, 3)])
            assert model.robots[0].unique_id > 3  # the map's obstacles come first
            return model

        verdict = check_rule(fails_near, CALM, world=row, steps=20, seeds=[1])
        assert f"Rule fails_near failed for robot {place} of 3 in step 1: it returned (nan, 0)" in str(verdict)

    @pytest.mark.parametrize("answer", [None, ...])
    def test_dots_are_no_answer(self, answer):
        assert str(check_rule(answer, CALM, world=hall)).startswith("Not yet. There is no answer yet")

    def test_what_is_no_rule_is_refused_in_words(self):
        assert str(check_rule(7, CALM, world=hall)).startswith("Not yet. ")


class TestModels:
    def test_so_many_seeds_may_miss(self):
        def seed_of(rng):
            return {"seed": rng}

        criterion = Criterion("seed", at_least=3, misses=1)
        assert check_model(seed_of, criterion, seeds=[2, 3, 4]).passed
        refused = check_model(seed_of, criterion, seeds=[1, 2, 3])
        assert not refused.passed
        assert str(refused).endswith("1 of 3 seeds pass (2 required)")

    def test_an_undefined_result_does_not_pass(self):
        verdict = check_model(lambda rng: {"out at": None}, Criterion("out at", at_most=9), seeds=[1])
        assert not verdict.passed
        assert "measured undefined" in str(verdict)

    def test_an_error_shows_the_learner_s_line_without_a_traceback(self):
        def broken(rng):
            return {"a": [1, 2][rng]}

        verdict = check_model(broken, Criterion("a", at_least=0), seeds=[5])
        assert "IndexError: list index out of range, at the line: return" in str(verdict)
        assert "Traceback" not in str(verdict)

    @pytest.mark.parametrize(
        ("answer", "message"),
        [
            (7, "expected a function that takes a seed"),
            (lambda rng: ..., "return what you made"),
            (lambda rng: {"b": 1}, "Unknown result 'a'"),
            (lambda: 0, "takes 0 positional arguments"),
        ],
    )
    def test_an_answer_that_cannot_run_is_refused_in_words(self, answer, message):
        verdict = check_model(answer, Criterion("a", at_least=0), seeds=[1])
        assert not verdict.passed
        assert message in str(verdict)

    def test_a_number_may_be_measured_by_a_function(self):
        criterion = Criterion("robots", at_least=1, measure=lambda model: len(model.swarm))
        assert check_model(hall, criterion, seeds=[1]).passed

    def test_a_criterion_without_limits_is_refused(self):
        with pytest.raises(InvalidValueError, match="has no limit"):
            Criterion("robots")


class TestSettings:
    CRITERION = Criterion("collisions per robot and 1,000 steps", at_most=5)

    def test_settings_that_meet_the_criterion_pass(self):
        assert check_settings(CollisionAvoidance, {"n_robots": 1}, self.CRITERION, steps=50, seeds=[1, 2]).passed

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            (dict(distance=...), "no answer yet"),
            (..., "no answer yet"),
            ([1], "expected settings by name, such as dict(distance=...)"),
            (dict(n_robots=3), "unknown parameter 'n_robots'"),
            (dict(distance="far"), "distance is 'far'"),
        ],
    )
    def test_impossible_settings_are_refused_in_words(self, settings, message):
        verdict = check_settings(CollisionAvoidance, settings, self.CRITERION, only=["distance"], steps=5, seeds=[1])
        assert not verdict.passed
        assert message in str(verdict).replace("Unknown", "unknown").replace("Distance", "distance")

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            (dict(side=1), "2 of 2 seeds pass"),
            (dict(side="1"), "Side is '1'; expected a finite number"),
            (dict(syde=1), "Unknown parameter 'syde'; did you mean 'side'"),
            (1, "expected settings by name, such as dict(side=...)"),
        ],
    )
    def test_they_may_be_those_of_a_function_that_makes_the_model(self, settings, message):
        def made(*, side, rng):
            return {"area": check_number("side", side) ** 2}

        verdict = check_settings(made, settings, Criterion("area", at_most=1), seeds=[1, 2])
        assert message in str(verdict)


class TestEstimates:
    def test_a_guess_near_the_mean_passes(self):
        assert check_estimate(1.4, float, within=0.2, seeds=[1, 2]).passed

    @pytest.mark.parametrize(
        ("guess", "message"),
        [
            (3, "You expected 3 for the mean; the mean of seeds 1 and 2 is 1.5"),
            (..., "no answer"),
            ("many", "expected a number"),
            (float("nan"), "Your answer is nan; expected a number"),
            (float("inf"), "expected a number"),
        ],
    )
    def test_other_guesses_are_refused_with_the_measured_mean(self, guess, message):
        verdict = check_estimate(guess, float, within=0.2, seeds=[1, 2])
        assert not verdict.passed
        assert message in str(verdict)


class TestFunctions:
    @pytest.mark.parametrize(
        ("function", "message"),
        [
            (lambda x: x + 1, "It returned 3 where 4 was expected, with seed 2"),
            (lambda x: None, "returned None"),
            (lambda x: [x, x], "returned [2. 2.]"),
            (lambda x: x / 0, "ZeroDivisionError"),
            (..., "no answer yet"),
            (5, "Your answer is 5; expected a function"),
        ],
    )
    def test_a_function_that_differs_is_refused_with_both_results(self, function, message):
        verdict = check_function(function, lambda x: 2 * x, lambda seed: (seed,), seeds=[2])
        assert not verdict.passed
        assert message in str(verdict)

    def test_one_that_is_passes(self):
        verdict = check_function(lambda x: x + x, lambda x: 2 * x, lambda seed: (seed,))
        assert verdict.passed
        assert str(verdict).endswith("with seeds 101 to 105")


def test_a_hint_ends_like_a_sentence():
    assert str(Verdict(False, "no answer", hint="look left")) == "Not yet. No answer.\nHint: look left."


@pytest.mark.parametrize(
    ("number", "text"), [(1234.5678, "1,235"), (0.123456, "0.1235"), (True, "1"), (None, "undefined")]
)
def test_a_measured_number_is_shown_to_four_digits(number, text):
    assert f"measured {text} with seed 1" in str(
        check_model(lambda seed: {"it": number}, Criterion("it", at_least=0), seeds=[1])
    )


def test_several_models_are_shown_side_by_side():
    shown = picture(hall(1), Boids(n_robots=3, rng=1), titles=("one", "two"))
    assert [axes.get_title() for axes in shown.figure.axes] == ["one", "two"]
    assert shown._repr_png_().startswith(b"\x89PNG")


class TestParts:
    """Pictures of a part of the world."""

    def limits(self, shown):
        axes = shown.figure.axes[0]
        return [*axes.get_xlim(), *axes.get_ylim()]

    @pytest.mark.parametrize("kind", ["point", "robot"])
    def test_a_picture_shows_the_part_around_a_point_or_a_robot(self, kind):
        model = hall(1)
        around = model.robots[0] if kind == "robot" else (700, 300)
        assert self.limits(picture(model, around=around, reach=40)) == [660, 740, 260, 340]
        assert self.limits(picture(model)) == [0, 800, 0, 600]

    def test_that_of_a_figure_too(self):
        model = hall(1)
        assert self.limits(picture(trace(model, 5), around=(700, 300), reach=25)) == [675, 725, 275, 325]

    @pytest.mark.parametrize(
        "wrong", [dict(around="here"), dict(around=(1, 2, 3)), dict(around=(math.nan, 1)), dict(around=(1, 1), reach=0)]
    )
    def test_what_is_no_point_or_no_reach_is_refused(self, wrong):
        with pytest.raises(InvalidValueError, match=r"(around|reach) is .*expected"):
            picture(hall(1), **wrong)


@pytest.mark.parametrize(("value", "size"), [("1", 3), ("0", 300), ("", 300)])
def test_runs_are_small_where_the_environment_asks_for_it(monkeypatch, value, size):
    monkeypatch.setenv("MESA_SWARM_QUICK", value)
    assert sized(300, 3) == size


class TestHints:
    STAGES = ("where is it?", "it is behind the door", "open the door")

    def check(self, passes: bool):
        return check_model(lambda rng: {"it": int(passes)}, Criterion("it", at_least=1), seeds=[1], hint=self.STAGES)

    def test_each_failed_check_shows_the_next_stage_and_the_last_one_stays(self):
        shown = [str(self.check(False)).splitlines()[-1] for _ in range(4)]
        self.check(True)
        assert shown[0] == "Hint: (1 of 3) where is it?"
        assert shown[1] == "Hint: (2 of 3) it is behind the door."
        assert shown[2] == shown[3] == "Hint: (3 of 3) open the door."

    def test_an_exercise_that_passes_begins_anew_and_shows_no_hint(self):
        self.check(False)
        assert "Hint" not in str(self.check(True))
        assert "(1 of 3)" in str(self.check(False))
        self.check(True)

    def test_exercises_count_by_themselves(self):
        self.check(False)
        other = check_model(lambda rng: {"it": 0}, Criterion("it", at_least=1), seeds=[1], hint=("else", "more"))
        assert str(other).endswith("Hint: (1 of 2) else.")
        self.check(True)


class TestGivenAnswers:
    def check(self, answer):
        def make(rng):
            return {"it": sum(answer)}

        return check_model(
            make,
            Criterion("it", at_least=1),
            seeds=[1],
            answer=answer,
            expects="two numbers",
            accepts=lambda given: len(given) == 2 and sum(given) > -9,
        )

    @pytest.mark.parametrize("answer", [3, "no", [1], [1, 2, 3], object(), ["a", "b"], {}])
    def test_an_answer_of_another_kind_is_refused_by_what_is_expected(self, answer):
        text = str(self.check(answer))
        assert text.startswith("Not yet. Your answer is ")
        assert text.endswith("; expected two numbers.")

    @pytest.mark.parametrize("answer", [None, ...])
    def test_a_missing_answer_is_named(self, answer):
        assert "no answer yet" in str(self.check(answer))

    def test_an_accepted_answer_is_measured(self):
        assert self.check([1, 2]).passed
        assert not self.check([0, 0]).passed


@pytest.mark.parametrize(("number", "passes"), [(0.05, True), (0.05 - 1e-12, True), (0.05 - 1e-3, False)])
def test_a_limit_is_met_but_for_rounding(number, passes):
    assert Criterion("turn", at_least=0.05).is_met(number) is passes
    assert Criterion("turn", at_most=-0.05).is_met(-number) is passes
