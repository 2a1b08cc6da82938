"""Maps: what stands in an arena, and all files that a map is read from and written to."""
