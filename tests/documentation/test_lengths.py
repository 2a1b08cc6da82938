"""How long the documentation is, and how each of its pages begins."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
OF_THE_REPOSITORY = [ROOT / name for name in ("CONTRIBUTING.md", "ARCHITECTURE.md", "CHANGELOG.md")]
PAGES = [*OF_THE_REPOSITORY, *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("appendix/*.md"))]
NOT_READ_THROUGH = {"reference", "appendix"}
MOST_WORDS = 50_000
# After the title: for whom the page is, and what it is for, in one or two sentences.
BEGINNING = re.compile(r"# .+\n\nFor (?P<whom>[^.:]+): (?P<purpose>[^\n].*?\.)\n\n", re.DOTALL)


def words(page: Path) -> list[str]:
    return page.read_text(encoding="utf-8").split()


def test_pages_outside_the_reference_and_the_appendix_have_at_most_50_000_words():
    pages = [page for page in DOCS.rglob("*.md") if page.parent.name not in NOT_READ_THROUGH]
    pages += [*OF_THE_REPOSITORY, ROOT / "README.md", ROOT / "notebooks" / "README.md"]
    assert len(pages) > 50
    assert sum(len(words(page)) for page in pages) <= MOST_WORDS


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_begins_with_whom_and_what_it_is_for(page):
    beginning = BEGINNING.match(page.read_text(encoding="utf-8"))
    assert beginning, "expected a first paragraph of the form 'For users: what ...'"
    assert len(beginning["purpose"].split()) <= 40
    assert beginning["purpose"].count(". ") <= 1
