"""Admits requests: with the token only, and on this machine none from other pages.

All answers pass here too, and get the headers of `mesa_swarm.viewing.server_headers`.
"""

import gzip
import hashlib
import hmac
import re
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from functools import cache
from http.cookies import CookieError, SimpleCookie
from ipaddress import IPv6Address
from os.path import isfile, normpath
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

from mesa_swarm.dashboard.gallery.gallery_pictures import PREFIX, picture_at
from mesa_swarm.viewing.server_headers import safe_headers

# As ASGI has them.
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Scope]]
Send = Callable[[Scope], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]
Headers = Sequence[tuple[bytes, bytes]]

COOKIE = "mesa_swarm_token"
# Vue 2 compiles templates in the browser, Solara's page starts from a script in its text, and every widget's script
# is loaded as a blob. Vuetify writes style sheets while it runs.
SOURCES = {
    "default-src": "'self'",
    "script-src": "'self' 'unsafe-inline' 'unsafe-eval' blob:",
    "style-src": "'self' 'unsafe-inline'",
    "img-src": "'self' data: blob:",
    "font-src": "'self' data:",
    "connect-src": "'self'",
    "form-action": "'self'",
}
PACKED = ((b"content-encoding", b"gzip"), (b"vary", b"accept-encoding"))
SAFE = [(name.lower().encode(), value.encode()) for name, value in safe_headers(SOURCES).items()]
HOST = re.compile(r"([a-z0-9._-]{1,253}|\[[0-9a-f:.]+\])(?::([0-9]{1,5}))?", re.IGNORECASE)
# Headers of a proxy: uvicorn has read them; Solara would trust them from any client, for all later pages too.
PROXY = re.compile(rb"x-forwarded-.*|(x-)?script-name", re.DOTALL)
ANSWERS = ("http.response.start", "websocket.http.response.start")
ASSETS = "/_solara/cdn/"
# Of the fonts, those of icons are used: the page has the system's letters, Roboto would be loaded for two hidden words.
FONTS = "/fonts.css"
FACE = re.compile(r"(?:/\*[^*]*\*/\s*)?@font-face\s*\{[^}]*'Roboto'[^}]*\}\s*")
FOR_GOOD = b"public, max-age=31536000, immutable"
CLOSE = "/_solara/api/close/"
READING = ("GET", "HEAD")
STORED = b"private, max-age=31536000, immutable"
LAST_PORT = 65535
LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
FORM = """<!doctype html><html lang="en"><meta charset="utf-8"><title>mesa_swarm</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:32em;margin:15vh auto;padding:0 1em}
input,button{font:inherit;padding:.4em .8em}</style>
<h1>mesa_swarm</h1><p>This dashboard requires a token. It was printed in the terminal that started the dashboard.</p>
<form><label>Token <input name="token" type="password" autofocus></label> <button>Enter</button></form></html>"""
MALFORMED = "This request is malformed."
HTML = b"text/html"
WIDGETS_SCRIPT = b"requirejs.config({map: {'*': {anywidget: 'nbextensions/anywidget/index'}}});\n        "
# What Solara's page lacks: its language, a name and liveness of its progress bar, for screen readers, leave to be
# enlarged, and where the script of our widgets is. Its extension has it too, but may come after the widgets.
COMPLETED = (
    (re.compile(rb"<html>"), b'<html lang="en">'),
    (re.compile(rb'(?<=<meta name="viewport" content=")[^"]*'), b"width=device-width, initial-scale=1"),
    (re.compile(rb"<v-progress-linear(?= :style)"), b'<v-progress-linear aria-label="Busy" aria-live="polite"'),
    (re.compile(rb"(?=requirejs\.config\(\{)"), WIDGETS_SCRIPT),
)


