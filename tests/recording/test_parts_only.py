"""Recordings read a model through its parts: no private attribute of it, nor of what it is made of."""

import re
from pathlib import Path

import pytest

import mesa_swarm.recording

FILES = sorted(Path(mesa_swarm.recording.__file__).parent.glob("*.py"))
# Objects of other rooms, by the names that they have there.
OWNERS = "model|old|new|fresh|swarm|streams|history|movers|fires|space|log|part|parts"
PRIVATE = re.compile(rf"\b({OWNERS})\._[a-z]\w*")


def private_reads(text: str) -> list[str]:
    return [match.group() for match in PRIVATE.finditer(text)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_file_reads_no_private_attribute_of_a_model_or_its_parts(path):
    assert private_reads(path.read_text(encoding="utf-8")) == []


def test_a_private_attribute_would_be_found():
    assert private_reads("steps = model._completed + old.streams._streams") == ["model._completed", "streams._streams"]
