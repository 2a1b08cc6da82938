"""A hook of MkDocs: equations become MathML, which browsers draw of themselves, without a script from elsewhere."""

import re
from html import unescape

from latex2mathml.converter import convert

EQUATION = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.DOTALL)


def on_page_content(html: str, **_: object) -> str:
    """Replace every equation of a page."""
    return EQUATION.sub(_mathml, html)


def _mathml(found: re.Match) -> str:
    latex = unescape(found[2]).strip()
    shown = "block" if latex.startswith(r"\[") else "inline"
    return convert(latex[2:-2].strip(), display=shown)