class Gate:
    """Filters requests to the server's application.

    Without a token only requests for this machine by its own name are admitted: a page elsewhere whose name is made
    to point here could otherwise read the dashboard. With a token a request may name any host, since other machines
    may use names unknown to this one. Malformed hosts are refused either way, and connections must come from the
    dashboard's own page.

    Of Solara's assets only installed files are served: Solara would request others from the internet, and delete a
    folder that is requested as if it were a file.
    """

    def __init__(self, app: Application, token: str = "", assets: Path | None = None) -> None:
        self.app, self.token, self.assets = app, token, assets

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        send = _safely(send)
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        host = headers.get("host", "")
        if not is_well_formed(scope):
            await _refuse(scope, send, 400, MALFORMED)
        elif not self.token and host_of(host) not in LOOPBACK:
            await _refuse(scope, send, 400, "This dashboard answers to 127.0.0.1 and localhost only.")
        elif "origin" in headers and not is_from(host, headers["origin"]):
            await _refuse(scope, send, 403, "Requests from other pages are refused.")
        elif not self.token or _same(cookie_of(headers.get("cookie", "")), digest_token(self.token)):
            await self._pass_on(scope, receive, send)
        else:
            await self._ask(scope, send)

    async def _pass_on(self, scope: Scope, receive: Receive, send: Send) -> None:
        if lacks_page(scope):
            await _refuse(scope, send, 400, MALFORMED)
            return
        if scope["type"] == "http" and scope["path"].startswith(PREFIX):
            await _show(scope, send)
            return
        if scope["path"].startswith(ASSETS) and not self._has(scope["path"].removeprefix(ASSETS)):
            await _refuse(scope, send, 404, "File not found.")
            return
        if scope["path"].startswith(ASSETS) and scope["path"].endswith(FONTS) and _takes_gzip(scope):
            kind = b"text/css; charset=utf-8"
            await _send(send, 200, kind, FOR_GOOD, lean_fonts(self._path(scope["path"].removeprefix(ASSETS))), PACKED)
            return
        headers = [(name, value) for name, value in scope["headers"] if not PROXY.fullmatch(name.lower())]
        if _asks_for_page(scope):  # which comes as it is written, since it is completed
            headers = [(name, value) for name, value in headers if name.lower() != b"accept-encoding"]
            send = _completely(send, packs=_takes_gzip(scope))
        await self.app({**scope, "headers": headers}, _sound(receive), send)

    def _has(self, name: str) -> bool:
        """Return whether an asset is a file that is installed."""
        if self.assets is None or "\\" in name:
            return False
        path = self._path(name)
        return path.is_relative_to(normpath(self.assets)) and isfile(path)

    def _path(self, name: str) -> Path:
        return Path(normpath(Path(self.assets or ".") / name))

    async def _ask(self, scope: Scope, send: Send) -> None:
        """Take the token from the address and remember it in a cookie, or ask for it."""
        words = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))
        if scope["type"] == "http" and _same(words.pop("token", ""), self.token):
            cookie = f"{COOKIE}={digest_token(self.token)}; Path=/; HttpOnly; SameSite=Lax"
            # Two slashes, or one and a backslash, would be another host.
            place = "/" + quote(scope["path"].lstrip("/\\")) + (f"?{urlencode(words)}" if words else "")
            await _answer(send, 303, "", [(b"location", place.encode()), (b"set-cookie", cookie.encode())])
        else:
            await _refuse(scope, send, 403, FORM)


@cache
def lean_fonts(path: Path) -> bytes:
    """Return a style sheet of fonts without those that the page does not use, compressed."""
    return gzip.compress(FACE.sub("", path.read_text(encoding="utf-8")).encode(), mtime=0)


def is_well_formed(scope: Scope) -> bool:
    """Return whether a request has one host, at most one origin, and a well-formed host and address."""
    hosts = [value.decode("latin-1") for name, value in scope["headers"] if name.lower() == b"host"]
    origins = [name for name, _ in scope["headers"] if name.lower() == b"origin"]
    address = "\0" not in scope["path"] and scope.get("query_string", b"").isascii()
    return address and len(hosts) == 1 and host_of(hosts[0]) != "" and len(origins) <= 1


def lacks_page(scope: Scope) -> bool:
    """Return whether a request lacks the page that Solara reads from it without a check."""
    words = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True))
    needs_page = scope["type"] == "websocket" or scope["path"].startswith(CLOSE)
    return needs_page and "session_id" not in words


def host_of(header: str) -> str:
    """Return the name in a Host header, without its port; empty if it is malformed."""
    match = HOST.fullmatch(header)
    if match is None or int(match[2] or 0) > LAST_PORT:
        return ""
    name = match[1].strip("[]").lower()
    if match[1].startswith("["):
        try:
            IPv6Address(name)
        except ValueError:
            return ""
    return name


