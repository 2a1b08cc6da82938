"""Distances, sectors, overlaps and neighbour grids: numbers in, numbers out."""

# x_min, y_min, x_max and y_max of a world or a part of it, map units.
Bounds = tuple[float, float, float, float]
