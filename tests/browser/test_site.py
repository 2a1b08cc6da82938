"""The documentation's site as both builders make it: links, equations, recorded runs, reference, search, widths."""

import functools
import http.server
import importlib
import inspect
import json
import os
import re
import subprocess
import sys
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path
from pkgutil import iter_modules
from urllib.parse import unquote, urlsplit

import nbformat
import pytest
from notebook_pages import executed, write_page
from prepare import MOVED
from recorded_runs import LARGEST
from typesetting import typeset

import mesa_swarm
from support.visits import HOST, blank_page
from support.waiting import wait_until

pytest.importorskip("material", reason="the site needs the extra docs (pip install -e '.[docs]')")
pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
PACKAGES = ["mesa_swarm", *(f"mesa_swarm.{module.name}" for module in iter_modules(mesa_swarm.__path__))]
# Compiled functions of sensors, which users do not call; a property that a class sets and SwarmModel explains.
NOT_METHODS = {
    "mesa_swarm.FieldSensor.read",
    "mesa_swarm.NeighbourSensor.read",
    "mesa_swarm.environments.TaskWorld.control",
}
# No equation is looked for within these.
CODE = {"pre", "code", "script", "style", "math"}
# What is left of an equation that was not drawn: Markdown takes the backslash from brackets, but not from commands.
RAW = re.compile(r"\$|\\[a-zA-Z(\[]+|\.\. math|:math:")
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


# Where `.ci/run` has built the site, and how a builder is called.
BUILT = {"mkdocs": "MESA_SWARM_SITE", "zensical": "MESA_SWARM_SITE_BY_ZENSICAL"}
# With -q MkDocs does not count warnings.
FLAGS = {"mkdocs": ["build", "--strict"], "zensical": ["build", "--strict"]}


