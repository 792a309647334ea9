"""Helpers that all figures share.  Each study draws its own (`figure.py` beside its measure)."""
