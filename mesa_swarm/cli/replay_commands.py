"""What the command `replay` does with what was typed."""

import webbrowser
from pathlib import Path

from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing.replay_page import Reel
from mesa_swarm.viewing.replay_server import ReplayServer


def replay(file: Path, *, port: int, browser: bool) -> None:
    """Serve the page that plays a recording until Ctrl-C, and open the browser on it if wished."""
    reel = Reel(Recording(file))
    with ReplayServer(reel, port) as server:
        for note in reel.about["notes"]:
            print(note)
        print(f"{file} plays at {server.address} (Ctrl-C ends it)", flush=True)
        if browser:
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print("ended")
