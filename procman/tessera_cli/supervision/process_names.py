"""Names of process lists and of their processes.

For deputies and people a process is LIST/PROCESS; its stage knows only PROCESS.
"""

import re

from tessera_cli.messages import procman_process_t, procman_status_t

LIST_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,47}")  # also the name of a folder


def full_name(list_name: str, process: str) -> str:
    """LIST/PROCESS; only PROCESS if the list has no name."""
    return f"{list_name}/{process}" if list_name else process


def split_name(name: str) -> tuple[str, str]:
    """The list and the process of a full name."""
    list_name, _, process = name.partition("/")
    return list_name, process


def processes_of(status: procman_status_t) -> dict[str, procman_process_t]:
    """All processes of a deputy by their full names."""
    return {full_name(each.name, process.name): process for each in status.lists for process in each.processes}
