"""Answers to exercises are texts of cells, no modules with examples."""

collect_ignore = ["answers"]
