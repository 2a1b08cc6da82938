"""The tab in which many runs are made."""
