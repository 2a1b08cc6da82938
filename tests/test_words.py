"""No text or name contains a word that reads as translated; what to write instead stands beside each."""

import ast
import io
import json
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
# Folders of Python files whose comments, strings and names are checked.
FOLDERS = ["docs", "mesa_swarm", "models", "notebooks/solutions", "studies", "tests"]
TEXTS = [
    *("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "mkdocs.yml", ".ci/run", "notebooks/*.md"),
    *("docs/**/*.md", "docs/*.css", "docs/pictures/step.svg"),
    *("mesa_swarm/**/*.js", "mesa_swarm/**/*.css", "models/*.toml", "studies/**/*.toml", "studies/**/*.c"),
    "pyproject.toml",
]
NOTEBOOKS = ["notebooks/*.ipynb"]

# Words, with what to write instead; forbidden in texts and as a part of a name.
WORDS = {
    "told|tells?|telling|foretold": "state, report, describe, distinguish; of a name: inputs, fields, described",
    "says?|said|saying": "state, report, mean, define",
    "lay|lays": "place, arrange",
    "nobody|somebody|anybody|everybody|whoever": "no robot, any robot, each robot, a body",
    "wish(?:e[sd])?|wishing": "setting, requirement, request",
    "hush(?:e[sd])?|sheds?|shedding|minding": "clear, drop, capture",
    "tapes?": "row buffer",
    "dithers?|dithering": "oscillate",
}
# Phrases, with what to write instead; forbidden in texts.
PHRASES = {
    "so many": "the number of, a given number of",
    "what (?:came|comes|became|becomes)": "result, outcome",
    "came never": "undefined",
    "comes? out again": "is reproduced",
    "giv(?:e|es|ing) birth": "create, initialise",
    r"(?<!there\s)(?:is|are) (?-i:none)": "is not a, is missing, does not exist",
    r"(?<!there\s)is no(?! (?:longer|more|less)\b)": "is not a",
    "is another than": "does not match",
    "holds what cannot be": "has out-of-range values",
    "(?:was|were|is|are) asked for": "required, requested",
    "(?:private )?doors? (?:to|for)": "methods, interface",
    "find back": "find the way back",
    "robots of metal": "physical robots",
    "none of an?": "not part of a",
    "of ours": "our, we chose",
    "of one's own": "custom, your own",
}
# Names, with what to write instead; a name may contain them but not be one of them.
NAMES = {
    "angle|theta|orientation": "heading, bearing or azimuth",
    "vel": "velocity",
    "config|data|utils?|helpers?|manager": "what it holds or does",
}
# What is right where it stands: the files, the literal text, and why.
ALLOWED = [
    ("tests/support/searches.py", "config", "a parameter of hooks, by the name that pytest prescribes"),
    ("CHANGELOG.md", "lay", "a former name"),
    ("CHANGELOG.md", "hush", "a former name"),
    ("CHANGELOG.md", "shed", "a former name"),
    ("docs/sensitivity.md", "tell", "ask-and-tell is the name of a method"),
    ("mesa_swarm/learning/evolution.py", "tell", "CMA-ES is an ask-and-tell method; a documented name"),
    ("mesa_swarm/base/moved.py", "learning.told", "a former address"),
    ("mesa_swarm/base/moved.py", "wish", "a former address"),
    ("mesa_swarm/base/moved.py", "Wish", "a former name"),
    ("mesa_swarm/physics/disturbances.py", "told", "the name of a stored column"),
    ("mesa_swarm/recording/stored_values.py", "code of one's own", "a key of stored states"),
    ("mesa_swarm/robots/swarm.py", "hush", "a former name"),
    ("mesa_swarm/robots/swarm.py", "shed", "a former name"),
    ("mesa_swarm/world/bodies.py", "lay", "a former name"),
    ("tests/studies/test_learning_targets.py", "tell", "CMA-ES is an ask-and-tell method; a documented name"),
    ("tests/base/test_moved.py", "teaching.wish", "a former address"),
    ("tests/base/test_moved.py", "Wish", "a former name"),
]


class Passage(NamedTuple):
    """A piece of text, or a name, and the line on which it begins."""

    line: int
    text: str
    is_name: bool = False


def texts(path: Path) -> Iterator[Passage]:
    """Yield what a file has to be read: its text, the cells of a notebook, or what people read in Python."""
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        yield from python(source)
    elif path.suffix == ".ipynb":
        for cell in json.loads(source)["cells"]:
            inside = "".join(cell["source"])
            yield from python(inside) if cell["cell_type"] == "code" else [Passage(1, inside)]
    else:
        yield Passage(1, source)
        if path.suffix == ".js":
            yield from declared(source)


def declared(source: str) -> Iterator[Passage]:
    """Yield the names that JavaScript declares or assigns: variables, functions, methods, properties."""
    for line, text in enumerate(source.splitlines(), 1):
        for name in re.findall(r"(?:\b(?:const|let|function|class)|\.)\s*(#?\w+)(?=\s*[=({]|\s*$)|^\s*(#?\w+)\(", text):
            yield Passage(line, "".join(name).lstrip("#"), is_name=True)


def python(source: str) -> Iterator[Passage]:
    """Yield the comments, strings and names of Python source; of names only those that it defines."""
    yield from comments(source)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield Passage(node.lineno, node.value)
        name = defined(node)
        if name:
            yield Passage(node.lineno, name, is_name=True)


def comments(source: str) -> Iterator[Passage]:
    """Yield comments, those on adjacent lines as one."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    found = [(token.start[0], token.string.lstrip("#! ")) for token in tokens if token.type == tokenize.COMMENT]
    for _, block in groupby(enumerate(found), key=lambda numbered: numbered[1][0] - numbered[0]):
        lines = [comment for _, comment in block]
        yield Passage(lines[0][0], "\n".join(text for _, text in lines))


def defined(node: ast.AST) -> str | None:
    """Return the name that a node defines: a variable, an attribute, an argument, a function, a class, an import."""
    if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
        return node.id if isinstance(node, ast.Name) else node.attr
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return node.name
    if isinstance(node, ast.arg):
        return node.arg
    return node.asname if isinstance(node, ast.alias) else None


@cache
def pattern(words: str) -> re.Pattern:
    return re.compile(rf"(?<!\w)(?:{words})(?!\w)".replace(" ", r"[\s>*#]+"), re.IGNORECASE)


def spoken(name: str) -> str:
    """Return a name as words."""
    return " ".join(re.findall(r"[A-Z]?[a-z]+|[A-Z]+|\d+", name))


def forbidden(passage: Passage, allowed: list[str]) -> Iterator[str]:
    """Yield a line for each forbidden word of a passage."""
    text = passage.text
    for literal in allowed:
        text = re.sub(rf"\b{re.escape(literal)}\b", "", text)
    if passage.is_name:
        searched = [(spoken(text), words, better) for words, better in WORDS.items()]
        searched += [(text, f"^(?:{words})$", better) for words, better in NAMES.items()]
    else:
        text = re.sub(r"(?<=\n)[ \t]+", "", text)  # a phrase may go on in an indented line
        searched = [(text, words, better) for words, better in {**WORDS, **PHRASES}.items()]
    for searched_text, words, better in searched:
        for match in pattern(words).finditer(searched_text):
            line = passage.line + searched_text.count("\n", 0, match.start())
            yield f"line {line}: {' '.join(match[0].split())!r} in {passage.text[:40]!r}; write: {better}"


def files() -> list[Path]:
    """Return all files that are checked."""
    patterns = [*TEXTS, *NOTEBOOKS, *(f"{folder}/**/*.py" for folder in FOLDERS)]
    found = {path for each in patterns for path in ROOT.glob(each)}
    found -= {Path(__file__)}
    return sorted(path for path in found if not path.is_relative_to(ROOT / "mesa_swarm" / "models"))


FILES = files()


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_file_uses_the_standard_words(path):
    allowed = [literal for where, literal, _ in ALLOWED if path.relative_to(ROOT).match(where)]
    found = [line for passage in texts(path) for line in forbidden(passage, allowed)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("entry", ALLOWED, ids=lambda entry: entry[1])
def test_every_exception_is_still_needed(entry):
    where, literal, _ = entry
    passages = [passage for path in ROOT.glob(where) for passage in texts(path)]
    assert any(literal in line for passage in passages for line in forbidden(passage, []))


def test_every_pattern_of_files_finds_some():
    for each in [*TEXTS, *NOTEBOOKS]:
        assert list(ROOT.glob(each)), each
    for folder in FOLDERS:
        assert list((ROOT / folder).rglob("*.py")), folder


@pytest.mark.parametrize(
    "source",
    [
        '"""It tells more."""',
        "def f():\n    '''Return so\n    many.'''",
        "x = f'{1} was said {2}'",
        "x = 1  # nobody",
        "# there are so\n# many of them",
        "told = 1",
        "def told_by(x): ...",
        "class LastWish: ...",
        "def f(theta): ...",
        "self.hushed = 1",
        "import numpy as data",
        "for angle in range(3): ...",
        '"""A thing that is no number."""',
    ],
)
def test_a_forbidden_word_is_found_in_python(source):
    assert [line for passage in python(source) for line in forbidden(passage, [])]


@pytest.mark.parametrize(
    "source", ["const wished = 1;", "  #tellRest() {", "this.toldTwice = 2;", "// It was asked for."]
)
def test_a_forbidden_word_is_found_in_javascript(source, tmp_path):
    path = tmp_path / "drawn.js"
    path.write_text(source, encoding="utf-8")
    assert [line for passage in texts(path) for line in forbidden(passage, [])]


@pytest.mark.parametrize(
    "source",
    [
        "search.tell(1)",  # a name defined elsewhere
        "mistold = 1",
        "field_angle = 1",
        '"""There is no reward, it is no longer paid, and it is None."""',
        "x = 'a stapler'",
    ],
)
def test_other_words_are_not_found_in_python(source):
    assert not [line for passage in python(source) for line in forbidden(passage, [])]
