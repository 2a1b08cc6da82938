"""Values as a reader sees them: numbers of things, values in brief, times."""


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
