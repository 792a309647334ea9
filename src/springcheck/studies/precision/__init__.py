"""Error against run time, down to rounding."""
