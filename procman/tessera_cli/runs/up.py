"""tessera up: starts the processes of a list on their nodes, or carries out a script of it. Other lists are left alone."""

import tempfile
import time
from argparse import Namespace
from pathlib import Path

from tessera_cli import settings
from tessera_cli.errors import UserError
from tessera_cli.lcm_bus import ttl_of
from tessera_cli.runs.script_summary import ScriptRun
from tessera_cli.supervision.process_list import ProcessList, read_process_list
from tessera_cli.supervision.process_names import LIST
from tessera_cli.supervision.script_runner import ScriptRunner
from tessera_cli.supervision.sheriff import Sheriff
from tessera_cli.supervision.sheriff_commands import say


def main(arguments: Namespace) -> int:
    process_list = read_process_list(Path(arguments.file), dict(arguments.counts))
    if arguments.script and arguments.script not in process_list.scripts:
        raise UserError(
            f"{arguments.file} has no script '{arguments.script}'; it has: {', '.join(process_list.scripts) or 'none'}."
        )
    name = _name(arguments)
    assignments = _assignments(process_list, arguments)
    values = _check(assignments)
    sheriff = Sheriff(arguments)
    runner = ScriptRunner(sheriff, name, process_list, assignments, say)
    sheriff.require_deputies(runner.hosts)
    sheriff.meet()
    _refuse_clash(sheriff, name, process_list, values["bus"])
    runner.leave_other_hosts()
    began = time.monotonic()
    if arguments.script:
        run = ScriptRun(sheriff, name, assignments, values)
        runner.carry_out(arguments.script)
        say(f"script {arguments.script} ended well after {time.monotonic() - began:.1f} s")
        if words := run.sum_up():
            print(words)
        return 0
    names = list(process_list.processes)
    runner.start(names)
    runner.wait(names, "ready", arguments.timeout)
    say(f"{len(names)} processes on {len(runner.hosts)} nodes are ready after {time.monotonic() - began:.1f} s")
    return 0


def _name(arguments: Namespace) -> str:
    name = arguments.name or Path(arguments.file).stem
    if not LIST.fullmatch(name):
        raise UserError(
            f"'{name}' can't be a list's name, which has letters, digits, _ . and -, at most 48: give --name NAME."
        )
    return name


def _assignments(process_list: ProcessList, arguments: Namespace) -> list[str]:
    """All settings of the run that differ from the defaults."""
    make = settings.lan_assignments if ttl_of(arguments) else settings.port_assignments
    assignments = make(arguments.port) + process_list.settings
    if arguments.out:
        assignments.append(f"evaluator.out_dir={Path(arguments.out).expanduser().absolute()}")
    return assignments + arguments.settings


def _check(assignments: list[str]) -> dict:
    """All settings as sections of keys. Raises UserError if one is at fault."""
    with tempfile.TemporaryDirectory() as folder:
        return settings.write_settings(assignments, Path(folder) / "settings.yaml")


def _refuse_clash(sheriff: Sheriff, name: str, process_list: ProcessList, bus: dict) -> None:
    """Two stages of one name on one bus, under one prefix, would answer each other's messages."""
    stages = {process.name for process in process_list.processes.values() if process.options.ready == "status"}
    for heard in sheriff.deputies.values():
        for each in heard.status.lists:
            if each.name == name or (each.main_url, each.channel_prefix) != (bus["main_url"], bus["channel_prefix"]):
                continue
            if common := [process.name for process in each.processes if process.pid and process.name in stages]:
                raise UserError(
                    f"the list {each.name} has a '{common[0]}' on the same bus: end it (procman/tessera down {each.name}), or give "
                    f"this one channels of its own: --set bus.channel_prefix={name.upper()}_"
                )
