"""One module for each command: its arguments (add_parser) and the function that carries it out (main).

A new command is a new module here and a row in cli/main.py.
"""
