"""Compile, or load from the cache, every kernel before the first real scan arrives."""
