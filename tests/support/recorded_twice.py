"""Recordings of runs that compiled calls drive, and of the same runs in single steps, and how they are compared."""

import math
from contextlib import contextmanager

import pyarrow as pa
import pytest

from mesa_swarm.kernels.plan import Driver
from mesa_swarm.model.driving import begin_stretch
from mesa_swarm.recording.sealed_stream import SealedReader
from support.driven_models import taken


def run(model, steps):
    """Return a model after a run."""
    return model.run(steps)


TAKING = {"driven": run, "single": taken}


@contextmanager
def steps_driven():
    """Yield a list of how many steps each compiled call takes."""
    numbers, take = [], Driver.take

    def counted(driver, steps, *arguments):
        numbers.append(steps)
        return take(driver, steps, *arguments)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Driver, "take", counted)
        yield numbers


@contextmanager
def without_clock():
    """Let no chunk end because a second is over."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("mesa_swarm.recording.recorder.MOST_SECONDS", math.inf)
        yield


def recorded_both_ways(make, folder, do, **settings):
    """Return the paths of two recordings of ``do(model, take)``, and how many steps compiled calls took."""
    paths = []
    with without_clock(), steps_driven() as numbers:
        for name, take in TAKING.items():
            model = make()
            paths.append(folder / f"{name}.arrow")
            with model.record(paths[-1], overwrite=True, **settings):
                do(model, take)
    return *paths, sum(numbers)


def contents_of(path, whole=True):
    """Return all rows of a recording, which was closed if it is whole, as bytes, and its pieces without rows."""
    reader = SealedReader(path)
    assert reader.complete or not whole
    batches = [reader.batch(piece) for piece in reader.pieces]
    attached = [(reader.name(piece), piece.step, reader.content(piece)) for piece in reader.attached]
    table = pa.Table.from_batches(batches, reader.schema.remove_metadata()).combine_chunks()
    return [
        name_and_bytes(column, name) for name, column in zip(table.column_names, table.columns, strict=True)
    ], attached


def name_and_bytes(column, name):
    """Return the name of a column and its values as bytes, NaN like any other number."""
    sink = pa.BufferOutputStream()
    batch = pa.RecordBatch.from_arrays([pa.concat_arrays(column.chunks)], [name]) if column.num_chunks else None
    with pa.ipc.new_stream(sink, pa.schema([(name, column.type)])) as writer:
        if batch is not None:
            writer.write_batch(batch)
    return name, sink.getvalue().to_pybytes()


def assert_same_recordings(one, other):
    """Assert that two recordings have the same rows and the same pieces without rows."""
    (columns, attached), (other_columns, other_attached) = contents_of(one), contents_of(other)
    for (name, values), (other_name, other_values) in zip(columns, other_columns, strict=True):
        assert name == other_name
        assert values == other_values, name
    assert [piece[:2] for piece in attached] == [piece[:2] for piece in other_attached]
    assert attached == other_attached


def can_be_driven(model):
    """Return whether a compiled call can take steps of a model."""
    return begin_stretch(model, 50) is not None
