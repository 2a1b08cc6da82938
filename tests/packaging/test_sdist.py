"""The archive of sources: complete, and its tests run."""

import subprocess
import tarfile

import pytest

from support.installing import ROOT, run


@pytest.mark.slow
class TestTheArchiveOfSources:
    def test_holds_every_file_of_the_repository(self, sdist):
        if not (ROOT / ".git").exists():
            pytest.skip("not a copy by git")
        listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
        done = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True)
        wanted = {name for name in done.stdout.splitlines() if (ROOT / name).exists()}
        with tarfile.open(sdist) as archive:
            names = {name.split("/", 1)[1] for name in archive.getnames()}
        assert names == {*wanted, "PKG-INFO"}

    def test_its_tests_run(self, editable, sources):
        tests = ("tests/base/test_errors.py", "tests/packaging/test_changelog.py")
        printed = run(editable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *tests, cwd=sources)
        assert " passed" in printed
