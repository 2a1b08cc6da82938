"""The widgets' texts: scripts that the browser runs, and how they look."""

from importlib.resources import files


def text_of(*names: str) -> str:
    """Return files that lie beside this one, one after the other: a widget is one module.

    Parameters
    ----------
    *names : str

    Examples
    --------
    >>> text_of("elements.js", "panel.js").count("export default")
    1
    """
    here = files("mesa_swarm.dashboard")
    return "".join((here / name).read_text(encoding="utf-8") for name in names)
