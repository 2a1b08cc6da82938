import webbrowser

import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.cli import main
from mesa_swarm.viewing.replay_server import ReplayServer


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


def typed(*words):
    with pytest.raises(SystemExit) as left:
        main(["replay", *map(str, words)])
    return left.value.code


def test_replay_opens_the_browser_where_it_says_and_ctrl_c_ends_it_cleanly(run, opened, capsys):
    assert typed(run) == 0
    out, err = capsys.readouterr()
    assert len(opened) == 1
    assert opened[0] in out
    assert opened[0].startswith("http://127.0.0.1:")
    assert err == ""


def test_replay_only_prints_the_address_if_so_wished(run, opened, capsys):
    assert typed(run, "--no-browser") == 0
    assert "http://127.0.0.1:" in capsys.readouterr().out
    assert opened == []


def test_replay_says_when_the_end_is_missing(run, opened, capsys):
    run.write_bytes(run.read_bytes()[:-500])
    assert typed(run) == 0
    assert "The recording was not closed; it is whole up to step 256." in capsys.readouterr().out


@pytest.mark.parametrize("content", [b"", b"not a recording", None])
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, opened, capsys, content):
    if content is not None:
        (tmp_path / "x.arrow").write_bytes(content)
    assert typed(tmp_path / "x.arrow") == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert opened == []
