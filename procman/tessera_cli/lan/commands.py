"""tessera up, down, status, restart and log."""

import json
import tempfile
import time
from argparse import Namespace
from pathlib import Path

from tessera_cli import settings
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.lan.process_list import ProcessList, read_process_list
from tessera_cli.lan.procman_bus import ttl_of
from tessera_cli.lan.script import ScriptRunner
from tessera_cli.lan.sheriff import TURN_S, Sheriff
from tessera_cli.lan.supervised import READY, STATE_NAMES
from tessera_cli.types import procman_order_t, procman_output_t, procman_process_t

# A message that fits one packet of a LAN: the loss of a fragment would lose it whole.
LAN_MESSAGE_BYTES = 1400
TAIL_TIMEOUT_S = 5.0
STOPPED = (procman_process_t.STOPPED, procman_process_t.ENDED, procman_process_t.FAILED)


def main(arguments: Namespace) -> int:
    return {"up": up, "down": down, "status": status, "restart": restart, "log": log}[arguments.command](arguments)


def say(sentence: str) -> None:
    print(f"tessera: {sentence}", flush=True)


def up(arguments: Namespace) -> int:
    process_list = read_process_list(Path(arguments.file))
    if arguments.script and arguments.script not in process_list.scripts:
        raise UserError(f"{arguments.file} has no script '{arguments.script}'; it has: {', '.join(process_list.scripts) or 'none'}.")
    assignments = _assignments(process_list, arguments)
    sheriff = Sheriff(arguments)
    runner = ScriptRunner(sheriff, process_list, assignments, say)
    sheriff.require_deputies(runner.hosts)
    began = time.monotonic()
    if arguments.script:
        runner.carry_out(arguments.script)
        say(f"script {arguments.script} ended well after {time.monotonic() - began:.1f} s")
        return 0
    names = list(process_list.processes)
    runner.start(names)
    runner.wait(names, "ready", arguments.timeout)
    say(f"{len(names)} processes on {len(runner.hosts)} nodes are ready after {time.monotonic() - began:.1f} s")
    return 0


def _assignments(process_list: ProcessList, arguments: Namespace) -> list[str]:
    """All settings of the run that differ from the defaults, checked."""
    assignments = settings.port_assignments(arguments.port)
    if ttl_of(arguments):
        assignments = [text.replace("?ttl=0", "?ttl=1") for text in assignments]
        assignments += [f"bus.tile_url=udpm://{settings.GROUP}:{{port}}?ttl=1", f"bus.max_message_bytes={LAN_MESSAGE_BYTES}"]
    assignments += process_list.settings
    if arguments.out:
        assignments.append(f"evaluator.out_dir={Path(arguments.out).expanduser().absolute()}")
    assignments += arguments.settings
    with tempfile.TemporaryDirectory() as folder:
        settings.write_settings(assignments, Path(folder) / "settings.yaml")
    return assignments


def down(arguments: Namespace) -> int:
    sheriff = Sheriff(arguments)
    sheriff.meet()
    # Those whose processes nobody waits for go first: the camera before the dispatcher. Each deputy does likewise with its own.
    for deputy in sorted(sheriff.deputies):
        sheriff.run(deputy, [], [], "")
    until = time.monotonic() + arguments.timeout
    while left := [name for name, (_, process) in sheriff.processes().items() if process.pid or process.state not in STOPPED]:
        if time.monotonic() > until:
            raise RunFailed(f"still running after {arguments.timeout:g} s: {', '.join(left)}.")
        sheriff.listen(TURN_S)
    say(f"all processes of {', '.join(sorted(sheriff.deputies))} are stopped")
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
    return {deputy: {"host": heard.status.host, "cpu_percent": heard.status.cpu_percent, "memory_percent": heard.status.memory_percent,
                     "orders_obeyed": heard.status.num_obeyed, "orders_refused": dict(zip(heard.status.kinds, heard.status.num_refused)),
                     "processes": {process.name: {"state": STATE_NAMES.get(process.state, "?"), "reason": process.reason, "pid": process.pid,
                                                  "starts": process.num_starts, "cpu_percent": process.cpu_percent, "rss_mb": process.rss_mb}
                                   for process in heard.status.processes}}
            for deputy, heard in sorted(sheriff.deputies.items())}


def print_status(sheriff: Sheriff) -> None:
    for deputy, heard in sorted(sheriff.deputies.items()):
        refused = sum(heard.status.num_refused)
        print(f"{deputy} ({heard.status.host}): CPU {heard.status.cpu_percent:.0f} %, memory {heard.status.memory_percent:.0f} %, "
              f"{heard.status.num_obeyed} orders obeyed, {refused} refused")
        for process in heard.status.processes:
            figures = f"{process.cpu_percent:5.0f} % {process.rss_mb:6.0f} MB  pid {process.pid}" if process.pid else ""
            state = STATE_NAMES.get(process.state, "?")
            print(f"  {process.name:20s} {state:12s} {process.num_starts:3d} starts {figures}  {process.reason}".rstrip())


def restart(arguments: Namespace) -> int:
    sheriff = Sheriff(arguments)
    sheriff.meet()
    order = procman_order_t()
    order.action, order.process = procman_order_t.RESTART, arguments.name
    deputy = sheriff.deputy_of(arguments.name)
    process = sheriff.processes()[arguments.name][1]
    starts = process.num_starts
    sheriff.send(deputy, order)
    until = time.monotonic() + arguments.timeout
    while process.num_starts == starts or process.state not in READY:
        process = sheriff.processes().get(arguments.name, (deputy, process))[1]
        if time.monotonic() > until or process.state == procman_process_t.FAILED:
            raise RunFailed(f"{arguments.name} on {deputy} is {STATE_NAMES.get(process.state, '?')}: {process.reason or 'no reason given'}.")
        sheriff.listen(TURN_S)
    say(f"{arguments.name} on {deputy} is ready again")
    return 0


def log(arguments: Namespace) -> int:
    """The last lines of a process's log on its node; with --follow also what it says from now on."""
    sheriff = Sheriff(arguments)
    sheriff.meet()
    deputy = sheriff.deputy_of(arguments.name)
    pieces: list[procman_output_t] = []
    sheriff.on_output(pieces.append)
    order = procman_order_t()
    order.action, order.process, order.num_lines = procman_order_t.TAIL, arguments.name, arguments.lines
    sent = sheriff.send(deputy, order)
    until = time.monotonic() + TAIL_TIMEOUT_S
    while not any(piece.order == sent and not piece.text for piece in pieces) and time.monotonic() < until:
        sheriff.listen(TURN_S)
    print("".join(piece.text for piece in pieces if piece.order == sent), end="", flush=True)
    while arguments.follow:
        pieces.clear()
        sheriff.listen(TURN_S)
        for piece in pieces:
            if piece.process == arguments.name and not piece.order:
                print(piece.text, end="", flush=True)
    return 0
