"""What an index shows of the package: addresses, links, keywords."""

import re
import tarfile
import tomllib
from zipfile import ZipFile

import pytest

import mesa_swarm
from metadata import urls, with_absolute_links
from support.installing import ROOT, build, run

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
README = (ROOT / "README.md").read_text(encoding="utf-8")
ADDRESS = "https://example.org/swarm/it"
TARGET = re.compile(r'\]\(([^)#\s]+)|src="([^"]+)"')


def targets(text: str) -> list[str]:
    return ["".join(pair) for pair in TARGET.findall(text)]


def test_in_the_repository_links_of_the_readme_lead_to_its_files():
    inside = [target for target in targets(README) if "://" not in target]
    assert len(inside) > 20
    assert not [target for target in inside if not (ROOT / target).exists()]


def test_published_every_link_of_the_readme_leads_to_the_file_of_this_version():
    before, after = targets(README), targets(with_absolute_links(README, ADDRESS, "1.2.3"))
    kinds = [re.sub(r".*\.(svg|png)$", "raw", target) for target in before]
    wanted = [
        target if "://" in target else f"{ADDRESS}/{'raw' if kind == 'raw' else 'blob'}/v1.2.3/{target}"
        for target, kind in zip(before, kinds, strict=True)
    ]
    assert after == wanted


def test_addresses_that_are_unknown_are_left_out():
    assert urls("", "", "1.0") == {}
    assert urls("", "https://site.org", "1.0") == {"Documentation": "https://site.org"}
    assert urls(ADDRESS, "", "1.0").keys() == {"Repository", "Issues", "Changelog"}


def test_keywords_are_those_of_the_citation():
    page = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert PROJECT["keywords"] == re.findall(r"^  - ([a-z -]+)$", page, re.MULTILINE)


@pytest.mark.slow
def test_an_index_accepts_both_archives(sdist, wheel, installed):
    assert run(installed, "-m", "twine", "check", "--strict", sdist, wheel, cwd=sdist.parent).count("PASSED") == 2


@pytest.mark.slow
def test_a_wheel_built_from_published_sources_has_the_addresses_of_their_build(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setenv("MESA_SWARM_REPO_URL", ADDRESS)
        published = build("sdist", ROOT, tmp_path / "published")
    with tarfile.open(published) as archive:
        archive.extractall(tmp_path, filter="data")
    built = build("wheel", tmp_path / published.name.removesuffix(".tar.gz"), tmp_path / "built")
    with ZipFile(built) as archive:
        (about,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        text = archive.read(about).decode()
    assert f"Project-URL: Repository, {ADDRESS}\n" in text
    assert f"({ADDRESS}/blob/v{mesa_swarm.__version__}/docs/tutorial.md)" in text
