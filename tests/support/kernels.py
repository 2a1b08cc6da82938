"""What a model decides by, and whether two models hold the same bits."""

import numpy as np


def decides_by(model):
    """Return the stage of the plan in which layers decide."""
    return next(stage for _, stage in model.plan.stages if stage.name == "layers decide")


def columns_after(model, steps=250):
    """Return copies of the columns of robots after these steps."""
    return {name: column.copy() for name, column in model.run(steps).swarm.columns.items()}


def assert_equal_columns(columns, others):
    """Check that columns have the same names and bits."""
    assert columns.keys() == others.keys()
    for name, column in columns.items():
        np.testing.assert_array_equal(column, others[name], err_msg=name)
