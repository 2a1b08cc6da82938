"""The command line as `python -m mesa_swarm`."""

from mesa_swarm.cli import main

if __name__ == "__main__":
    main()
