"""How exported pictures and films look: their size, and what is drawn besides the world."""

from dataclasses import dataclass

from mesa_swarm.errors import InvalidValueError, check_count, shortened
from mesa_swarm.world.map_parts import Bounds

SMALLEST, LARGEST = 64, 4096
# The longer side of the world in a film.
USUAL = 800
# Above the world of a film stands its name and step; around it is a margin.
CAPTION, MARGIN = 32, 4


@dataclass(frozen=True, kw_only=True, slots=True)
class Look:
    """How it is drawn.

    Parameters
    ----------
    size : (width, height), optional
        Pixels, 64 to 4096 each.
    sectors : bool
        Whether to show where the robots' proximity sensors look.
    trails : int
        Over how many steps to show where robots were, 0 for no trails.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.
    """

    size: tuple[int, int] | None = None
    sectors: bool = False
    trails: int = 0

    def __post_init__(self) -> None:
        """Check every value."""
        check_count("trails", self.trails)
        if self.size is None:
            return
        if isinstance(self.size, str) or len(self.size) != 2:
            raise InvalidValueError(f"size is {shortened(self.size)}; expected (width, height) such as (800, 600)")
        for name, length in zip(("width", "height"), self.size, strict=True):
            check_count(name, length, minimum=SMALLEST, maximum=LARGEST)


def film_size(bounds: Bounds) -> tuple[int, int]:
    """Return the pixels of a film that shows a world of these bounds, both even as films want them.

    Examples
    --------
    >>> film_size((0, 0, 800, 600))
    (808, 640)
    """
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    scale = USUAL / max(width, height)
    return _even(width * scale + 2 * MARGIN), _even(height * scale + 2 * MARGIN + CAPTION)


def _even(length: float) -> int:
    return max(SMALLEST, 2 * round(length / 2))


def parsed_size(text: str) -> tuple[int, int]:
    """Return what was typed such as 800x600 as (width, height).

    Examples
    --------
    >>> parsed_size("800x600")
    (800, 600)
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and len(part) < 6 for part in parts):
        raise InvalidValueError(f"size is {text!r:.60}; expected WIDTHxHEIGHT such as 800x600")
    return int(parts[0]), int(parts[1])
