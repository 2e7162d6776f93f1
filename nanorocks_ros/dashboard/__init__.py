"""The live page: what is measured, in a browser."""
