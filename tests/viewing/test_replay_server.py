import http.client
import threading

import pytest

from mesa_swarm.recording import Recording
from mesa_swarm.viewing.replay_page import Reel
from mesa_swarm.viewing.replay_server import ReplayServer
from support.unpacking import unpacked_chunk


@pytest.fixture(scope="module")
def server(fires):
    with ReplayServer(Reel(Recording(fires))) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(server, path, host=None, method="GET"):
    connection = http.client.HTTPConnection(server.host, timeout=60)
    connection.request(method, path, headers={"Host": host or server.host})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def test_it_serves_the_page_the_chunks_and_the_events(server):
    answer, page = ask(server, f"/{server.token}/")
    assert (answer.status, page.startswith(b"<!doctype html>")) == (200, True)
    assert b'id="chunk-' not in page
    chunk = ask(server, f"/{server.token}/chunk/1")[1]
    assert unpacked_chunk(chunk, server.reel.about["world"])[0][0] == 257
    assert ask(server, f"/{server.token}/events")[1].startswith(b"[{")


def test_it_answers_only_requests_with_the_token_and_its_own_name(server):
    for path in (
        "/",
        "/chunk/0",
        "/wrong/",
        f"/{server.token[:-1]}/",
        f"/{server.token}",
        "/\xe9".encode().decode("latin1"),
    ):
        assert ask(server, path.encode("ascii", "ignore").decode())[0].status == 403
    for host in ("evil.example", "localhost:80", f"evil.example:{server.server_address[1]}"):
        answer, content = ask(server, f"/{server.token}/", host)
        assert (answer.status, b"html" in content) == (403, False)


def test_it_has_nothing_else_and_changes_nothing(server):
    for path in ("chunk/2", "chunk/-1", "chunk/x", "chunk/", "chunk/99999999999999", "../", "player.js", "chunk/0/1"):
        assert ask(server, f"/{server.token}/{path}")[0].status == 404
    for method in ("POST", "PUT", "DELETE"):
        assert ask(server, f"/{server.token}/", method=method)[0].status == 501


def test_other_sites_may_not_show_or_read_it(server):
    answer, _ = ask(server, f"/{server.token}/")
    assert answer.getheader("Access-Control-Allow-Origin") is None
    assert answer.getheader("X-Frame-Options") == "DENY"
    assert answer.getheader("Cache-Control") == "no-store"
    assert answer.getheader("Referrer-Policy") == "no-referrer"


def test_it_listens_on_this_machine_only(server):
    assert server.server_address[0] == "127.0.0.1"