def built(folder: Path, pages: Path, builder: str = "mkdocs", **settings) -> Path:
    """Build a site of these pages like ours, and return its folder."""
    file = folder / "mkdocs.yml"
    settings = {"INHERIT": ROOT / "mkdocs.yml", "docs_dir": pages, "site_dir": folder / "site", **settings}
    file.write_text("".join(f"{name}: {value}\n" for name, value in settings.items()))
    command = [sys.executable, "-m", builder, *FLAGS[builder], "-f", file]
    surroundings = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    made = subprocess.run(command, cwd=ROOT, env=surroundings, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder / "site"


def written(folder: Path, texts: list[str], code: str) -> Path:
    """Write the pages of a small site with two notebooks, made like ours; return their folder."""
    pages = folder / "pages"
    (pages / "notebooks").mkdir(parents=True)
    (pages / "index.md").write_text("# Top\n\n[first](notebooks/first.md)\n")
    for name in ("site.css", "site.js"):
        (pages / name).write_text("")
    cells = [nbformat.v4.new_markdown_cell(text) for text in texts]
    for name, more in (("first", [*cells, nbformat.v4.new_code_cell(code)]), ("second", [])):
        title = nbformat.v4.new_markdown_cell(f"# The {name}")
        kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
        notebook = nbformat.v4.new_notebook(cells=[title, *more], metadata=kernel)
        nbformat.write(notebook, folder / f"{name}.ipynb")
        page = write_page(executed(folder / f"{name}.ipynb"), name, pages / "notebooks")
        page.write_text(typeset(page.read_text()))
    return pages


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Return the folder of all pages, without executing their notebooks."""
    folder = tmp_path_factory.mktemp("pages")
    surroundings = {**os.environ, "MESA_SWARM_EXECUTE": "false", "MESA_SWARM_PAGES": str(folder)}
    subprocess.run([sys.executable, ROOT / "docs" / "prepare.py"], env=surroundings, check=True)
    return folder


@pytest.fixture(scope="module", params=BUILT)
def site(request, tmp_path_factory):
    """Return the folder of our site, whose notebooks are not executed: the one that `.ci/run` has built, if any."""
    if BUILT[request.param] in os.environ:
        return Path(os.environ[BUILT[request.param]])
    return built(tmp_path_factory.mktemp("site"), request.getfixturevalue("pages"), request.param)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Return the folder of a small site whose notebook is executed and shows a widget."""
    folder = tmp_path_factory.mktemp("small")
    nav = ["index.md", "notebooks/first.md", "notebooks/second.md"]
    return built(folder, written(folder, TEXT, SHOWS), nav=nav)


def addresses_of(site: Path) -> set[str]:
    """Return the names that the reference explains, from the inventory that other sites link by."""
    packed = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    return {line.split()[0] for line in zlib.decompress(packed).decode().splitlines()}


def names_of(value: object, package: str, name: str) -> set[str]:
    """Return the names under which the reference may explain what a package exports."""
    return {f"{package}.{name}", f"{getattr(value, '__module__', package)}.{getattr(value, '__qualname__', name)}"}


def methods_of(one: type) -> list[str]:
    """Return the names of a class's public methods and properties of this package that have a docstring."""
    fields = set(getattr(one, "__dataclass_fields__", ()))
    mine = {name for base in one.__mro__ if base.__module__.startswith("mesa_swarm") for name in vars(base)}
    kinds = (property, classmethod, staticmethod)
    return [
        name
        for name in sorted(mine - fields)
        if not name.startswith("_")
        and (inspect.isroutine(found := inspect.getattr_static(one, name)) or isinstance(found, kinds))
        and inspect.getdoc(found)
    ]


@pytest.fixture
def asked(chromium):
    """Return a function that visits pages of a site and returns the requested addresses, with their status."""

    def visit(folder: Path, pages: list[str]) -> dict[str, int]:
        answers: dict[str, int] = {}
        with served(folder) as address:
            tab = blank_page(chromium)
            tab.on("request", lambda request: answers.setdefault(request.url, 0))
            tab.on("response", lambda response: answers.update({response.url: response.status}))
            for page in pages:
                tab.goto(f"{address}/{page}", wait_until="load")
            tab.wait_for_load_state("networkidle")
            tab.close()
        return {url: status for url, status in answers.items() if not url.startswith(("data:", "blob:"))}

    return visit


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve a folder, and yield its address."""
    with http.server.ThreadingHTTPServer((HOST, 0), functools.partial(Silent, directory=folder)) as server:
        threading.Thread(target=server.serve_forever).start()
        try:
            yield f"http://{HOST}:{server.server_port}"
        finally:
            server.shutdown()


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        """Log nothing."""


def pages_of(site: Path) -> list[Page]:
    """Return the pages of a site, without those at former addresses, which only lead to others."""
    former = {site / name / "index.html" for name in MOVED}
    return [Page(path) for path in sorted(site.rglob("index.html")) if path not in former]


def test_every_link_within_the_site_leads_somewhere(site):
    broken = {page.path.parent.name: page.broken(site) for page in pages_of(site)}
    assert len(broken) > 40
    assert not {name: links for name, links in broken.items() if links}


@pytest.mark.parametrize("name", MOVED)
def test_the_former_address_of_a_page_leads_to_the_present_one(name, site):
    page = Page(site / name / "index.html")
    assert page.broken(site) == []
    assert page.links == [f"../{MOVED[name]}/"]


def searched(site: Path) -> set[str]:
    """Return the addresses of the pages that the search knows, by either builder."""
    file = next(path for path in (site / "search" / "search_index.json", site / "search.json") if path.exists())
    index = json.loads(file.read_text(encoding="utf-8"))
    return {entry["location"].partition("#")[0].strip("/") for entry in index.get("docs") or index["items"]}


def test_the_search_leaves_out_the_appendix_and_nothing_else(site):
    pages = {page.path.parent.relative_to(site).as_posix().strip(".") for page in pages_of(site)}
    assert pages - searched(site) == {page for page in pages if page.startswith("appendix/")}
    assert len(searched(site)) > 80


def test_the_reference_explains_every_public_name_and_every_method(site):
    explained, missing = addresses_of(site), []
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            places = names_of(value, package, name)
            if not places & explained:
                missing.append(f"{package}.{name}")
            elif inspect.isclass(value):
                known = {place.removeprefix(one + ".") for one in places for place in explained}
                missing += [f"{package}.{name}.{method}" for method in methods_of(value) if method not in known]
    assert set(missing) == NOT_METHODS


def test_no_equation_is_left_as_it_was_typed(site):
    raw = {page.path.parent.name: RAW.findall(page.text) for page in pages_of(site)}
    assert {name: found for name, found in raw.items() if found} == {}
    drawn = {page.path.parent.name: page.path.read_text(encoding="utf-8").count("<math") for page in pages_of(site)}
    assert all(drawn[name] > 5 for name in ("physics", "not_round", "differences"))
    assert drawn["model"], "of a docstring"


def test_every_table_is_drawn_as_one(site):
    assert [page.path.parent.name for page in pages_of(site) if re.search(r"={4,}  |\|\s*-{3,}", page.text)] == []


def test_no_page_makes_external_requests(site, asked):
    answers = asked(site, [str(page.path.parent.relative_to(site)) + "/" for page in pages_of(site)])
    assert {urlsplit(url).hostname for url in answers} == {HOST}
    assert {status for status in answers.values() if status >= 400} == set()


def test_the_home_page_every_model_and_every_notebook_has_a_recorded_run(site):
    pages = [site / "index.html", *site.glob("models/*/index.html"), *site.glob("notebooks/*/index.html")]
    assert len(pages) >= 30
    assert [str(page) for page in pages if 'class="recorded-run' not in page.read_text(encoding="utf-8")] == []


def test_a_recorded_run_plays_by_itself_and_begins_again_at_its_end(site, chromium):
    with served(site) as address:
        page = blank_page(chromium)
        page.goto(f"{address}/recorded/foraging.html#embedded")
        page.locator("html[data-embedded][data-ready]").wait_for()
        step = page.locator("#scrub")
        before = step.input_value()
        wait_until(lambda: step.input_value() != before)
        page.locator("#scrub").fill(step.get_attribute("max"))
        wait_until(lambda: int(step.input_value()) < int(step.get_attribute("max")) // 2)
        assert page.locator("header").is_hidden()
        page.close()


def test_a_model_that_runs_on_a_page_runs_on_its_own(site, chromium):
    with served(site) as address:
        page = blank_page(chromium)
        for place in ("models/boids/", "models/foraging/", "notebooks/12_your_own/", ""):
            page.goto(f"{address}/{place}")
            frame = page.frame_locator("iframe.recorded-run")
            frame.locator("html[data-embedded][data-ready]").wait_for()
            step = frame.locator("#step")
            wait_until(lambda step=step: int(step.text_content().replace(",", "")) > 20)
        page.close()


def test_a_system_with_less_motion_shows_it_at_rest(site, chromium):
    with served(site) as address:
        page = blank_page(chromium, reduced_motion="reduce")
        page.goto(f"{address}/recorded/boids.html#embedded")
        page.locator("html[data-embedded][data-ready]").wait_for()
        assert page.locator("#play").get_attribute("aria-label") == "Play"
        page.close()


def test_no_page_is_wider_than_its_window(site, chromium):
    with served(site) as address:
        page = blank_page(chromium)
        page.route(re.compile("/(recorded|live)/"), lambda route: route.abort())  # as wide as their frame
        wide = []
        for one in pages_of(site):
            page.goto(f"{address}/{one.path.parent.relative_to(site)}/", wait_until="domcontentloaded")
            page.add_style_tag(content="* { transition: none !important; }")  # as after a change of size
            for width in (390, 1366, 1920):
                page.set_viewport_size({"width": width, "height": 900})
                if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
                    wide.append((one.path.parent.name, width))
        page.close()
    assert wide == []


def test_recorded_runs_are_small(site):
    sizes = {path: path.stat().st_size for folder in ("recorded", "live") for path in (site / folder).glob("*.html")}
    assert len(sizes) >= 35
    assert max(sizes.values()) <= LARGEST


LINKS = "(all) => all.map((link) => link.href)"
# Words of a visitor, and a page that the search offers for them.
SEARCHED = {
    "cite": "cite",
    "FAQ": "faq",
    "troubleshooting": "faq",
    "glossary": "glossary",
    "video": "faq",
    "licence": "cite",
    "pheromone": "notebooks/14_stigmergy",
    "deposit": "reference/model",
    "get_neighbors_in_radius": "reference/model",
    "find_pathologies": "reference/analysis",
}


@pytest.mark.parametrize("site", ["mkdocs"], indirect=True)
def test_the_search_finds_what_visitors_look_for(site, chromium):
    missed = {}
    with served(site) as address:
        page = blank_page(chromium)
        page.goto(address)
        field = page.locator("input.md-search__input")
        field.click()
        for words, wanted in SEARCHED.items():
            field.fill(words)
            field.press("End")
            page.locator(".md-search-result__meta").filter(has_text="matching").wait_for()
            links = page.locator("a.md-search-result__link").evaluate_all(LINKS)
            if not any(f"/{wanted}/" in link for link in links):
                missed[words] = links
            field.fill("")
            field.press("End")
            page.locator(".md-search-result__meta").filter(has_text="Type to start").wait_for()
        page.close()
    assert missed == {}


class TestAPageMadeOfANotebook:
    def test_a_figure_and_a_widget_are_shown_as_pictures_and_ask_for_no_script(self, small, asked):
        text = (small / "notebooks" / "first" / "index.html").read_text()
        assert len(re.findall(r"<img [^>]*\.png", text)) == 2
        assert "widget-view" not in text
        answers = asked(small, ["notebooks/first/"])
        assert {urlsplit(url).hostname for url in answers} == {HOST}
        assert sum(url.endswith(".png") for url in answers) >= 2

    def test_its_links_lead_to_pages(self, small):
        page = Page(small / "notebooks" / "first" / "index.html")
        assert {"../second/", "../../#top", "first.ipynb"} <= {
            link.removeprefix("../") if link.endswith(".ipynb") else link for link in page.links
        }
        assert page.broken(small) == []

    def test_its_equations_are_drawn_and_its_code_is_left_alone(self, small):
        page = Page(small / "notebooks" / "first" / "index.html")
        text = page.path.read_text()
        assert "$" not in page.text
        assert text.count("<math ") == 2
        assert 'display="block"' in text
        assert "<code>$v_R$</code>" in text
        assert "5 $ and 6 $" in text

    def test_a_link_that_leads_nowhere_ends_a_strict_build(self, tmp_path):
        with pytest.raises(AssertionError, match=r"third\.md"):
            built(
                tmp_path,
                written(tmp_path, ["[no](third.ipynb)"], "1"),
                nav=["index.md", "notebooks/first.md", "notebooks/second.md"],
            )
