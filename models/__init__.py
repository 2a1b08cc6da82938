"""The models of mesa_swarm, one file each."""
