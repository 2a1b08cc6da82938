"""Who may come in: whoever knows the token, and on this machine nobody who was sent by another page."""

import hashlib
import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

# As ASGI has them.
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Scope]]
Send = Callable[[Scope], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]

COOKIE = "mesa_swarm_token"
LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
FORM = """<!doctype html><html lang="en"><meta charset="utf-8"><title>mesa_swarm</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:32em;margin:15vh auto;padding:0 1em}
input,button{font:inherit;padding:.4em .8em}</style>
<h1>mesa_swarm</h1><p>This dashboard asks for a token. It was printed where the dashboard was started.</p>
<form><label>Token <input name="token" type="password" autofocus></label> <button>Enter</button></form></html>"""
OTHER_HOST = "This dashboard answers to 127.0.0.1 and localhost only."
OTHER_PAGE = "Another page may not talk to this dashboard."


class Gate:
    """Stands before the server's application, and lets in whom it may.

    Without a token only requests for this machine by its own name are let in: a page elsewhere whose name is made
    to point here would otherwise read what the dashboard says. Connections must come from the dashboard's own page.

    Parameters
    ----------
    app : ASGI application
    token : str
        What must be known, empty for nothing.
    """

    def __init__(self, app: Application, token: str = "") -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if not self.token and host_of(headers.get("host", "")) not in LOOPBACK:
            await _refuse(scope, send, 400, OTHER_HOST)
        elif "origin" in headers and urlsplit(headers["origin"]).netloc != headers.get("host", ""):
            await _refuse(scope, send, 403, OTHER_PAGE)
        elif not self.token or _same(cookie_of(headers.get("cookie", "")), mark_of(self.token)):
            await self.app(scope, receive, send)
        else:
            await self._ask(scope, send)

    async def _ask(self, scope: Scope, send: Send) -> None:
        """Take the token from the address and remember it in a cookie, or ask for it."""
        words = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))
        if scope["type"] == "http" and _same(words.pop("token", ""), self.token):
            cookie = f"{COOKIE}={mark_of(self.token)}; Path=/; HttpOnly; SameSite=Lax"
            # Two slashes, or one and a backslash, would be another host.
            place = "/" + quote(scope["path"].lstrip("/\\")) + (f"?{urlencode(words)}" if words else "")
            await _answer(send, 303, "", [(b"location", place.encode()), (b"set-cookie", cookie.encode())])
        else:
            await _refuse(scope, send, 403, FORM)


def host_of(header: str) -> str:
    """Return the name in a Host header, without its port.

    Examples
    --------
    >>> host_of("localhost:8765"), host_of("[::1]:8765"), host_of("bad host:x")
    ('localhost', '::1', '')
    """
    try:
        return urlsplit(f"//{header}").hostname or "" if " " not in header else ""
    except ValueError:
        return ""


def mark_of(token: str) -> str:
    """Return what is kept in a cookie by whoever knows a token; cookies cannot hold every letter.

    Examples
    --------
    >>> mark_of("secret")[:8]
    '2bb80d53'
    """
    return hashlib.sha256(token.encode()).hexdigest()


def cookie_of(header: str) -> str:
    """Return what the dashboard's own cookie holds, empty if there is none.

    Examples
    --------
    >>> cookie_of("a=1; mesa_swarm_token=0a1b")
    '0a1b'
    """
    try:
        found = SimpleCookie(header).get(COOKIE)
    except CookieError:
        return ""
    return found.value if found else ""


def _same(word: str, wanted: str) -> bool:
    return hmac.compare_digest(word.encode(), wanted.encode())


async def _refuse(scope: Scope, send: Send, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 4403})
    else:
        await _answer(send, status, text)


async def _answer(send: Send, status: int, text: str, more: list[tuple[bytes, bytes]] | None = None) -> None:
    kind = b"text/html; charset=utf-8" if text.startswith("<!") else b"text/plain; charset=utf-8"
    headers = [(b"content-type", kind), (b"cache-control", b"no-store"), *(more or [])]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text.encode()})
