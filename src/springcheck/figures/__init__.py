"""Charts as data, and as pictures; each study describes its own (`page.py` beside its measure)."""
