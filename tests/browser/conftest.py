"""The browser, and the dashboard that it visits."""

from support.browsers import chromium, server, shots, visit, visitor

__all__ = ["chromium", "server", "shots", "visit", "visitor"]
