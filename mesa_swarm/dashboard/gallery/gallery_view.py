"""All models, each with a picture that moves when it is pointed at, and one line."""

import threading
from collections.abc import Callable, Sequence
from functools import cache
from zlib import crc32

import anywidget
import solara
import traitlets

from mesa_swarm.dashboard import page_models
from mesa_swarm.dashboard.gallery.gallery_pictures import SHOTS, picture_address, still_of
from mesa_swarm.model.gallery import description, find_model, short_name
from mesa_swarm.viewing import text_of
from mesa_swarm.viewing.drawing import drawing_of_model
from mesa_swarm.viewing.error_lines import reported

# Steps before the picture of a model that does not come with one, so that its behaviour is visible.
STEPS = 800
# Its robots are larger than to scale, so that they are visible in so small a picture.
LARGER = 1.4
_DRAWING = threading.Lock()


@cache
def thumbnail(name: str) -> str:
    """Return a picture of a model as SVG, drawn once in the life of the program; of one that fails its world."""
    try:
        model = find_model(name)(rng=1)
    except Exception as problem:  # a model of a user's may raise anything: the terminal has what
        reported(problem)
        return ""
    try:
        model.run(STEPS)
    except Exception as problem:  # likewise
        reported(problem)
    return drawing_of_model(model, LARGER, f"own{crc32(name.encode()):x}")


def title(name: str) -> str:
    """Return a model's name as a title."""
    return short_name(name).replace("_", " ").capitalize()


def card_of(name: str) -> dict[str, str]:
    """Return what a card shows: title, a line, the picture at rest, and the address of the moving one if there is one.

    The pictures at rest come with the cards, so that none is missing when they appear.
    """
    shown = {"name": name, "title": title(name), "about": description(find_model(name)), "still": "", "moving": ""}
    if name in SHOTS:
        shown |= {"still": still_of(name)[0].decode(), "moving": picture_address(name)}
    return shown


class GalleryCards(anywidget.AnyWidget):
    """The cards, of which each is a button."""

    _esm = text_of("viewing/elements.js", "dashboard/gallery/gallery.js")
    cards: traitlets.List = traitlets.List().tag(sync=True)
    # Pictures that were drawn meanwhile, by the names of their models.
    drawn = traitlets.Dict().tag(sync=True)
    chosen = traitlets.Unicode("").tag(sync=True)
    # The name on the card that was pressed.
    choice = traitlets.Unicode("").tag(sync=True)


@solara.component
def Gallery(chosen: str, on_choose: Callable[[str], None]) -> None:
    """Show all models as buttons."""
    none_yet: dict[str, str] = {}
    pictures, set_pictures = solara.use_state(none_yet)
    cards = solara.use_memo(lambda: [card_of(name) for name in page_models()], [])
    missing = [card["name"] for card in cards if not card["still"]]
    solara.use_effect(lambda: _drawing_thread(missing, set_pictures), [])
    with solara.Div(classes=["swarm-gallery"]):
        GalleryCards.element(cards=cards, drawn=pictures, chosen=chosen, on_choice=on_choose)


def _drawing_thread(names: Sequence[str], set_pictures: Callable[[dict], None]) -> Callable[[], None]:
    """Draw pictures in a thread, and pass on each; return a function that stops it."""
    stop = threading.Event()

    def draw() -> None:
        pictures: dict[str, str] = {}
        for name in names:
            with _DRAWING:
                if stop.is_set():
                    return
                pictures = {**pictures, name: thumbnail(name)}
            set_pictures(pictures)

    if names:
        threading.Thread(target=draw, name="gallery", daemon=True).start()
    return stop.set
