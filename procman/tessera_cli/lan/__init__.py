"""Processes on the nodes of a LAN: process lists, signed orders, the deputy of a node and the sheriff who asks it."""
