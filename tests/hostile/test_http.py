"""Both servers against hostile clients: malformed, slow, endless and many, from this machine only."""

import os
import socket
import struct
import subprocess
import sys
from contextlib import ExitStack
from urllib.parse import quote, urlencode

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.dashboard.page.navigation import COUNTS, Address, address_from
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.models.fire_fighting import FireFighting
from support.clients import (
    HOST,
    QUICK,
    answered,
    connection,
    half_open,
    memory,
    message,
    opened,
    peak_memory,
    request,
    threads_of,
)
from support.hostile import attack
from support.visits import LAUNCH, answers, free_port
from support.waiting import comes_true, wait_until

pytestmark = pytest.mark.slow

REPLAY = """
import sys
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.replay_page import Reel
from mesa_swarm.viewing.replay_server import ReplayServer
with ReplayServer(Reel(Recording(sys.argv[1]))) as server:
    print(server.address, flush=True)
    server.serve_forever()
"""
GOAL = 500
SAFE = (b"content-security-policy:", b"x-frame-options: deny", b"x-content-type-options: nosniff", b"referrer-policy:")


class Served:
    """A server in a process of its own: its port, and an address that it answers well."""

    def __init__(self, process: subprocess.Popen, port: int, path: str) -> None:
        self.process, self.port, self.path = process, port, path

    def is_well(self) -> bool:
        return answered(self.port, request(self.port, self.path))[0] == 200


@pytest.fixture(scope="module")
def assets(tmp_path_factory):
    """A folder of assets like Solara's, for those are deleted if an attack succeeds."""
    place = tmp_path_factory.mktemp("cdn")
    (place / "pkg@1.0.0" / "dist").mkdir(parents=True)
    (place / "pkg@1.0.0" / "dist" / "x.js").write_text("1")
    return place


