"""Nodes of a LAN: copying Tessera to them, what they lack, and the keys that decide whose orders they obey."""
