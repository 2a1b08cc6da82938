"""The colours of everything that is drawn, one set for a light and one for a dark background.

Pictures, films, charts and pages take their colours from here: Python by name, style sheets as custom properties
(`style_sheet`), scripts as the object ``PALETTE`` (`palette_script`); legends name them by `MEANINGS`.
``tests/viewing/test_palette.py`` computes contrasts (WCAG 2.2: text 4.5:1, graphics 3:1) and how much layers and series
differ with protanopia, deuteranopia and tritanopia.
"""

import json
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

# Colours of fires from temperature 0 to 1, both included.
FIRE_STEPS = 65
# Colours of values, with which robots are drawn.
VALUE_STEPS = 17


@dataclass(frozen=True, kw_only=True, slots=True)
class Palette:
    """The colours for one background, as #rrggbb, or #rrggbbaa where what lies below shines through."""

    # What text stands on: the page, panels on it, where one types, what the pointer is on.
    page: str
    paper: str
    field: str
    hover: str
    # Lines between parts and in charts, the outline of buttons, what menus cast; text, and text of less weight.
    line: str
    edge: str
    shadow: str
    ink: str
    soft: str
    # What is chosen, the text on it, the outline of what has the focus; states, and the paper of notes about them.
    accent: str
    on_accent: str
    focus: str
    good: str
    warn: str
    bad: str
    warn_paper: str
    bad_paper: str
    # Around the map, the map, its frame, and text on it; bodies, marks on the ground, and bodies that are pushed.
    outside: str
    ground: str
    border: str
    label: str
    obstacle: str
    mark: str
    load: str
    # By temperature, evenly spaced between 0 and 1: lightness rises all the way.
    fire: tuple[str, ...]
    fire_rim: str
    on_fire: str
    ashes: str
    on_ashes: str
    # The rear half, the front half that marks the heading, the outline, and the rear half while it is too hot.
    robot: str
    robot_front: str
    robot_outline: str
    robot_hot: str
    # What a sensor covers, what it reads, and the line to the perceived centroid.
    sector: str
    seeing: str
    perceived: str
    # Where a robot was, a collision, how warm it is, what it heard, the selected robot, where it goes.
    trail: str
    contact: str
    heat: str
    message: str
    selection: str
    travel: str
    # Of layers and lines of charts in order; after the last the first comes again, in charts dashed.
    layers: tuple[str, ...]
    no_layer: str
    series: tuple[str, ...]
    # From the least to the greatest value by which robots are coloured.
    values: tuple[str, ...]
    # Single points behind a mean; an area behind everything; a map of colours with zero in its middle.
    faint: str
    band: str
    diverging: tuple[str, ...]
    # Of scalar fields in order, at their largest value; smaller ones are more transparent.
    scalars: tuple[str, ...]


def rgb(colour: str) -> np.ndarray:
    """Return red, green and blue of a colour, integers from 0 to 255."""
    return np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)])


def ramp(*stops: str, steps: int = FIRE_STEPS) -> tuple[str, ...]:
    """Return colours that go evenly from stop to stop."""
    table = np.array([rgb(stop) for stop in stops], float)
    places = np.linspace(0, len(stops) - 1, steps)
    parts = np.column_stack([np.interp(places, np.arange(len(stops)), column) for column in table.T])
    return tuple(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in np.rint(parts).astype(int).tolist())


def _blue_first(layers: tuple[str, ...]) -> tuple[str, ...]:
    return (layers[1], layers[0], *layers[2:])


LIGHT_LAYERS = ("#d4702c", "#5284e2", "#049e74", "#ad4176", "#806300", "#2c7a90", "#7b1c30", "#311c93")
DARK_LAYERS = ("#fd894c", "#42a1ff", "#0ac895", "#f5a3d0", "#f4d444", "#83e6ff", "#d8565b", "#a28bbe")

