"""The commands that order and show processes on all nodes: tessera down, status, restart and log."""

import json
from argparse import Namespace
from typing import Any

from tessera_cli.console import say
from tessera_cli.constants import LISTEN_S, TAIL_TIMEOUT_S
from tessera_cli.errors import RunError, UserError
from tessera_cli.messages import procman_list_t, procman_order_t, procman_output_t, procman_process_t
from tessera_cli.supervision.process_names import split_name
from tessera_cli.supervision.sheriff import KnownDeputy, Sheriff
from tessera_cli.supervision.supervised_process import READY, STATE_NAMES

NOT_RUNNING = (procman_process_t.STOPPED, procman_process_t.ENDED, procman_process_t.FAILED)


def down(arguments: Namespace) -> int:
    """Ends one list, or all lists."""
    sheriff = Sheriff(arguments)
    sheriff.discover_deputies()
    if arguments.name and arguments.name not in sheriff.lists:
        known = ", ".join(sheriff.lists) or "none"
        raise UserError(f"no deputy has a list '{arguments.name}'; known: {known}.")
    deputies = sheriff.deputies_of(arguments.name) if arguments.name else sorted(sheriff.deputies)
    # Each deputy first ends processes that none of its own depends on: the camera before the dispatcher.
    for deputy in deputies:
        sheriff.run(deputy, arguments.name, [], [], "")
    if not sheriff.listen_until(lambda: not _running(sheriff, arguments.name), arguments.timeout):
        left = ", ".join(_running(sheriff, arguments.name))
        raise RunError(f"still running after {arguments.timeout:g} s: {left}.")
    say(f"all processes of {arguments.name or ', '.join(deputies)} are stopped")
    return 0


def _running(sheriff: Sheriff, list_name: str) -> list[str]:
    """Full names of the processes of this list that still run; of all lists if the name is empty."""
    return [
        name
        for name, (_, process) in sheriff.processes().items()
        if list_name in ("", split_name(name)[0]) and (process.pid or process.state not in NOT_RUNNING)
    ]


def status(arguments: Namespace) -> int:
    """Exit status 1 if a process has failed."""
    sheriff = Sheriff(arguments)
    sheriff.discover_deputies()
    if arguments.json:
        print(json.dumps({name: _to_json(deputy) for name, deputy in sorted(sheriff.deputies.items())}, indent=2))
    else:
        print_status(sheriff)
    return int(any(process.state == procman_process_t.FAILED for _, process in sheriff.processes().values()))


def _to_json(deputy: KnownDeputy) -> dict[str, Any]:
    status = deputy.status
    return {
        "host": status.host,
        "cpu_percent": status.cpu_percent,
        "memory_percent": status.memory_percent,
        "orders_obeyed": status.num_obeyed,
        "orders_refused": dict(zip(status.kinds, status.num_refused)),
        "lists": {each.name: _list_to_json(each) for each in status.lists},
    }


def _list_to_json(each: procman_list_t) -> dict[str, Any]:
    processes = {
        process.name: {
            "state": STATE_NAMES.get(process.state, "?"),
            "reason": process.reason,
            "pid": process.pid,
            "starts": process.num_starts,
            "cpu_percent": process.cpu_percent,
            "rss_mb": process.rss_mb,
        }
        for process in each.processes
    }
    return {"main_url": each.main_url, "channel_prefix": each.channel_prefix, "processes": processes}


def print_status(sheriff: Sheriff) -> None:
    for name, deputy in sorted(sheriff.deputies.items()):
        status = deputy.status
        print(
            f"{name} ({status.host}): CPU {status.cpu_percent:.0f} %, memory {status.memory_percent:.0f} %, "
            f"{status.num_obeyed} orders obeyed, {sum(status.num_refused)} refused"
        )
        for each in status.lists:
            print(f"  {describe_list(each)}")
            for process in each.processes:
                print(_status_line(process))


def _status_line(process: procman_process_t) -> str:
    usage = ""
    if process.pid:
        usage = f"{process.cpu_percent:5.0f} % {process.rss_mb:6.0f} MB  pid {process.pid}"
    state = STATE_NAMES.get(process.state, "?")
    return f"    {process.name:20s} {state:12s} {process.num_starts:3d} starts {usage}  {process.reason}".rstrip()


def describe_list(each: procman_list_t) -> str:
    """A list with its bus and channels."""
    return f"{each.name}: on {each.main_url}" + (f", channels {each.channel_prefix}..." if each.channel_prefix else "")


def restart(arguments: Namespace) -> int:
    """Ends a process and starts it again; returns when it is ready."""
    sheriff = Sheriff(arguments)
    sheriff.discover_deputies()
    name = sheriff.find(arguments.name)
    order = procman_order_t()
    order.action, order.process = procman_order_t.RESTART, name
    deputy, process = sheriff.processes()[name]
    starts = process.num_starts
    sheriff.send(deputy, order)

    def is_decided() -> bool:
        nonlocal process
        process = sheriff.processes().get(name, (deputy, process))[1]
        return process.state == procman_process_t.FAILED or (process.num_starts != starts and process.state in READY)

    if not sheriff.listen_until(is_decided, arguments.timeout) or process.state == procman_process_t.FAILED:
        state = STATE_NAMES.get(process.state, "?")
        raise RunError(f"{name} on {deputy} is {state}: {process.reason or 'no reason given'}.")
    say(f"{name} on {deputy} is ready again")
    return 0


def log(arguments: Namespace) -> int:
    """The last lines of a process's log on its node; with --follow also what it writes from now on."""
    sheriff = Sheriff(arguments)
    sheriff.discover_deputies()
    name = sheriff.find(arguments.name)
    deputy, _ = sheriff.processes()[name]
    pieces: list[procman_output_t] = []
    sheriff.on_output(pieces.append)
    order = procman_order_t()
    order.action, order.process, order.num_lines = procman_order_t.TAIL, name, arguments.lines
    sent = sheriff.send(deputy, order)
    # The last piece is empty.
    sheriff.listen_until(lambda: any(piece.order == sent and not piece.text for piece in pieces), TAIL_TIMEOUT_S)
    print("".join(piece.text for piece in pieces if piece.order == sent), end="", flush=True)
    while arguments.follow:
        pieces.clear()
        sheriff.listen(LISTEN_S)
        for piece in pieces:
            if piece.process == name and not piece.order:
                print(piece.text, end="", flush=True)
    return 0
