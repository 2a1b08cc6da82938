"""Clients that speak HTTP badly or slowly, and pages that open without a browser."""

import json
import re
import socket
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from websockets.sync.client import ClientConnection, connect

HOST = "127.0.0.1"
# A machine that is busy answers late; a server that hangs does not answer at all.
PATIENCE = 30.0
PAGE = "a-page"
# So long clients wait that send what may have no end, before they end their half of the connection.
QUICK = 0.2


def peak_memory(process: int) -> float:
    """Return the most memory that a process had resident, in megabytes."""
    return int(re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process}/status").read_text())[1]) / 1024


def memory(process: int) -> float:
    """Return the memory that a process has resident now, in megabytes."""
    return int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{process}/status").read_text())[1]) / 1024


def threads_of(process: int) -> int:
    """Return how many threads a process has."""
    return len(list(Path(f"/proc/{process}/task").iterdir()))


def half_open(port: int, sent: bytes = b"GET / HTTP/1.1\r\nHo") -> socket.socket:
    """Return a connection on which a request was begun and not ended."""
    client = socket.create_connection((HOST, port), PATIENCE)
    client.sendall(sent)
    return client


def answered(port: int, sent: bytes, patience: float = PATIENCE) -> tuple[int, bytes]:
    """Send bytes, and return the status of the answer and all of it: 0 if the connection was closed without one.

    After `patience` the client ends its half of the connection, and waits once more.

    Raises
    ------
    TimeoutError
        If there is neither an answer nor an end.
    """
    content = b""
    with socket.create_connection((HOST, port), PATIENCE) as client, suppress(ConnectionResetError, BrokenPipeError):
        client.sendall(sent)
        client.settimeout(patience)
        while len(content) < 200_000:
            try:
                part = client.recv(65536)
            except TimeoutError:  # it waits for more: there is none
                if patience == PATIENCE:
                    raise
                patience = PATIENCE
                client.settimeout(patience)
                client.shutdown(socket.SHUT_WR)
                continue
            if not part:
                break
            content += part
    found = re.match(rb"HTTP/1\.[01] (\d{3}) ", content)
    return int(found[1]) if found else 0, content


def request(port: int, path: str = "/", method: str = "GET", host: str = "", **headers: str) -> bytes:
    """Return a request as it is sent; an underscore in a header's name is a dash."""
    lines = [f"{method} {path} HTTP/1.1", f"Host: {host or f'{HOST}:{port}'}", "Connection: close"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join([*lines, "", ""]).encode("utf-8", "surrogateescape")


def connection(
    port: int, query: str | None = None, kernel: str = "", **options
) -> AbstractContextManager[ClientConnection]:
    """Return what holds a connection to a kernel of its own, as the dashboard's page opens it."""
    address = f"ws://{HOST}:{port}/jupyter/api/kernels/{kernel or uuid4()}/channels"
    address += f"?session_id={PAGE}" if query is None else query
    given = {"origin": f"http://{HOST}:{port}", "max_size": None, "open_timeout": PATIENCE, **options}
    return connect(address, **given)


@contextmanager
def opened(port: int, query: str) -> Iterator[ClientConnection]:
    """Hold a connection on which the dashboard's page was built, as a browser has it that never draws.

    Raises
    ------
    TimeoutError
        If the page is not there in time.
    """
    comm, kernel = uuid4().hex, str(uuid4())
    arguments = {"path": f"/?{query}", "dark": False, "themes": {"light": {}, "dark": {}}}
    with connection(port, kernel=kernel) as client:
        client.send(message("comm_open", comm_id=comm, target_name="solara.control", data={}))
        client.send(message("comm_msg", comm_id=comm, data={"method": "run", "args": arguments}))
        while True:
            heard = client.recv(4 * PATIENCE)
            if '"finished"' in (heard if isinstance(heard, str) else heard.decode("utf-8", "replace")):
                break
        yield client
    answered(port, request(port, f"/_solara/api/close/{kernel}?session_id={PAGE}", "POST", content_length="0"))


def message(kind: str, **content) -> str:
    """Return one of Jupyter's messages."""
    header = {"msg_type": kind, "msg_id": uuid4().hex, "session": "s", "username": "", "version": "5.3", "date": ""}
    return json.dumps(
        {"channel": "shell", "header": header, "parent_header": {}, "metadata": {}, "content": content, "buffers": []}
    )
