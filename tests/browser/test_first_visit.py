"""The first moments: the model plays, and a tour shows the page once."""

import pytest

from mesa_swarm.dashboard.page.navigation import TOUR

pytestmark = pytest.mark.slow

LINK = "?model=fire_fighting&n_robots=4&seed=3"


@pytest.fixture
def newcomer(visit):
    """Open a page as one does who comes for the first time."""
    return lambda query=LINK, **looks: visit(query, plays=True, **looks)


def tour_of(visitor):
    return visitor.page.locator(".swarm-tour")


def test_the_page_opens_playing_and_so_does_a_chosen_model(newcomer):
    visitor = newcomer()
    visitor.wait("player.playing === 'true' && +player.step > 3")
    visitor.press("Models")
    visitor.page.locator(".swarm-card").filter(has_text="Boids").click()
    visitor.page.wait_for_selector(".swarm-header b:text('Boids')")
    visitor.wait("player.playing === 'true' && +player.step > 3")


@pytest.mark.parametrize(
    ("query", "looks"),
    [(f"{LINK}&step=2", {}), (f"{LINK}&play=no", {}), (LINK, {"reduced_motion": "reduce"})],
    ids=["step", "play=no", "reduced motion"],
)
def test_the_page_opens_at_rest_where_motion_is_unwelcome(newcomer, query, looks):
    visitor = newcomer(query, **looks)
    step = 2 if "step" in query else 0
    visitor.wait_for_step(step)
    visitor.press("Step")
    visitor.wait_for_step(step + 1)
    assert visitor.about("playing") == "false"


def test_the_tour_shows_each_part_once_and_is_walked_by_keys(newcomer):
    visitor = newcomer()
    page, tour = visitor.page, tour_of(visitor)
    for place, (selector, words) in enumerate(TOUR, 1):
        tour.filter(has_text=f"{place} of {len(TOUR)}").wait_for()
        assert words in tour.inner_text()
        page.wait_for_selector(f"{selector}.swarm-toured")
        card = tour.bounding_box()
        assert min(card["x"], card["y"], 1366 - card["x"] - card["width"], 768 - card["y"] - card["height"]) >= 0
        page.keyboard.press("Enter")
    tour.wait_for(state="detached")
    page.reload()
    visitor.wait("player.drawn")
    page.goto(page.url.partition("&step")[0])
    visitor.wait("player.playing === 'true' && +player.step > 3")
    assert tour.count() == 0
    visitor.press("Models")
    visitor.press("Tour")
    tour.filter(has_text="1 of").wait_for()
    page.keyboard.press("Escape")
    tour.wait_for(state="detached")


def test_the_tour_blocks_nothing(newcomer):
    visitor = newcomer()
    tour_of(visitor).wait_for()
    visitor.page.keyboard.press(" ")
    visitor.wait("player.playing === 'false'")
    visitor.press("Step")
    visitor.wait("player.rest === 'true'")
    assert tour_of(visitor).is_visible()
    tour_of(visitor).get_by_role("button", name="End").click()
    tour_of(visitor).wait_for(state="detached")


def test_no_tour_comes_with_a_link_to_a_step_or_to_a_tab(newcomer):
    for query in (f"{LINK}&step=2", f"{LINK}&tab=compare", f"{LINK}&tour=no"):
        visitor = newcomer(query)
        visitor.wait("player.drawn")
        assert visitor.page.evaluate("localStorage.getItem('mesa_swarm.toured')") is None
        assert tour_of(visitor).count() == 0


def test_the_tour_fits_on_a_phone(newcomer):
    visitor = newcomer(viewport={"width": 390, "height": 844})
    tour = tour_of(visitor)
    for place in range(1, len(TOUR) + 1):
        tour.filter(has_text=f"{place} of").wait_for()
        card = tour.bounding_box()
        assert min(card["x"], card["y"], 390 - card["x"] - card["width"], 844 - card["y"] - card["height"]) >= 0
        tour.locator(".swarm-do").click()
    tour.wait_for(state="detached")
