"""What is published, built once: the archive of sources from the repository, the wheel from the archive."""

import tarfile
from pathlib import Path

import pytest

from support.installing import ROOT, build, environment, pip


@pytest.fixture(scope="session")
def sdist(tmp_path_factory) -> Path:
    return build("sdist", ROOT, tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="session")
def sources(sdist, tmp_path_factory) -> Path:
    """Return the folder of the unpacked archive."""
    folder = tmp_path_factory.mktemp("sources")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    return folder / sdist.name.removesuffix(".tar.gz")


@pytest.fixture(scope="session")
def wheel(sources, tmp_path_factory) -> Path:
    return build("wheel", sources, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def installed(wheel, tmp_path_factory) -> Path:
    """Return the Python of an environment with the wheel."""
    python = environment(tmp_path_factory.mktemp("installed"))
    pip(python, wheel)
    return python


@pytest.fixture(scope="session")
def editable(sources, tmp_path_factory) -> Path:
    """Return the Python of an environment with an editable installation of the sources."""
    python = environment(tmp_path_factory.mktemp("editable"))
    pip(python, "-e", sources)
    return python
