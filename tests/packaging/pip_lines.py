"""The lines of README and documentation that install: each is run in an empty environment, and what it enables tried.

::

    python tests/packaging/pip_lines.py FOLDER DIST

makes the environments in a new folder, of the built distribution, in a few minutes: lines with the same extras share
one, and all of them what the package always requires. It ends with 1 if a line fails, and names it.
"""

import json
import re
import shlex
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
CONSTRAINTS = "constraints.txt"
INSTALLS = re.compile(r"(?<![\w.-])(?:\S*/)?pip3? install (?P<words>[^`\n&|;#]*)")
OURS = re.compile(r"(?P<name>\.|mesa-swarm)(?:\[(?P<extras>[\w,]+)\])?")
BLOCK = re.compile(r"^ *```(?P<language>\w*)\n(?P<text>.*?)^ *```", re.DOTALL | re.MULTILINE)
IMPORT = re.compile(r"^(?:from [\w.]+ import (?:\([^)]*\)|[^\n(]+)|import [^\n]+)", re.MULTILINE)
COMMAND = re.compile(r"^(?:\.venv/bin/)?mesa-swarm (?P<name>[a-z][\w-]*)", re.MULTILINE)
# A package whose files a page shows, and which it installs: the command that it adds has its name.
MADE = re.compile(r"pip install \./(\w+)")
# What a page installs that has none of these lines: what README and tutorial install.
USUAL = frozenset({"dashboard"})
# Lines that are run elsewhere, and what there shows it.
ELSEWHERE = {
    "-c constraints.txt -e .[test]": (".ci/run", 'eval "$(readme_line)"'),
    "-c constraints.txt -e .[docs]": (".ci/run", "pip install -q -c constraints.txt -e '.[docs]'"),
    "-c constraints-lowest.txt -e .": (".ci/run", "-c constraints-lowest.txt -e '.[dashboard,evolution]'"),
    "-c constraints-lowest.txt -e .[dashboard,evolution] pytest pytest-xdist pytest-benchmark hypothesis": (
        ".ci/run",
        "-c constraints-lowest.txt -e '.[dashboard,evolution]'",
    ),
    "--pre mesa==4.0.0a0": (".ci/run", "pip install -q --pre 'mesa>=4.0.0a0'"),
    "./anthill": ("tests/documentation/test_own_package_page.py", "pip install ./anthill"),
    "./visits": ("tests/documentation/test_own_command_page.py", "pip install ./visits"),
}
# Runs in an environment: imports the packages of its extras and what pages import, and asks commands for their help.
TRY = """
import contextlib, importlib, io, json, sys, warnings
from importlib.metadata import packages_distributions, version

wanted = json.load(sys.stdin)
warnings.simplefilter("ignore")
modules = {}
for module, names in packages_distributions().items():
    for name in names:
        modules.setdefault(name.lower().replace("_", "-"), []).append(module)
faults = []

def attempt(what, act):
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            act()
    except BaseException as error:
        if not (isinstance(error, SystemExit) and error.code in (0, None)):
            faults.append(f"{what}: {type(error).__name__}: {error}")

def package(name):
    version(name)
    for module in modules.get(name.lower().replace("_", "-"), []):
        if module.isidentifier() and module not in ("tests", "test") and not module.startswith("_"):
            importlib.import_module(module)

for name in wanted["packages"]:
    attempt(name, lambda: package(name))
for page, statement in wanted["imports"]:
    attempt(f"{page}: {statement}", lambda: exec(statement, {}))
from mesa_swarm import cli
for page, name in wanted["commands"]:
    attempt(f"{page}: mesa-swarm {name}", lambda: cli.main([name, "--help"]))
print(json.dumps(faults))
"""


@dataclass(frozen=True, slots=True)
class Line:
    """A line that installs, as a page shows it."""

    page: str
    number: int
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page}:{self.number}: pip install {shlex.join(self.words)}"

    @property
    def text(self) -> str:
        """The words as they are typed, without quotes."""
        return " ".join(self.words)

    @property
    def extras(self) -> frozenset[str] | None:
        """The extras of this package that it installs, None for a line that installs something else."""
        found = OURS.fullmatch(self.words[-1])
        return None if found is None else frozenset(filter(None, (found["extras"] or "").split(",")))

    def here(self, wheel: Path) -> list[str]:
        """Return its words for a folder of sources: what is not published yet is the wheel, always with constraints."""
        name = self.words[-1]
        if name.startswith("mesa-swarm"):
            name = f"{wheel}{name.removeprefix('mesa-swarm')}"
        options = list(self.words[:-1])
        return [*options, *([] if "-c" in options else ["-c", CONSTRAINTS]), name]


