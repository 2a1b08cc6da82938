"""Which machine code a process may run: names of machines, and the levels of processors for which code is published.

Numba compiles for the processor at hand. A wheel may carry code for a level that many processors have; it is found by
the same names, which hold all that machine code depends on besides the sources.
"""

import sysconfig
from functools import cache
from hashlib import blake2b
from typing import Any

import numba
from numba.core.codegen import ll
from numba.core.registry import cpu_target

# Numba finds its settings when it is imported, where no type checker sees them.
settings: Any = numba.config
# What a processor of a level has beyond the level before, in the words of LLVM, which has names for the levels.
MORE_FEATURES = {
    "x86-64-v2": "cx16 popcnt sahf sse3 sse4.1 sse4.2 ssse3",
    "x86-64-v3": "avx avx2 bmi bmi2 f16c fma lzcnt movbe xsave",
}
# What every 64-bit processor of ARM has is a level, too.
ARM = "arm64"
ARM_NAMES = ("aarch64", "arm64")


def describe_levels() -> dict[str, str]:
    """Return the levels of this process's family of processors, lowest first, and their features as Numba reads them.

    Examples
    --------
    >>> all(features == "" or features.startswith("+") for features in describe_levels().values())
    True
    """
    family = _describe_target()[0].partition("-")[0]
    if family in ARM_NAMES:
        return {ARM: ""}
    features: list[str] = []
    levels = {}
    for level, words in MORE_FEATURES.items() if family == "x86_64" else ():
        features += words.split()
        levels[level] = ",".join(f"+{feature}" for feature in sorted(features))
    return levels


def settings_for(level: str) -> dict[str, str]:
    """Return the environment variables with which Numba compiles for a level of this family of processors.

    Raises
    ------
    KeyError
        If it is not a level of this family.
    """
    return {"NUMBA_CPU_NAME": _processor_of(level), "NUMBA_CPU_FEATURES": describe_levels()[level]}


def _processor_of(level: str) -> str:
    """Return LLVM's name of the processors of a level."""
    return "generic" if level == ARM else level


@cache
def name_machine() -> str:
    """Return a name for what machine code that is compiled here depends on besides the sources."""
    return _name_for(*_describe_target()[1:])


@cache
def list_machines() -> tuple[str, ...]:
    """Return the names of the machines of `list_levels`."""
    return tuple(_name_for(_processor_of(level), describe_levels()[level]) for level in list_levels())


def list_levels() -> tuple[str, ...]:
    """Return the levels that this processor has, best first: it runs their code."""
    features = set(_describe_target()[2].split(","))
    levels = reversed(describe_levels().items())
    return tuple(level for level, needed in levels if not needed or features.issuperset(needed.split(",")))


def _describe_target() -> tuple[str, str, str]:
    """Return the platform, the processor and its features for which Numba compiles, its settings included."""
    return cpu_target.target_context.codegen().magic_tuple()


def _name_for(processor: str, features: str) -> str:
    """Return a name of a folder: in words what a reader looks for, and a digest of all."""
    family = _describe_target()[0].partition("-")[0]
    # SVML is a library of Intel, which has to be there where it was there when the code was compiled.
    more = ll.llvm_version_info, settings.USING_SVML, features
    digest = blake2b(repr(more).encode(), digest_size=5).hexdigest()
    python = sysconfig.get_config_var("EXT_SUFFIX").split(".")[1]
    return f"{python}-{family}-numba-{numba.__version__}-{processor}-{digest}"
