"""Lines for people on the terminal or in a log."""


def say(sentence: str) -> None:
    """Prints one line with the name of this command."""
    print(f"tessera: {sentence}", flush=True)
