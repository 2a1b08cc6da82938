"""Equations in docstrings as MathML: an extension of Griffe, which reads docstrings for either builder of the site."""

import sys
from pathlib import Path
from typing import Any

import griffe

sys.path.append(str(Path(__file__).parent))
from typesetting import typeset_docstring


class Equations(griffe.Extension):
    """Typesets the equations of every docstring that is read."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Typeset those of an object, once all of it was read."""
        if obj.docstring is not None:
            obj.docstring.value = typeset_docstring(obj.docstring.value)
