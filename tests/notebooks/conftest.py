"""Answers to exercises are texts of cells: no modules with examples in docstrings."""

collect_ignore = ["answers"]
