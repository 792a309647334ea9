"""Engines broken on purpose: the package's own negative controls."""
