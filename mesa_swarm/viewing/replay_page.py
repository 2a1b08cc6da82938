"""A recording as one page of HTML that plays from disk, without a network and for ever."""

import json
from base64 import b64encode
from importlib import resources

from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing.headers import policy, source_of
from mesa_swarm.viewing.reel import Reel

IMPORT = 'import { Stage, TOGGLES } from "./canvas.js";\n'


def replay_page(recording: Recording) -> str:
    """Return a page that plays a recording; it is whole in itself and asks for nothing.

    What is drawn is rounded as `mesa_swarm.viewing.chunks` says: positions to within 1/65535 of the map.
    50 robots and 3,000 steps take less than 2 MB.

    Parameters
    ----------
    recording : Recording

    Raises
    ------
    RecordingError
        If there is nothing to draw in it.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> model = FireFighting(rng=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(20)
    ...     page = replay_page(Recording(f"{folder}/run.arrow"))
    >>> page.startswith("<!doctype html>"), len(page) < 200_000
    (True, True)
    """
    reel = Reel(recording)
    about = {**reel.about, "embedded": True, "events": reel.events}
    return page_of(about, [reel.chunk(place) for place in range(reel.chunks)])


def page_of(about: dict, chunks: list[bytes]) -> str:
    """Return the player's page with what it must know, and with chunks if it is to have them at hand.

    Parameters
    ----------
    about : dict
        `Reel.about`; ``embedded`` says whether the chunks are in the page.
    chunks : list of bytes
    """
    # A "<" in a text would end the element; nobody but JSON reads it.
    facts = json.dumps(about, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    data = [f'<script type="application/json" id="about">{facts}</script>']
    for place, chunk in enumerate(chunks):
        data.append(f'<script type="text/plain" id="chunk-{place}">{b64encode(chunk).decode()}</script>')
    page = asset("replay.html")
    parts = {"policy": policy(sources(), in_page=True), "style": asset("player.css"), "script": script()}
    # Data last: what a recording holds is never searched for the names of the other parts.
    for name, text in {**parts, "data": "\n".join(data)}.items():
        page = page.replace(f"{{{{{name}}}}}", text, 1)
    return page


def script() -> str:
    """Return all that the page runs.

    Examples
    --------
    >>> IMPORT in script()
    False
    """
    return "\n" + asset("canvas.js") + asset("player.js").replace(IMPORT, "")


def sources() -> dict[str, str]:
    """Return what the page may run and load, as `mesa_swarm.viewing.headers.policy` takes it.

    Its own script is named by its hash: no other would run, should what a recording holds ever become an element.

    Examples
    --------
    >>> sources()["connect-src"]
    "'self'"
    """
    return {
        "script-src": source_of(script()),
        "style-src": "'unsafe-inline'",
        "img-src": "data:",
        "connect-src": "'self'",
    }


def asset(name: str) -> str:
    """Return one of the files beside this one.

    Examples
    --------
    >>> IMPORT in asset("player.js")
    True
    """
    return (resources.files("mesa_swarm.viewing") / name).read_text(encoding="utf-8")