def pages() -> dict[str, str]:
    """Return the texts of all pages by their path, of notebooks those of their cells."""
    markdown = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("notebooks/*.md"), *ROOT.glob("docs/**/*.md")]
    texts = {path: path.read_text(encoding="utf-8") for path in markdown}
    for path in ROOT.glob("notebooks/*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        texts[path] = "\n".join("".join(cell["source"]) for cell in cells)
    return {path.relative_to(ROOT).as_posix(): texts[path] for path in sorted(texts)}


def lines() -> list[Line]:
    """Return all lines that install."""
    found = []
    for page, text in pages().items():
        for match in INSTALLS.finditer(text):
            number = text.count("\n", 0, match.start()) + 1
            found.append(Line(page, number, tuple(shlex.split(match["words"]))))
    return found


def run_here() -> list[Line]:
    """Return the lines that are run here."""
    return [line for line in lines() if line.text not in ELSEWHERE]


def closure(extras: Iterable[str]) -> frozenset[str]:
    """Return extras with those that they include."""
    found = set(extras)
    for extra in extras:
        for requirement in EXTRAS[extra]:
            ours = OURS.fullmatch(requirement)
            if ours:
                found |= closure((ours["extras"] or "").split(","))
    return frozenset(found)


def packages_of(extras: Iterable[str]) -> list[str]:
    """Return the names of the packages that extras add."""
    required = [line for extra in sorted(closure(extras)) for line in EXTRAS[extra] if not OURS.fullmatch(line)]
    return [re.split(r"[\[<>=!~; ]", line, maxsplit=1)[0] for line in required]


def extras_of_pages() -> dict[str, frozenset[str]]:
    """Return the extras in which the code of each page is to run: those of its own lines, or the usual ones."""
    of_page: dict[str, frozenset[str]] = {}
    for line in run_here():
        of_page[line.page] = of_page.get(line.page, frozenset()) | closure(line.extras or ())
    of_notebooks = dict.fromkeys((page for page in pages() if page.endswith(".ipynb")), of_page["notebooks/README.md"])
    return {page: closure(USUAL) for page in pages()} | of_notebooks | of_page


def shown_on(page: str, text: str) -> tuple[list[str], list[str]]:
    """Return the imports and the commands that a page shows, without the commands of a package that it makes."""
    if page.endswith(".ipynb"):
        return IMPORT.findall(text), []
    blocks = [(found["language"], found["text"]) for found in BLOCK.finditer(text)]
    imports = [one for language, block in blocks if language == "python" for one in IMPORT.findall(block)]
    commands = {one for language, block in blocks if language in ("sh", "") for one in COMMAND.findall(block)}
    return imports, sorted(commands - set(MADE.findall(text)))


class Installer:
    """Makes environments in a folder, of the built distribution."""

    def __init__(self, folder: Path, dist: Path) -> None:
        self.folder, self.sources = folder.absolute(), folder.absolute() / "sources"
        (archive,), (self.wheel,) = dist.absolute().glob("*.tar.gz"), dist.absolute().glob("*.whl")
        with tarfile.open(archive) as packed:
            packed.extractall(folder, filter="data")
        (folder / archive.name.removesuffix(".tar.gz")).rename(self.sources)
        self.base = self.folder / "base"
        subprocess.run([sys.executable, "-m", "venv", self.base], check=True)

    def install(self, home: Path, words: Iterable[str]) -> str:
        """Install into an environment; return what pip prints if that fails, else an empty text."""
        pip = [self.base / "bin" / "python", "-m", "pip", f"--python={home / 'bin' / 'python'}", "install", "-q"]
        done = subprocess.run([*pip, *words], cwd=self.sources, capture_output=True, text=True, check=False)
        return done.stdout + done.stderr if done.returncode else ""

    def environment(self, name: str) -> Path:
        """Return an environment that finds what the package always requires, and nothing else."""
        home = self.folder / name
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", home], check=True)
        (own,) = home.glob("lib/python*/site-packages")
        (shared,) = self.base.glob("lib/python*/site-packages")
        (own / "always_required.pth").write_text(f"{shared}\n")
        return home

    def faults(self, home: Path, wanted: dict) -> list[str]:
        """Return what does not work in an environment."""
        command = [home / "bin" / "python", "-c", TRY]
        done = subprocess.run(
            command, input=json.dumps(wanted), cwd=self.folder, capture_output=True, text=True, check=False
        )
        return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else [done.stdout + done.stderr]


def tried(installer: Installer) -> Iterator[str]:
    """Run all lines, and yield what failed; print each line as soon as it was run."""
    wrong = installer.install(installer.base, ["-c", CONSTRAINTS, *PROJECT["dependencies"]])
    if wrong:
        yield wrong
        return
    of_page, texts = extras_of_pages(), pages()
    groups = {frozenset(line.extras or ()) for line in run_here()} | set(of_page.values())
    for extras in sorted({closure(group) for group in groups}, key=sorted):
        yield from tried_group(installer, extras, [page for page in texts if of_page[page] == extras])


def tried_group(installer: Installer, extras: frozenset[str], its_pages: list[str]) -> Iterator[str]:
    """Run the lines of some extras in one environment, and what pages show for which it is."""
    name = "-".join(sorted(extras)) or "none"
    home = installer.environment(name)
    mine = [line for line in run_here() if closure(line.extras or ()) == extras]
    words = {tuple(line.here(installer.wheel)): line for line in mine}
    if not mine:  # of a page with several lines
        words = {("-c", CONSTRAINTS, "-e", f".[{','.join(sorted(extras))}]"): Line(its_pages[0], 0, ("all",))}
    failed = {line: wrong for typed, line in words.items() if (wrong := installer.install(home, typed))}
    texts = pages()
    shown = {page: shown_on(page, texts[page]) for page in its_pages}
    wanted = {
        "packages": packages_of(extras),
        "imports": [(page, one) for page, (imports, _) in shown.items() for one in dict.fromkeys(imports)],
        "commands": [(page, one) for page, (_, commands) in shown.items() for one in commands],
    }
    faults = [] if failed else installer.faults(home, wanted)
    print(f"[{name}] {len(wanted['imports'])} imports, {len(mine)} lines", flush=True)
    for line in mine:
        wrong = failed.get(words.get(tuple(line.here(installer.wheel)), line), "")
        print(f"  {'FAILED' if wrong or faults else 'ok'}  {line}", flush=True)
    yield from (f"{line}\n{wrong}" for line, wrong in failed.items())
    yield from (f"in an environment with [{name}]: {fault}" for fault in faults)


def main(folder: Path, dist: Path) -> int:
    """Run all lines in a new folder; return 1 if any failed."""
    folder.mkdir(parents=True)
    wrong = list(tried(Installer(folder, dist)))
    for text in wrong:
        print(f"FAILED: {text}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:3])))
