"""A page in the browser on which one plays a model: `launch` serves it, `dashboard/app.py` is it."""

import os
import secrets
import socket
import sys
import warnings
from contextlib import suppress
from importlib.util import find_spec

from mesa_swarm.errors import SwarmError, check_choice, check_count
from mesa_swarm.gallery import model_names

# What the page shows first if nobody says otherwise.
FIRST = "fire_fighting"
HOST = "127.0.0.1"
HERE = (HOST, "localhost", "::1")
MODEL_VARIABLE = "MESA_SWARM_MODEL"
APP = "mesa_swarm.dashboard.app"


def launch(model_name: str = FIRST, port: int = 8765, open_browser: bool = True, host: str = HOST) -> None:
    """Serve the dashboard until interrupted.

    Parameters
    ----------
    model_name : str
        The model that is shown first.
    port : int
        1 to 65535.
    open_browser : bool
        Whether to open the page in the user's browser.
    host : str
        The address to listen on. On any but this machine's own, 127.0.0.1, the page asks for a token, which is
        printed; set the environment variable MESA_SWARM_TOKEN to choose it.

    Raises
    ------
    SwarmError
        If the model is unknown, the port is taken, or Solara is not installed.
    """
    check_choice("model", model_name, model_names())
    _check_port(host, check_count("port", port, minimum=1, maximum=65535))
    if find_spec("solara") is None:
        raise SwarmError("the dashboard needs Solara; install it with: pip install 'mesa-swarm[dashboard]'")
    from click import Abort  # noqa: PLC0415 - comes with Solara
    from solara.__main__ import cli  # noqa: PLC0415 - heavy, and optional

    os.environ[MODEL_VARIABLE] = model_name
    # It says so of every plain http page that is not called localhost.
    warnings.filterwarnings("ignore", message="Cookies with samesite=none", category=UserWarning)
    token = "" if host in HERE else os.environ.get("MESA_SWARM_TOKEN") or secrets.token_urlsafe(24)
    _stand_guard(token)
    if token:
        print(f"mesa-swarm: open http://{socket.gethostname()}:{port}/?token={token}", file=sys.stderr, flush=True)
    browser = "--open" if open_browser and not token else "--no-open"
    place = ["--host", host, "--port", str(port), browser]
    with suppress(Abort):  # Ctrl-C
        cli(["run", APP, *place, "--production", "--no-check-version"], standalone_mode=False)


def _stand_guard(token: str) -> None:
    """Put the gate before Solara's server."""
    os.environ["SOLARA_APP"] = APP  # which the server reads when it is imported
    from solara.server.starlette import app  # noqa: PLC0415 - heavy, and optional

    from mesa_swarm.dashboard.gate import Gate  # noqa: PLC0415 - beside what it guards

    app.add_middleware(Gate, token=token)


def _check_port(host: str, port: int) -> None:
    """Refuse an address or a port on which one cannot listen."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
        except OSError as error:
            reason = error.strerror or error
            raise SwarmError(f"port {port} of {host} cannot be used ({reason}); give another one") from None
