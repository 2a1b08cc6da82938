"""Recordings as pictures, films, pages and tables: see `export`."""

from mesa_swarm.exports.export import export

__all__ = ["export"]
