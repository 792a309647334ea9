"""The atlas of extreme cases."""
