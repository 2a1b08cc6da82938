"""The values inside SVG attributes as numbers: lengths, lists of points, transforms, view boxes, styles.

Every reader here is strict where browsers are lenient: an attribute that is not understood is refused,
because a map that is silently misread is worse than one that is not read.
"""

import math
import re
from collections.abc import Mapping

import numpy as np
from svgelements import Matrix

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.world.shapes import LARGEST_COORDINATE, MOST_VERTICES

# CSS pixels by unit. Own table: svgelements rounds a millimetre to 3.7795296 px and reads "abc" as 0.
PIXELS = {"": 1.0, "px": 1.0, "pt": 96 / 72, "pc": 16.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4}
LONGEST_TRANSFORM = 500
LONGEST_LENGTH = 100
NEGLIGIBLE = 1e-12
LARGEST_ENTRY = 1e12

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LENGTH = re.compile(rf"\s*({_NUMBER})\s*([a-zA-Z]*)\s*")
_NUMBERS = re.compile(_NUMBER)
_OF_NUMBERS = re.compile(r"[\d\s,.eE+-]*", re.ASCII)
_TRANSFORM = re.compile(r"(matrix|translate|scale|rotate|skewX|skewY)\s*\(([\d\s,.eE+-]*)\)", re.ASCII)
_TRANSFORM_ARGUMENTS = {
    "matrix": {6},
    "translate": {1, 2},
    "scale": {1, 2},
    "rotate": {1, 3},
    "skewX": {1},
    "skewY": {1},
}


def length(name: str, text: str) -> float:
    """Return a length in CSS pixels (96 to the inch).

    Raises
    ------
    InvalidValueError
        If it is not a number with a unit that has a fixed size: %, em and the like have none.

    Examples
    --------
    >>> length("width", "25.4mm"), length("r", " 30 ")
    (96.0, 30.0)
    """
    found = _LENGTH.fullmatch(text[:LONGEST_LENGTH])
    if not found or found[2].lower() not in PIXELS:
        raise InvalidValueError(f"{name} is {shortened(text)}; expected such as 5, 5px, 5mm or 5in")
    return float(found[1]) * PIXELS[found[2].lower()]


def numbers(name: str, text: str) -> list[float]:
    """Return a list of numbers separated by spaces, commas or only their signs.

    Examples
    --------
    >>> numbers("points", "1,2 3-4")
    [1.0, 2.0, 3.0, -4.0]
    """
    if not _OF_NUMBERS.fullmatch(text):
        raise InvalidValueError(f"{name} is {shortened(text)}; expected numbers")
    words = text.replace(",", " ").split()
    if len(words) > 2 * MOST_VERTICES:
        raise InvalidValueError(f"{name} has more than {MOST_VERTICES} points; simplify it first")
    try:
        return [float(word) for word in words]
    except ValueError:  # tightly written, such as 3-4 or .5.5
        return _tight_numbers(name, text)


def points(name: str, text: str) -> np.ndarray:
    """Return (n, 2) points from pairs of numbers.

    Examples
    --------
    >>> points("points", "0,0 10,0").tolist()
    [[0.0, 0.0], [10.0, 0.0]]
    """
    values = numbers(name, text)
    if len(values) % 2 or not values:
        raise InvalidValueError(f"{name} has {len(values)} numbers; expected pairs")
    return np.array(values).reshape(-1, 2)


def transform(text: str) -> np.ndarray:
    """Return the 3 x 3 matrix of a transform attribute.

    Examples
    --------
    >>> transform("translate(10, 20) scale(2)").tolist()
    [[2.0, 0.0, 10.0], [0.0, 2.0, 20.0], [0.0, 0.0, 1.0]]
    """
    refused = InvalidValueError(f"transform is {shortened(text)}; expected such as translate(10, 20)")
    if len(text) > LONGEST_TRANSFORM or _TRANSFORM.sub("", text).strip(" \t\r\n,"):
        raise refused
    for kind, arguments in _TRANSFORM.findall(text):
        given = numbers("transform", arguments)
        if len(given) not in _TRANSFORM_ARGUMENTS[kind]:
            raise refused
        if not np.abs(given).max() <= LARGEST_ENTRY:  # of an angle too: svgelements fails on sines of infinity
            raise InvalidValueError(f"transform has a number beyond {LARGEST_ENTRY:g}")
    own = Matrix(text)
    matrix = np.array([[own.a, own.c, own.e], [own.b, own.d, own.f], [0.0, 0.0, 1.0]], dtype=float)
    return checked_matrix(_without_dust(matrix))


