"""Disks that are small or read-only, also for root, whom no file mode stops."""

import os
import subprocess
from contextlib import contextmanager

import pytest


@contextmanager
def small_disk(folder, kilobytes):
    """Put a disk of this many kilobytes in the place of a folder."""
    folder.mkdir()
    _mount("-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", folder)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


@contextmanager
def read_only(folder):
    """Take all rights to write to a folder and to those within."""
    if os.name == "nt":
        pytest.skip("needs POSIX")
    if os.geteuid():
        folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
        for each in folders:
            each.chmod(0o500)
        yield folder
        for each in folders:
            each.chmod(0o700)
        return
    _mount("--bind", folder, folder)
    try:
        _mount("-o", "remount,ro,bind", folder)
        yield folder
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def _mount(*words):
    if not hasattr(os, "geteuid") or os.geteuid() or subprocess.run(["mount", *words], check=False).returncode:
        pytest.skip("may not mount")
