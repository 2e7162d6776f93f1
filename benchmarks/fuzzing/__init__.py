"""Seeded damage of every kind of input, for `python -m benchmarks fuzz`."""
