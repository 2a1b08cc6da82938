"""Drawing a map as SVG, so that any viewer shows it and `read_svg` reads back an equal map.

The shapes stand in one group that turns y up, with the map's own coordinates: turning each of them instead
would round (600 - (600 - 0.1) is not 0.1), and the map read back would not be equal.
"""

from collections.abc import Iterable
from xml.sax.saxutils import escape

from mesa_swarm.world.map_parts import Bounds, FireSpot
from mesa_swarm.world.map_toml import number_text
from mesa_swarm.world.shapes import Shape

GROUND = "#f7f6f2"
SOLID = "#5f6670"
MARK = "#1d1f23"
EMBERS = "#f0a03c"
FLAME = "#d8431f"


def svg_text(name: str, bounds: Bounds, obstacles: Iterable[Shape], fires: Iterable[FireSpot]) -> str:
    """Return the drawing of a map.

    Marks on the ground are black, obstacles grey, fires red, the paler the cooler.

    Examples
    --------
    >>> from mesa_swarm.world.shapes import disc
    >>> text = svg_text("hall", (0.0, 0.0, 80.0, 60.0), [disc((40, 20), 5)], [])
    >>> print(text.splitlines()[4].strip())
    <circle cx="40" cy="20" r="5"/>
    """
    width, height = number_text(bounds[2] - bounds[0]), number_text(bounds[3] - bounds[1])
    moved = bounds[:2] != (0.0, 0.0)
    where = f' data-bounds="{" ".join(map(number_text, bounds))}"' if moved else ""
    size = f'width="{width}" height="{height}"'
    # A group of its own for the move: in one transform the reader would round height + y_min.
    shift = f'<g transform="translate({number_text(-bounds[0])} {number_text(-bounds[1])})">' if moved else ""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width} {height}"{where}>',
        f"  <title>{escape(name)}</title>",
        f'  <rect class="background" {size} fill="{GROUND}"/>',
        f'  <g transform="translate(0 {height}) scale(1 -1)" fill="{SOLID}" fill-rule="evenodd">{shift}',
        *(f"    {_shape_text(shape)}" for shape in obstacles),
        *(f"    {_fire_text(fire)}" for fire in fires),
        "  </g></g>" if moved else "  </g>",
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _shape_text(shape: Shape) -> str:
    look = "" if shape.contact else f' class="mark" fill="{MARK}"'
    if shape.is_disc:
        return f"<circle{look}{_round_text(shape.position.tolist(), shape.radius)}/>"
    if shape.kind == "rectangle" and _is_exact(shape.bounds):
        return f"<rect{look}{_box_text(*shape.bounds)}/>"
    rings = [shape.geometry.exterior, *shape.geometry.interiors]
    texts = [" ".join(f"{number_text(x)},{number_text(y)}" for x, y in ring.coords[:-1]) for ring in rings]
    if len(rings) == 1:
        return f'<polygon{look} points="{texts[0]}"/>'
    path = " ".join(f"M {text} Z" for text in texts)
    return f'<path{look} d="{path}"/>'


def _fire_text(fire: FireSpot) -> str:
    heat = f'data-temperature="{number_text(fire.temperature)}"'
    opacity = f"{0.35 + 0.65 * fire.temperature:.2f}"
    paint = f'fill="{FLAME}" fill-opacity="{opacity}" stroke="{EMBERS}" stroke-width="3"'
    return f'<circle class="fire"{_round_text(fire.position, fire.radius)} {heat} {paint}/>'


def _box_text(x_min: float, y_min: float, x_max: float, y_max: float) -> str:
    width, height = number_text(x_max - x_min), number_text(y_max - y_min)
    return f' x="{number_text(x_min)}" y="{number_text(y_min)}" width="{width}" height="{height}"'


def _round_text(centre: Iterable[float], radius: float) -> str:
    x, y = map(number_text, centre)
    return f' cx="{x}" cy="{y}" r="{number_text(radius)}"'


def _is_exact(bounds: Bounds) -> bool:
    """Return whether corner plus size gives back the other corner to the bit; if not, draw a polygon."""
    x_min, y_min, x_max, y_max = bounds
    return x_min + (x_max - x_min) == x_max and y_min + (y_max - y_min) == y_max
