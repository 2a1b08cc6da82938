"""Recordings as pictures, films, pages and tables."""
