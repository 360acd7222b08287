"""Helpers that tests share: shapes, scenes, pictures and statistics."""
