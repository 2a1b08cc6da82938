"""Equations of a page as MathML, which browsers draw without a script, and intervals that no line breaks."""

import re

from latex2mathml.converter import convert

# Code and links contain no equations; a dollar that is followed or preceded by a space is money.
PARTS = re.compile(
    r"(?P<code>^(?P<fence>`{3,}|~{3,})[^\n]*\n.*?^(?P=fence)[ \t]*$|(?P<ticks>`+)(?!`).+?(?<!`)(?P=ticks)(?!`)"
    r"|<(?P<tag>pre|code|script|style)\b.*?</(?P=tag)>)"
    r"|\[(?P<low>[-+]?[\d,.]*\d), (?P<high>[-+]?\d[\d,.]*)\](?!\()"
    r"|\$\$(?P<block>.+?)\$\$|(?<![\\$])\$(?P<inline>[^\s$](?:[^$]*?[^\s$\\])?)\$(?![\d$])",
    re.DOTALL | re.MULTILINE,
)
# Read as marks of Markdown otherwise, also within an element.
MARKS = str.maketrans({mark: f"&#{ord(mark)};" for mark in "*_`|\\[]{}~^"})


def typeset(markdown: str) -> str:
    """Return a page with its equations, ``$...$`` within a line and ``$$...$$`` as a block, as MathML.

    Intervals are kept in one line: ``[0.1, 0.2]`` with a space that does not break.

    >>> typeset("`$v$` is code, $5 and $6 are money, $v$ is a speed")
    '`$v$` is code, $5 and $6 are money, <math xmlns="http://www.w3.org/1998/Math/MathML" display="inline"><mrow><mi>v</mi></mrow></math> is a speed'
    >>> typeset("`[1, 2]` is code, 0.15 [0.1, 0.2] has an interval")
    '`[1, 2]` is code, 0.15 [0.1,&nbsp;0.2] has an interval'
    """  # noqa: E501 - MathML is long
    return PARTS.sub(_replaced, markdown)


def _replaced(found: re.Match) -> str:
    if found["low"]:
        return f"[{found['low']},&nbsp;{found['high']}]"
    if found["inline"]:
        return _mathml(found["inline"], "inline")
    return f'\n\n<div class="equation">{_mathml(found["block"], "block")}</div>\n\n' if found["block"] else found[0]


def _mathml(latex: str, display: str) -> str:
    return convert(" ".join(latex.split()), display=display).translate(MARKS)
