"""A recording as one page that plays from disk."""

import json
from base64 import b64encode
from collections.abc import Iterator
from functools import cached_property
from threading import Lock

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.recording.frames import Frame, events_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.frame_bytes import packed_chunk
from mesa_swarm.viewing.scene import Scene, scene_of_recording
from mesa_swarm.viewing.server_headers import policy, source_of

# Rows of a chunk: many compress well, few are quickly fetched. Fewer of many robots.
MOST_ROWS = 256
FEWEST_ROWS = 8
ROBOT_ROWS = 200_000
IMPORT = 'import { Stage, TRAIL_STEPS, fillLegend, sameIds, togglesOf } from "./canvas.js";\n'


class Reel:
    """The rows of a recording before the first that is damaged; may be asked by several threads."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.rows = recording.intact
        self._lock = Lock()
        robots = len(recording[0].robots) if self.rows else 0
        self.chunk_rows = max(FEWEST_ROWS, min(MOST_ROWS, ROBOT_ROWS // max(robots, 1)))

    def __iter__(self) -> Iterator[Frame]:
        """Iterate over the frames."""
        return self._frames(0, self.rows)

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-self.rows // self.chunk_rows)

    def chunk(self, place: int) -> bytes:
        """Return one chunk, see `packed_chunk`."""
        if not 0 <= place < self.chunks:
            raise InvalidValueError(f"chunk is {place}; expected 0 to {self.chunks - 1}")
        first = place * self.chunk_rows
        return packed_chunk(self._frames(first, min(first + self.chunk_rows, self.rows)), self.scene)

    @cached_property
    def about(self) -> dict:
        """What the player needs first: the world, its changes, and the run that was recorded in it."""
        facts = self.recording.provenance
        return {
            "world": self.scene.world(),
            "later": self.scene.later,
            "model": facts["model"]["name"],
            "parameters": {name: _in_words(value) for name, value in facts["parameters"].items()},
            "seed": _in_words(facts["seed"]),
            "version": facts["versions"].get("mesa-swarm", ""),
            "every": facts["every"],
            "first": self.recording[0].step if self.rows else 0,
            "rows": self.rows,
            "chunk_rows": self.chunk_rows,
            "notes": list(self._notes()),
        }

    @cached_property
    def events(self) -> list[dict]:
        """What happened, oldest first; every row is read for it."""
        return [{"step": event.step, "kind": event.kind, "text": event.text} for event in events_of(self)]

    @cached_property
    def scene(self) -> Scene:
        """What stands behind the frames."""
        return scene_of_recording(self.recording)

    def _frames(self, begin: int, end: int) -> Iterator[Frame]:
        for row in range(begin, end):
            with self._lock:
                frame = self.recording[row]
            yield frame

    def _notes(self) -> Iterator[str]:
        yield from damage_notes(self.recording)
        if not self.recording.provenance.get("scenery"):
            yield "An older version recorded this: robots are drawn in the usual size, without their sensors."


def damage_notes(recording: Recording) -> Iterator[str]:
    """Yield what is missing at the end of a recording."""
    rows = recording.intact
    last = recording[rows - 1].step if rows else 0
    if rows < len(recording):
        yield f"The recording is damaged after step {last}; what follows is left out."
    elif recording.damage:
        yield f"The recording {recording.damage}."
    elif not recording.complete:
        yield f"The recording was not closed; it is whole up to step {last}."


def _in_words(value: object) -> str:
    """Return a parameter or a seed as a user would write it."""
    return f"{value:.6g}" if isinstance(value, float) else shortened(value) if isinstance(value, dict) else str(value)


def replay_page(recording: Recording) -> str:
    """Return a page that plays a recording; it is whole in itself and asks for nothing.

    What is drawn is rounded as `mesa_swarm.viewing.frame_bytes` describes: positions to within 1/65535 of the map.
    50 robots and 3,000 steps take less than 2 MB.
    """
    reel = Reel(recording)
    about = {**reel.about, "embedded": True, "events": reel.events}
    return page_of(about, [reel.chunk(place) for place in range(reel.chunks)])


def page_of(about: dict, chunks: list[bytes]) -> str:
    """Return the player's page with its inputs, and with the chunks that are embedded."""
    # A "<" in a text would end the element; JSON reads the escape as the same text.
    facts = json.dumps(about, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    elements = [f'<script type="application/json" id="about">{facts}</script>']
    for place, chunk in enumerate(chunks):
        elements.append(f'<script type="text/plain" id="chunk-{place}">{b64encode(chunk).decode()}</script>')
    page = text_of("viewing/replay.html")
    parts = {"policy": policy(sources(), in_page=True), "style": style(), "script": page_script()}
    # Data last: what a recording holds is never searched for the names of the other parts.
    for name, text in {**parts, "data": "\n".join(elements)}.items():
        page = page.replace(f"{{{{{name}}}}}", text, 1)
    return page


def page_script() -> str:
    """Return all that the page runs."""
    drawers = palette.palette_script() + text_of("viewing/canvas.js", "viewing/elements.js")
    return "\n" + drawers + text_of("viewing/player.js").replace(IMPORT, "")


def style() -> str:
    """Return how the page looks, with the colours of its two themes."""
    return palette.style_sheet(":root", ':root[data-theme="dark"]') + text_of("viewing/player.css")


def sources() -> dict[str, str]:
    """Return what the page may run and load, as `mesa_swarm.viewing.server_headers.policy` takes it.

    Its own script is named by its hash: no other would run, should what a recording holds ever become an element.
    """
    return {
        "script-src": source_of(page_script()),
        "style-src": "'unsafe-inline'",
        "img-src": "data:",
        "connect-src": "'self'",
    }
