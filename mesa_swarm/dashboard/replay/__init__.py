"""The tab in which a recording is replayed."""
