"""Names of lists and of their processes. On a deputy and to people a process is LIST/PROCESS; its stage knows the latter part."""

import re

from tessera_cli.messages import procman_process_t, procman_status_t

LIST = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,47}")  # also the name of a folder


def qualify(list_name: str, process: str) -> str:
    """A list without a name adds nothing."""
    return f"{list_name}/{process}" if list_name else process


def split(name: str) -> tuple[str, str]:
    """The list and the process in it."""
    list_name, _, process = name.partition("/")
    return list_name, process


def processes_of(status: procman_status_t) -> dict[str, procman_process_t]:
    """All of a deputy by their whole names."""
    return {qualify(each.name, process.name): process for each in status.lists for process in each.processes}
