"""What distribution brings: extractors on the host of all others, on a second one, and on slow nodes."""
