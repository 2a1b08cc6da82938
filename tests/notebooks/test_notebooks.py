"""The notebooks: stripped, of one form, running to their end; exercises that fail unsolved and pass solved."""

import os
import re

import nbformat
import pytest
from nbclient import NotebookClient

from support.exercises import EXERCISES, NAMES, NOTEBOOKS, ROOT, cells_of, check_of, read, solutions_of, verdict_of

# Run by default; the others are in .ci/run.
ALWAYS = {"01_a_first_robot"}
SLOWLY = [pytest.param(path, id=path.stem, marks=() if path.stem in ALWAYS else pytest.mark.slow) for path in NOTEBOOKS]


class TestForm:
    def test_there_are_notebooks(self):
        assert len(NOTEBOOKS) >= 10

    @pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
    def test_a_notebook_is_stripped_and_written_as_nbformat_writes_it(self, path):
        notebook = read(path)
        nbformat.validate(notebook)
        for cell in notebook.cells:
            assert not cell.metadata
            if cell.cell_type == "code":
                assert cell.outputs == [], "strip it: jupyter nbconvert --clear-output --inplace"
                assert cell.execution_count is None
        assert set(notebook.metadata) == {"kernelspec", "language_info"}
        assert set(notebook.metadata.language_info) == {"name"}
        assert path.read_text() == nbformat.writes(notebook).rstrip("\n") + "\n"

    @pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
    def test_a_notebook_has_all_its_parts_in_order(self, path):
        cells = cells_of(path)
        text = "\n".join(cell.source for cell in read(path).cells if cell.cell_type == "markdown")
        headings = re.findall(r"^## (.+)$", text, flags=re.MULTILINE)
        order = [headings.index(part) for part in ("Question", "Predict", "Results", "Exercises")]
        assert order == sorted(order)
        names = list(cells)
        for exercise in EXERCISES:
            assert names.index(exercise) < names.index(check_of(exercise))

    @pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
    def test_there_is_a_solution_for_every_exercise(self, path):
        assert set(solutions_of(path)) == set(EXERCISES)


@pytest.mark.long
@pytest.mark.parametrize("exercise", EXERCISES)
@pytest.mark.parametrize("path", NOTEBOOKS, ids=NAMES)
class TestExercises:
    def test_an_exercise_that_is_not_solved_is_refused_in_plain_words(self, path, exercise, tmp_path):
        verdict = verdict_of(path, exercise, cells_of(path)[exercise], tmp_path)
        assert not verdict.passed
        assert str(verdict).startswith("Not yet.")
        assert "Traceback" not in str(verdict)

    def test_its_solution_passes(self, path, exercise, tmp_path):
        verdict = verdict_of(path, exercise, solutions_of(path)[exercise], tmp_path)
        assert verdict.passed, verdict


BACKS = "@behaviour\ndef turn_away(me, distance=15.0):\n    return -0.03, -0.03"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "exercise", "answer", "words"),
    [
        ("02", 1, "answer = ...", "no answer yet"),
        ("02", 1, "answer = (30, 'stationary')", "expected settings by name, such as dict(distance=...)"),
        ("02", 1, "answer = dict(distanc=30)", "did you mean 'distance'"),
        ("03", 1, BACKS, "nearest to the corner: required <= 60"),
        ("03", 2, "distance = ...", "no answer yet"),
        ("03", 2, "distance = None", "no answer yet"),
        ("03", 2, "distance = '6'", "distance is '6'; expected"),
        ("03", 2, "distance = -1", "distance is -1; expected"),
        ("03", 2, "distance = [6]", "distance is [6]; expected"),
        ("04", 2, "answer = dict(sight=2000, stop_distance=1, avoid_distance=0)", "Unknown parameter 'sight'"),
        ("05", 1, "leaders = 5", "Your answer is 5; expected a function"),
        ("07", 1, "answer = dict(stay=1000)", "Unknown parameter 'stay'"),
    ],
)
def test_an_answer_that_cannot_be_or_passes_by_a_gap_is_refused_in_words(number, exercise, answer, words, tmp_path):
    (path,) = (path for path in NOTEBOOKS if path.stem.startswith(number))
    verdict = verdict_of(path, f"exercise-{exercise}", answer, tmp_path)
    assert not verdict.passed
    assert words in str(verdict)


@pytest.mark.slow
@pytest.mark.parametrize("path", SLOWLY)
def test_a_notebook_runs_to_its_end_and_complains_of_nothing(path, tmp_path):
    notebook = read(path)
    work = {"metadata": {"path": str(ROOT)}}
    surroundings = {**os.environ, "MESA_SWARM_QUICK": "1"}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=work).execute(env=surroundings)
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            assert output.output_type != "error"
            assert output.get("name") != "stderr", output.text
