"""The models that come with mesa_swarm, one file each."""
