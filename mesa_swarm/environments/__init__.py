"""PettingZoo and Gymnasium faces of the swarm."""
