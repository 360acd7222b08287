"""Checks of pictures against other pictures and other renderers."""
