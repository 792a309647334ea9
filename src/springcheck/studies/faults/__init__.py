"""Engines broken on purpose: the negative controls of the package and its detection limits."""
