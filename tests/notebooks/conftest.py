"""Answers to exercises are texts of cells, no modules with examples; all claims of a notebook share their runs."""

import pytest

collect_ignore = ["answers"]


def pytest_collection_modifyitems(items):
    """Let one process run all claims of a notebook, with pytest-xdist's `--dist loadgroup`."""
    for item in items:
        if item.path.name.startswith("test_claims"):
            item.add_marker(pytest.mark.xdist_group(item.path.name))
