"""Runs of the whole stack: their sources, settings, start, progress and results in a folder."""
