"""The `tessera` command: runs of the stack, the processes behind them, and reports of their results."""
