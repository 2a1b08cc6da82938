"""Names that are imported when they are first used, and imports without garbage collection."""

import gc
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import mesa_swarm
from mesa_swarm.base.lazy import lazy_names, without_collection

ROOT = Path(__file__).parents[2]
PACKAGES = ("mesa_swarm", "mesa_swarm.control", "mesa_swarm.environments", "mesa_swarm.fire")


@pytest.fixture(autouse=True)
def collecting():
    """Collect all garbage before and after, whatever a test does."""
    gc.unfreeze()
    gc.enable()
    yield
    gc.unfreeze()
    gc.enable()


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_imported_from_where_it_is_defined(package):
    module = import_module(package)
    assert (
        {name for names in module._MODULES.values() for name in names.split()}
        <= set(module.__all__)
        <= set(dir(module))
    )
    for home, names in module._MODULES.items():
        for name in names.split():
            assert getattr(module, name) is getattr(import_module(f"mesa_swarm.{home}"), name)
            assert vars(module)[name] is getattr(module, name)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_lazy_name_is_that_of_a_module_beside_it(package):
    folder = Path(import_module(package).__file__).parent
    beside = {path.stem for path in folder.iterdir()}
    assert not beside & {name for names in import_module(package)._MODULES.values() for name in names.split()}


@pytest.mark.parametrize("package", PACKAGES)
def test_an_unknown_name_is_an_attribute_error_of_the_package(package):
    with pytest.raises(AttributeError, match=rf"module '{package}' has no attribute 'nothing'"):
        getattr(import_module(package), "nothing")  # noqa: B009 - what an attribute access calls


def test_a_name_is_imported_without_collection_and_stays_in_the_package():
    imported, names = lazy_names("mesa_swarm", {"base.progress": "finishing_time"})
    assert "finishing_time" in names()
    assert imported("finishing_time") is mesa_swarm.finishing_time
    del mesa_swarm.finishing_time


def test_collection_is_as_before_afterwards_even_after_an_error():
    def fail():
        with without_collection(), without_collection():
            seen.append(gc.isenabled())
            raise ImportError

    seen = []
    with pytest.raises(ImportError):
        fail()
    assert (seen, gc.isenabled()) == ([False], True)
    assert gc.get_freeze_count() == 0


def test_where_collection_is_off_it_stays_off():
    gc.disable()
    with without_collection(for_good=True):
        pass
    assert not gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_what_a_program_has_exempted_stays_exempt():
    # In a process of its own: threads that run the tests meanwhile free objects that were exempted.
    code = """if True:
        import gc
        from mesa_swarm.base.lazy import without_collection
        gc.freeze()
        before = gc.get_freeze_count()
        with without_collection():
            cycle = []
            cycle.append(cycle)
        print(gc.get_freeze_count() == before > 0)
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


GARBAGE = """
import gc, weakref
from mesa_swarm.base.lazy import without_collection

class Cycle:
    pass

with without_collection(for_good={}):
    cycle = Cycle()
    cycle.itself, there = cycle, weakref.ref(cycle)
    del cycle
gc.collect()
print(there() is None)
"""


@pytest.mark.slow
@pytest.mark.parametrize("for_good", [False, True])
def test_garbage_made_meanwhile_is_collected_later_unless_it_is_for_good(for_good):
    # Alone in a process: what is exempt for good stays so, of other tests too.
    code = GARBAGE.format(for_good)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"{not for_good}\n"


@pytest.mark.slow
@pytest.mark.parametrize("names", ["SwarmModel", "AGENT9, SwarmModel", "Looks, Map, SwarmModel"])
def test_hardly_any_garbage_is_collected_during_the_first_imports(names):
    code = f"import gc\nfrom mesa_swarm import {names}\nprint(sum(one['collections'] for one in gc.get_stats()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 100  # of 400


SLOW = ("mesa", "numba", "pandas", "scipy", "matplotlib", "networkx", "pyarrow", "shapely", "svgelements", "solara")
# What of these the import of a name may bring in.
NEEDS = {
    "import mesa_swarm": set(),
    "from mesa_swarm import Map, Shape, disc, polygon, rectangle": {"shapely"},
    "from mesa_swarm import Chart, ColourMap, Looks": set(),
    "from mesa_swarm import AGENT9, RobotDesign, Emitter, Gripper, Lamp, Radio, Sensor, OmniDrive, Field": {
        *("numba", "scipy", "shapely"),  # Numba imports SciPy
    },
    "from mesa_swarm.fire import FireConstants, design_constants": set(),
}


@pytest.mark.slow
@pytest.mark.parametrize("line", NEEDS)
def test_a_name_brings_in_only_what_it_needs(line):
    code = f"{line}\nimport sys; print(sorted({set(SLOW)} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"{sorted(NEEDS[line])}\n"


@pytest.mark.slow
def test_a_first_step_imports_neither_svg_readers_nor_layers_that_it_does_not_use():
    code = (
        "import sys\nfrom mesa_swarm import AGENT9, SwarmModel\nfrom mesa_swarm.control import Avoid, Subsumption\n"
        "model = SwarmModel(rng=1)\nrobots = model.add_robots(AGENT9, 3)\nmodel.control = Subsumption(Avoid())\n"
        "model.step()\nprint([name for name in sys.modules if name.startswith('mesa_swarm.')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    rooms = ("analysis", "cli", "dashboard", "experiments", "learning", "models", "recording", "viewing")
    unused = {f"mesa_swarm.{room}" for room in rooms} | {"mesa_swarm.maps.svg", "mesa_swarm.control.flocking"}
    assert "mesa_swarm.control.avoid" in done.stdout
    assert not unused & set(done.stdout.replace("'", " ").split())
