"""Errors of a check are not shown as the learner's, and typing errors use up no hint."""

import re

import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.teaching import Criterion, Verdict, check_estimate, check_function, check_model, check_settings
from mesa_swarm.teaching.checks import code_of
from mesa_swarm.teaching.verdicts import CHECK_FAILED, JUDGED, NOT_JUDGED
from support.exercises import last_value

SETUP = """
import numpy as np
from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.control import PASS, Avoid, Explore, behaviour
from mesa_swarm.teaching import Criterion, check_estimate, check_function, check_model, check_rule, check_settings
def helped(x):
    return x + addend
"""
HALL = "def hall(rng):\n    model = SwarmModel(rng=rng)\n    model.add_robots(AGENT9, 2)\n    return model\n"
RULE = "@behaviour\ndef rule(me):\n    return PASS"
CALM = "Criterion('total_collisions', at_most=10**6)"


class Desk:
    """A notebook: each cell is a file of its own."""

    def __init__(self, folder):
        self.folder, self.place, self.number = folder, {"__name__": "__main__"}, 0
        self.run(SETUP)

    def run(self, source):
        self.number += 1
        return last_value(source, self.place, self.folder / f"cell_{self.number}.py")

    def verdict(self, answer: str, check: str) -> Verdict:
        self.run(answer)
        return self.run(check)


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


