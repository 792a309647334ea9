"""Studies: many runs put together.  They measure how good a scheme is; nothing here passes or fails."""
