"""Coefficient of restitution, with an honest interval, from films of a granular gas."""

__version__ = '0.1.0'
