"""tessera down, status, restart and log."""

import json
import time
from argparse import Namespace

from tessera_cli.errors import RunFailed, UserError
from tessera_cli.messages import procman_list_t, procman_order_t, procman_output_t, procman_process_t
from tessera_cli.supervision.process_names import split
from tessera_cli.supervision.sheriff import TURN_S, Sheriff
from tessera_cli.supervision.supervised_process import READY, STATE_NAMES

TAIL_TIMEOUT_S = 5.0
STOPPED = (procman_process_t.STOPPED, procman_process_t.ENDED, procman_process_t.FAILED)


def main(arguments: Namespace) -> int:
    return {"down": down, "status": status, "restart": restart, "log": log}[arguments.command](arguments)


def say(sentence: str) -> None:
    print(f"tessera: {sentence}", flush=True)


def down(arguments: Namespace) -> int:
    """Ends one list, or all; the others are left alone."""
    sheriff = Sheriff(arguments)
    sheriff.meet()
    if arguments.name and arguments.name not in sheriff.lists:
        raise UserError(f"no deputy has a list '{arguments.name}'; there is: {', '.join(sheriff.lists) or 'none'}.")
    deputies = sheriff.deputies_of(arguments.name) if arguments.name else sorted(sheriff.deputies)
    # Each deputy ends first whom nobody of its own waits for: the camera before the dispatcher.
    for deputy in deputies:
        sheriff.run(deputy, arguments.name, [], [], "")
    until = time.monotonic() + arguments.timeout
    while left := [
        name
        for name, (_, process) in sheriff.processes().items()
        if arguments.name in ("", split(name)[0]) and (process.pid or process.state not in STOPPED)
    ]:
        if time.monotonic() > until:
            raise RunFailed(f"still running after {arguments.timeout:g} s: {', '.join(left)}.")
        sheriff.listen(TURN_S)
    say(f"all processes of {arguments.name or ', '.join(deputies)} are stopped")
    return 0


def status(arguments: Namespace) -> int:
    """Exit status 1 if a process failed."""
    sheriff = Sheriff(arguments)
    sheriff.meet()
    if arguments.json:
        print(json.dumps(_as_json(sheriff), indent=2))
    else:
        print_status(sheriff)
    return int(any(process.state == procman_process_t.FAILED for _, process in sheriff.processes().values()))


def _as_json(sheriff: Sheriff) -> dict:
    return {
        deputy: {
            "host": heard.status.host,
            "cpu_percent": heard.status.cpu_percent,
            "memory_percent": heard.status.memory_percent,
            "orders_obeyed": heard.status.num_obeyed,
            "orders_refused": dict(zip(heard.status.kinds, heard.status.num_refused)),
            "lists": {each.name: _list_as_json(each) for each in heard.status.lists},
        }
        for deputy, heard in sorted(sheriff.deputies.items())
    }


def _list_as_json(each: procman_list_t) -> dict:
    return {
        "main_url": each.main_url,
        "channel_prefix": each.channel_prefix,
        "processes": {
            process.name: {
                "state": STATE_NAMES.get(process.state, "?"),
                "reason": process.reason,
                "pid": process.pid,
                "starts": process.num_starts,
                "cpu_percent": process.cpu_percent,
                "rss_mb": process.rss_mb,
            }
            for process in each.processes
        },
    }


def print_status(sheriff: Sheriff) -> None:
    for deputy, heard in sorted(sheriff.deputies.items()):
        refused = sum(heard.status.num_refused)
        print(
            f"{deputy} ({heard.status.host}): CPU {heard.status.cpu_percent:.0f} %, memory {heard.status.memory_percent:.0f} %, "
            f"{heard.status.num_obeyed} orders obeyed, {refused} refused"
        )
        for each in heard.status.lists:
            print(f"  {describe_list(each)}")
            for process in each.processes:
                figures = (
                    f"{process.cpu_percent:5.0f} % {process.rss_mb:6.0f} MB  pid {process.pid}" if process.pid else ""
                )
                state = STATE_NAMES.get(process.state, "?")
                print(
                    f"    {process.name:20s} {state:12s} {process.num_starts:3d} starts {figures}  {process.reason}".rstrip()
                )


def describe_list(each: procman_list_t) -> str:
    return f"{each.name}: on {each.main_url}" + (f", channels {each.channel_prefix}..." if each.channel_prefix else "")


def restart(arguments: Namespace) -> int:
    sheriff = Sheriff(arguments)
    sheriff.meet()
    name = sheriff.find(arguments.name)
    order = procman_order_t()
    order.action, order.process = procman_order_t.RESTART, name
    deputy, process = sheriff.processes()[name]
    starts = process.num_starts
    sheriff.send(deputy, order)
    until = time.monotonic() + arguments.timeout
    while process.num_starts == starts or process.state not in READY:
        process = sheriff.processes().get(name, (deputy, process))[1]
        if time.monotonic() > until or process.state == procman_process_t.FAILED:
            raise RunFailed(
                f"{name} on {deputy} is {STATE_NAMES.get(process.state, '?')}: {process.reason or 'no reason given'}."
            )
        sheriff.listen(TURN_S)
    say(f"{name} on {deputy} is ready again")
    return 0


def log(arguments: Namespace) -> int:
    """The last lines of a process's log on its node; with --follow also what it says from now on."""
    sheriff = Sheriff(arguments)
    sheriff.meet()
    name = sheriff.find(arguments.name)
    deputy, _ = sheriff.processes()[name]
    pieces: list[procman_output_t] = []
    sheriff.on_output(pieces.append)
    order = procman_order_t()
    order.action, order.process, order.num_lines = procman_order_t.TAIL, name, arguments.lines
    sent = sheriff.send(deputy, order)
    until = time.monotonic() + TAIL_TIMEOUT_S
    while not any(piece.order == sent and not piece.text for piece in pieces) and time.monotonic() < until:
        sheriff.listen(TURN_S)
    print("".join(piece.text for piece in pieces if piece.order == sent), end="", flush=True)
    while arguments.follow:
        pieces.clear()
        sheriff.listen(TURN_S)
        for piece in pieces:
            if piece.process == name and not piece.order:
                print(piece.text, end="", flush=True)
    return 0
