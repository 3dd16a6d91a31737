"""Procedural generator of the braid benchmark scenes."""