def checked_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix if its numbers are within reason and it keeps areas above 0.

    Examples
    --------
    >>> checked_matrix(np.zeros((3, 3)))
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: transform squeezes the shape to nothing
    """
    if not np.abs(matrix).max() <= LARGEST_ENTRY:
        raise InvalidValueError(f"transform has a number beyond {LARGEST_ENTRY:g}")
    if np.linalg.det(matrix[:2, :2]) == 0:
        raise InvalidValueError("transform squeezes the shape to nothing")
    return matrix


def viewbox(text: str, aspect: str, width: float, height: float) -> np.ndarray:
    """Return the matrix from view box to viewport, as SVG 2 section 8.2 has it.

    Parameters
    ----------
    text : str
        The viewBox attribute: x, y, width, height.
    aspect : str
        The preserveAspectRatio attribute; empty for `xMidYMid meet`.
    width, height : float
        The viewport, in pixels.

    Examples
    --------
    >>> viewbox("0 0 400 300", "", 800, 600)[0].tolist()
    [2.0, 0.0, 0.0]
    """
    x, y, box_width, box_height = viewbox_numbers(text)
    align, _, crop = (" ".join(aspect.split()) or "xMidYMid").partition(" ")
    if not re.fullmatch(r"none|x(Min|Mid|Max)Y(Min|Mid|Max)", align) or crop not in ("", "meet", "slice"):
        raise InvalidValueError(f"preserveAspectRatio is {shortened(aspect)}; expected such as xMidYMid")
    scales = np.array([width / box_width, height / box_height])
    if align != "none":
        scales[:] = scales.max() if crop == "slice" else scales.min()
    share = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
    aligned = [share[align[1:4]], share[align[5:8]]] if align != "none" else [0.0, 0.0]
    shift = (np.array([width, height]) - scales * [box_width, box_height]) * aligned - scales * [x, y]
    return np.array([[scales[0], 0.0, shift[0]], [0.0, scales[1], shift[1]], [0.0, 0.0, 1.0]])


def viewbox_numbers(text: str) -> list[float]:
    """Return x, y, width and height of a viewBox attribute.

    Examples
    --------
    >>> viewbox_numbers("0 0 400 300")
    [0.0, 0.0, 400.0, 300.0]
    """
    values = numbers("viewBox", text)
    if len(values) != 4:
        raise InvalidValueError(f"viewBox is {shortened(text)}; expected 4 numbers")
    for name, value in zip(("x", "y", "width", "height"), values, strict=True):
        above = 0 if name in ("width", "height") else -math.inf
        check_number(f"{name} of viewBox", value, above=above, maximum=LARGEST_COORDINATE)
    return values


def properties(attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the attributes with the declarations of the style attribute laid over them, as CSS has it.

    Examples
    --------
    >>> properties({"fill": "red", "style": "fill: none; display:inline"})
    {'fill': 'none', 'display': 'inline'}
    """
    merged = {name: value for name, value in attributes.items() if name != "style"}
    for declaration in attributes.get("style", "").split(";"):
        name, colon, value = declaration.partition(":")
        if colon:
            merged[name.strip()] = value.replace("!important", "").strip()
    return merged


def scale_of(matrix: np.ndarray) -> float:
    """Return the largest factor by which a matrix stretches a length.

    Examples
    --------
    >>> round(scale_of(transform("scale(2, 3)")), 9)
    3.0
    """
    return float(np.linalg.norm(matrix[:2, :2], 2))


def is_similarity(matrix: np.ndarray) -> bool:
    """Return whether a matrix turns, mirrors, scales and moves, so that circles stay circles.

    Examples
    --------
    >>> is_similarity(transform("rotate(30) scale(2)")), is_similarity(transform("scale(2, 3)"))
    (True, False)
    """
    (a, c), (b, d) = matrix[:2, :2].tolist()
    size = a * a + b * b
    return abs(c * c + d * d - size) <= 1e-9 * size and abs(a * c + b * d) <= 1e-9 * size


def moved(at: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return points moved by a matrix; the identity leaves every bit as it is.

    Examples
    --------
    >>> moved(np.array([[1.0, 2.0]]), transform("translate(10)")).tolist()
    [[11.0, 2.0]]
    """
    with np.errstate(all="ignore"):  # what overflows is refused as a shape, in the user's words
        return at @ matrix[:2, :2].T + matrix[:2, 2]


def _tight_numbers(name: str, text: str) -> list[float]:
    if _NUMBERS.sub("", text).strip(" \t\r\n,"):
        raise InvalidValueError(f"{name} is {shortened(text)}; expected numbers")
    return [float(word) for word in _NUMBERS.findall(text)]


def _without_dust(matrix: np.ndarray) -> np.ndarray:
    """Set what rotate(90) leaves of a cosine to 0, so that rectangles stay rectangles."""
    linear = matrix[:2, :2]
    linear[np.abs(linear) < NEGLIGIBLE * np.abs(linear).max()] = 0.0
    return matrix
