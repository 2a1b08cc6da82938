"""How pages of the site are prepared for any builder: equations, notebooks, recorded runs, slides, the gallery."""

import re
from pathlib import Path

import nbformat
import pytest
from gallery_page import gallery_page
from markdown import markdown
from notebook_pages import write_page
from prepare import MOVED, SLIDES, write_redirects
from recorded_runs import LARGEST, RecordedRun, recorded_runs, steps_a_row
from typesetting import typeset, typeset_docstring

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.dashboard.gallery.gallery_pictures import SHOTS
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.model.parameters import parameters_of

ROOT = Path(__file__).parents[2]
NOTEBOOKS = [path.stem for path in sorted((ROOT / "notebooks").glob("*.ipynb"))]


class TestEquations:
    @pytest.mark.parametrize(
        "text",
        [
            "`$v$`",
            "```python\nprice = '$a$'\n```",
            "~~~\n$$x$$\n~~~",
            "costs $5 and $6",
            "from $ 5 $ on",
            "<code>$v$</code>",
            "``a ` $v$``",
            "`[1, 2]`",
            "```\n0.5 [0.1, 0.9]\n```",
            "[1, 2](a.md) and [a, 2] and [1, 2, 3]",
        ],
    )
    def test_code_money_and_what_is_no_interval_stay_as_they_are(self, text):
        assert typeset(text) == text

    def test_an_equation_within_a_line_stays_within_it(self):
        text = typeset("a speed $v_L + 1$, then")
        assert text.startswith("a speed <math ")
        assert text.endswith("</math>, then")
        assert "\n" not in text

    def test_a_block_is_an_element_of_its_own(self):
        before, block, after = typeset("this:\n$$\na < b\n$$\nthat").split("\n\n")
        assert (before.strip(), after.strip()) == ("this:", "that")
        assert block.strip().startswith('<div class="equation"><math ')
        assert 'display="block"' in block

    def test_no_mark_of_markdown_is_left_in_an_equation(self):
        text = typeset(r"$a^* \le |b|_1$")
        inside = text[text.index("<math") :]
        assert not set("*|_`") & set(inside)

    @pytest.mark.parametrize("text", ["$v$ is a speed", "that\n  $v$ is a speed", "- a\n- $v$ is a speed"])
    def test_an_equation_at_the_beginning_of_a_line_stays_within_its_paragraph(self, text):
        html = markdown(typeset(text))
        assert html.count("<p>") == ("- " not in text)
        assert re.search(r"</math>(</span>)? is a speed", html)

    def test_an_equation_may_stand_in_the_brackets_of_latex(self):
        assert typeset(r"a speed \(v_L\), then") == typeset("a speed $v_L$, then")
        assert typeset("this:\n\n\\[ a\n< b \\]\n\nthat") == typeset("this:\n\n$$ a\n< b $$\n\nthat")
        assert typeset(r"`\(v\)` and \(| x |\)").count("<math") == 1

    def test_an_equation_of_a_docstring_is_drawn_where_it_stands(self):
        text = typeset_docstring("Of it,\n\n    .. math:: a_1\n        + b\n\n    where :math:`a_1` is")
        assert text.startswith('Of it,\n\n    <div class="equation"><math ')
        assert text.count("<math") == 2
        assert "math:" not in text
        assert "_" not in text

    @pytest.mark.parametrize("page", sorted((ROOT / "docs").rglob("*.md")), ids=lambda page: page.stem)
    def test_no_command_of_latex_is_left_on_a_page(self, page):
        drawn = typeset(page.read_text(encoding="utf-8"))
        outside = re.sub(r"^(`{3,}|~{3,}).*?^\1|`[^`]*`", "", drawn, flags=re.DOTALL | re.MULTILINE)
        assert re.findall(r"\\[a-zA-Z(\[]+|&#92;[a-zA-Z]+", outside) == [], "or one that the converter does not know"

    @pytest.mark.parametrize("interval", ["[0.1, 0.9]", "[-1,234, +5]", "[.5, 12.0]"])
    def test_an_interval_is_not_broken(self, interval):
        assert typeset(f"| 0.5 {interval} |") == f"| 0.5 {interval.replace(', ', ',&nbsp;')} |"


def page_of(folder: Path, *cells) -> str:
    notebook = nbformat.v4.new_notebook(cells=list(cells))
    return write_page(notebook, "one", folder).read_text()


