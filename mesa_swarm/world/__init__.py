"""Arena, obstacles, maps and placement: everything that is not a robot."""
