"""The gallery of models: pictures that lead to the models' pages."""

from html import escape
from pathlib import Path

from mesa_swarm.dashboard.gallery.gallery_pictures import moving_of, still_of
from mesa_swarm.gallery import description, find_model, gallery_names


def gallery_page() -> str:
    """Return the page as Markdown."""
    cards = "\n".join(map(_card, gallery_names()))
    return f"""# Models

Each model is one short file in `models/`, opens in the dashboard, and runs in every command. A picture moves while you
point at it; its page has a recorded run, parameters, settings to try, equations, a description, and the code.

<div class="gallery">
{cards}
</div>
"""


def _card(name: str) -> str:
    title, about = name.replace("_", " ").capitalize(), escape(description(find_model(name)))
    still = f'<img src="pictures/{name}.svg" alt="">'
    moving = f'<img class="moving" src="pictures/{name}_moving.svg" alt="" loading="lazy">'
    return f'<a class="card" href="{name}/">{still}{moving}<strong>{title}</strong><span>{about}</span></a>'


def write_pictures(folder: Path) -> None:
    """Write the pictures at rest and the moving ones."""
    (folder / "pictures").mkdir()
    for name in gallery_names():
        (folder / "pictures" / f"{name}.svg").write_bytes(still_of(name)[0])
        (folder / "pictures" / f"{name}_moving.svg").write_bytes(moving_of(name)[0])
