"""Environments on graphs: an ant walks from vertex to vertex."""
