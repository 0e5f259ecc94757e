"""The status that a deputy publishes."""

import os
from collections.abc import Iterable

import psutil

from tessera_cli.messages import header_t, procman_list_t, procman_process_t, procman_status_t
from tessera_cli.supervision.orders import OrderVerifier
from tessera_cli.supervision.process_names import split_name
from tessera_cli.supervision.running_list import RunningList
from tessera_cli.supervision.supervised_process import SupervisedProcess

MAX_REASON_LENGTH = 300


def make_status(
    header: header_t,
    verifier: OrderVerifier,
    lists: Iterable[RunningList],
    processes: list[SupervisedProcess],
    now: float,
) -> procman_status_t:
    """Everything except the result of the last order. `now`: monotonic seconds."""
    status = procman_status_t()
    status.header = header
    status.deputy, status.host, status.nonce = verifier.deputy, os.uname().nodename, verifier.nonce
    status.last_number, status.num_obeyed = verifier.last_number, verifier.num_accepted
    status.num_for_others = verifier.num_for_others
    status.kinds = sorted(verifier.refused)
    status.num_kinds = len(status.kinds)
    status.num_refused = [verifier.refused[kind] for kind in status.kinds]
    status.cpu_percent, status.memory_percent = psutil.cpu_percent(), psutil.virtual_memory().percent
    status.lists = [_describe_list(each, processes, now) for each in lists]
    status.num_lists = len(status.lists)
    return status


def _describe_list(running: RunningList, processes: list[SupervisedProcess], now: float) -> procman_list_t:
    described = procman_list_t()
    described.name, described.run = running.name, running.run
    described.main_url, described.channel_prefix = running.main_url, running.channel_prefix
    own = [process for process in processes if split_name(process.name)[0] == running.name]
    described.processes = [_describe(process, now) for process in own]
    described.num_processes = len(described.processes)
    return described


def _describe(process: SupervisedProcess, now: float) -> procman_process_t:
    described = procman_process_t()
    described.name, described.state = split_name(process.name)[1], process.state
    described.reason = process.reason[:MAX_REASON_LENGTH].replace("\0", "")
    described.command = process.wanted.command if process.wanted else ""
    described.num_starts = process.num_starts
    if process.child:
        described.pid, described.up_s = process.child.pid, now - process.started_at
        usage = process.usage
        described.cpu_percent, described.cpu_s, described.rss_mb = usage.cpu_percent, usage.total_cpu_s, usage.rss_mb
    return described