LIGHT = Palette(
    page="#f4f2ed",
    paper="#fbfaf7",
    field="#ffffff",
    hover="#eceae4",
    line="#dcd9d1",
    edge="#b9b6ad",
    shadow="#0000002e",
    ink="#1d1f23",
    soft="#5a5f68",
    accent="#14538f",
    on_accent="#ffffff",
    focus="#b85c00",
    good="#00735a",
    warn="#8a4b00",
    bad="#b3161b",
    warn_paper="#fff3d6",
    bad_paper="#fdeeee",
    outside="#e9e7e1",
    ground="#faf9f6",
    border="#83888f",
    label="#55585e",
    obstacle="#646b75",
    mark="#9c8858",
    load="#1f7a55",
    fire=ramp("#100c0c", "#7f0f0c", "#e81c14"),
    fire_rim="#8a1710",
    on_fire="#ffffff",
    ashes="#cfcec8",
    on_ashes="#3a3a38",
    robot="#1d4e89",
    robot_front="#bfe5ff",
    robot_outline="#0b2545",
    robot_hot="#d55e00",
    sector="#1d4e8917",
    seeing="#f096286b",
    perceived="#6e6e72",
    trail="#1d4e8966",
    contact="#c2185b",
    heat="#e1321461",
    message="#7b3fb3",
    selection="#c2006b",
    travel="#0b2545",
    layers=LIGHT_LAYERS,
    no_layer="#858b94",
    series=_blue_first(LIGHT_LAYERS),
    values=ramp("#440154", "#31688e", "#1f9d76", "#b59b00", steps=VALUE_STEPS),
    faint="#8a8a8a",
    band="#efefec",
    diverging=ramp("#f1a340", "#f7f7f7", "#998ec3", steps=33),
    scalars=("#0f8b8dd9", "#a8650fd9", "#7a5195d9", "#5f7a1fd9"),
)
DARK = Palette(
    page="#14171c",
    paper="#1a1e25",
    field="#232932",
    hover="#2c333d",
    line="#333a45",
    edge="#505a68",
    shadow="#00000080",
    ink="#e8eaee",
    soft="#a7aeba",
    accent="#6cb2f5",
    on_accent="#0b1320",
    focus="#ffae42",
    good="#4fcfa7",
    warn="#ffc06b",
    bad="#ff8f8b",
    warn_paper="#3d3214",
    bad_paper="#3a2024",
    outside="#101216",
    ground="#1c2027",
    border="#6f7883",
    label="#a9afb9",
    obstacle="#7d8794",
    mark="#c2b69a",
    load="#1f9c6e",
    fire=ramp("#d05038", "#f28a3c", "#ffcf6b"),
    fire_rim="#ffb38a",
    on_fire="#120a06",
    ashes="#4a4d52",
    on_ashes="#dcdcd8",
    robot="#3b82d6",
    robot_front="#e8f4ff",
    robot_outline="#060c16",
    robot_hot="#ff7a45",
    sector="#6eafff1a",
    seeing="#ffb4466b",
    perceived="#b4b4b8",
    trail="#78b4ff66",
    contact="#ff5c9a",
    heat="#ff50286b",
    message="#c9a0ff",
    selection="#ff6fb5",
    travel="#e8f4ff",
    layers=DARK_LAYERS,
    no_layer="#90959e",
    series=_blue_first(DARK_LAYERS),
    values=ramp("#8a63d2", "#4aa3d8", "#54cf8b", "#fde725", steps=VALUE_STEPS),
    faint="#8c9097",
    band="#262c35",
    diverging=ramp("#8a5200", "#2b2f36", "#5c4f94", steps=33),
    scalars=("#35c9c4d9", "#eba64fd9", "#b892e0d9", "#a9c46cd9"),
)
PALETTES = {"light": LIGHT, "dark": DARK}
# What colours stand for, in all legends.
MEANINGS = {
    "robot": "robot, its front pale",
    "robot_hot": "robot too hot to fight",
    "heat": "heat of a robot",
    "fire": "fire, temperature",
    "ashes": "fire, out",
    "seeing": "sensor that sees something",
    "sector": "sensor that sees nothing",
    "travel": "direction of travel",
    "contact": "contact",
    "message": "message, from its sender",
    "trail": "trail",
    "places": "where it was, way unknown",
    "perceived": "to the centroid that it perceives",
    "selection": "selected robot",
}


