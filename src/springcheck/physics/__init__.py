"""The physics of a scene: its data, its terms, quantities derived from them, and the exact solution."""
