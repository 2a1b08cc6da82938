"""Environments of their own, in which the package is installed as others install it."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).parents[2]


def run(*command: object, cwd: Path, check: bool = True) -> str:
    """Return what a command prints; it may see neither the repository nor this process's settings of Python."""
    words = [str(word) for word in command]
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=300, check=False, env=clean)
    assert not check or done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(kind: str, sources: Path, folder: Path) -> Path:
    """Build what is published, `kind` sdist or wheel, and return its file."""
    run(sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", folder, cwd=sources)
    (built,) = folder.glob("*.tar.gz" if kind == "sdist" else "*.whl")
    return built


def environment(home: Path) -> Path:
    """Make an environment that finds all packages of this one but mesa_swarm, and return its Python."""
    run(sys.executable, "-m", "venv", "--without-pip", home, cwd=home.parent)
    own = home / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        if not path.name.startswith(("mesa_swarm", "__")) and path.suffix != ".pth":
            (own / path.name).symlink_to(path)
    return home / "bin" / "python"


def pip(python: Path, *words: object) -> str:
    """Run this environment's pip for another one; it fetches nothing."""
    options = ("-q", "--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check")
    return run(sys.executable, "-m", "pip", f"--python={python}", "install", *options, *words, cwd=python.parent)
