"""Learners: networks, policies, and how they are trained."""
