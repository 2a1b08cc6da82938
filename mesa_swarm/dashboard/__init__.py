"""A page in the browser on which one plays a model: `launch` serves it, `dashboard/app.py` is it."""

import os
import socket
import warnings
from contextlib import suppress
from importlib.util import find_spec

from mesa_swarm.errors import SwarmError, check_choice, check_count
from mesa_swarm.gallery import model_names

# What the page shows first if nobody says otherwise.
FIRST = "fire_fighting"
HOST = "127.0.0.1"
MODEL_VARIABLE = "MESA_SWARM_MODEL"


def launch(model_name: str = FIRST, port: int = 8765, open_browser: bool = True) -> None:
    """Serve the dashboard on this machine until interrupted.

    Parameters
    ----------
    model_name : str
        The model that is shown first.
    port : int
        Of 127.0.0.1, 1 to 65535.
    open_browser : bool
        Whether to open the page in the user's browser.

    Raises
    ------
    SwarmError
        If the model is unknown, the port is taken, or Solara is not installed.
    """
    check_choice("model", model_name, model_names())
    _check_port(check_count("port", port, minimum=1, maximum=65535))
    if find_spec("solara") is None:
        raise SwarmError("the dashboard needs Solara; install it with: pip install 'mesa-swarm[dashboard]'")
    from click import Abort  # noqa: PLC0415 - comes with Solara
    from solara.__main__ import cli  # noqa: PLC0415 - heavy, and optional

    os.environ[MODEL_VARIABLE] = model_name
    # It says so of every plain http page that is not called localhost.
    warnings.filterwarnings("ignore", message="Cookies with samesite=none", category=UserWarning)
    browser = "--open" if open_browser else "--no-open"
    place = ["--host", HOST, "--port", str(port), browser]
    with suppress(Abort):  # Ctrl-C
        cli(["run", "mesa_swarm.dashboard.app", *place, "--production", "--no-check-version"], standalone_mode=False)


def _check_port(port: int) -> None:
    """Refuse a port on which something else listens."""
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, port))
        except OSError as error:
            reason = error.strerror or error
            raise SwarmError(f"port {port} of {HOST} cannot be used ({reason}); give another one") from None
