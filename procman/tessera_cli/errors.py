"""The two ways in which a command fails; each exception holds one sentence for the user."""


class UserError(Exception):
    """The arguments or the input are wrong: exit status 2."""


class RunError(Exception):
    """What was asked for was started and did not end well: exit status 1."""
