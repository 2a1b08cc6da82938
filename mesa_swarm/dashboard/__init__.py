"""The page in the browser that plays models: `launch` serves what `dashboard/app.py` shows."""

import os
import secrets
import socket
import threading
import time
import warnings
import webbrowser
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from mesa_swarm.base.errors import SwarmError, UnknownNameError, check_choice, check_count, shortened
from mesa_swarm.base.extras import require_extra
from mesa_swarm.model.gallery import find_model, gallery_names, is_address, model_names

if TYPE_CHECKING:
    import uvicorn

    from mesa_swarm.dashboard.gate import Gate

# The model shown first by default.
FIRST = "fire_fighting"
HOST = "127.0.0.1"
HERE = (HOST, "localhost", "::1")
MODEL_VARIABLE = "MESA_SWARM_MODEL"
RECORDINGS_VARIABLE = "MESA_SWARM_RECORDINGS"
TOKEN_VARIABLE = "MESA_SWARM_TOKEN"
# Files are sent in pieces of 1 MB.
LARGEST_MESSAGE = 4_000_000


def launch(
    model_name: str = FIRST,
    port: int = 8765,
    open_browser: bool = True,
    host: str = HOST,
    recordings: str | os.PathLike[str] | None = None,
) -> None:
    """Serve the dashboard of all models, and of the one at this name or address, until interrupted.

    On a host other than 127.0.0.1, this machine's own, the page asks for a token, which is printed; the environment
    variable MESA_SWARM_TOKEN chooses it. All users of the page may replay `recordings`, a recording or a folder of
    them.
    """
    find_model(model_name)  # now, since no link makes the page import anything
    _check_port(host, check_count("port", port, minimum=1, maximum=65535))
    require_extra("solara", "dashboard", "the dashboard needs", "Solara")
    os.environ[MODEL_VARIABLE] = model_name
    if recordings is not None:
        os.environ[RECORDINGS_VARIABLE] = str(_checked_place(recordings))
    # This warning concerns every plain http page that is not called localhost.
    warnings.filterwarnings("ignore", message="Cookies with samesite=none", category=UserWarning)
    token = "" if host in HERE else os.environ.get(TOKEN_VARIABLE) or secrets.token_urlsafe(24)
    application = guard_server(token)
    name = socket.gethostname() if token else f"[{host}]" if ":" in host else host
    address = f"http://{name}:{port}/" + (f"?token={token}" if token else "")
    print(f"mesa-swarm: the dashboard is at {address} (Ctrl-C ends it)", flush=True)
    _serve(application, host, port, address if open_browser else "")


def page_models() -> list[str]:
    """Return the names of the page's models: all that can be loaded, and the address that the server was given."""
    first = os.environ.get(MODEL_VARIABLE, FIRST)
    return sorted([*gallery_names(), *_usable(tuple(model_names()))]) + [first] * is_address(first)


def check_page_model(name: str) -> str:
    """Return the name of a model of the page; a link never makes it import another one."""
    if is_address(name) and name not in page_models():
        text = f"model {shortened(name)} was not given to this dashboard, and a link imports none; start it with: "
        raise UnknownNameError(f"{text}mesa-swarm dashboard ADDRESS")
    return check_choice("model", name, page_models())


@cache
def _usable(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return those names of models of installed packages whose models can be loaded."""
    return tuple(name for name in names if name not in gallery_names() and _loads(name))


def _loads(name: str) -> bool:
    try:
        find_model(name)
    except SwarmError:
        return False
    return True


def _serve(application: "Gate", host: str, port: int, address: str) -> None:
    """Serve until Ctrl-C; open the address, if there is one, as soon as it answers."""
    import uvicorn  # noqa: PLC0415 - comes with Solara

    # Packing frames smaller costs more time than sending them as they are.
    options: dict = {"ws_per_message_deflate": False, "ws_max_size": LARGEST_MESSAGE}
    server = uvicorn.Server(uvicorn.Config(application, host=host, port=port, log_level="warning", **options))
    if address:
        threading.Thread(target=_open_when_served, args=(server, address), daemon=True).start()
    with suppress(KeyboardInterrupt):
        server.run()


def _open_when_served(server: "uvicorn.Server", address: str) -> None:
    while not server.started and not server.should_exit:
        time.sleep(0.1)
    webbrowser.open(address)


def guard_server(token: str) -> "Gate":
    """Return Solara's server behind the gate, which requires this token of requests unless it is empty."""
    os.environ["SOLARA_APP"] = "mesa_swarm.dashboard.app"  # which the server reads when it is imported
    from solara.server import settings  # noqa: PLC0415 - heavy, and optional
    from solara.server.starlette import app  # noqa: PLC0415 - heavy, and optional

    from mesa_swarm.dashboard.gate import Gate  # noqa: PLC0415 - beside what it guards

    # Otherwise the first request would set the path of all pages.
    settings.main.root_path = settings.main.root_path or ""
    return Gate(app, token, settings.assets.proxy_cache_dir)


def _checked_place(recordings: str | os.PathLike[str]) -> Path:
    place = Path(recordings).absolute()
    if not place.exists():
        raise SwarmError(f"{recordings} does not exist; expected a recording or a folder of recordings")
    return place


def _check_port(host: str, port: int) -> None:
    """Refuse an address or a port that cannot be listened on."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
        except OSError as error:
            reason = error.strerror or error
            raise SwarmError(f"port {port} of {host} cannot be used ({reason}); give another one") from None
