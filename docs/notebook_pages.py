"""Notebooks as pages of Markdown: text, code, and what the code printed and drew."""

import os
import re
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

# A link to another notebook leads to its page.
LINK = re.compile(r"(?<=\]\()(?P<path>[^):#\s]+)\.ipynb(?=[#)])")
ESCAPES = re.compile(r"\x1b\[[0-9;]*m")
SECONDS = 600
PICTURES = {"image/png": ".png", "image/svg+xml": ".svg"}


def executed(file: Path) -> NotebookNode:
    """Return a notebook with the output of its cells; an error in a cell is raised."""
    notebook = nbformat.read(file, as_version=4)
    NotebookClient(notebook, timeout=SECONDS, resources={"metadata": {"path": str(file.parent)}}).execute()
    return notebook


def write_page(notebook: NotebookNode, name: str, folder: Path) -> Path:
    """Write the page of a notebook, and its pictures beside it; return the page."""
    pieces = [piece for cell in notebook.cells for piece in _pieces(cell, name, folder)]
    pieces.append(f"[Download this notebook]({name}.ipynb)")
    (folder / f"{name}.md").write_text("\n\n".join(pieces) + "\n", encoding="utf-8")
    stripped = {
        **notebook,
        "cells": [{**cell, "outputs": []} if "outputs" in cell else cell for cell in notebook.cells],
    }
    nbformat.write(nbformat.from_dict(stripped), folder / f"{name}.ipynb")
    return folder / f"{name}.md"


def _pieces(cell: NotebookNode, name: str, folder: Path) -> Iterator[str]:
    if cell.cell_type == "markdown":
        yield LINK.sub(r"\g<path>.md", cell.source)
    elif cell.cell_type == "raw":
        yield cell.source
    elif cell.cell_type == "code":
        yield _fenced(cell.source, "python")
        for number, output in enumerate(cell.get("outputs", [])):
            yield _shown(output, f"{name}-{cell.id}-{number}", folder)


def _shown(output: NotebookNode, name: str, folder: Path) -> str:
    """Return an output as Markdown; of several forms the one that shows most, without a script."""
    if output.output_type == "stream":
        return _fenced(output.text, "text")
    forms = output.get("data", {})
    for kind, ending in PICTURES.items():
        if kind in forms:
            content = b64decode(forms[kind]) if ending == ".png" else forms[kind].encode()
            (folder / f"{name}{ending}").write_bytes(content)
            return f"![{_alt(forms)}]({name}{ending}){{ .output loading=lazy }}"
    if "text/html" in forms:
        return f'<div class="output">{"".join(forms["text/html"].split(chr(10)))}</div>'
    return forms["text/markdown"] if "text/markdown" in forms else _fenced(forms.get("text/plain", ""), "text")


def _alt(forms: NotebookNode) -> str:
    """Return what stands for a picture: its description, without marks of Markdown."""
    return re.sub(r"[^\w .,:;()-]", " ", forms.get("text/plain", "").split("\n")[0]).strip()


def _fenced(text: str, language: str) -> str:
    text = ESCAPES.sub("", text).rstrip("\n")
    fence = "`" * max(3, 1 + max(map(len, re.findall(r"`+", text)), default=0))
    return f"{fence}{language}\n{text}\n{fence}"


def is_executed() -> bool:
    """Return whether notebooks are to be executed: not if MESA_SWARM_EXECUTE is false."""
    return os.environ.get("MESA_SWARM_EXECUTE", "true") != "false"
