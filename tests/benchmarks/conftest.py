"""The browser, and the dashboard that it visits."""

from support.browsers import chromium, server, visit

__all__ = ["chromium", "server", "visit"]
