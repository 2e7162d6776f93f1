"""Figures that only the report of the reproduction draws."""
