"""How fast the page is while it plays one step a frame: figures are printed beside what was promised."""

import time

import pytest

from support.machine import Watch, slowness
from support.visits import HOST, Visit

pytestmark = pytest.mark.slow

# Robots: frames a second, and the map's width and height.
PROMISED = {50: (45, 800, 600), 500: (40, 1600, 1200), 5000: (30, 4000, 3000)}
# More than this share of the machine taken by others, and nothing is measured.
MOST_OTHERS = 0.15
# Nor where a processor is this many times slower than usual.
MOST_SLOW = 1.3
COUNT = "[+document.querySelector('.swarm-player').dataset.drawn, performance.now()]"
WEIGHT = """performance.getEntries().filter((one) => "encodedBodySize" in one)
    .reduce((sum, one) => sum + one.encodedBodySize, 0)"""


def rate(visitor, seconds: float = 5.0) -> tuple[float, float]:
    """Return frames a second, and the share of the machine that others took meanwhile."""
    machine, (drawn, began) = Watch(), visitor.page.evaluate(COUNT)
    time.sleep(seconds)
    later, ended = visitor.page.evaluate(COUNT)
    return 1000 * (later - drawn) / (ended - began), machine.others()


def skip_if_held_up(figure: str, others: float) -> None:
    slow = slowness()
    if others > MOST_OTHERS or slow > MOST_SLOW:
        pytest.skip(
            f"{figure}, but others took {others:.0%} of the machine, which is {slow:.1f} times slower than usual"
        )


def fill(visitor, robots: int, width: int, height: int) -> None:
    """Let this number of robots drive about in a hall of this size."""
    field = visitor.field("n_robots").locator("input[type=text]")
    field.fill(str(robots))
    field.press("Enter")
    size = f'width="{width}" height="{height}"'
    hall = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><circle cx="400" cy="300" r="20"/></svg>'
    file = {"name": "hall.svg", "mimeType": "image/svg+xml", "buffer": hall.encode()}
    visitor.page.set_input_files(".swarm-panel input[type=file]", file)
    visitor.page.wait_for_function(f"document.querySelector('.swarm-readings')?.textContent.includes('{robots:,}')")


@pytest.mark.parametrize("robots", PROMISED)
def test_pictures_come_as_often_as_promised(visit, robots):
    least, width, height = PROMISED[robots]
    visitor = visit("?model=collision_avoidance")
    fill(visitor, robots, width, height)
    visitor.press("Play")
    visitor.wait("+player.step > 60")
    measured = []
    while len(measured) < 3 and not (measured and measured[-1][0] >= least):
        measured.append(rate(visitor))
    frames, others = max(measured)
    print(f"{robots} robots: {frames:.0f} frames a second, promised {least}, others took {others:.0%} of the machine")
    if frames < least:
        skip_if_held_up(f"{frames:.0f} frames a second", others)
    assert frames >= least


def test_the_first_picture_comes_soon_and_the_page_is_light(visit, chromium, server):
    visit()
    took = []
    for _ in range(3):
        machine, began = Watch(), time.perf_counter()
        visitor = Visit(chromium.new_context(viewport={"width": 1366, "height": 768}), server[1])
        took.append((time.perf_counter() - began, machine.others()))
        weight = visitor.page.evaluate(WEIGHT)
        visitor.context.close()
    seconds, others = min(took)
    print(f"first picture after {seconds:.1f} s (others took {others:.0%}), {weight / 1e6:.2f} MB")
    assert weight < 6e6
    if seconds >= 3:
        skip_if_held_up(f"{seconds:.1f} s", others)
    assert seconds < 3
    assert HOST in server[1]
