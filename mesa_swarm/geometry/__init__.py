"""Distances, sectors, overlaps and neighbour grids: numbers in, numbers out."""
