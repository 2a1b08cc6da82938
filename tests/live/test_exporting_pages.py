"""`model.export`: what is refused, before anything is made."""

import pytest

from mesa_swarm.errors import ExportError, InvalidValueError
from mesa_swarm.models.boids import Boids


@pytest.mark.parametrize(("name", "options", "error", "text"), [
    ("page.png", {}, InvalidValueError, "path is .*; expected a .html file"),
    ("page.html", {"live": False}, InvalidValueError, "live is False; expected True"),
    ("page.html", {"seeds": -1}, InvalidValueError, "seeds is -1"),
    ("nowhere/page.html", {}, ExportError, "does not exist; make it first"),
    ("there.html", {}, ExportError, "exists already; choose another name"),
])  # fmt: skip
def test_what_cannot_be_written_is_refused_and_nothing_is_left(name, options, error, text, tmp_path):
    (tmp_path / "there.html").write_text("mine")
    with pytest.raises(error, match=text):
        Boids(n_robots=3, rng=1).export(tmp_path / name, **options)
    assert [path.name for path in tmp_path.iterdir()] == ["there.html"]
    assert (tmp_path / "there.html").read_text() == "mine"
