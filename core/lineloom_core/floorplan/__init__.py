"""Straightening a map to its walls, and placing it in a building's floor plan."""
