"""How fast the page is while it plays, and what it weighs: speeds are printed, not judged.

They depend on what else a machine does. Proved is what does not: all robots are drawn, and pictures go on coming.
"""

import time

import pytest

from support.visits import HOST, Visit, quiet

pytestmark = pytest.mark.long

# Width and height of the hall in which this number of robots drives about.
HALLS = {50: (800, 600), 500: (1600, 1200), 5000: (4000, 3000)}
MEGABYTE = 1_000_000
COUNT = "[+document.querySelector('.swarm-player').dataset.drawn, performance.now()]"
WEIGHT = """performance.getEntries().filter((one) => "encodedBodySize" in one)
    .reduce((sum, one) => sum + one.encodedBodySize, 0)"""
ROBOTS = "document.querySelector('.swarm-stage canvas').stage.frame?.ids.length"


def fill(visitor, robots: int, width: int, height: int) -> None:
    """Let this number of robots drive about in a hall of this size."""
    size = f'width="{width}" height="{height}"'
    hall = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><circle cx="400" cy="300" r="20"/></svg>'
    file = {"name": "hall.svg", "mimeType": "image/svg+xml", "buffer": hall.encode()}
    visitor.page.set_input_files(".swarm-panel input[type=file]", file)
    visitor.page.wait_for_function("document.querySelector('.swarm-panel')?.textContent.includes('hall')")
    field = visitor.field("n_robots").locator("input[type=text]")
    field.fill(str(robots))
    field.press("Enter")
    visitor.page.wait_for_function(f"{ROBOTS} === {robots}")


@pytest.mark.parametrize("robots", HALLS)
def test_pictures_of_all_robots_go_on_coming_while_a_model_is_played(visit, robots):
    visitor = visit("?model=collision_avoidance")
    fill(visitor, robots, *HALLS[robots])
    visitor.press("Play")
    visitor.wait("+player.step > 60")
    drawn, began = visitor.page.evaluate(COUNT)
    visitor.wait(f"+player.drawn > {drawn + 100}")
    later, ended = visitor.page.evaluate(COUNT)
    print(f"{robots} robots: {1000 * (later - drawn) / (ended - began):.0f} pictures a second")
    assert visitor.page.evaluate(ROBOTS) == robots
    assert visitor.complaints == []


def test_the_page_weighs_less_than_a_megabyte_and_loads_nothing_from_elsewhere(chromium, server):
    began = time.perf_counter()
    # As one that plays: of others the visit ends when all parts around the picture have come, too.
    context = chromium.new_context(viewport={"width": 1366, "height": 768})
    visitor = Visit(context, quiet(server[1]), plays=True)
    seconds, weight = time.perf_counter() - began, visitor.page.evaluate(WEIGHT)
    print(f"first picture after {seconds:.1f} s, {weight / MEGABYTE:.3f} MB")
    assert weight < MEGABYTE
    assert all(f"//{HOST}:" in asked for asked in visitor.asked)
    visitor.context.close()
