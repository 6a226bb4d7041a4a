"""Helpers that any other module may use and that import none of them."""
