"""Chapters of the report that reproduces the paper, in its order."""
