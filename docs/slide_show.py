"""Slides of a lecture: a page made of Markdown, with a slide after each line of three dashes."""

from pathlib import Path

from markdown import markdown

FOLDER = Path(__file__).with_name("lecture")

EXTENSIONS = ["pymdownx.superfences", "pymdownx.highlight", "sane_lists"]
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}
</style>
{slides}
<script>
{script}
</script>
</html>
"""


def slide_show(text: str) -> str:
    """Return a page with the slides of a text."""
    parts = [markdown(part, extensions=EXTENSIONS) for part in text.split("\n---\n")]
    title = text.partition("\n")[0].lstrip("# ")
    style, script = ((FOLDER / f"slides.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    return PAGE.format(
        title=title, style=style, script=script, slides="\n".join(f"<section>\n{part}\n</section>" for part in parts)
    )
