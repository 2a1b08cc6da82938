"""The tab in which two runs are compared."""
