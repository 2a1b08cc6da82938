"""replay and dashboard: pages that are served until Ctrl-C."""

import socket
import webbrowser
from pathlib import Path

import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm import dashboard as page
from mesa_swarm.base import extras
from mesa_swarm.base.extras import install_command
from mesa_swarm.viewing.replay_server import ReplayServer


def test_dashboard_is_launched_with_model_port_and_browser(typed, monkeypatch):
    calls = []
    monkeypatch.setattr(page, "launch", lambda *details: calls.append(details))
    typed("dashboard")
    typed("dashboard collision_avoidance --port 9000 --no-browser")
    typed("dashboard boids --host 0.0.0.0 --recordings .")
    assert calls == [
        ("fire_fighting", 8765, True, "127.0.0.1", None),
        ("collision_avoidance", 9000, False, "127.0.0.1", None),
        ("boids", 8765, True, "0.0.0.0", Path()),
    ]


def test_without_solara_the_dashboard_names_the_extra_to_install(typed, monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    status, out, err = typed(["dashboard", "--port", free_port()])
    assert (status, out) == (2, "")
    assert err == f"mesa-swarm: the dashboard needs Solara; install it with: {install_command('dashboard')}\n"


def free_port():
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return str(listening.getsockname()[1])


@pytest.fixture
def opened(monkeypatch):
    """Have Ctrl-C pressed at once; return the addresses at which the browser is opened."""
    addresses = []

    def interrupt(server):
        raise KeyboardInterrupt

    monkeypatch.setattr(ReplayServer, "serve_forever", interrupt)
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    return addresses


@pytest.fixture
def run(tmp_path):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, 2)
    with model.record(tmp_path / "run.arrow"):
        model.run(300)
    return tmp_path / "run.arrow"


def test_replay_opens_the_browser_at_the_printed_address_and_ctrl_c_ends_it(run, opened, typed):
    status, out, err = typed(f"replay {run}")
    assert status == 0
    assert len(opened) == 1
    assert opened[0] in out
    assert opened[0].startswith("http://127.0.0.1:")
    assert err == ""


def test_replay_without_a_browser_only_prints_the_address(run, opened, typed):
    assert "http://127.0.0.1:" in typed(f"replay {run} --no-browser")[1]
    assert opened == []


def test_replay_prints_where_a_torn_recording_ends(run, opened, typed):
    run.write_bytes(run.read_bytes()[:-500])
    status, out, _ = typed(f"replay {run}")
    assert status == 0
    assert "The recording was not closed; it is whole up to step 256." in out


@pytest.mark.parametrize("content", [b"", b"not a recording", None])
def test_a_file_that_is_not_a_recording_is_refused_in_one_line(tmp_path, opened, typed, content):
    if content is not None:
        (tmp_path / "x.arrow").write_bytes(content)
    status, _, err = typed("replay x.arrow")
    assert (status, err.count("\n")) == (2, 1)
    assert opened == []
