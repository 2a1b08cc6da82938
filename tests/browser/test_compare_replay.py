"""Two worlds side by side, runs over many seeds, and recordings, in a real browser."""

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from support.browsers import recorded_run
from support.visits import resize
from support.waiting import wait_until

pytestmark = pytest.mark.long

SIDES = ".swarm-worlds .swarm-player"
# Of every map: its height, and what stands upon it.
COVERED = """[...document.querySelectorAll(".swarm-stage")].map((stage) => {
    const canvas = stage.querySelector("canvas"), [left, top, right, bottom] = canvas.arena();
    const { x, y, height } = canvas.getBoundingClientRect(), upon = [];
    for (const part of stage.querySelectorAll(".swarm-tools, .swarm-tools > *, .swarm-key")) {
        const box = part.getBoundingClientRect();
        const beside = box.right <= x + left || box.left >= x + right || box.bottom <= y + top || box.top >= y + bottom;
        if (!beside || box.bottom > y + height || box.top < y) upon.push(part.className || part.title || "menu");
    }
    if (left < 131 && bottom > height - 36) upon.push("scale");
    return [bottom - top, ...upon];
})"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return recorded_run(tmp_path_factory.mktemp("recordings") / "fires.arrow", 120)


@pytest.fixture
def compared(visit):
    visitor = visit("?model=fire_fighting&n_robots=5&seed=3")
    visitor.press("Compare")
    visitor.page.wait_for_selector(f"{SIDES}[data-drawn]")
    visitor.page.evaluate("document.activeElement.blur()")  # on a tab, the space bar presses that
    wait_until(lambda: steps_of(visitor) == ["0", "0"])
    return visitor


@pytest.fixture
def replayed(visit, recording):
    visitor = visit()
    visitor.press("Replay")
    visitor.page.set_input_files(".swarm-set input[type=file]", recording)
    visitor.page.wait_for_selector(".swarm-player[data-step]")
    return visitor


def steps_of(visitor) -> list[str]:
    return [side.get_attribute("data-step") for side in visitor.page.locator(SIDES).all()]


def marks_of(visitor) -> list[str]:
    return [side.get_attribute("data-fingerprint") for side in visitor.page.locator(SIDES).all()]


def clock(visitor, name: str) -> str:
    return visitor.page.locator(".swarm-clock .swarm-player").get_attribute(f"data-{name}")


def test_two_worlds_step_back_and_play_as_one(compared):
    press = compared.page.keyboard.press
    for step in ("1", "2"):
        press("ArrowRight")
        wait_until(lambda step=step: steps_of(compared) == [step, step])
    press("ArrowLeft")
    wait_until(lambda: steps_of(compared) == ["1", "1"])
    press(" ")
    compared.wait("+player.step > 20")
    press(" ")
    compared.wait("player.playing === 'false' && player.fingerprint !== ''")
    wait_until(lambda: steps_of(compared) == [clock(compared, "step")] * 2)
    press("r")
    wait_until(lambda: steps_of(compared) == ["0", "0"])
    wait_until(lambda: clock(compared, "fingerprint") == "-".join(marks_of(compared)))


def test_nothing_stands_upon_the_maps_whatever_their_height(compared, shots):
    page = compared.page
    for height in (768, 640, 1000):
        resize(page, 1366, height)
        page.screenshot(path=shots / f"compare_{height}.png")
        maps = page.evaluate(COVERED)
        assert [upon for _, *upon in maps] == [[], []]
        assert all(shown > 140 for shown, *_ in maps)
        menu = page.locator(".swarm-worlds .swarm-tools summary").first
        menu.click()
        page.screenshot(path=shots / f"compare_menu_{height}.png")
        stage, list_ = (page.locator(f".swarm-stage{part}").first.bounding_box() for part in ("", " details > div"))
        assert stage["y"] <= list_["y"]
        assert list_["y"] + list_["height"] <= stage["y"] + stage["height"], "the whole list is in sight"
        assert stage["x"] <= list_["x"]
        menu.click()
    compared.press("Watch")
    page.wait_for_selector(".swarm-side")
    compared.wait("player.drawn")
    assert [upon for _, *upon in page.evaluate(COVERED)] == [[]]


def test_what_is_compared_is_chosen_and_named(compared, shots):
    page = compared.page
    compared.field("parameter").locator("select").select_option("n_robots")
    wait_until(lambda: page.locator(".swarm-caption").all_inner_texts()[-2:] == ["A: robots 10", "B: robots 50"])
    value = compared.field("B").locator("input[type=text]")
    value.fill("20")
    value.press("Enter")
    page.wait_for_selector(".swarm-field[data-name=B] .swarm-waits")
    compared.press("Reset")
    wait_until(lambda: page.locator(".swarm-caption").all_inner_texts()[-1] == "B: robots 20")
    page.wait_for_selector("img.swarm-curves")
    compared.press("Step")
    wait_until(lambda: steps_of(compared) == ["1", "1"])
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    page.screenshot(path=shots / "compare.png")


def test_many_seeds_are_compared_in_the_background_or_cancelled(compared, shots):
    page = compared.page
    for name, text in (("seeds", "8"), ("steps", "100000")):
        field = compared.field(name).locator("input[type=text]")
        field.fill(text)
        field.press("Enter")
    compared.press("Compare over 8 seeds")
    page.wait_for_selector("progress")
    compared.press("Step")
    wait_until(lambda: steps_of(compared) == ["1", "1"])
    compared.press("Cancel")
    wait_until(lambda: "cancelled after" in page.locator(".swarm-start").inner_text())
    field.fill("60")
    field.press("Enter")
    compared.press("Compare over 8 seeds")
    page.wait_for_selector(".swarm-finding", timeout=300_000)
    assert "in 0 of 8 runs" in page.locator(".swarm-finding").inner_text()
    page.wait_for_selector("img.swarm-pairs")
    page.screenshot(path=shots / "compare_seeds.png")
    compared.press("Watch")
    compared.press("Compare")
    page.wait_for_selector(".swarm-finding")


def test_a_recording_that_is_handed_over_is_played_and_scrubbed(replayed, shots):
    replayed.press("Step")
    replayed.wait("player.step === '2'")
    replayed.play_slowly()
    replayed.press("Play")
    replayed.wait("+player.step > 5")
    replayed.press("Pause")
    replayed.wait("player.playing === 'false'")
    replayed.page.get_by_role("slider", name="Steps in memory").press("End")
    replayed.wait("player.step === '120'")
    replayed.press("Reset")
    replayed.wait("player.step === '1'")
    replayed.page.screenshot(path=shots / "replay.png")


def test_an_event_is_jumped_to_and_the_watch_page_goes_on_from_there(replayed):
    page = replayed.page
    event = page.locator(".swarm-events button").first
    step = event.inner_text().split()[0]
    event.click()
    replayed.wait(f"player.step === '{step}'")
    replayed.press("Continue live")
    page.wait_for_selector(".swarm-header button[aria-current]:has-text('Watch')")
    replayed.wait_for_step(int(step))
    model = FireFighting(strategy="A", initial_temperature=0.02, rng=4).run(int(step))
    assert replayed.about("fingerprint") == model.state_hash()
    replayed.press("Step")
    replayed.wait_for_step(int(step) + 1)
    assert replayed.about("fingerprint") == model.run(1).state_hash()
    replayed.press("Reset")
    replayed.wait_for_step(0)
    assert "seed=4" in page.url


def test_a_file_that_is_not_a_recording_is_refused_in_one_line(visitor):
    visitor.press("Replay")
    file = {"name": "notes.arrow", "mimeType": "application/octet-stream", "buffer": b"hello"}
    visitor.page.set_input_files(".swarm-set input[type=file]", file)
    wait_until(lambda: "notes.arrow is not a recording" in visitor.page.locator(".swarm-set").inner_text())
