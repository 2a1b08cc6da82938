"""Pictures of every view, for a person to look at: pytest -m slow tests/browser/test_pictures.py --screenshots DIR."""

import pytest

from mesa_swarm.dashboard.app import MORE_TABS
from mesa_swarm.model.gallery import model_names
from support.visits import resize

pytestmark = pytest.mark.long

# What a tab shows when it is there.
SIGHTS = {
    "compare": ".swarm-worlds .swarm-player[data-drawn]",
    "experiment": ".swarm-experiment",
    "replay": "input[type=file]",
}
SIZES = {"laptop": (1366, 768), "projector": (1920, 1080)}


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_every_view_is_written_as_a_picture_and_fits_its_screen(visit, shots, size, theme):
    visitor, (width, height) = visit("?model=fire_fighting&n_robots=20&step=300", color_scheme=theme), SIZES[size]
    page = visitor.page
    resize(page, width, height)
    visitor.wait_for_step(300)
    for _ in range(3):
        visitor.press("Step")
    visitor.wait_for_step(303)
    page.screenshot(path=shots / f"watch-{theme}-{size}.png")
    for tab in ("Models", *MORE_TABS):
        visitor.press(tab.capitalize())
        if tab == "Models":
            page.wait_for_function(f"document.querySelectorAll('.swarm-picture svg').length === {len(model_names())}")
        else:
            page.wait_for_selector(SIGHTS[tab], state="attached")
        page.screenshot(path=shots / f"{tab.lower()}-{theme}-{size}.png")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert len(list(shots.glob(f"*-{theme}-{size}.png"))) == 2 + len(MORE_TABS)
