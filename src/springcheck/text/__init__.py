"""Words, lines and tables: what reports, messages and pages are written with."""
