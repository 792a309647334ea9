"""springcheck: simulation engines judged to rounding by a mass on a spring."""
