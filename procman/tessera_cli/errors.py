"""The two ways a command fails. Each holds one sentence for the user."""


class UserError(Exception):
    """The arguments or the input are at fault: exit status 2."""


class RunFailed(Exception):
    """What was asked for began, and did not end well: exit status 1."""
