"""The arrangement of the page: its title, what folds, and what the gate adds to Solara's page."""

import asyncio
import gzip
from functools import cache

import pytest
from solara.server import server

from mesa_swarm.dashboard.gate import Gate, complete_page
from mesa_swarm.dashboard.page.widgets import LEFT, ColumnFold, ScreenButtons, page_title

BARE = b'<!doctype html>\n<html>\n<head><meta name="viewport" content="width=device-width, user-scalable=no"></head>'
WHOLE = (
    b'<!doctype html>\n<html lang="en">\n'
    b'<head><meta name="viewport" content="width=device-width, initial-scale=1"></head>'
)


def answer(parts, *, kind=b"text/html; charset=utf-8", accept=b"text/html,*/*", more=(), takes=b"gzip"):
    """Return the headers and the bytes of an answer in parts that pass the gate, and the request behind it."""
    length, asked, sent = sum(map(len, parts)), [], []

    async def app(scope, receive, send):
        asked.append(scope)
        headers = [(b"content-type", kind), (b"content-length", b"%d" % length), *more]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        for place, part in enumerate(parts):
            await send({"type": "http.response.body", "body": part, "more_body": place < len(parts) - 1})

    async def send(message):
        sent.append(message)

    headers = [(b"host", b"localhost"), (b"accept", accept), (b"accept-encoding", takes)]
    scope = {"type": "http", "path": "/", "query_string": b"", "headers": headers}
    asyncio.run(Gate(app)(scope, None, send))
    return dict(sent[0]["headers"]), b"".join(one["body"] for one in sent[1:]), dict(asked[0]["headers"])


@pytest.mark.parametrize("parts", [(BARE,), (BARE[:20], BARE[20:50], BARE[50:])])
def test_a_page_gets_its_language_a_viewport_that_can_be_enlarged_and_its_length(parts):
    headers, body, asked = answer(parts)
    assert (gzip.decompress(body), headers[b"content-encoding"]) == (WHOLE, b"gzip")
    assert headers[b"content-length"] == b"%d" % len(body)
    assert b"accept-encoding" not in asked, "it comes as it is written"
    headers, body, _ = answer(parts, takes=b"identity")
    assert (body, b"content-encoding" in headers) == (WHOLE, False)
    assert headers[b"content-length"] == b"%d" % len(body)


@pytest.mark.parametrize(
    "about", [{"kind": b"text/plain"}, {"accept": b"*/*"}, {"more": [(b"content-encoding", b"br")]}]
)
def test_other_answers_pass_as_they_are(about):
    headers, body, _ = answer((BARE,), **about)
    assert body == BARE
    assert headers[b"content-length"] == b"%d" % len(BARE)


@cache
def solaras_page() -> str:
    return (server.directory / "templates" / "solara.html.j2").read_text(encoding="utf-8")


def test_solaras_page_still_has_what_is_replaced():
    page = complete_page(solaras_page().encode())
    for added in (b'<html lang="en">', b'<v-progress-linear aria-label="Busy"'):
        assert page.count(added) == 1
    assert page.index(b"anywidget: 'nbextensions/anywidget/index'") < page.index(
        b"{% for ext in resources.nbextensions if"
    )
    assert b"user-scalable" not in page
    assert b"maximum-scale" not in page


def test_a_title_names_the_model_and_the_tab_unless_it_is_the_first():
    assert page_title("Fire fighting", "Watch", "Watch") == "Fire fighting - mesa_swarm"
    assert page_title("Fire fighting", "Compare", "Watch") == "Compare: Fire fighting - mesa_swarm"


def test_a_fold_has_its_side_and_label():
    fold = ColumnFold(side=LEFT, label="Recordings", folded_below=True)
    assert (fold.part, fold.side, fold.label, fold.folded_below) == ("fold", "left", "Recordings", True)
    assert ScreenButtons().part == "screen"
