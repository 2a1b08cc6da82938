"""Compiled functions for another process: those of the package by their names, others with all that they call."""

import io
from importlib import import_module
from typing import Any

from numba import cloudpickle, njit  # type: ignore[attr-defined]
from numba.core.dispatcher import Dispatcher

from mesa_swarm.kernels.digests import FUNCTIONS


class FunctionPickler(cloudpickle.CloudPickler):
    """Pickles functions with the compiler that they have, which Numba itself leaves out."""

    def reducer_override(self, value: Any) -> Any:
        """Return how a compiled function is made again."""
        if not isinstance(value, Dispatcher):
            return super().reducer_override(value)
        function: Any = value
        if function.py_func in FUNCTIONS:
            return find_function, (function.__module__, function.__qualname__)
        return make_function, (function.py_func, dict(function.targetoptions), function._compiler.pipeline_class)


def find_function(module: str, name: str) -> Any:
    """Return a compiled function of the package."""
    return getattr(import_module(module), name)


def make_function(function: Any, options: dict[str, Any], pipeline: type) -> Any:
    """Return a function compiled as it was."""
    return njit(pipeline_class=pipeline, **options)(function)


def pickle_functions(functions: Any) -> bytes:
    """Return what `numba.cloudpickle.loads` makes the same of in another process."""
    file = io.BytesIO()
    FunctionPickler(file).dump(functions)
    return file.getvalue()