class TestNotebooks:
    def test_text_code_and_output_come_in_their_order_and_links_lead_to_pages(self, tmp_path):
        code = nbformat.v4.new_code_cell("print(1)", outputs=[nbformat.v4.new_output("stream", text="1\n")])
        page = page_of(tmp_path, nbformat.v4.new_markdown_cell("# Top\n[next](two.ipynb#end)"), code)
        assert page.index("[next](two.md#end)") < page.index("```python\nprint(1)\n```") < page.index("```text\n1\n```")
        assert "](one.ipynb)" in page
        assert (tmp_path / "one.ipynb").exists()

    def test_a_raw_cell_is_part_of_the_page_as_it_stands(self, tmp_path):
        assert "<!-- recorded run: boids -->" in page_of(
            tmp_path, nbformat.v4.new_raw_cell("<!-- recorded run: boids -->")
        )

    def test_a_picture_is_a_file_beside_the_page(self, tmp_path):
        picture = nbformat.v4.new_output("display_data", {"image/png": "aGVsbG8=", "text/plain": "<Figure size 1x1>"})
        page = page_of(tmp_path, nbformat.v4.new_code_cell("draw()", outputs=[picture], id="cell"))
        assert "(one-cell-0.png)" in page
        assert (tmp_path / "one-cell-0.png").read_bytes() == b"hello"

    def test_of_a_widget_its_text_is_shown_if_it_has_no_picture(self, tmp_path):
        widget = {"application/vnd.jupyter.widget-view+json": {"model_id": "1"}, "text/plain": "SwarmCanvas"}
        page = page_of(
            tmp_path,
            nbformat.v4.new_code_cell("show()", outputs=[nbformat.v4.new_output("display_data", widget)]),
        )
        assert "widget" not in page
        assert "SwarmCanvas" in page

    def test_output_with_fences_or_colours_of_a_terminal_is_fenced(self, tmp_path):
        output = nbformat.v4.new_output("stream", text="\x1b[31m```\x1b[0m")
        assert "````text\n```\n````" in page_of(tmp_path, nbformat.v4.new_code_cell("f()", outputs=[output]))


class TestRecordedRuns:
    def test_there_is_one_of_each_model_and_of_each_notebook(self):
        assert set(recorded_runs()) == {*gallery_names(), *NOTEBOOKS}

    @pytest.mark.parametrize("name", recorded_runs())
    def test_its_settings_are_parameters_of_its_model(self, name):
        run = recorded_runs()[name]
        assert run.cells or set(run.settings) <= set(parameters_of(find_model(run.model)))

    @pytest.mark.parametrize("name", SHOTS)
    def test_that_of_a_model_is_the_run_of_its_picture_from_then_on_or_earlier(self, name):
        run, shot = recorded_runs()[name], SHOTS[name]
        assert (run.model, run.settings, run.rng) == (name, shot.settings, shot.seed)
        assert run.start <= shot.start

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["page", "live_page"])
    def test_a_model_that_a_notebook_defines_is_made_from_its_cells(self, kind):
        page = getattr(recorded_runs()["12_your_own"], kind)()
        assert "Tramway" in page
        assert "/tmp" not in page

    @pytest.mark.slow
    def test_a_run_that_has_ended_before_it_is_seen_is_refused(self):
        run = RecordedRun(model="cooperative_transport", title="a load", settings={"n_robots": 20}, start=5_000)
        with pytest.raises(InvalidValueError, match="a load: 0 rows from step 5000 on; expected 90 or more"):
            run.page()

    @pytest.mark.slow
    def test_a_page_is_no_larger_than_permitted_and_as_long_as_that_permits(self):
        page = RecordedRun(model="collision_avoidance", title="", settings={"n_robots": 100}).page()
        assert 0.8 * LARGEST < len(page) <= LARGEST

    @pytest.mark.slow
    def test_it_begins_at_its_first_step_and_plays_at_the_speed_of_its_model(self):
        assert steps_a_row(find_model("boids")) == 2
        assert '"first":32,' in RecordedRun(model="boids", title="", start=30).page()


def test_pictures_of_the_slides_exist():
    folder = ROOT / "docs" / "lecture"
    pictures = re.findall(r"\((\.\./\S+\.(?:png|svg))\)", (folder / SLIDES).read_text(encoding="utf-8"))
    assert len(pictures) > 5
    assert [picture for picture in pictures if not (folder / picture).is_file()] == []


def test_a_former_address_leads_to_a_page_that_exists_and_not_to_itself(tmp_path):
    write_redirects(tmp_path)
    for former, page in MOVED.items():
        assert not (ROOT / "docs" / f"{former}.md").exists()
        assert (ROOT / "docs" / f"{page}.md").is_file()
        assert f'href="../{page}/"' in (tmp_path / former / "index.html").read_text(encoding="utf-8")


def test_the_gallery_shows_every_model_with_a_picture_and_a_link():
    page = gallery_page()
    for name in gallery_names():
        assert f'href="{name}/"' in page
        assert f'src="pictures/{name}.svg"' in page
