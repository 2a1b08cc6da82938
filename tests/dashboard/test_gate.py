"""Admission: no request without the token, by any path; and none from another page."""

import asyncio
import gzip
from pathlib import Path
from urllib.parse import quote

import pytest

from mesa_swarm.dashboard.gallery.gallery_pictures import moving_of
from mesa_swarm.dashboard.gate import COOKIE, Gate, digest_token, is_well_formed
from mesa_swarm.model.gallery import gallery_names

TOKEN = "right-token_1"
INSIDE = b"the dashboard"
ASSETS = Path(__file__).parent


async def inside(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    elif scope["type"] == "http":
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": INSIDE})


def ask(
    path="/",
    *,
    token=TOKEN,
    query=b"",
    kind="http",
    host="127.0.0.1:8765",
    more=(),
    app=inside,
    method="GET",
    **headers,
):
    """Return what the gate answers: the first message, and all bytes."""
    return answer_of(Gate(app, token, ASSETS), path, query, kind, {"host": host, **headers}, more, method)


def answer_of(gate, path, query=b"", kind="http", named=None, more=(), method="GET"):
    query = query or (b"session_id=1" if kind == "websocket" else b"")
    scope = {"type": kind, "path": path, "query_string": query, "method": method}
    scope["headers"] = [(name.encode(), value.encode()) for name, value in (named or {"host": "localhost"}).items()]
    scope["headers"] += [(name.encode(), value.encode()) for name, value in more]
    sent = []

    async def send(message):
        sent.append(message)

    asyncio.run(gate(scope, None, send))
    return sent[0], b"".join(message.get("body", b"") for message in sent)


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


@pytest.mark.parametrize("cookie", [";", "=;=", "a" * 5000, f"x{COOKIE}={digest_token(TOKEN)}", f'{COOKIE}="', "\xff"])
def test_a_strange_cookie_is_refused(cookie):
    assert not is_in(ask(cookie=cookie))


def test_a_connection_without_the_token_is_closed_even_if_the_address_has_it():
    assert ask(kind="websocket")[0] == {"type": "websocket.close", "code": 4403}
    assert not is_in(ask(kind="websocket", query=b"token=" + TOKEN.encode()))
    assert not is_in(ask(kind="websocket", cookie=f"{COOKIE}=wrong"))
    assert is_in(ask(kind="websocket", cookie=f"{COOKIE}={digest_token(TOKEN)}"))


def test_the_right_token_is_remembered_and_vanishes_from_the_address():
    first, _ = ask("/", query=b"model=boids&token=" + TOKEN.encode())
    headers = dict(first["headers"])
    assert (first["status"], headers[b"location"]) == (303, b"/?model=boids")
    assert b"HttpOnly" in headers[b"set-cookie"]
    assert b"SameSite=Lax" in headers[b"set-cookie"]
    assert is_in(ask(cookie=headers[b"set-cookie"].decode().split(";")[0]))
    assert is_in(ask(cookie=f"a=1; {COOKIE}={digest_token(TOKEN)}"))


@pytest.mark.parametrize("path", ["//elsewhere.example", "//elsewhere.example/a", "/\\elsewhere.example", "/a\r\nx: y"])
def test_the_token_is_not_sent_to_another_host(path):
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
    assert not is_in(ask(token=token, kind="websocket", origin=origin, cookie=f"{COOKIE}={digest_token(token)}"))
    assert is_in(
        ask(token=token, kind="websocket", origin="http://127.0.0.1:8765", cookie=f"{COOKIE}={digest_token(token)}")
    )


def test_a_token_of_letters_that_cookies_cannot_hold_is_known_again():
    for token in ("with space", 'quote"semi;colon', "umlaut-ü"):
        first, _ = ask(token=token, query=b"token=" + quote(token).encode())
        headers = dict(first["headers"])
        assert is_in(ask(token=token, cookie=headers[b"set-cookie"].decode("latin-1").split("; Path")[0]))


@pytest.mark.parametrize("name", gallery_names())
def test_the_moving_picture_of_every_model_is_served_and_may_be_stored(name):
    first, body = ask(f"/gallery/{name}.svg", token="")
    headers = dict(first["headers"])
    assert (first["status"], body, headers[b"content-type"]) == (200, moving_of(name)[0], b"image/svg+xml")
    assert b"immutable" in headers[b"cache-control"]
    assert int(headers[b"content-length"]) == len(body)
    assert set(headers) >= SAFE_NAMES


NO_PICTURES = [
    "",
    "boids",
    "boids_moving.svg",
    "boids.svg/",
    "boids.svgz",
    "Boids.svg",
    "nothing.svg",
    ".svg",
    "./boids.svg",
    "../gallery/boids.svg",
    "../gate.py",
    "/boids.svg",
    "boids.svg\\",
    "..\\gallery\\boids.svg",
    "%62oids.svg",
    "boids.svg\n",
    "x" * 5000,
]


@pytest.mark.parametrize("name", NO_PICTURES)
def test_no_other_path_of_pictures_leads_to_a_file_or_to_the_page(name):
    answer = ask(f"/gallery/{name}", token="")
    assert not is_in(answer)
    assert answer[0]["status"] == 404


def test_pictures_are_only_read_and_only_with_the_token():
    path, cookie = "/gallery/boids.svg", f"{COOKIE}={digest_token(TOKEN)}"
    first, body = ask(path, method="HEAD", token="")
    assert (first["status"], body) == (200, b"")
    assert int(dict(first["headers"])[b"content-length"]) == len(moving_of("boids")[0])
    assert [ask(path, method=method, token="")[0]["status"] for method in ("POST", "PUT", "get", "")] == [405] * 4
    assert ask(path)[0]["status"] == 403
    assert ask(path, cookie=cookie)[1] == moving_of("boids")[0]
    assert ask(path, token="", host="elsewhere.example")[0]["status"] == 400


HOSTS_OF_NONE = [
    "[::1",
    "[::1]x",
    "",
    " localhost",
    "localhost:",
    "localhost:1234567",
    "lo\u00e9",
    "a@localhost",
    "x" * 70_000,
    "bad host:x",
    "evil/../x",
    "localhost:65536",
    "\xff",
    "[:::]",
    "[1.2.3.4]",
    "localhost\n",
]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("token", ["", TOKEN])
@pytest.mark.parametrize("origin", [f"http://{host}" for host in HOSTS_OF_NONE] + ["null", "", "//", "\0", "http://["])
def test_a_malformed_origin_is_refused_and_raises_nothing(origin, token, kind):
    answer = ask(token=token, kind=kind, origin=origin, cookie=f"{COOKIE}={digest_token(token)}")
    assert not is_in(answer)
    assert answer[0] == {"type": "websocket.close", "code": 4403} or answer[0]["status"] == 403


@pytest.mark.parametrize("token", ["", TOKEN])
@pytest.mark.parametrize("host", HOSTS_OF_NONE)
def test_a_malformed_host_is_refused_and_raises_nothing(host, token):
    cookie = f"{COOKIE}={digest_token(token)}"
    for path in ("/", "/nothing", "/static/"):
        assert ask(path, token=token, host=host, cookie=cookie)[0]["status"] == 400
        assert ask(path, token=token, host=host)[0]["status"] == 400
    assert ask(token=token, host=host, query=b"token=" + TOKEN.encode())[0]["status"] == 400
    assert ask(token=token, host=host, origin=f"http://{host}", cookie=cookie)[0]["status"] == 400
    assert ask(token=token, host=host, kind="websocket", cookie=cookie)[0] == {
        "type": "websocket.close",
        "code": 4403,
    }


@pytest.mark.parametrize("host", ["laptop.example:65535", "xn--bcher-kva.example", "192.168.0.7:1", "[fe80::1]:8765"])
def test_with_the_token_this_machine_is_let_in_under_any_name(host):
    cookie = f"{COOKIE}={digest_token(TOKEN)}"
    assert is_in(ask(host=host, cookie=cookie))
    assert is_in(ask(host=host, cookie=cookie, kind="websocket", origin=f"http://{host}"))
    assert ask(host=host)[0]["status"] == 403


@pytest.mark.parametrize("name", ["host", "Host", "origin"])
def test_of_several_hosts_or_origins_none_counts(name):
    more = [(name, "http://127.0.0.1:8765"), (name, "http://127.0.0.1:8765")]
    assert ask(token="", more=more)[0]["status"] == 400


@pytest.mark.parametrize(("path", "query"), [("/static/a\0b", b""), ("/", b"v=\xff"), ("/static/x.js", "v=é".encode())])
def test_a_malformed_address_is_refused(path, query):
    assert ask(path, token="", query=query)[0]["status"] == 400


def test_a_request_without_a_host_is_malformed():
    scope = {"path": "/", "query_string": b"seed=1", "headers": [(b"host", b"localhost")]}
    assert is_well_formed(scope)
    assert not is_well_formed({**scope, "headers": []})


SAFE_NAMES = {
    b"content-security-policy",
    b"x-frame-options",
    b"x-content-type-options",
    b"referrer-policy",
    b"cross-origin-resource-policy",
}


@pytest.mark.parametrize(
    "wanted",
    [
        {"path": "/", "token": ""},
        {"path": "/static/x.js", "token": ""},
        {"path": "/"},
        {"query": b"token=" + TOKEN.encode()},
        {"token": "", "host": "elsewhere.example"},
        {"token": "", "origin": "null"},
        {"token": "", "path": "/_solara/cdn/nothing"},
        {"token": "", "query": b"\xff"},
    ],
)
def test_every_answer_forbids_to_frame_it_and_to_load_from_elsewhere(wanted):
    first, _ = ask(**wanted)
    named = [name for name, _ in first["headers"]]
    assert set(named) >= SAFE_NAMES
    assert len(named) == len(set(named))


def test_headers_of_the_application_on_framing_are_replaced():
    async def permissive(scope, receive, send):
        headers = [(b"X-Frame-Options", b"ALLOWALL"), (b"x-own", b"1")]
        await send({"type": "http.response.start", "status": 500, "headers": headers})
        await send({"type": "http.response.body", "body": b""})

    headers = ask(token="", app=permissive)[0]["headers"]
    assert [value for name, value in headers if name.lower() == b"x-frame-options"] == [b"DENY"]
    assert (b"x-own", b"1") in headers


def test_only_installed_files_are_handed_out_as_assets():
    assert is_in(ask("/_solara/cdn/test_gate.py", token=""))
    for name in (
        "",
        ".",
        "/",
        "no.js",
        "../dashboard",
        "../test_model.py",
        "./../../README.md",
        "x" * 5000,
        "..\\test_model.py",
    ):
        answer = ask(f"/_solara/cdn/{name}", token="")
        assert (answer[0]["status"], is_in(answer)) == (404, False)


def test_headers_that_only_proxies_may_send_do_not_reach_the_application():
    seen = []

    async def looking(scope, receive, send):
        seen.extend(name for name, _ in scope["headers"])
        await inside(scope, receive, send)

    more = [
        ("X-Script-Name", "/evil"),
        ("script-name", "/evil"),
        ("x-forwarded-host", "a"),
        ("X-Forwarded-Proto", "ftp"),
    ]
    assert is_in(ask(token="", app=looking, more=more))
    assert seen == [b"host"]


@pytest.mark.parametrize("query", [b"a=1", b"xsession_id=1", b"session=1"])
def test_a_request_without_its_page_is_refused(query):
    assert not is_in(ask(token="", kind="websocket", query=query))
    assert ask("/_solara/api/close/1", token="", query=query)[0]["status"] == 400
    assert is_in(ask("/_solara/api/close/1", token="", query=b"session_id=1"))


def heard(message) -> dict:
    """Return what the application hears of a message from a browser."""
    found = []

    async def listening(scope, receive, send):
        found.append(await receive())

    async def receive():
        return message

    scope = {"type": "websocket", "path": "/", "query_string": b"session_id=1", "headers": [(b"host", b"localhost")]}
    asyncio.run(Gate(listening)(scope, receive, None))
    return found[0]


def test_a_packed_message_that_claims_more_parts_than_it_has_bytes_ends_the_connection():
    for parts, rest in ((2**31 - 1, b""), (2**32 - 1, bytes(8)), (0, bytes(8)), (3, bytes(11))):
        packed = parts.to_bytes(4, "big") + rest
        assert heard({"type": "websocket.receive", "bytes": packed})["type"] == "websocket.disconnect"
    for message in ({"bytes": bytes([0, 0, 0, 1, 0, 0, 0, 8]) + b"{}"}, {"text": "{}"}, {"bytes": None, "text": ""}):
        message["type"] = "websocket.receive"
        assert heard(message) == message


SHEET = """/* roboto-100normal - latin */
@font-face { font-family: 'Roboto'; src: url(a.woff2) format('woff2'), /* modern */ url(a.woff); }
@font-face { font-family: "Material Design Icons"; src: url(b.woff2); }
.mdi-alert::before { content: "x"; }
"""


def test_letters_that_the_page_does_not_use_are_left_out_of_its_fonts(tmp_path):
    (tmp_path / "dist").mkdir()
    (tmp_path / "dist" / "fonts.css").write_text(SHEET, encoding="utf-8")
    gate, path = Gate(inside, "", tmp_path), "/_solara/cdn/dist/fonts.css"
    first, body = answer_of(gate, path, more=[("Accept-Encoding", "br, gzip")])
    assert gzip.decompress(body).decode().splitlines() == SHEET.splitlines()[2:]
    assert (b"content-encoding", b"gzip") in first["headers"]
    assert is_in(answer_of(gate, path)), "as it is where a browser takes no gzip"
    assert answer_of(gate, "/_solara/cdn/dist/../../fonts.css")[0]["status"] == 404
