"""A LAN made of network namespaces on a bridge: nodes that share nothing but packets. Needs root."""

import os
import subprocess

DEVICE = "eth0"


def ip(*words: object) -> None:
    subprocess.run(["ip", *map(str, words)], check=True, capture_output=True, text=True)


class Lan:
    """Nodes 1 .. num_nodes. Multicast goes from one to the others, and no farther: the bridge has no way out."""

    def __init__(self, num_nodes: int) -> None:
        self._bridge = f"tb{os.getpid()}"
        self._nodes = range(1, num_nodes + 1)

    def make(self) -> None:
        ip("link", "add", self._bridge, "type", "bridge", "mcast_snooping", 0)
        ip("link", "set", self._bridge, "up")
        for node in self._nodes:
            space, port = self.space(node), self._port(node)
            ip("netns", "add", space)
            ip("link", "add", port, "type", "veth", "peer", "name", DEVICE, "netns", space)
            ip("link", "set", port, "master", self._bridge, "up")
            ip("-n", space, "link", "set", "lo", "up")
            ip("-n", space, "addr", "add", f"10.77.0.{node}/24", "dev", DEVICE)
            ip("-n", space, "link", "set", DEVICE, "up")
            ip("-n", space, "route", "add", "224.0.0.0/4", "dev", DEVICE)

    def remove(self) -> None:
        for words in [("netns", "del", self.space(node)) for node in self._nodes] + [("link", "del", self._bridge)]:
            subprocess.run(["ip", *words], capture_output=True)

    def space(self, node: int) -> str:
        return f"{self._bridge}n{node}"

    def _port(self, node: int) -> str:
        return f"{self._bridge}p{node}"

    def set_link(self, node: int, state: str) -> None:
        """`state`: up or down. As if its cable were pulled."""
        ip("link", "set", self._port(node), state)

    def at(self, node: int) -> list[str]:
        """What stands before a command that is to run there."""
        return ["ip", "netns", "exec", self.space(node)]
