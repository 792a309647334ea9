"""The physics of a scene: its data, its terms, what follows from them, and the exact solution."""
