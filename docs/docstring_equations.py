"""What Griffe, which reads docstrings for either builder of the site, cannot do itself: equations and delegates."""

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
    """Explains the methods that a class has by `mesa_swarm.model.parts.delegate` as those of the part."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Replace those of the whole package, once it was read."""
        for module in (pkg, *_modules_within(pkg)):
            for kind in module.classes.values():
                for name, member in list(kind.members.items()):
                    call = None if member.is_alias or not member.is_attribute else member.value
                    if isinstance(call, griffe.ExprCall) and call.function.canonical_path.endswith(".delegate"):
                        path = call.arguments[1].canonical_path.removeprefix(f"{pkg.name}.")
                        kind.set_member(name, griffe.Alias(name, pkg[path], parent=kind))


def _modules_within(module: griffe.Module) -> Iterator[griffe.Module]:
    for inner in module.modules.values():
        if not inner.is_alias:
            yield inner
            yield from _modules_within(inner)
