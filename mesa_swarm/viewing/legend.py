"""Entries of a legend: the kinds of bodies, the values by which robots are coloured, and scalar fields.

Pages, pictures, films and animations show the same ones, each in its own form.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mesa_swarm.viewing.palette import DARK, LIGHT, PALETTES, Palette, kind_colour, rgb, value_colours

# Colours of a bar from its least to its greatest value, evenly spaced.
BAR_STEPS = 17
STANDARD = ("obstacle", "load", "mark")


@dataclass(frozen=True, kw_only=True, slots=True)
class LegendEntry:
    """A line of a legend.

    Parameters
    ----------
    form : str
        "body", "radiant", "value" or "field".
    label : str
    light, dark : tuple of str
        Its colour in each theme, #rrggbb; of values and fields those from the least to the greatest value.
    low, high : float
        The least and the greatest value; both 0 where there are none, or they are not known.
    """

    form: str
    label: str
    light: tuple[str, ...]
    dark: tuple[str, ...]
    low: float = 0.0
    high: float = 0.0

    @property
    def text(self) -> str:
        """The label, with the range of values if there is one, and with what has these values."""
        label = f"robot, {self.label}" if self.form == "value" else self.label
        return f"{label}, {self.low:.3g} to {self.high:.3g}" if self.high > self.low else label

    def as_json(self) -> dict:
        """Return the entry as a browser shows it."""
        return {"form": self.form, "name": self.label, "light": list(self.light), "dark": list(self.dark)}


def body_entries(looks: dict, standing: Iterable[str], moving: Iterable[str]) -> list[LegendEntry]:
    """Return an entry for each colour of the kinds that stand and that move: those of one colour have one together.

    Kinds to which the model gives a colour come last, in the order of their names.

    Examples
    --------
    >>> [entry.label for entry in body_entries({"kinds": {"puck": ("#c08030",) * 2}}, {"obstacle", "door"}, {"puck"})]
    ['obstacle, door', 'puck']
    """
    still, moved = set(standing), set(moving)
    declared = set(looks.get("kinds", {})) - set(STANDARD)
    groups = {"obstacle": still - declared - {"mark"}, "load": moved - declared, "mark": still & {"mark"}}
    groups |= {kind: {kind} for kind in sorted(declared & (still | moved))}
    usual = {"obstacle": (LIGHT.obstacle, DARK.obstacle), "mark": (LIGHT.mark, DARK.mark)}
    entries = []
    for kind, kinds in groups.items():
        if kinds:
            light, dark = usual.get(kind, (LIGHT.load, DARK.load))
            colours = kind_colour(looks, kind, light), kind_colour(looks, kind, dark, "dark")
            label = "ground mark" if kind == "mark" else _listed(kind, kinds)
            entries.append(LegendEntry(form="body", label=label, light=colours[:1], dark=colours[1:]))
    return entries


def _listed(first: str, kinds: set[str]) -> str:
    return ", ".join(sorted(kinds, key=lambda kind: (kind != first, kind)))


def value_entry(looks: dict) -> LegendEntry:
    """Return the entry of the values by which a model's looks colour robots."""
    column = looks["column"]
    light, dark = (value_colours(looks, theme) for theme in PALETTES)
    return LegendEntry(
        form="value", label=column["label"], light=light, dark=dark, low=column["low"], high=column["high"]
    )


def heat_entry(kind: str) -> LegendEntry:
    """Return the entry of a kind of body that is drawn in the colour of its temperature."""
    light, dark = (palette.fire[::4] for palette in PALETTES.values())
    return LegendEntry(form="radiant", label=f"{kind}, temperature", light=light, dark=dark, high=1.0)


def field_entry(name: str, place: int) -> LegendEntry:
    """Return the entry of a scalar field, by its place among those of the model; its range is not known yet."""
    light, dark = (scalar_bar(place, palette) for palette in PALETTES.values())
    return LegendEntry(form="field", label=name, light=light, dark=dark)


def part_entry(name: str, colour: str) -> LegendEntry:
    """Return the entry of the discs that a part of the model's own shows."""
    return LegendEntry(form="body", label=name, light=(colour,), dark=(colour,))


def scalar_bar(place: int, palette: Palette) -> tuple[str, ...]:
    """Return the colours in which values of a field are seen on the ground, evenly from 0 to the largest.

    Examples
    --------
    >>> scalar_bar(0, LIGHT)[0] == LIGHT.ground
    True
    """
    colour = palette.scalars[place % len(palette.scalars)]
    opacity = np.sqrt(np.linspace(0, 1, BAR_STEPS))[:, None] * int(colour[7:], 16) / 255
    mixed = np.rint(opacity * rgb(colour) + (1 - opacity) * rgb(palette.ground)).astype(int)
    return tuple(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in mixed.tolist())
