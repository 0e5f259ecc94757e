"""`tessera spy --text`: what is on a bus, for terminals."""
