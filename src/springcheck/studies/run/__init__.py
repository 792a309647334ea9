"""The main job: a scene by all its methods, stored, compared and judged."""
