"""The map in Python: a copy that follows the mapper, and files that hold it."""
