"""The documentation's site as MkDocs builds it: links lead somewhere, equations are drawn, no external requests."""

import functools
import http.server
import os
import re
import subprocess
import sys
import threading
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbformat
import pytest

from support.visits import HOST, blank_page

pytest.importorskip("mkdocs_jupyter", reason="the site needs the extra docs (pip install -e '.[docs]')")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
# No equation is looked for within these.
CODE = {"pre", "code", "script", "style", "math"}
TEXT = [
    "A dollar: $v_L + 1$, then\n`$v_R$`, and a block: $$a < b$$",
    "[next](second.ipynb) and [home](../index.md#top)",
]
SHOWS = """import matplotlib.pyplot as plt
from mesa_swarm import SwarmModel
print('5 $ and 6 $')
plt.plot([1, 2])
plt.show()
SwarmModel(rng=1).show()"""


class Page(HTMLParser):
    """What a page links to, and its text outside code."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path, self.links, self.text, self._within = path, [], "", []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.links += [given[name] for name in ("href", "src") if given.get(name)]
        is_copied = "clipboard-copy-txt" in (given.get("class") or "")
        if tag in CODE or is_copied or (self._within and tag == self._within[-1]):
            self._within.append(tag)

    def handle_endtag(self, tag):
        if self._within and tag == self._within[-1]:
            self._within.pop()

    def handle_data(self, text):
        self.text += "" if self._within else text

    def broken(self, site: Path) -> list[str]:
        """Return the links within the site that lead nowhere."""
        within = [unquote(urlsplit(link).path) for link in self.links if not urlsplit(link).scheme]
        return [path for path in within if path and not (self._folder(path, site) / path.lstrip("/")).exists()]

    def _folder(self, path: str, site: Path) -> Path:
        return site if path.startswith("/") else self.path.parent


def built(folder: Path, settings: Path, *, execute: bool) -> Path:
    surroundings = {**os.environ, "MESA_SWARM_EXECUTE": str(execute).lower(), "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", settings, "-d", folder]
    made = subprocess.run(command, cwd=ROOT, env=surroundings, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder


def written(folder: Path, texts: list[str], code: str) -> Path:
    """Write the sources of a small site with two notebooks, made like ours; return its settings."""
    (folder / "docs" / "notebooks").mkdir(parents=True)
    (folder / "docs" / "index.md").write_text("# Top\n\n[first](notebooks/first.ipynb)\n")
    cells = [nbformat.v4.new_markdown_cell(text) for text in texts]
    for name, more in (("first", [*cells, nbformat.v4.new_code_cell(code)]), ("second", [])):
        title = nbformat.v4.new_markdown_cell(f"# The {name}")
        kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
        notebook = nbformat.v4.new_notebook(cells=[title, *more], metadata=kernel)
        nbformat.write(notebook, folder / "docs" / "notebooks" / f"{name}.ipynb")
    hooks = [str(ROOT / "docs" / name) for name in ("equations.py", "notebook_pages.py")]
    settings = {"docs_dir": str(folder / "docs"), "hooks": hooks, "extra_css": [], "nav": ["index.md"]}
    settings["nav"] += ["notebooks/first.ipynb", "notebooks/second.ipynb"]
    file = folder / "mkdocs.yml"
    file.write_text("".join(f"{k}: {v}\n" for k, v in {"INHERIT": ROOT / "mkdocs.yml", **settings}.items()))
    return file


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of our site, whose notebooks are not executed: the one that `.ci/run` has built, if any."""
    if "MESA_SWARM_SITE" in os.environ:
        return Path(os.environ["MESA_SWARM_SITE"])
    return built(tmp_path_factory.mktemp("site"), ROOT / "mkdocs.yml", execute=False)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Return the folder of a small site whose notebook is executed and shows a widget."""
    folder = tmp_path_factory.mktemp("small")
    return built(folder / "site", written(folder, TEXT, SHOWS), execute=True)


@pytest.fixture
def asked(chromium):
    """Return a function that visits pages of a site and returns the requested addresses, with their status."""

    def visit(folder: Path, pages: list[str]) -> dict[str, int]:
        handler = functools.partial(Silent, directory=folder)
        answers: dict[str, int] = {}
        with http.server.ThreadingHTTPServer((HOST, 0), handler) as server:
            threading.Thread(target=server.serve_forever).start()
            tab = blank_page(chromium)
            tab.on("request", lambda request: answers.setdefault(request.url, 0))
            tab.on("response", lambda response: answers.update({response.url: response.status}))
            for page in pages:
                tab.goto(f"http://{HOST}:{server.server_port}/{page}", wait_until="load")
            tab.wait_for_load_state("networkidle")
            tab.close()
            server.shutdown()
        return {url: status for url, status in answers.items() if not url.startswith(("data:", "blob:"))}

    return visit


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        """Log nothing."""


def pages_of(site: Path) -> list[Page]:
    return [Page(path) for path in sorted(site.rglob("index.html"))]


def test_every_link_within_the_site_leads_somewhere(site):
    broken = {page.path.parent.name: page.broken(site) for page in pages_of(site)}
    assert len(broken) > 40
    assert not {name: links for name, links in broken.items() if links}


def test_no_equation_is_left_as_it_was_typed(site):
    assert [page.path.parent.name for page in pages_of(site) if "$" in page.text or "\\(" in page.text] == []


def test_no_page_makes_external_requests(site, asked):
    answers = asked(site, [str(page.path.parent.relative_to(site)) + "/" for page in pages_of(site)])
    assert {urlsplit(url).hostname for url in answers} == {HOST}
    assert {status for status in answers.values() if status >= 400} == set()


class TestAPageMadeOfANotebook:
    def test_a_figure_and_a_widget_are_shown_as_pictures_and_ask_for_no_script(self, small, asked):
        text = (small / "notebooks" / "first" / "index.html").read_text()
        assert len(re.findall(r"<img [^>]*data:image/png;base64,", text)) == 2
        assert "widget-view" not in text
        assert "widget-state" not in text
        answers = asked(small, ["notebooks/first/"])
        assert {urlsplit(url).hostname for url in answers} == {HOST}

    def test_its_links_lead_to_pages(self, small):
        page = Page(small / "notebooks" / "first" / "index.html")
        assert {"../second/", "../../#top"} <= set(page.links)
        assert page.broken(small) == []

    def test_its_equations_are_drawn_and_its_code_is_left_alone(self, small):
        page = Page(small / "notebooks" / "first" / "index.html")
        text = page.path.read_text()
        assert "$" not in page.text
        assert text.count("<math ") == 2
        assert 'display="block"' in text
        assert "<code>$v_R$</code>" in text
        assert "5 $ and 6 $\n</pre>" in text
        assert "print('5 $ and 6 $')\n" in text, "what is copied is what stands there"

    def test_a_link_that_leads_nowhere_ends_a_strict_build(self, tmp_path):
        with pytest.raises(AssertionError, match=r"notebooks/first.ipynb links to notebooks/third.ipynb"):
            built(tmp_path / "site", written(tmp_path, ["[no](third.ipynb)"], ""), execute=False)
