"""What a deputy says of itself."""

import os
from collections.abc import Iterable

import psutil

from tessera_cli.messages import header_t, procman_list_t, procman_process_t, procman_status_t
from tessera_cli.supervision.orders import Gate
from tessera_cli.supervision.process_names import split
from tessera_cli.supervision.running_list import RunningList
from tessera_cli.supervision.supervised_process import Supervised

MAX_REASON = 300


def make_status(
    header: header_t, gate: Gate, lists: Iterable[RunningList], members: list[Supervised], now: float
) -> procman_status_t:
    """All but what depends on the last order. `now`: monotonic seconds."""
    status = procman_status_t()
    status.header = header
    status.deputy, status.host, status.nonce = gate.deputy, os.uname().nodename, gate.nonce
    status.last_number, status.num_obeyed, status.num_for_others = (
        gate.last_number,
        gate.num_passed,
        gate.num_for_others,
    )
    status.kinds = sorted(gate.refused)
    status.num_kinds = len(status.kinds)
    status.num_refused = [gate.refused[kind] for kind in status.kinds]
    status.cpu_percent, status.memory_percent = psutil.cpu_percent(), psutil.virtual_memory().percent
    status.lists = [_describe_list(each, members, now) for each in lists]
    status.num_lists = len(status.lists)
    return status


def _describe_list(running: RunningList, members: list[Supervised], now: float) -> procman_list_t:
    described = procman_list_t()
    described.name, described.run = running.name, running.run
    described.main_url, described.channel_prefix = running.main_url, running.channel_prefix
    described.processes = [_describe(member, now) for member in members if split(member.name)[0] == running.name]
    described.num_processes = len(described.processes)
    return described


def _describe(member: Supervised, now: float) -> procman_process_t:
    process = procman_process_t()
    process.name, process.state, process.reason = (
        split(member.name)[1],
        member.state,
        member.reason[:MAX_REASON].replace("\0", ""),
    )
    process.command = member.wanted.command if member.wanted else ""
    process.num_starts = member.num_starts
    if member.child:
        process.pid, process.up_s = member.child.pid, now - member.started_at
        usage = member.usage
        process.cpu_percent, process.cpu_s, process.rss_mb = usage.cpu_percent, usage.total_cpu_s, usage.rss_mb
    return process
