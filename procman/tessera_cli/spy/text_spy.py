"""`tessera spy --text`: a table of the channels, and the last message of one; lines where there is no terminal."""

import os
import select
import sys
import termios
import time
import tty
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from tessera_cli.console import say
from tessera_cli.constants import LINE_PERIOD_S, LISTEN_S, WATCH_PANEL_PERIOD_S
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import Bus, is_on_lan, listen, stack_bus_url
from tessera_cli.spy.message_tree import tree_of
from tessera_cli.spy.traffic import Channel, Traffic

MAX_WIDTH = 80
UP, DOWN, QUIT = (b"\x1b[A", b"k"), (b"\x1b[B", b"j"), (b"q",)


def spy_as_text(arguments: Namespace) -> int:
    """Until Ctrl-C, q, or --seconds have passed."""
    bus = Bus(stack_bus_url(arguments.bus, arguments.port, is_on_lan(arguments)), "spy", hears_images=True)
    traffic = Traffic()
    bus.subscribe_all(lambda channel, data: traffic.add(channel, data, time.monotonic()))
    end = time.monotonic() + arguments.seconds if arguments.seconds else float("inf")
    if sys.stdout.isatty() and sys.stdin.isatty():
        _show_panel(bus, traffic, end, arguments.channel)
    else:
        _print_lines(bus, traffic, end, arguments.channel)
    return 0


# --- Without a terminal -------------------------------------------------------------------------------------------
def _print_lines(bus: Bus, traffic: Traffic, end: float, channel: str | None) -> None:
    """Every few seconds; with an end, once then."""
    interrupt, told_at = Interrupt(), time.monotonic()
    while time.monotonic() < end and not interrupt.requested:
        listen([bus], LISTEN_S)
        if end == float("inf") and time.monotonic() - told_at > LINE_PERIOD_S:
            told_at = time.monotonic()
            print("\n".join(plain_lines(traffic, told_at, channel)), flush=True)
    print("\n".join(plain_lines(traffic, time.monotonic(), channel)), flush=True)
    if not traffic.channels():
        say(f"nothing was heard on {bus.url}: does a stack run there? --port N and --bus select others")


def plain_lines(traffic: Traffic, now: float, channel: str | None) -> list[str]:
    """A table, and the last message of this channel."""
    lines = [f"{'channel':<24} {'type':<22} {'per s':>7} {'kB/s':>8} {'bytes':>6} {'gaps':>5}"]
    for heard in traffic.channels():
        name, type_name, *numbers = _cells(heard, now)
        rate, kilobytes, size, gaps = numbers
        lines.append(f"{name:<24} {type_name:<22} {rate:>7} {kilobytes:>8} {size:>6} {gaps:>5}")
    for heard in traffic.channels():
        if heard.name == channel:
            lines += [f"{channel}, the last message:", *(f"  {line}" for line in tree_of(heard.last))]
    return lines


# --- In a terminal ------------------------------------------------------------------------------------------------
def _show_panel(bus: Bus, traffic: Traffic, end: float, channel: str | None) -> None:
    interrupt, drawn_at = Interrupt(), 0.0
    console = Console()
    with _raw_keys(), Live(console=console, auto_refresh=False, screen=True) as live:
        while time.monotonic() < end and not interrupt.requested:
            listen([bus], LISTEN_S)
            key = _key()
            if key in QUIT:
                return
            names = [heard.name for heard in traffic.channels()]
            if names and (key in UP or key in DOWN or channel is None):
                channel = _moved(names, channel, (key in DOWN) - (key in UP))
            if key or time.monotonic() - drawn_at > WATCH_PANEL_PERIOD_S:
                drawn_at = time.monotonic()
                live.update(draw(traffic, drawn_at, channel, console.size.height, bus.url), refresh=True)


def draw(traffic: Traffic, now: float, channel: str | None, height: int, url: str) -> Group:
    """Fits 80 columns and this height."""
    table = Table(box=box.SIMPLE_HEAD, width=MAX_WIDTH, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("channel", no_wrap=True, overflow="ellipsis")
    table.add_column("type", no_wrap=True, overflow="ellipsis")
    for heading in ("per s", "kB/s", "bytes", "gaps"):
        table.add_column(heading, justify="right", no_wrap=True)
    channels = traffic.channels()
    for heard in channels:
        table.add_row(*_cells(heard, now), style="reverse" if heard.name == channel else "")
    title = Text(f"{url}   arrows: another channel, q: end", style="dim", no_wrap=True, overflow="ellipsis")
    chosen = next((heard for heard in channels if heard.name == channel), None)
    if chosen is None:
        waiting = "waiting for messages" if not channels else f"{channel}: nothing was heard on it"
        return Group(title, table, Text(waiting))
    senders = ", ".join(chosen.publishers)
    rows = [f"{chosen.name} from {senders}" if senders else chosen.name, *tree_of(chosen.last)]
    # The title, and the table with its heading and the lines around that.
    rows = rows[: max(1, height - len(channels) - 5)]
    return Group(title, table, *(Text(row, no_wrap=True, overflow="ellipsis") for row in rows))


def _cells(heard: Channel, now: float) -> tuple[str, ...]:
    messages, num_bytes = heard.rates(now)
    return (
        heard.name,
        heard.type_name,
        f"{messages:.1f}",
        f"{num_bytes / 1000:.1f}",
        str(len(heard.last)),
        str(heard.num_missing),
    )


def _moved(names: list[str], channel: str | None, step: int) -> str:
    if channel not in names:
        return names[0]
    return names[(names.index(channel) + step) % len(names)]


@contextmanager
def _raw_keys() -> Iterator[None]:
    """Keys come at once, and are not echoed."""
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _key() -> bytes:
    """One that was pressed; empty if none was."""
    descriptor = sys.stdin.fileno()
    return os.read(descriptor, 3) if select.select([descriptor], [], [], 0)[0] else b""