def layer_colour(index: int, palette: Palette = LIGHT) -> str:
    """Return the colour of a layer by its index, below 0 for no layer."""
    return palette.no_layer if index < 0 else palette.layers[index % len(palette.layers)]


def fire_colour(temperature: float, palette: Palette = LIGHT) -> str:
    """Return the colour of a fire that burns at this temperature, 0 to 1."""
    return palette.fire[int(fire_steps(temperature))]


def scalar_pixels(levels: np.ndarray, place: int, palette: Palette = LIGHT) -> np.ndarray:
    """Return a picture of a field, from 0 to 255 (`levels_of`), as red, green, blue and opacity, shape (h, w, 4).

    A pixel of 0 is transparent, one of 255 has the field's colour; ``canvas.js`` colours in the same way.
    """
    colour = palette.scalars[place % len(palette.scalars)]
    pixels = np.empty((*levels.shape, 4), np.uint8)
    pixels[..., :3] = rgb(colour)
    pixels[..., 3] = (levels * float(int(colour[7:], 16)) / 255 + 0.5).astype(np.uint8)
    return pixels


def fire_steps(temperature: ArrayLike) -> np.ndarray:
    """Return the index in `Palette.fire` of each temperature; ``canvas.js`` rounds in the same way."""
    return np.floor(np.clip(temperature, 0.0, 1.0) * (FIRE_STEPS - 1) + 0.5).astype(int)


def value_colours(looks: dict, theme: str) -> tuple[str, ...]:
    """Return the colours of values, from `Looks.as_json`: those that a model declares, else those of the palette."""
    pairs = looks["column"]["colours"]
    own = [pair[theme == "dark"] for pair in pairs]
    return ramp(*own, steps=VALUE_STEPS) if own else PALETTES[theme].values


def value_steps(values: ArrayLike, low: float, high: float) -> np.ndarray:
    """Return the index of the colour of each value, -1 for NaN."""
    with np.errstate(all="ignore"):  # a range in a recording may be of any two numbers
        shares = (np.asarray(values, float) - low) / (high - low)
    steps = np.floor(np.clip(np.nan_to_num(shares), 0.0, 1.0) * (VALUE_STEPS - 1) + 0.5)
    return np.where(np.isnan(shares), -1, steps).astype(np.int8)


def kind_colour(looks: dict, kind: str, usual: str, theme: str = "light") -> str:
    """Return the colour that a model declares for a kind of body, else the usual one."""
    pair = looks.get("kinds", {}).get(kind)
    return pair[theme == "dark"] if pair else usual


def style_sheet(light: str, dark: str) -> str:
    """Return CSS rules that give two selectors every colour as a custom property, such as ``--swarm-robot-front``.

    Fields of several colours, such as those of fires and layers, are for scripts only.
    """
    rules = ((light, LIGHT), (dark, DARK))
    return "".join(f"{selector} {{ {_properties(palette)} }}\n" for selector, palette in rules)


def _properties(palette: Palette) -> str:
    single = {name: value for name, value in _colours(palette).items() if isinstance(value, str)}
    return " ".join(f"--swarm-{name.replace('_', '-')}: {value};" for name, value in single.items())


def palette_script() -> str:
    """Return the constants ``PALETTE``, by theme ("light", "dark") and the names of `Palette`, and `MEANINGS`."""
    constants = {"PALETTE": {name: _colours(palette) for name, palette in PALETTES.items()}, "MEANINGS": MEANINGS}
    written = {name: json.dumps(value, separators=(",", ":")) for name, value in constants.items()}
    return "".join(f"const {name} = {text};\n" for name, text in written.items())


def _colours(palette: Palette) -> dict[str, str | tuple[str, ...]]:
    return {field.name: getattr(palette, field.name) for field in fields(palette)}
