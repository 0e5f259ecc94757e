"""The command line: argument types, shared options, and one module for each command in commands/.

Nothing here imports more than the standard library before a command runs, so that --help works on a fresh machine and
every command starts at once.
"""
