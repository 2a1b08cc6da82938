"""Who may come in: nobody without the token, by no path; and nobody whom another page sent."""

import asyncio
from urllib.parse import quote

import pytest

from mesa_swarm.dashboard.gate import COOKIE, Gate, mark_of

TOKEN = "right-token_1"
INSIDE = b"the dashboard"


async def inside(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    elif scope["type"] == "http":
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": INSIDE})


def ask(path="/", *, token=TOKEN, query=b"", kind="http", host="127.0.0.1:8765", **headers):
    """Return what the gate answers: the first message, and all bytes."""
    named = {"host": host, **headers}
    scope = {"type": kind, "path": path, "query_string": query}
    scope["headers"] = [(name.encode(), value.encode()) for name, value in named.items()]
    told = []

    async def send(message):
        told.append(message)

    asyncio.run(Gate(inside, token)(scope, None, send))
    return told[0], b"".join(message.get("body", b"") for message in told)


def is_in(answer) -> bool:
    first, body = answer
    return body == INSIDE or first["type"] == "websocket.accept"


WRONG = ["", "wrong", TOKEN[:-1], TOKEN + "x", TOKEN.upper(), "%00", TOKEN + "\0", "é", "x" * 100_000]
PATHS = [
    "/",
    "/static/../",
    "/readyz",
    "/_solara/cdn/x.js",
    "//",
    "/./",
    "/%2e%2e/etc/passwd",
    "/solara/api/close/1",
    "*",
]


@pytest.mark.parametrize("path", PATHS)
def test_no_path_leads_past_the_token(path):
    answer = ask(path)
    assert not is_in(answer)
    assert answer[0]["status"] == 403
    assert TOKEN.encode() not in answer[1]


@pytest.mark.parametrize("word", WRONG)
def test_a_wrong_token_is_refused_in_address_and_cookie(word):
    assert not is_in(ask(query=b"token=" + word.encode()))
    assert not is_in(ask(cookie=f"{COOKIE}={word.encode().decode('latin-1')}"))


@pytest.mark.parametrize(
    "query", [b"token", b"token[]=x", b"token=wrong&token=", b"=&&&=", b"\xff\xfe", b"TOKEN=" + TOKEN.encode()]
)
def test_a_strange_query_is_refused(query):
    assert not is_in(ask(query=query))


@pytest.mark.parametrize("cookie", [";", "=;=", "a" * 5000, f"x{COOKIE}={mark_of(TOKEN)}", f'{COOKIE}="', "\xff"])
def test_a_strange_cookie_is_refused(cookie):
    assert not is_in(ask(cookie=cookie))


def test_a_connection_without_the_token_is_closed_even_if_the_address_has_it():
    assert ask(kind="websocket")[0] == {"type": "websocket.close", "code": 4403}
    assert not is_in(ask(kind="websocket", query=b"token=" + TOKEN.encode()))
    assert not is_in(ask(kind="websocket", cookie=f"{COOKIE}=wrong"))
    assert is_in(ask(kind="websocket", cookie=f"{COOKIE}={mark_of(TOKEN)}"))


def test_the_right_token_is_remembered_and_vanishes_from_the_address():
    first, _ = ask("/", query=b"model=boids&token=" + TOKEN.encode())
    headers = dict(first["headers"])
    assert (first["status"], headers[b"location"]) == (303, b"/?model=boids")
    assert b"HttpOnly" in headers[b"set-cookie"]
    assert b"SameSite=Lax" in headers[b"set-cookie"]
    assert is_in(ask(cookie=headers[b"set-cookie"].decode().split(";")[0]))


@pytest.mark.parametrize("path", ["//elsewhere.example", "//elsewhere.example/a", "/\\elsewhere.example", "/a\r\nx: y"])
def test_nobody_is_sent_elsewhere_with_the_token(path):
    first, _ = ask(path, query=b"token=" + TOKEN.encode())
    place = dict(first["headers"])[b"location"]
    assert place.startswith(b"/")
    assert not place.startswith((b"//", b"/\\"))
    assert b"\r" not in place
    assert b"\n" not in place


@pytest.mark.parametrize(
    "host", ["elsewhere.example", "127.0.0.1.elsewhere.example", "", "localhost@elsewhere.example", "["]
)
def test_without_a_token_only_this_machine_by_its_own_name_is_answered(host):
    assert not is_in(ask(token="", host=host))
    assert not is_in(ask(token="", host=host, kind="websocket"))


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost", "[::1]:8765"])
def test_without_a_token_this_machine_is_let_in(host):
    assert is_in(ask(token="", host=host))


@pytest.mark.parametrize("token", ["", TOKEN])
@pytest.mark.parametrize("origin", ["http://elsewhere.example", "null", "http://127.0.0.1:9999"])
def test_a_page_from_elsewhere_may_not_connect(token, origin):
    assert not is_in(ask(token=token, kind="websocket", origin=origin, cookie=f"{COOKIE}={mark_of(token)}"))
    assert is_in(
        ask(token=token, kind="websocket", origin="http://127.0.0.1:8765", cookie=f"{COOKIE}={mark_of(token)}")
    )


def test_a_token_of_letters_that_cookies_cannot_hold_is_known_again():
    for token in ("with space", 'quote"semi;colon', "umlaut-ü"):
        first, _ = ask(token=token, query=b"token=" + quote(token).encode())
        headers = dict(first["headers"])
        assert is_in(ask(token=token, cookie=headers[b"set-cookie"].decode("latin-1").split("; Path")[0]))
