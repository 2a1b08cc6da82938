"""The arrangement of the page: columns that fold, the world alone, large type; and the page's title."""

import anywidget
import traitlets

from mesa_swarm.viewing import text_of

MODULE = text_of("viewing/elements.js") + text_of("dashboard/page/layout.js")
LEFT, RIGHT = "left", "right"
PRODUCT = "mesa_swarm"


class ColumnFold(anywidget.AnyWidget):
    """A button between a column and the world that folds the column; the browser remembers it."""

    _esm = MODULE
    part = traitlets.Unicode("fold").tag(sync=True)
    side = traitlets.Unicode(LEFT).tag(sync=True)
    label = traitlets.Unicode("Settings").tag(sync=True)
    # Whether the column is folded at first where it stands below the world.
    folded_below = traitlets.Bool(False).tag(sync=True)


class ScreenButtons(anywidget.AnyWidget):
    """Buttons for the world alone on the screen, and for large type on a projector."""

    _esm = MODULE
    part = traitlets.Unicode("screen").tag(sync=True)


def page_title(name: str, tab: str, first: str) -> str:
    """Return the title of the page of one model and tab; the first tab needs no name."""
    return f"{name} - {PRODUCT}" if tab == first else f"{tab}: {name} - {PRODUCT}"
