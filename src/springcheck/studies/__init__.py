"""Studies: many runs put together.  What they measure is how good a scheme is; nothing here passes or fails."""
