"""Pages that are served to the browser until Ctrl-C: replay, dashboard."""

from pathlib import Path
from typing import Annotated

import typer

from mesa_swarm.cli.options import NoBrowser, RecordingFile, known_model

commands = typer.Typer()


@commands.command("replay")
def replay_command(
    file: RecordingFile,
    *,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Where the page is served; 0 is any free one.")] = 0,
    no_browser: NoBrowser = False,
) -> None:
    """Play a recording in the browser: at any speed, forwards and backwards, from event to event."""
    import webbrowser

    from mesa_swarm.recording.recording import Recording
    from mesa_swarm.viewing.replay_page import Reel
    from mesa_swarm.viewing.replay_server import ReplayServer

    reel = Reel(Recording(file))
    with ReplayServer(reel, port) as server:
        for note in reel.about["notes"]:
            print(note)
        print(f"{file} plays at {server.address} (Ctrl-C ends it)", flush=True)
        if not no_browser:
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print("ended")


@commands.command("dashboard")
def dashboard_command(
    model: Annotated[
        str, typer.Argument(callback=known_model, metavar="[MODEL]", help="The model to show first.")
    ] = "fire_fighting",
    *,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Where the page is served.")] = 8765,
    host: Annotated[
        str, typer.Option(help="Address to listen on; all but this machine's own require a token, which is printed.")
    ] = "127.0.0.1",
    recordings: Annotated[
        Path | None, typer.Option(metavar="PATH", help="A recording, or a folder of them, to replay on the page.")
    ] = None,
    no_browser: NoBrowser = False,
) -> None:
    """Look at a model in the browser."""
    from mesa_swarm.dashboard import launch

    launch(model, port, not no_browser, host, recordings)
