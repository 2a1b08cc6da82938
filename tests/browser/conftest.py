"""The browser, and the dashboard that it visits."""

from support.browsers import chromium, recorded_fires, server, shots, visit, visitor

__all__ = ["chromium", "recorded_fires", "server", "shots", "visit", "visitor"]