CHECKS_THAT_FAIL = {
    "a world with a misspelt name": (
        RULE,
        f"def hall(rng):\n    return SwarmModle(rng=rng)\ncheck_rule(rule, {CALM}, world=hall, steps=5)",
        ["NameError: name 'SwarmModle' is not defined", "in hall, line 2: return SwarmModle(rng=rng)", "seed 101"],
    ),
    "a world that the package refuses": (
        RULE,
        f"def hall(rng):\n    return SwarmModel(map='orignal', rng=rng)\ncheck_rule(rule, {CALM}, world=hall, steps=5)",
        ["MapError", "orignal", "in hall, line 2"],
    ),
    "a world that returns nothing": (
        RULE,
        f"def hall(rng):\n    SwarmModel(rng=rng)\ncheck_rule(rule, {CALM}, world=hall, steps=5)",
        ["AttributeError: 'NoneType'"],
    ),
    "a layer below that fails": (
        RULE,
        f"{HALL}def broken(me):\n    return float('nan'), 0.0\n"
        f"check_rule(rule, {CALM}, world=hall, below=(behaviour(broken),), steps=5)",
        ["rule broken failed", "seed 101"],
    ),
    "a number as a layer below": (
        RULE,
        f"{HALL}check_rule(rule, {CALM}, world=hall, below=(7,), steps=5)",
        ["mesa_swarm"],
    ),
    "a measure that divides by zero": (
        RULE,
        f"{HALL}def share(model):\n    return 1 / model.total_collisions\n"
        "check_rule(rule, Criterion('share', at_least=0, measure=share), world=hall, steps=1)",
        ["ZeroDivisionError: division by zero", "in share, line 6: return 1 / model.total_collisions"],
    ),
    "a measure that returns a text": (
        RULE,
        f"{HALL}check_rule(rule, Criterion('it', at_least=0, measure=lambda model: 'much'), world=hall, steps=1)",
        ["InvalidValueError: it is 'much'; expected a number"],
    ),
    "a result that the model does not have": (
        RULE,
        f"{HALL}check_rule(rule, Criterion('total_colisions', at_most=0), world=hall, steps=1)",
        ["unknown result 'total_colisions'"],
    ),
    "a model of settings with a misspelt name": (
        "answer = dict(distance=10)",
        "def made(*, distance=15, rng):\n    return {'it': distnce}\n"
        "check_settings(made, answer, Criterion('it', at_least=0))",
        ["NameError: name 'distnce' is not defined", "in made, line 2"],
    ),
    "a model of settings that fails whatever they are": (
        "answer = dict(distance=10)",
        "def made(*, distance=15, rng):\n    return {'it': distance + [1]}\n"
        "check_settings(made, answer, Criterion('it', at_least=0))",
        ["TypeError", "in made, line 2"],
    ),
    "a function that uses the answer and a misspelt name": (
        "answer = [1, 2]",
        "def made(rng):\n    return {'it': sum(answr)}\n"
        "check_model(made, Criterion('it', at_least=0), answer=answer, expects='two numbers')",
        ["NameError: name 'answr' is not defined", "in made, line 2: return {'it': sum(answr)}"],
    ),
    "one that returns nothing": (
        "answer = [1, 2]",
        "def made(rng):\n    sum(answer)\ncheck_model(made, Criterion('it', at_least=0), answer=answer)",
        ["ValueError: it returned None"],
    ),
    "a measure of what the answer made, with a misspelt name": (
        "def made(rng):\n    return SwarmModel(rng=rng)",
        "check_model(made, Criterion('it', at_least=0, measure=lambda model: modle.steps))",
        ["NameError: name 'modle' is not defined"],
    ),
    "a test of the kind of answer with a misspelt name": (
        "answer = [1, 2]",
        "check_model(lambda rng: {'it': 1}, Criterion('it', at_least=0), answer=answer,\n"
        "            accepts=lambda given: lenn(given) == 2)",
        ["NameError: name 'lenn' is not defined"],
    ),
    "an estimate whose run fails": (
        "guess = 3.0",
        "check_estimate(guess, lambda rng: [1, 2][rng], within=1)",
        ["IndexError: list index out of range", "seed 101"],
    ),
    "an estimate whose run returns nothing": (
        "guess = 3.0",
        "check_estimate(guess, lambda rng: None, within=1)",
        ["TypeError", "seed 101"],
    ),
    "a correct function that fails": (
        "def mine(x):\n    return x",
        "check_function(mine, lambda x: x / 0, lambda rng: (rng,))",
        ["ZeroDivisionError: division by zero"],
    ),
    "arguments that fail": (
        "def mine(x):\n    return x",
        "check_function(mine, abs, lambda rng: (rng + 'a',))",
        ["TypeError", "seed 101"],
    ),
    "a helper of the check in another cell": (
        "def mine(x):\n    return x",
        "check_function(mine, lambda x: helped(x), lambda rng: (rng,))",
        ["NameError: name 'addend' is not defined", "in helped, line 7: return x + addend"],
    ),
    "a function around the answer with a misspelt name": (
        "leaps = {1: 2}",
        "check_function(lambda x: leap[1], lambda x: 2, lambda rng: (rng,), answer=leaps)",
        ["NameError: name 'leap' is not defined"],
    ),
    "no seeds": (
        "guess = 3.0",
        "check_estimate(guess, float, within=1, seeds=[])",
        ["seeds is empty; expected at least one"],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(("answer", "check", "lines"), CHECKS_THAT_FAIL.values(), ids=CHECKS_THAT_FAIL)
def test_an_error_of_the_check_is_named_as_such_with_what_to_send_to_the_teacher(desk, answer, check, lines):
    verdict = desk.verdict(answer, check)
    assert (verdict.passed, verdict.status, verdict.hint) == (False, CHECK_FAILED, "")
    first, *rest = str(verdict).splitlines()
    assert first == (
        "The check itself failed: this is not a mistake in your answer. Please send these lines to your teacher:"
    )
    assert all(line.startswith("  ") and len(line) <= 302 for line in rest)
    assert all(words.lower() in "\n".join(rest).lower() for words in lines)
    assert re.search(r"mesa_swarm \d+\.\d+", rest[-1])
    assert "Traceback" not in str(verdict)


ANSWERS_THAT_FAIL = {
    "a rule with a misspelt name": (
        "@behaviour\ndef rule(me):\n    return me.max_sped, 0.0",
        f"{HALL}check_rule(rule, {CALM}, world=hall, steps=5)",
        "max_sped",
    ),
    "a rule that divides by zero": (
        "@behaviour\ndef rule(me):\n    return 1.0 / (me.max_speed - me.max_speed), 0.0",
        f"{HALL}check_rule(rule, {CALM}, world=hall, steps=5)",
        "Rule rule failed",
    ),
    "a rule that fails in a model with a step of its own": (
        "def rule(me):\n    return float('nan'), 0.0",
        "class Hall(SwarmModel):\n    def step(self):\n        super().step()\n"
        "def hall(rng):\n    model = Hall(rng=rng)\n    model.add_robots(AGENT9, 2)\n    return model\n"
        f"check_rule(rule, {CALM}, world=hall, steps=5)",
        "Rule rule failed for robot 1 of 2 in step 1",
    ),
    "a function with a misspelt name": (
        "def mine(x):\n    return y",
        "check_function(mine, abs, lambda rng: (rng,))",
        "it stopped with NameError: name 'y' is not defined, at the line: return y",
    ),
    "a function that is given too much": (
        "def mine():\n    return 1",
        "check_function(mine, abs, lambda rng: (rng,))",
        "mine() takes 0 positional arguments but 1 was given",
    ),
    "a function of the learner's that the check calls in a measure": (
        "def rule(me):\n    return PASS\ndef mine(x):\n    return z",
        "def made(rng):\n    return {'it': mine(rng)}\n"
        "check_model(made, Criterion('it', at_least=0), answer=mine, accepts=callable)",
        "it stopped with NameError: name 'z' is not defined, at the line: return z",
    ),
    "a setting of another kind": (
        "answer = dict(distance=[6])",
        "def made(*, distance=15, rng):\n    return {'it': 1.0 * distance}\n"
        "check_settings(made, answer, Criterion('it', at_least=0))",
        "it stopped with TypeError",
    ),
    "a result with a misspelt name": (
        "def made(rng):\n    return {'itt': 1}",
        "check_model(made, Criterion('it', at_least=0))",
        "nknown result 'it'; did you mean 'itt'?",
    ),
    "a result that is a text": (
        "def made(rng):\n    return {'it': 'much'}",
        "check_model(made, Criterion('it', at_least=0))",
        "t is 'much'; expected a number",
    ),
    "nothing made": ("def made(rng):\n    1", "check_model(made, Criterion('it', at_least=0))", "return what you made"),
    "nothing returned": ("def mine(x):\n    1", "check_function(mine, abs, lambda rng: (rng,))", "It returned None"),
}


@pytest.mark.parametrize(("answer", "check", "words"), ANSWERS_THAT_FAIL.values(), ids=ANSWERS_THAT_FAIL)
def test_an_error_of_the_answer_is_the_learner_s_and_is_not_judged(desk, answer, check, words):
    verdict = desk.verdict(answer, check)
    assert (verdict.passed, verdict.status, verdict.hint) == (False, NOT_JUDGED, "")
    assert str(verdict).startswith("Not yet. ")
    assert words.lower() in str(verdict).lower()
    assert "teacher" not in str(verdict)


UNDECIDED = {
    "an answer of another kind than a lax check expects": (
        "answer = [1, 'a']",
        "def made(rng):\n    return {'it': sum(answer)}\ncheck_model(made, Criterion('it', at_least=0), answer=answer)",
        "This happened in made, at the line: return {'it': sum(answer)}",
    ),
    "a value that the package refuses": (
        "answer = -3",
        "def made(rng):\n    return {'it': Avoid(distance=answer).distance}\n"
        "check_model(made, Criterion('it', at_least=0), answer=answer)",
        "Avoid's distance is -3; expected a finite number at least 0",
    ),
    "a helper that the answer uses": (
        "def mine(x):\n    return helped(x)",
        "check_function(mine, abs, lambda rng: (rng,))",
        "at the line: return helped(x). This happened in helped, at the line: return x + addend",
    ),
    "what the answer made, and the measure does not expect": (
        "def made(rng):\n    return {'it': 1}",
        "check_model(made, Criterion('it', at_least=0, measure=lambda model: model.steps))",
        "AttributeError: 'dict' object has no attribute 'steps'",
    ),
}


@pytest.mark.parametrize(("answer", "check", "words"), UNDECIDED.values(), ids=UNDECIDED)
def test_where_both_may_be_wrong_the_text_names_in_which_code_it_happened(desk, answer, check, words):
    verdict = desk.verdict(answer, check)
    assert (verdict.passed, verdict.status) == (False, NOT_JUDGED)
    assert words in str(verdict)
    assert str(verdict).endswith(
        "; if you did not write that, and your answer is what is required, send this to your teacher."
    )


def test_a_check_without_a_criterion_is_refused_for_it_would_pass_everything():
    with pytest.raises(InvalidValueError, match=r"^a check without a criterion passes every answer"):
        check_model(lambda rng: {"it": 1})


class TestHints:
    """Three stages, of which only answers that were judged use one up."""

    HINT = "hint=('first', 'second', 'third')"

    def check(self, desk, answer: str) -> Verdict:
        return desk.verdict(answer, f"check_function(mine, abs, lambda rng: (rng,), {self.HINT})")

    def number(self, verdict: Verdict) -> str:
        return verdict.hint[:2]

    WRONG = "def mine(x):\n    return {0}"

    @pytest.fixture(autouse=True)
    def _begin(self, desk):
        assert self.check(desk, "def mine(x):\n    return abs(x)").passed

    @pytest.mark.parametrize(
        "slip", ["def mine(x):\n    return xx", "def mine():\n    return 1", "mine = ...", "mine = 5", "def mine(x): 1"]
    )
    def test_a_slip_uses_no_stage_up_and_shows_again_what_was_shown(self, desk, slip):
        assert [self.check(desk, slip).hint for _ in range(3)] == [""] * 3
        assert self.number(self.check(desk, self.WRONG.format(1))) == "(1"
        assert [self.number(self.check(desk, slip)) for _ in range(3)] == ["(1"] * 3
        assert self.number(self.check(desk, self.WRONG.format(2))) == "(2"

    def test_an_answer_whose_cell_did_not_run_is_named_as_the_one_before_and_uses_no_stage_up(self, desk):
        assert self.number(self.check(desk, self.WRONG.format(1))) == "(1"
        with pytest.raises(SyntaxError):
            desk.run("def mine(x)\n    return abs(x)")
        check = f"check_function(mine, abs, lambda rng: (rng,), {self.HINT})"
        assert [desk.run(check).hint for _ in range(2)] == ["(1 of 3; your answer is the same as before) first"] * 2
        assert self.check(desk, self.WRONG.format(2)).hint == "(2 of 3) second"

    def test_an_error_of_the_check_uses_no_stage_up(self, desk):
        desk.run(self.WRONG.format(1))
        broken = f"check_function(mine, abs, lambda rng: rngg, {self.HINT})"
        assert [desk.run(broken).hint for _ in range(2)] == [""] * 2
        assert self.number(self.check(desk, self.WRONG.format(1))) == "(1"

    @pytest.mark.parametrize(
        ("first", "second"),
        [("4", "5"), ("[1, 2]", "[1, 3]"), ("np.array([1, 2])", "np.array([1, 3])"), ("{'a': 1}", "{'a': 2}")],
    )
    def test_numbers_are_the_same_answer_as_long_as_they_are_equal(self, desk, first, second):
        check = (
            "check_model(lambda rng: {'it': 0}, Criterion('it', at_least=1), answer=answer,"
            f" hint=('number', {first!r}, 'last'))"
        )
        assert [self.number(desk.verdict(f"answer = {value}", check)) for value in (first, first, second)] in (
            [["(1", "(1", "(2"], ["(1", "(2", "(3"]] if "array" in first else [["(1", "(1", "(2"]]
        )

    def test_numbers_that_are_changed_in_place_are_another_answer(self, desk):
        check = "check_model(lambda rng: {'it': 0}, Criterion('it', at_least=1), answer=answer, hint=('in', 'place'))"
        assert self.number(desk.verdict("answer = [1, 2]", check)) == "(1"
        assert self.number(desk.verdict("answer[0] = 5", check)) == "(2"


def test_what_was_judged_has_that_status():
    passed = check_estimate(1.5, float, within=1, seeds=[1, 2])
    failed = check_estimate(9, float, within=1, seeds=[1, 2])
    assert (passed.status, failed.status) == (JUDGED, JUDGED)
    assert check_function(lambda x: "abc", abs, lambda rng: (rng,)).text.startswith("it returned 'abc' where 101")
    missed = check_settings(lambda *, it=1, rng: {"it": it}, {"it": 0}, Criterion("it", at_least=1))
    assert (missed.passed, missed.status) == (False, JUDGED)


def test_code_of_an_answer_is_found_wherever_it_is_wrapped():
    class Agent:
        def step(self):
            return [each for each in range(3)]

        @property
        def near(self):
            return 1

        @staticmethod
        def far():
            return 2

    names = {code.co_name for code in code_of(Agent)}
    assert {"step", "near", "far"} <= names
    assert code_of(3) == code_of(int) == code_of(None) == set()
