"""Answers to the exercises that students could give: right ones pass, wrong ones and garbage are refused.

They stand in `answers/`, a file a notebook, each after a line such as `# %% exercise-1 right: with two sensors`. The
kind is `right`, `wrong` or `hint`: the last stage of the exercise's own hint, taken literally.
"""

import re

import pytest

from support.exercises import ANSWERS, EXERCISES, NAMES, NOTEBOOKS, Desk, answers_of, name_of_answer

TITLE = re.compile(r"(exercise-[12]) (right|wrong|hint): \S.*")
GARBAGE = ["None", "...", "'a text'", "-1", "float('nan')", "10**30", "[]", "{}", "object()", "lambda *_: 1 / 0"]
LEAST = {"right": 5, "wrong": 5, "hint": 1}


def answers(path, exercise, kind):
    """Return the answers to an exercise of one kind by title."""
    return {title: text for title, text in answers_of(path).items() if title.startswith(f"{exercise} {kind}:")}


def test_every_file_of_answers_belongs_to_a_notebook():
    assert sorted(path.stem for path in ANSWERS.glob("*.py")) == NAMES


@pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
def test_every_exercise_has_five_right_and_five_wrong_answers_and_its_hint(path):
    assert all(TITLE.fullmatch(title) for title in answers_of(path))
    for exercise in EXERCISES:
        for kind, least in LEAST.items():
            given = answers(path, exercise, kind)
            assert len(set(given.values())) >= least, f"{exercise}: {len(given)} {kind}"


@pytest.mark.long
@pytest.mark.parametrize("exercise", EXERCISES)
@pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
class TestVerdicts:
    def test_right_answers_and_the_hint_taken_literally_pass(self, path, exercise, tmp_path):
        desk = Desk(path, tmp_path)
        for title, answer in {**answers(path, exercise, "right"), **answers(path, exercise, "hint")}.items():
            verdict = desk.verdict_on(exercise, answer)
            assert verdict.passed, f"{title}: {verdict}"

    def test_wrong_answers_do_not_pass(self, path, exercise, tmp_path):
        desk = Desk(path, tmp_path)
        for title, answer in answers(path, exercise, "wrong").items():
            verdict = desk.verdict_on(exercise, answer)
            assert not verdict.passed, f"{title}: {verdict}"
            assert "Traceback" not in str(verdict)

    def test_garbage_is_refused_in_words(self, path, exercise, tmp_path):
        desk, name = Desk(path, tmp_path), name_of_answer(path, exercise)
        for garbage in GARBAGE:
            verdict = desk.verdict_on(exercise, f"{name} = {garbage}")
            assert not verdict.passed, garbage
            assert str(verdict).startswith("Not yet.")
            assert "Traceback" not in str(verdict)
