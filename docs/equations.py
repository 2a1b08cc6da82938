"""A hook of MkDocs: convert equations to MathML, which browsers draw without an external script."""

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.structure.pages import Page

EQUATION = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.DOTALL)
# Equations of notebooks are still between dollars. Code, its output and its clipboard text contain no equations.
OF_NOTEBOOK = re.compile(
    r'<(?P<code>pre|code|script|style)\b.*?</(?P=code)>|<div [^>]*class="clipboard-copy-txt"[^>]*>.*?</div>'
    r"|(?P<mark>\$\$?)(?P<latex>[^$]+)(?P=mark)",
    re.DOTALL,
)


def on_page_content(html: str, *, page: Page, **_: object) -> str:
    """Replace every equation of a page."""
    html = EQUATION.sub(_of_markdown, html)
    return OF_NOTEBOOK.sub(_of_notebook, html) if page.file.src_uri.endswith(".ipynb") else html


def _of_markdown(found: re.Match) -> str:
    latex = unescape(found[2]).strip()
    return _mathml(latex[2:-2], is_block=latex.startswith(r"\["))


def _of_notebook(found: re.Match) -> str:
    return _mathml(unescape(found["latex"]), is_block=found["mark"] == "$$") if found["latex"] else found[0]


def _mathml(latex: str, is_block: bool) -> str:
    return convert(latex.strip(), display="block" if is_block else "inline")
