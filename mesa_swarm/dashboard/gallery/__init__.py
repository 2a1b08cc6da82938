"""The tab of all models, and their pictures."""
