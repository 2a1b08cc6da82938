"""Values as a reader sees them: numbers of things, values in brief, times; and text where letters are missing."""

import unicodedata

# By their names in Unicode, what has no plain letters within.
PLAIN = {
    "MINUS SIGN": "-",
    "EN DASH": "-",
    "EM DASH": "-",
    "MULTIPLICATION SIGN": "x",
    "MIDDLE DOT": "*",
    "FRACTION SLASH": "/",
    "PLUS-MINUS SIGN": "+/-",
    "SQUARE ROOT": "sqrt ",
    "LESS-THAN OR EQUAL TO": "<=",
    "GREATER-THAN OR EQUAL TO": ">=",
    "NOT EQUAL TO": "!=",
    "ALMOST EQUAL TO": "~",
    "RIGHTWARDS ARROW": "->",
    "DEGREE SIGN": " degrees",
    "INFINITY": "infinity",
    "FULL BLOCK": "#",
    "LEFT SINGLE QUOTATION MARK": "'",
    "RIGHT SINGLE QUOTATION MARK": "'",
    "LEFT DOUBLE QUOTATION MARK": '"',
    "RIGHT DOUBLE QUOTATION MARK": '"',
    "LATIN SMALL LETTER SHARP S": "ss",
    "LATIN SMALL LETTER AE": "ae",
    "LATIN SMALL LETTER O WITH STROKE": "o",
    "LATIN SMALL LETTER L WITH STROKE": "l",
}


def quantity(count: int, what: str) -> str:
    """Return a number of things, which are named in the singular.

    Examples
    --------
    >>> quantity(1, "run"), quantity(3000, "run")
    ('1 run', '3,000 runs')
    """
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def in_brief(value: object) -> str:
    """Return a value as a user would write it.

    Examples
    --------
    >>> in_brief(0.1 + 0.2), in_brief(50), in_brief("A"), in_brief(None)
    ('0.3', '50', 'A', '-')
    """
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def time_text(seconds: float) -> str:
    """Return a time.

    Examples
    --------
    >>> time_text(0.3456), time_text(7.25), time_text(83.4), time_text(7500)
    ('0.346 s', '7.2 s', '1 min 23 s', '2 h 5 min 0 s')
    """
    if seconds < 1:
        return f"{seconds:.3g} s"
    if seconds < 59.95:  # 60.0 s is a minute
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:,} h {minutes} min {rest} s" if hours else f"{minutes} min {rest} s"


def in_plain_letters(text: str) -> str:
    r"""Return a text for whatever lacks some of its letters: Greek ones by name, others without their marks.

    Parameters
    ----------
    text : str
        Of any letters; those without a plain form are escaped.

    Returns
    -------
    str
        Of ASCII letters only.

    Examples
    --------
    >>> in_plain_letters("\u0394x \u2264 2, Erd\u0151s, \u65e5")
    'Deltax <= 2, Erdos, \\u65e5'
    """
    return "".join(letter if letter.isascii() else _plain(letter) for letter in text)


def _plain(letter: str) -> str:
    name = unicodedata.name(letter, "")
    if name in PLAIN:
        return PLAIN[name]
    if name.startswith("GREEK ") and " LETTER " in name:
        word = name.partition(" LETTER ")[2].partition(" ")[0]
        return word.lower() if "SMALL" in name else word.capitalize()
    parts = [part for part in unicodedata.normalize("NFKD", letter) if not unicodedata.combining(part)]
    if parts in ([], [letter]):
        return letter.encode("ascii", "backslashreplace").decode()
    return in_plain_letters("".join(parts))
