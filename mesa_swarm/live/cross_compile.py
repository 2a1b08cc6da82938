"""Functions compiled to WebAssembly, in a process of its own: ``python -m mesa_swarm.live.cross_compile JOB OBJECT``.

Numba writes the code of LLVM for this machine's processor. Its passes would put sizes of this machine's pointers into
it, so none of them runs here: what Numba has written is linked, and only then LLVM learns that it is for WebAssembly,
and optimises it. No linker and no library of C takes part. What one process compiles for its own processor and what it
compiles here must not meet, hence a process of its own.
"""

import gc
import os
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba.cloudpickle import loads  # type: ignore[attr-defined]
from numba.core.codegen import JITCodeLibrary
from numba.core.registry import cpu_target

TRIPLE = "wasm32-unknown-unknown"
FEATURES = "+simd128,+bulk-memory,+sign-ext,+nontrapping-fptoint,+mutable-globals"
SPEED = 3
# What LLVM calls where it writes the code of the processor.
CALLED_BY_LLVM = ("__multi3", "fmod")
# Functions of Python and of its library of numbers, which only texts of errors are made with.
STOPS = re.compile(r"Py|_Py|numba_|NRT_|log10$")


class UnoptimisedLibrary(JITCodeLibrary):
    """Code as Numba has written it, which this process does not run."""

    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave it as it is."""

    def _optimize_final_module(self) -> None:
        """Leave it as it is."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Finish the code, and return that there is none to be run."""
        self._ensure_finalized()
        return 0


def prepare_compiler() -> None:
    """Let Numba write code and leave it, and the package neither load machine code nor keep functions apart."""
    module: Any = import_module("mesa_swarm.kernels.compiled")
    module.keep_apart = module.compile_sparingly = lambda dispatcher: None
    files = import_module("mesa_swarm.kernels.code_files").StoredCode
    files.load_overload = lambda self, sig, target_context: None
    files.save_overload = lambda self, sig, result: None


def begin_writing() -> None:
    """Let Numba no longer make machine code: what is imported from now on may call no compiled function."""
    context: Any = cpu_target.target_context
    context.create_cpython_wrapper = context.create_cfunc_wrapper = lambda *arguments, **options: None
    codegen: Any = context.codegen()
    codegen._library_class = UnoptimisedLibrary
    codegen.set_env = lambda name, environment: None


def written_code(function: Any, signature: Any) -> tuple[str, Any]:
    """Return the name of a function in LLVM's code, and the module of that code."""
    function.compile(signature)
    result = function.overloads[tuple(signature)]
    return result.fndesc.llvm_func_name, result.library._final_module


def link_modules(modules: list[Any], texts: list[str], machine: Any) -> Any:
    """Return one module with what these define, each function once."""
    whole = None
    for text in [*map(text_for_linking, modules), *texts]:
        module = llvm.parse_assembly(text)
        module.triple, module.data_layout = TRIPLE, str(machine.target_data)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    return whole


def text_for_linking(module: Any) -> str:
    """Return a module's text, without what it states of this machine, and with functions that others may define too."""
    text = re.sub(r"^target (triple|datalayout).*\n", "", str(module), flags=re.M)
    text = re.sub(r'"(target-cpu|target-features|probe-stack|frame-pointer)"="[^"]*"', "", text)
    text = re.sub(r"= common ((local_)?unnamed_addr )?global", "= weak_odr global", text)
    text = text.replace("@llvm.log10.f64(", "@log10(")
    return re.sub(r"^define (linkonce_odr |internal |private |hidden )*", "define weak_odr ", text, flags=re.M)


def stop_where_python_is_called(whole: Any) -> None:
    """Define the functions of Python's own library, which errors with texts need: a page stops there."""
    texts = [
        re.sub(r"^declare ", "define ", _declaration(function)) + " {\n  call void @llvm.trap()\n  unreachable\n}"
        for function in whole.functions
        if function.is_declaration and STOPS.match(function.name)
    ]
    if texts:
        module = llvm.parse_assembly("declare void @llvm.trap()\n" + "\n".join(texts))
        module.triple, module.data_layout = whole.triple, whole.data_layout
        whole.link_in(module)


def _declaration(function: Any) -> str:
    """Return a declaration without attributes."""
    words = re.search(r"^declare .*", str(function), re.MULTILINE)
    text = "" if words is None else words[0]
    text = re.sub(
        r"\b(noundef|signext|zeroext|noalias|nonnull|readonly|writeonly|captures\(none\)|nocapture)\b ?", "", text
    )
    return re.sub(r" (#\d+|local_unnamed_addr|unnamed_addr)", "", text).strip()


def with_names(text: str, names: dict[str, str]) -> str:
    """Return a text with names in LLVM's code in place of those of functions in double braces."""
    for name, mangled in names.items():
        text = text.replace(f"{{{{{name}}}}}", mangled)
    return text


def optimise(whole: Any, kept: set[str], machine: Any) -> None:
    """Let LLVM optimise a module of which functions of these names are called from outside."""
    for function in whole.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name in kept else "internal"
    whole.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=SPEED)
    options.loop_vectorization = options.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, options)
    passes = builder.getModulePassManager()
    passes.add_refprune_pass()
    passes.run(whole, builder)


def main(source: Path, target: Path) -> None:
    """Read functions with their signatures and texts of LLVM's code from a file, and write the object file."""
    gc.disable()  # Numba keeps all that it makes
    prepare_compiler()
    job = loads(source.read_bytes())
    begin_writing()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(
        cpu="generic", features=FEATURES, opt=SPEED, reloc="static", codemodel="default"
    )
    codes = {name: written_code(function, signature) for name, (function, signature) in job["functions"].items()}
    texts = [with_names(text, {name: mangled for name, (mangled, _) in codes.items()}) for text in job["texts"]]
    whole = link_modules([module for _, module in codes.values()], texts, machine)
    names = {name: codes[name][0] if name in codes else name for name in job["exports"]}
    stop_where_python_is_called(whole)
    optimise(whole, {*names.values(), *CALLED_BY_LLVM}, machine)
    missing = [f.name for f in whole.functions if f.is_declaration and not f.name.startswith("llvm.")]
    if missing:
        print("MISSING", *missing, sep="\n", file=sys.stderr)
    target.write_bytes(machine.emit_object(whole))
    lines = (f"{name}\t{mangled}" for name, mangled in names.items())
    Path(f"{target}.names").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
    sys.stdout.flush()
    os._exit(0)
