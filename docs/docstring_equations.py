"""What Griffe, which reads docstrings for either builder of the site, cannot do itself: equations and delegates."""

import ast
import sys
from collections.abc import Iterator
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


class Delegates(griffe.Extension):
    """Explains what a class has by `delegate` as the method of the part, an `ImportedMethod` as the function."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Replace those of the whole package, once it was read."""
        for module in (pkg, *_modules_within(pkg)):
            for kind in module.classes.values():
                for name, member in list(kind.members.items()):
                    path = "" if member.is_alias or not member.is_attribute else _delegated(name, member.value)
                    if path:
                        kind.set_member(name, griffe.Alias(name, pkg[path], parent=kind))


def _delegated(name: str, call: object) -> str:
    """Return where in the package what a class has under a name by such a call is; "" for another value."""
    if isinstance(call, griffe.ExprCall) and str(call.function) == "delegate":
        return call.arguments[1].canonical_path.partition(".")[2]
    if isinstance(call, griffe.ExprCall) and str(call.function) == "ImportedMethod":
        return f"{ast.literal_eval(str(call.arguments[0]))}.{name}"
    return ""


def _modules_within(module: griffe.Module) -> Iterator[griffe.Module]:
    for inner in module.modules.values():
        if not inner.is_alias:
            yield inner
            yield from _modules_within(inner)