@pytest.fixture(scope="module")
def dashboard(assets):
    port = free_port()
    settings = {**os.environ, "SOLARA_ASSETS_PROXY_CACHE_DIR": str(assets)}
    process = subprocess.Popen(
        [sys.executable, "-c", LAUNCH, str(port)], env=settings, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        wait_until(lambda: answers(port), 90)
        yield Served(process, port, "/readyz")
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "run.arrow"
    model = FireFighting(n_robots=5, rng=1)
    with model.record(path):
        model.run(50)
    with subprocess.Popen([sys.executable, "-c", REPLAY, str(path)], stdout=subprocess.PIPE, text=True) as process:
        try:
            _, _, place, token, _ = process.stdout.readline().strip().split("/")
            yield Served(process, int(place.rpartition(":")[2]), f"/{token}/")
        finally:
            process.kill()


@pytest.fixture(params=["dashboard", "replay"])
def served(request):
    return request.getfixturevalue(request.param)


def judged(tally, served, requests, refused=()):
    """Count each request: an answer of the server's own or an end, never an error of the server's; then it is well."""
    for name, content in requests:
        try:
            status, text = answered(served.port, content, QUICK)
        except TimeoutError:
            tally.check(name, False, "neither an answer nor an end")
            continue
        safe = not status or status == 400 or all(one in text.lower() for one in SAFE)
        good = status in range(400, 500) or status == 0 if name in refused else status < 500 or status in (501, 505)
        secret = b"root:x:" in text
        tally.check(name, good and safe and not secret, f"{status}, safe headers {safe}, secret {secret}")
    tally.check("after it", served.is_well(), "it answers no more")


HOSTS = ["[::1", "[::1]x", "[", "]", "", " ", "a b", "evil.example", "127.0.0.1@evil.example", "evil.example:80"]
HOSTS += ["127.0.0.1:", "127.0.0.1:99999999", "127.0.0.1.evil.example", "é", "\udcff", "x" * 10_000, "127.0.0.1,a"]
ORIGINS = ["null", "", "//", "http://", "https://[", "http://\udcff", "file://", "a" * 10_000, "javascript:alert(1)"]


def test_no_host_or_origin_is_an_error_of_the_servers(served, tally):
    port = served.port
    begin, end = f"GET {served.path} HTTP/1.1\r\n".encode(), b"Connection: close\r\n\r\n"
    own = f"Host: {HOST}:{port}\r\n".encode()
    named = [(f"host {host[:20]!r}", request(port, served.path, host=host)) for host in HOSTS if host]
    named += [
        ("no host", begin + end),
        ("empty host", begin + b"Host:\r\n" + end),
        ("two hosts", begin + own + own + end),
    ]
    refused = [name for name, _ in named]
    if served.path == "/readyz":  # the replay page is known by its token, whatever page asks
        origins = [*ORIGINS, *(f"http://{host}" for host in HOSTS)]
        named += [(f"origin {origin[:20]!r}", request(port, served.path, origin=origin)) for origin in origins]
        line = f"Origin: http://{HOST}:{port}\r\n".encode()
        named += [("two origins", begin + own + line + line + end)]
        refused = [name for name, _ in named]
    judged(tally("HTTP: Host and Origin"), served, named, refused)


UP = ["../", "..%2f", "%2e%2e/", "..%5c", "..\\", "....//", "%252e%252e/", "..;/", "..%c0%af", "..%00/"]
PLACES = ["/", "/static/", "/static/public/", "/static/assets/", "/jupyter/nbextensions/", "/_solara/cdn/", "/gallery/"]


def test_no_path_leads_out_of_what_is_served(served, tally, assets):
    paths = [f"{place}{up * 12}etc/passwd" for place in [*PLACES, served.path] for up in UP]
    paths += [
        "//etc/passwd",
        "/static/%00",
        "/%ff%fe",
        "/static/" + "a" * 5000,
        "/x" * 3000,
        "/?v=%ff",
        "/static/x?v=\udcff",
    ]
    paths += [
        f"/_solara/cdn/{name}" for name in ("", ".", "pkg@1.0.0", "pkg@1.0.0/dist", "pkg@1.0.0/", "none@1/x.js", "x")
    ]
    paths += ["http://evil.example/", "*", "", "?", "#", "/resourcez?verbose", f"{served.path}chunk/{'9' * 4000}"]
    named = [(path[:60], request(served.port, path)) for path in paths]
    posts = ("/_solara/api/close/x", "/_solara/api/evict/x", "/", served.path)
    named += [(f"POST {path}", request(served.port, path, "POST", content_length="0")) for path in posts]
    judged(tally("HTTP: paths"), served, named)
    assert (assets / "pkg@1.0.0" / "dist" / "x.js").exists()


def framed(served):
    """Return requests of which the end, the length or the form is in doubt."""
    own = f"Host: {HOST}:{served.port}\r\n".encode()
    head = f"{served.path} HTTP/1.1\r\n".encode() + own
    lines = [b"Content-Length: 5\r\nContent-Length: 6", b"Content-Length: 5\r\nTransfer-Encoding: chunked"]
    lines += [
        b"Content-Length: -1",
        b"Content-Length: x",
        b"Content-Length: " + b"9" * 5000,
        b"Content-Length: 99999999999",
    ]
    lines += [
        b"Transfer-Encoding: chunked, gzip",
        b"Transfer-Encoding: \x0bchunked",
        b"No colon",
        b" folded",
        b": empty",
    ]
    lines += [b"A: \0", b"A\0: b", b"Long: " + b"x" * 200_000, b"\r\n".join(b"H%d: 1" % k for k in range(2000))]
    lines += [
        b"Expect: 100-continue\r\nContent-Length: 5",
        b"Upgrade: websocket",
        b"Upgrade: h2c\r\nConnection: Upgrade",
    ]
    lines += [b"Cookie: " + b'=;"' * 3000, b"Connection: \xff", b"X-Forwarded-Proto: ftp\r\nX-Forwarded-Host: a:b"]
    for line in lines:
        yield line[:50].decode("latin-1"), b"GET " + head + line + b"\r\n\r\n"
    for size in (b"F" * 40, b"-1", b"zz", b"5;" + b"x" * 50_000):
        yield f"chunk {size[:9]!r}", b"POST " + head + b"Transfer-Encoding: chunked\r\n\r\n" + size + b"\r\nhello\r\n"
    for method in (b"get", b"TRACE", b"CONNECT", b"PRI", b"X" * 70_000, b"G\0T", b"\xff", b""):
        yield f"method {method[:9]!r}", method + b" " + head + b"\r\n"
    for version in (b"HTTP/0.9", b"HTTP/2.0", b"HTTP/9999.1", b"HTTP/1.1 x", b"HTTPS/1.1", b""):
        yield f"version {version!r}", b"GET / " + version + b"\r\n" + own + b"\r\n"
    yield "a hundred at once", b"".join([b"GET " + head + b"\r\n"] * 100)
    yield "nothing", b"\r\n" * 1000
    yield "TLS", bytes.fromhex("16030100a5010000a10303") + bytes(160)
    yield (
        "a request in a body",
        b"GET " + head + b"Content-Length: 40\r\n\r\nGET /secret HTTP/1.1\r\nHost: evil\r\n\r\n",
    )


def test_no_framing_is_an_error_of_the_servers(served, tally, amount):
    rng = np.random.default_rng(1)
    good = request(served.port, served.path, cookie="a=b", accept="*/*")
    noise = [(f"mutated {k}", mutated(good, rng)) for k in range(amount(10, 500))]
    judged(tally("HTTP: framing"), served, [*framed(served), *noise])


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Return a request with a few bytes replaced, dropped or doubled; it ends as requests do."""
    letters = bytearray(content[:-4])
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(len(letters)))
        letters[at : at + int(rng.integers(3))] = rng.integers(0, 256, rng.integers(3), np.uint8).tobytes()
    return bytes(letters) + b"\r\n\r\n"


def test_slow_clients_keep_no_other_waiting(served, tally, amount):
    slow, most = tally("HTTP: slow clients"), amount(100, 200)
    before = memory(served.process.pid)
    with ExitStack() as stack:
        clients = [stack.enter_context(half_open(served.port)) for _ in range(most)]
        for letter in (b"s", b"t", b":", b" "):
            for client in clients:
                client.sendall(letter)
            slow.check(f"others after {letter!r}", served.is_well(), "no answer meanwhile")
        grown = memory(served.process.pid) - before
        slow.check("memory", grown < 100, f"{grown:.0f} MB for {most} connections")
    slow.check("after it", served.is_well(), "no answer after")


def test_an_endless_upload_is_ended_and_takes_no_memory(served, tally):
    endless, before = tally("HTTP: endless uploads"), memory(served.process.pid)
    for header in (b"Transfer-Encoding: chunked", b"Content-Length: 99999999999"):
        head = f"POST {served.path} HTTP/1.1\r\nHost: {HOST}:{served.port}\r\n".encode() + header + b"\r\n\r\n"
        sent, piece = 0, b"10000\r\n" + bytes(0x10000) + b"\r\n"
        with half_open(served.port, head) as client:
            client.settimeout(2)
            try:
                while sent < 50_000_000:
                    sent += client.send(piece)
            except (OSError, TimeoutError):
                pass
        grown = memory(served.process.pid) - before
        endless.check(header.decode(), grown < 50, f"{grown:.0f} MB more after {sent:,} bytes")
    endless.check("after it", served.is_well(), "no answer after")


WRONG = [
    "",
    "nan",
    "inf",
    "-1",
    "1e400",
    "9" * 3000,
    "\u0663",
    "\u00b2",
    "../../etc/passwd",
    "<img src=x onerror=1>",
    "\0",
]
WRONG += [
    "None",
    "[]",
    "a\nb",
    "%00",
    "é" * 500,
    "1e-400",
    "0x10",
    " 5 ",
    "'",
    "\U0001f916",
    "True",
    "1_000",
    "-0",
    "5;6",
]


def wrong_links(number: int):
    """Yield links with a wrong value of each parameter of each model, and of some at once."""
    rng = np.random.default_rng(3)
    for _ in range(number):
        model = rng.choice(model_names())
        names = [*parameters_of(find_model(model)), *COUNTS, "model", "token", "__class__", "rng", "\u202e"]
        chosen = rng.choice(names, rng.integers(1, 6))
        words = [("model", model), *((name, rng.choice(WRONG)) for name in chosen)]
        text = urlencode(words) if rng.random() < 0.7 else "&".join(f"{name}={value}" for name, value in words)
        yield text if rng.random() < 0.9 else text[: rng.integers(len(text))] + chr(rng.integers(1, 0xD7FF))


def test_links_with_wrong_values_are_taken_as_far_as_they_are_right(tally, amount):
    def work(query):
        found = address_from(query, "boids")
        assert isinstance(found, Address)
        assert found.model in model_names()
        assert all(len(fault) <= 300 and "\n" not in fault for fault in found.faults)

    links = [(query[:80], query) for query in wrong_links(amount(1000, 20_000))]
    tally("links: wrong values").add(attack(work, links, refusals=SwarmError, cpu=2, memory=GOAL))


def test_links_with_wrong_values_open_pages(dashboard, tally, amount):
    served, area = dashboard, tally("HTTP: links with wrong values")
    for query in wrong_links(amount(20, 1000)):
        status, text = answered(served.port, request(served.port, f"/?{quote(query, safe='=&%')}"))
        area.check(query[:80], status == 200 and b"onerror=1" not in text, str(status))
    for query in wrong_links(amount(4, 40)):
        try:
            with opened(served.port, query):
                pass
            area.check(query[:80], True)
        except (TimeoutError, ConnectionClosed) as error:
            area.check(query[:80], False, repr(error))


def test_connections_that_talk_nonsense_end_alone(dashboard, tally):
    served, area = dashboard, tally("HTTP: websocket misuse")
    before = peak_memory(served.process.pid)
    for options in ({"origin": "http://evil.example"}, {"origin": "http://[::1"}, {"origin": "null"}, {"query": ""}):
        try:
            with connection(served.port, **options):
                area.check(str(options), False, "it was let in")
        except (InvalidStatus, ConnectionClosed, EOFError):
            area.check(str(options), True)
    nonsense = [
        "",
        "{",
        "[]",
        "1",
        "null",
        "{}",
        '{"header": {}}',
        message("none"),
        message("comm_msg", comm_id="none"),
    ]
    nonsense += [message("comm_open", comm_id="a", target_name="os"), message("shutdown_request"), "[" * 100_000]
    nonsense += [struct.pack("!i", number) for number in (2**31 - 1, -1, 0, 1)] + [b"", b"\xff", bytes(3_000_000)]
    nonsense += ["x" * 5_000_000, struct.pack("!iI", 1, 2**32 - 1)]
    for sent in nonsense:
        try:
            with connection(served.port) as client:
                client.send(sent)
                client.send(message("kernel_info_request"))
        except ConnectionClosed:
            pass
        area.check(repr(sent[:40]), served.is_well(), "no answer after")
    grown = peak_memory(served.process.pid) - before
    area.check("memory", grown < 150, f"{grown:.0f} MB more")
    try:
        with opened(served.port, "model=boids"):
            pass
        area.check("a page after it", True)
    except (TimeoutError, ConnectionClosed) as error:
        area.check("a page after it", False, repr(error))


def test_many_sessions_at_once_end_with_their_threads(dashboard, tally, amount, capsys):
    served, area, most = dashboard, tally("HTTP: sessions at once"), amount(6, 45)
    process = served.process.pid
    with opened(served.port, "model=fire_fighting"):
        pass
    before, threads = memory(process), threads_of(process)
    with ExitStack() as stack:
        for number in range(most):
            try:
                stack.enter_context(opened(served.port, f"model=fire_fighting&seed={number}"))
                area.check(f"session {number}", True)
            except (TimeoutError, ConnectionClosed) as error:
                area.check(f"session {number}", False, repr(error))
        each = (memory(process) - before) / most
        area.check("after it", served.is_well(), "no answer meanwhile")

    def ended():
        # Idle threads of the server's pool end ten seconds later, when another connection comes.
        with opened(served.port, "model=boids"):
            pass
        return threads_of(process) <= threads + 2

    area.check("threads", comes_true(ended, 60.0, every=3.0), f"{threads_of(process)} threads, {threads} before")
    with capsys.disabled():
        print(f"\n{most} sessions: {each:.1f} MB each, at most {peak_memory(process):.0f} MB in all")


def test_servers_stay_below_the_goal_of_memory(served, tally):
    peak = peak_memory(served.process.pid)
    area = tally(f"HTTP: memory of the {'dashboard' if served.path == '/readyz' else 'replay server'}")
    area.megabytes = peak
    area.check("peak", peak < GOAL or served.path == "/readyz", f"{peak:.0f} MB")
    with pytest.raises(ConnectionRefusedError), socket.create_connection(("127.0.0.2", served.port), 1):
        pass  # it listens on 127.0.0.1 alone
