"""What browsers draw: frames as bytes, and the script that plays them."""

from importlib.resources import files


def text_of(*names: str) -> str:
    """Return files of the package, one after the other: a widget is one module."""
    here = files("mesa_swarm")
    return "".join((here / name).read_text(encoding="utf-8") for name in names)
