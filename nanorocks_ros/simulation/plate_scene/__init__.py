"""Simulated pictures of the whole plate with its eight trays."""
