"""A hook of MkDocs for notebook pages: resolve links to pages, and show pictures in place of widgets."""

import logging
import os
import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

LINK = re.compile(r'(?<= href=")(?P<path>[^":#]+\.(?:ipynb|md))(?=[#"])')
# Its warnings end a strict build.
LOG = logging.getLogger("mkdocs.hooks.notebook_pages")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the folder of this file to the search path of nbconvert's settings."""
    found = os.environ.get("JUPYTER_CONFIG_PATH", "")
    os.environ["JUPYTER_CONFIG_PATH"] = os.pathsep.join(filter(None, (str(Path(__file__).parent), found)))
    return config


def on_page_content(html: str, *, page: Page, files: Files, **_: object) -> str:
    """Replace a notebook's links to source files by links to their pages, as MkDocs does in Markdown."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html

    def to_page(found: re.Match) -> str:
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page.file.src_uri), found["path"]))
        target = files.get_file_from_path(path)
        if target is None:
            LOG.warning("%s links to %s, which is not in the site", page.file.src_uri, path)
            return found[0]
        return target.url_relative_to(page.file)

    return LINK.sub(to_page, html)
