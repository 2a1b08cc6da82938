"""Sense all, move all, resolve all contacts: array functions, and their Shapely twins."""
