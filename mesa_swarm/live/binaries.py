"""The WebAssembly module of a set of functions: compiled by another process, and stored for the next time."""

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from hashlib import blake2b
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numba
from numba import types

from mesa_swarm.base.errors import ExportError
from mesa_swarm.kernels.block import SIGNATURE
from mesa_swarm.kernels.code_files import file_of, read_code, write_code
from mesa_swarm.kernels.compiled import stem_of
from mesa_swarm.kernels.digests import digest_source
from mesa_swarm.kernels.plan import drive_steps
from mesa_swarm.live import cross_compile
from mesa_swarm.live.draws import next_word
from mesa_swarm.live.pickled_functions import pickle_functions
from mesa_swarm.live.remainders import remainder_of
from mesa_swarm.live.wasm_file import FUNCTION, imports_of, with_exports

# What pages call besides kernels.
ENTRIES = "drive", "call_kernel", "draw_word", "draw_number", "begin_heap", "heap_end"
# The names by which pages find kernels: this, and their place in the table.
PREFIX = "k"
# Functions of other signatures that the entries call.
INNER: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "drive_steps": (drive_steps, (types.int64[::1], *[types.int64] * 4)),
    "remainder_of": (remainder_of, (types.float64, types.float64)),
    "next_word": (next_word, (types.uint64[::1],)),
}
MODULE = "mesa_swarm.live.cross_compile"


def module_of(functions: Mapping[Any, int]) -> bytes:
    """Return the WebAssembly module of functions, by the places that pages have them at in their table.

    Raises
    ------
    ExportError
        If something that they call cannot be part of a page.
    """
    kernels = {f"{PREFIX}{place}": function for function, place in functions.items() if not isinstance(function, str)}
    digest = digest_of(kernels)
    if digest is None:
        return _compile(kernels)
    name = file_of("pages/module", " ".join(map(stem_of, kernels.values())), digest)
    for content in read_code(name):
        return content
    content = _compile(kernels)
    write_code(name, content)
    return content


def digest_of(kernels: Mapping[str, Any]) -> str | None:
    """Return a digest of all that the module of kernels depends on; None if it is not known of one of them."""
    digest = blake2b(f"{numba.__version__} {entries_text()} {digest_source(cross_compile.__file__)}".encode())
    for name, function in {**kernels, **{name: function for name, (function, _) in INNER.items()}}.items():
        code = getattr(function._cache, "digest", lambda: None)()
        if code is None:
            return None
        digest.update(f"{name} {function.__module__} {function.__qualname__} {code}".encode())
    return digest.hexdigest()


def entries_text() -> str:
    """Return what is written in LLVM's language."""
    return files("mesa_swarm.live").joinpath("entries.ll").read_text(encoding="utf-8")


def _compile(kernels: Mapping[str, Any]) -> bytes:
    functions = {name: (function, SIGNATURE) for name, function in kernels.items()} | INNER
    job = {
        "functions": functions,
        "texts": [entries_text()],
        "exports": [*kernels, *ENTRIES],
    }
    with TemporaryDirectory() as folder:
        source, target = Path(folder, "job"), Path(folder, "object")
        source.write_bytes(pickle_functions(job))
        call = subprocess.run(
            [sys.executable, "-m", MODULE, str(source), str(target)],
            env={**os.environ, "NUMBA_OPT": "0", "NUMBA_DISABLE_JIT": "0"},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if call.returncode or not target.exists():
            raise ExportError(f"the model's functions cannot be compiled for pages: {_last_line(call.stderr)}")
        names = dict(line.split("\t") for line in Path(f"{target}.names").read_text(encoding="utf-8").splitlines())
        module = with_exports(target.read_bytes(), names)
    lacking = [imported.name for imported in imports_of(module) if imported.kind == FUNCTION]
    if lacking:
        raise ExportError(f"the model calls {', '.join(lacking)}, which pages do not have")
    return module


def _last_line(text: str) -> str:
    """Return the last line of what a process wrote, without its colours."""
    lines = re.sub(r"\x1b\[[0-9;]*m", "", text).strip().splitlines()
    return lines[-1] if lines else "it ended without a word"
