"""What is known only when the package is built: its addresses, and with them the links of the README."""

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

# The same settings as of the site (mkdocs.yml): where the repository and the site are, once they are somewhere.
REPOSITORY, SITE = "MESA_SWARM_REPO_URL", "MESA_SWARM_SITE_URL"
LINK = re.compile(r'(?P<before>(?P<image>!)?\[[^\]]*\]\(|(?P<tag><img src="))(?P<path>(?![a-z]+:|#|/)[^)"\s]+)')


class Addresses(MetadataHookInterface):  # type: ignore[misc]  # hatchling's types are not complete
    """Complete the metadata by addresses and README."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set `urls` and `readme`."""
        repository = os.environ.get(REPOSITORY, "").rstrip("/")
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        metadata["urls"] = urls(repository, os.environ.get(SITE, ""), metadata["version"])
        text = with_absolute_links(text, repository, metadata["version"]) if repository else text
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def urls(repository: str, site: str, version: str) -> dict[str, str]:
    """Return the addresses that are known."""
    known = {"Documentation": site} if site else {}
    if repository:
        known["Repository"] = repository
        known["Issues"] = f"{repository}/issues"
        known["Changelog"] = f"{repository}/blob/v{version}/CHANGELOG.md"
    return known


def with_absolute_links(text: str, repository: str, version: str) -> str:
    """Return a README whose links into the repository lead to the files of this version there.

    Examples
    --------
    >>> with_absolute_links("[Tutorial](docs/tutorial.md) ![a](b.svg)", "https://host.org/me/it", "1.0")
    '[Tutorial](https://host.org/me/it/blob/v1.0/docs/tutorial.md) ![a](https://host.org/me/it/raw/v1.0/b.svg)'
    """

    def absolute(found: re.Match[str]) -> str:
        kind = "raw" if found["image"] or found["tag"] else "blob"
        return f"{found['before']}{repository}/{kind}/v{version}/{found['path']}"

    return LINK.sub(absolute, text)
