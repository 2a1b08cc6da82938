"""What composes a canvas and the panels beside it, for notebooks."""

from collections.abc import Callable
from typing import Any

# The panels are the dashboard's, on a floor above this one, which is therefore not imported from here, not even late:
# the package's root, above both, provides a function that returns the composer.
_providers: list[Callable[[], Callable[..., Any]]] = []


def provide_composer(provider: Callable[[], Callable[..., Any]]) -> None:
    """Have panels composed by what this function returns when they are first shown.

    The composer is called with a model, a `canvas_widget.Beside`, and the speed, width and height of
    `SwarmModel.show`.
    """
    _providers[:] = [provider]


def composer() -> Callable[..., Any]:
    """Return what composes panels."""
    (provider,) = _providers
    return provider()