def is_from(host: str, origin: str) -> bool:
    """Return whether an Origin header names a page of this host, without parsing it."""
    return origin.lower() in (f"http://{host.lower()}", f"https://{host.lower()}")


def digest_token(token: str) -> str:
    """Return the content of the cookie for a token; cookies cannot hold every character."""
    return hashlib.sha256(token.encode()).hexdigest()


def cookie_of(header: str) -> str:
    """Return the content of the dashboard's own cookie, empty without one."""
    try:
        cookie = SimpleCookie(header).get(COOKIE)
    except CookieError:
        return ""
    return cookie.value if cookie else ""


def _same(word: str, token: str) -> bool:
    return hmac.compare_digest(word.encode(), token.encode())


def _safely(send: Send) -> Send:
    """Return `send` with the headers of every answer; they replace those of the application."""
    names = {name for name, _ in SAFE}

    async def send_safely(message: Scope) -> None:
        if message["type"] in ANSWERS:
            headers = [(name, value) for name, value in message.get("headers", []) if name.lower() not in names]
            message = {**message, "headers": [*headers, *SAFE]}
        await send(message)

    return send_safely


def _asks_for_page(scope: Scope) -> bool:
    return scope["type"] == "http" and any(
        name.lower() == b"accept" and HTML in value for name, value in scope["headers"]
    )


def _completely(send: Send, *, packs: bool) -> Send:
    """Return `send` that completes pages, and compresses them if the browser takes that."""
    start: list[Scope] = []
    parts: list[bytes] = []

    async def send_completely(message: Scope) -> None:
        if message["type"] == ANSWERS[0] and _is_page(message):
            start.append(message)
        elif start and message["type"] == "http.response.body":
            parts.append(message.get("body", b""))
            if not message.get("more_body"):
                page = complete_page(b"".join(parts))
                page = gzip.compress(page, mtime=0) if packs else page
                length = b"%d" % len(page)
                headers = [
                    (name, length if name == b"content-length" else value) for name, value in start[0]["headers"]
                ]
                await send({**start[0], "headers": [*headers, *(PACKED if packs else ())]})
                await send({**message, "body": page})
        else:
            await send(message)

    return send_completely


def _is_page(message: Scope) -> bool:
    headers = dict(message.get("headers", []))
    return headers.get(b"content-type", b"").startswith(HTML) and b"content-encoding" not in headers


def complete_page(page: bytes) -> bytes:
    """Return Solara's page with what it lacks."""
    for pattern, text in COMPLETED:
        page = pattern.sub(text, page, count=1)
    return page


def _sound(receive: Receive) -> Receive:
    """Return `receive` that ends connections at a packed message with an impossible number of parts.

    Solara would allocate memory for them before checking.
    """

    async def receive_sound() -> Scope:
        message = await receive()
        content = message.get("bytes") or b""
        if content and not 1 <= int.from_bytes(content[:4], "big") < len(content) // 4:
            return {"type": "websocket.disconnect", "code": 1003}
        return message

    return receive_sound


def _takes_gzip(scope: Scope) -> bool:
    return any(name.lower() == b"accept-encoding" and b"gzip" in value for name, value in scope["headers"])


async def _show(scope: Scope, send: Send) -> None:
    """Send a picture of the gallery; its address changes with it, so that browsers may store it."""
    found = picture_at(scope["path"])
    if found is None or scope["method"] not in READING:
        await _refuse(scope, send, 404 if found is None else 405, "There is no such picture.")
        return
    content, kind = found
    length = [(b"content-length", b"%d" % len(content))]
    await _send(send, 200, kind.encode(), STORED, b"" if scope["method"] == "HEAD" else content, length)


async def _refuse(scope: Scope, send: Send, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 4403})
    else:
        await _answer(send, status, text)


async def _answer(send: Send, status: int, text: str, more: Headers = ()) -> None:
    kind = b"text/html; charset=utf-8" if text.startswith("<!") else b"text/plain; charset=utf-8"
    await _send(send, status, kind, b"no-store", text.encode(), more)


async def _send(send: Send, status: int, kind: bytes, stored: bytes, body: bytes, more: Headers = ()) -> None:
    """Send an answer of this kind, which browsers store for this long."""
    headers = [(b"content-type", kind), (b"cache-control", stored), *more]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
