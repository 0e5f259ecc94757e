"""Processes: what starts, watches and ends them, on this machine and on the nodes of a LAN."""
