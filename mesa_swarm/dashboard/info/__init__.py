"""The tab that describes a model."""
