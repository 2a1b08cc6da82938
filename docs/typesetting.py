"""Equations of a page as MathML, which browsers draw without a script, and intervals that no line breaks."""

import re

from latex2mathml.converter import convert

# Code and links contain no equations; a dollar that is followed or preceded by a space is money.
PARTS = re.compile(
    r"(?P<code>^(?P<fence>`{3,}|~{3,})[^\n]*\n.*?^(?P=fence)[ \t]*$|(?P<ticks>`+)(?!`).+?(?<!`)(?P=ticks)(?!`)"
    r"|<(?P<tag>pre|code|script|style)\b.*?</(?P=tag)>)"
    r"|\[(?P<low>[-+]?[\d,.]*\d), (?P<high>[-+]?\d[\d,.]*)\](?!\()"
    r"|\$\$(?P<block>.+?)\$\$|(?<![\\$])\$(?P<inline>[^\s$](?:[^$]*?[^\s$\\])?)\$(?![\d$])"
    r"|\\\[(?P<display>.+?)\\\]|\\\((?P<within>.+?)\\\)",
    re.DOTALL | re.MULTILINE,
)
BEGUN = re.compile(r"(?:^|\n) *\Z")
# In docstrings: the directive of reStructuredText, up to a line that is not indented further, and its role.
DIRECTIVE = re.compile(r"^(?P<space> *)\.\. math::(?P<latex>[^\n]*(?:\n(?P=space) +\S[^\n]*)*)", re.MULTILINE)
ROLE = re.compile(r":math:`(?P<latex>[^`]+)`")
# Read as marks of Markdown otherwise, also within an element.
MARKS = str.maketrans({mark: f"&#{ord(mark)};" for mark in "*_`|\\[]{}~^"})


def typeset(markdown: str) -> str:
    r"""Return a page with its equations as MathML.

    Within a line they stand in ``$...$`` or ``\(...\)``, as a block in ``$$...$$`` or ``\[...\]``. Intervals are kept in
    one line: ``[0.1, 0.2]`` with a space that does not break.

    >>> typeset("`$v$` is code, $5 and $6 are money, $v$ is a speed")
    '`$v$` is code, $5 and $6 are money, <math xmlns="http://www.w3.org/1998/Math/MathML" display="inline"><mrow><mi>v</mi></mrow></math> is a speed'
    >>> typeset("`[1, 2]` is code, 0.15 [0.1, 0.2] has an interval")
    '`[1, 2]` is code, 0.15 [0.1,&nbsp;0.2] has an interval'
    """  # noqa: E501 - MathML is long
    return PARTS.sub(_replaced, markdown)


def typeset_docstring(text: str) -> str:
    """Return a docstring with its equations, ``.. math::`` and ``:math:``, as MathML.

    >>> typeset_docstring("where :math:`v` is")[:54]
    'where <math xmlns="http://www.w3.org/1998/Math/MathML"'
    """
    return ROLE.sub(lambda found: mathml(found["latex"], "inline"), DIRECTIVE.sub(_indented, text))


def _indented(found: re.Match) -> str:
    return f'{found["space"]}<div class="equation">{mathml(found["latex"], "block")}</div>'


def _replaced(found: re.Match) -> str:
    if found["low"]:
        return f"[{found['low']},&nbsp;{found['high']}]"
    within, block = found["inline"] or found["within"], found["block"] or found["display"]
    if within:
        drawn = mathml(within, "inline")
        # At the beginning of a line Markdown would take it for a block.
        return f"<span>{drawn}</span>" if BEGUN.search(found.string, 0, found.start()) else drawn
    return f'\n\n<div class="equation">{mathml(block, "block")}</div>\n\n' if block else found[0]


def mathml(latex: str, display: str) -> str:
    """Return an equation as MathML that Markdown leaves as it is."""
    return convert(" ".join(latex.split()), display=display).translate(MARKS)
