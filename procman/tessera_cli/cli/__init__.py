"""The command line: what people type, and one module for each command."""
