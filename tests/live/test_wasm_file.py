"""Object files of LLVM become modules."""

import llvmlite.binding as llvm
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.live.cross_compile import FEATURES, TRIPLE
from mesa_swarm.live.wasm_file import (
    ModuleImport,
    SectionReader,
    encode,
    end_of_data,
    functions_of,
    imports_of,
    sections_of,
    with_exports,
)

TEXT = """
@table = internal constant [4 x i64] [i64 7, i64 8, i64 9, i64 10]
declare double @other(double)
define i64 @look_up(i32 %place) {
  %at = getelementptr [4 x i64], ptr @table, i32 0, i32 %place
  %number = load i64, ptr %at
  ret i64 %number
}
define double @ask(double %x) {
  %y = call double @other(double %x)
  ret double %y
}
"""


@pytest.fixture(scope="module")
def object_file():
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(cpu="generic", features=FEATURES, opt=2)
    module = llvm.parse_assembly(TEXT)
    module.triple, module.data_layout = TRIPLE, str(machine.target_data)
    return machine.emit_object(module)


@given(st.integers(0, 2**40))
def test_numbers_are_read_as_they_were_written(number):
    assert SectionReader(encode(number)).number() == number


@pytest.mark.parametrize(
    ("content", "number"), [(b"\x7f", -1), (b"\x3f", 63), (b"\x40", -64), (b"\xc0\x00", 64), (b"\x80\x7f", -128)]
)
def test_numbers_with_a_sign_are_read_as_the_format_has_them(content, number):
    assert SectionReader(content).signed() == number


def test_functions_are_found_by_their_names(object_file):
    assert functions_of(object_file).keys() == {"look_up", "ask"}


def test_imports_are_those_of_the_object(object_file):
    assert ModuleImport(0, "other") in imports_of(object_file)


def test_constants_end_where_the_last_one_does(object_file):
    assert end_of_data(object_file) >= 32


def test_a_module_has_its_exports_and_nothing_for_linkers(object_file):
    module = with_exports(object_file, {"found": "look_up"})
    kinds = [kind for kind, _ in sections_of(module)]
    assert 0 not in kinds
    assert kinds.index(7) < kinds.index(10)
    assert b"\x05found" in module


def test_a_function_that_is_not_there_cannot_be_exported(object_file):
    with pytest.raises(KeyError):
        with_exports(object_file, {"found": "nowhere"})
