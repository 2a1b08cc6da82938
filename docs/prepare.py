"""Write the pages of the site as plain Markdown, for any builder that reads the settings of MkDocs.

What builders differ in is done here: equations become MathML, notebooks Markdown with their output, each model of the
gallery a page, and recorded runs pages that play without a server. Then ``mkdocs build`` or ``zensical build``.

::

    python docs/prepare.py
"""

import os
import re
import shutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import nbformat
from gallery_page import gallery_page, write_pictures
from model_pages import model_page
from notebook_pages import executed, is_executed, write_page
from recorded_runs import RecordedRun, recorded_runs
from slide_show import slide_show
from typesetting import typeset

from mesa_swarm.gallery import gallery_names

ROOT = Path(__file__).parents[1]
SOURCES, TARGET = ROOT / "docs", ROOT / "build" / "docs"
NOT_PAGES = shutil.ignore_patterns("*.py", "*.toml", "__pycache__")
# Files of the repository that are pages too.
OF_THE_REPOSITORY = ("CONTRIBUTING.md", "ARCHITECTURE.md", "CHANGELOG.md")
SLIDES = "slides_of_a_lecture.md"
# Stands where a page embeds a recorded run.
EMBEDDED = re.compile(r"^<!-- recorded run: (?P<name>\w+) -->$", re.MULTILINE)
# How it is written: on a slide, and on a page, where `site.js` makes a frame of it.
FRAME = '<iframe class="recorded-run" src="{source}" title="{title}" loading="lazy"></iframe>'
LINK = "[{title}]({source}){{ .recorded-run }}"
# Where the model itself runs on a page: `site.js` shows that one, and the recorded run is what the link leads to.
LIVE_LINK = "[{title}]({source}){{ .recorded-run .live-run }}"
# Results and tables to look up, which the search of the site leaves out.
APPENDIX = "appendix"
NOT_SEARCHED = "---\nsearch:\n  exclude: true\n---\n\n"
IN_THE_APPENDIX_NOW = (
    *("deciding_constants", "differences", "fire_learning", "foresight", "learning_results", "published", "readings"),
    *("reproduction", "validation", "one_machine"),
)
# Kernels of live pages are compiled by this number of processes at a time.
PROCESSES = 2
# Former names of pages, and the pages where their contents are now.
MOVED = {
    **{name: f"{APPENDIX}/{name}" for name in IN_THE_APPENDIX_NOW},
    "benchmarks": f"{APPENDIX}/one_machine",
    "without_a_compiler": "live_pages",
    "concepts": "how_it_works",
}
REDIRECT = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Moved</title><meta http-equiv="refresh" content="1; url=../{page}/">
<script>location.replace("../{page}/" + location.hash)</script></head>
<body><a href="../{page}/">This page has moved.</a></body></html>
"""


def prepare(target: Path = TARGET) -> None:
    """Write all pages."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(SOURCES, target, ignore=NOT_PAGES)
    runs = recorded_runs()
    live = write_live_pages(target / "live", runs)
    _write_repository(target)
    _write_models(target / "models")
    _write_notebooks(target / "notebooks", runs)
    for page in sorted(target.rglob("*.md")):
        text = typeset(page.read_text(encoding="utf-8"))
        if page.parent.name == APPENDIX:
            text = NOT_SEARCHED + text
        if page.parent == target:  # in the repository notebooks lie beside docs/, on the site among the pages
            text = text.replace("](../notebooks/", "](notebooks/")
        if page.name == SLIDES:
            page.with_suffix(".html").write_text(
                slide_show(_with_runs(text, FRAME, "../", runs, live)), encoding="utf-8"
            )
            page.unlink()
        else:
            up = "../" * (len(page.relative_to(target).parts) - 1)
            page.write_text(_with_runs(text, LINK, up, runs, live), encoding="utf-8")
    _write_runs(target / "recorded", runs)
    write_redirects(target)


def write_redirects(folder: Path) -> None:
    """Write at each former address of a page what leads to the present one."""
    for former, page in MOVED.items():
        (folder / former).mkdir()
        (folder / former / "index.html").write_text(REDIRECT.format(page=page), encoding="utf-8")


def _write_repository(folder: Path) -> None:
    """Write the files of the repository as pages; links between them lead to pages."""
    for name in OF_THE_REPOSITORY:
        text = (ROOT / name).read_text(encoding="utf-8")
        for other in OF_THE_REPOSITORY:
            text = text.replace(f"({other})", f"({other.lower()})")
        (folder / name.lower()).write_text(text.replace("](docs/", "]("), encoding="utf-8")


def _write_models(folder: Path) -> None:
    folder.mkdir()
    for name in gallery_names():
        (folder / f"{name}.md").write_text(model_page(name), encoding="utf-8")
    (folder / "index.md").write_text(gallery_page(), encoding="utf-8")
    write_pictures(folder)


def _write_notebooks(folder: Path, runs: dict[str, RecordedRun]) -> None:
    folder.mkdir()
    sources = ROOT / "notebooks"
    (folder / "index.md").write_text((sources / "README.md").read_text(encoding="utf-8").replace(".ipynb)", ".md)"))
    for file in sorted(sources.glob("*.ipynb")):
        notebook = executed(file) if is_executed() else nbformat.read(file, as_version=4)
        if file.stem in runs:
            notebook.cells.insert(1, nbformat.v4.new_raw_cell(f"<!-- recorded run: {file.stem} -->"))
        write_page(notebook, file.stem, folder)


def _with_runs(text: str, form: str, up: str, runs: dict[str, RecordedRun], live: set[str]) -> str:
    """Return a page with its recorded runs in this form; `up` leads to the top of the site."""

    def shown(found: re.Match) -> str:
        name, is_link = found["name"], form == LINK
        title = f"A recorded run: {runs[name].title}"
        folder = "live" if name in live and not is_link else "recorded"
        shape = LIVE_LINK if name in live and is_link else form
        return shape.format(source=f"{up}{folder}/{name}.html", title=title)

    return EMBEDDED.sub(shown, text)


def write_live_pages(folder: Path, runs: dict[str, RecordedRun]) -> set[str]:
    """Write a page of each run whose model can run on one, and return their names."""
    folder.mkdir()
    with ProcessPoolExecutor(PROCESSES, get_context("spawn")) as pool:
        pages = dict(zip(runs, pool.map(RecordedRun.live_page, runs.values()), strict=True))
    live = {name: page for name, page in pages.items() if page}
    for name, page in live.items():
        (folder / f"{name}.html").write_text(page, encoding="utf-8")
    return set(live)


def _write_runs(folder: Path, runs: dict[str, RecordedRun]) -> None:
    folder.mkdir()
    for name, run in runs.items():
        (folder / f"{name}.html").write_text(run.page(), encoding="utf-8")


if __name__ == "__main__":
    prepare(Path(os.environ.get("MESA_SWARM_PAGES", TARGET)))
