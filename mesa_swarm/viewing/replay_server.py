"""The replay page on a small local server, which sends chunks of frames on request."""

import json
import secrets
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.viewing.replay_page import Reel, page_of, sources
from mesa_swarm.viewing.server_headers import safe_headers

HOST = "127.0.0.1"
TOKEN_BYTES = 18
LONGEST_PLACE = 9
BODY = ("Content-Length", "Transfer-Encoding")
HTML, JSON, BYTES, TEXT = "text/html; charset=utf-8", "application/json", "application/octet-stream", "text/plain"


class ReplayServer(ThreadingHTTPServer):
    """Serves one recording on 127.0.0.1, at an address with a random token.

    Other sites cannot read it: they do not know the token, and a foreign host name that resolves to this machine (DNS
    rebinding) is refused. `serve_forever` serves until `shutdown` or Ctrl-C.
    """

    daemon_threads = True
    # With a shorter queue, simultaneous connections would wait for seconds.
    request_queue_size = 128

    def __init__(self, reel: Reel, port: int = 0) -> None:
        self.reel = reel
        self.page = page_of({**reel.about, "embedded": False}, []).encode()
        self.safe_headers = {"Cache-Control": "no-store", **safe_headers(sources())}
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        super().__init__((HOST, port), Handler)

    @property
    def host(self) -> str:
        """Name and port, as browsers name them in their requests."""
        return f"{HOST}:{self.server_address[1]}"

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{self.host}/{self.token}/"

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore a browser that closed the connection."""


class Handler(BaseHTTPRequestHandler):
    """Answers one request: the page, a chunk, the events, and nothing else."""

    server: ReplayServer
    server_version = "mesa-swarm"
    sys_version = ""
    protocol_version = "HTTP/1.1"
    timeout = 60

    def do_GET(self) -> None:
        """Send the requested content."""
        try:
            status, kind, content = self._answer()
        except SwarmError as error:
            status, kind, content = HTTPStatus.INTERNAL_SERVER_ERROR, TEXT, str(error).encode(errors="replace")
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def end_headers(self) -> None:
        """End the headers of any answer, errors included, with those that all answers carry."""
        for name, value in self.server.safe_headers.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, *words: object) -> None:
        """Be silent: the terminal is for the user."""

    def _answer(self) -> tuple[HTTPStatus, str, bytes]:
        reel, begin = self.server.reel, f"/{self.server.token}/"
        is_known = secrets.compare_digest(self.path[: len(begin)].encode(), begin.encode())
        if any(name in self.headers for name in BODY):
            self.close_connection = True  # what follows would be read as the next request
            return HTTPStatus.BAD_REQUEST, TEXT, b"No request has a body here."
        if self.headers.get_all("Host") != [self.server.host] or not is_known:
            return HTTPStatus.FORBIDDEN, TEXT, b"This address is not the one that mesa-swarm replay has printed."
        match self.path[len(begin) :].split("/"):
            case [""]:
                return HTTPStatus.OK, HTML, self.server.page
            case ["events"]:
                return HTTPStatus.OK, JSON, json.dumps(reel.events).encode()
            case ["chunk", place] if _is_number(place) and int(place) < reel.chunks:
                return HTTPStatus.OK, BYTES, reel.chunk(int(place))
        return HTTPStatus.NOT_FOUND, TEXT, b"There is no such thing here."


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= LONGEST_PLACE
