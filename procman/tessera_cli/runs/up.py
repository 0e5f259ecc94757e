"""tessera up: starts the processes of a list on their nodes, or carries out one of its scripts."""

import tempfile
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

from tessera_cli.cluster.keys import key_folder
from tessera_cli.console import say
from tessera_cli.constants import LAN_MESSAGE_BYTES
from tessera_cli.errors import UserError
from tessera_cli.files import absolute
from tessera_cli.lcm_bus import is_on_lan
from tessera_cli.membership import LOCAL_RUN_DIR, draw_secret, pool_secret, run_dir_of
from tessera_cli.runs.script_summary import ScriptWatcher
from tessera_cli.runs.summary import Present
from tessera_cli.settings import Settings, network_assignments, write_settings
from tessera_cli.supervision.process_list import ProcessList, read_process_list
from tessera_cli.supervision.process_names import LIST_NAME
from tessera_cli.supervision.script_runner import ScriptRunner, hosts_of
from tessera_cli.supervision.sheriff import Sheriff


def up(arguments: Namespace, present: Present) -> int:
    """`present` says what is printed about a run that a script carried out. Other lists are left alone."""
    process_list = read_process_list(Path(arguments.file), dict(arguments.counts))
    if arguments.script and arguments.script not in process_list.scripts:
        known = ", ".join(process_list.scripts) or "none"
        raise UserError(f"{arguments.file} has no script '{arguments.script}'; it has: {known}.")
    name = _name(arguments)
    assignments = _assignments(process_list, arguments)
    values = _merge(assignments)
    sheriff, hosts = Sheriff(arguments), hosts_of(process_list)
    sheriff.require_deputies(hosts)
    sheriff.discover_deputies()
    _refuse_clash(sheriff, name, process_list, values["bus"])
    runner = ScriptRunner(sheriff, name, process_list, assignments, _secret(sheriff, process_list, values), say)
    runner.end_on_other_hosts()
    began = time.monotonic()
    if arguments.script:
        watcher = ScriptWatcher(sheriff, name, assignments, values)
        runner.run(arguments.script)
        say(f"script {arguments.script} ended well after {time.monotonic() - began:.1f} s")
        if words := watcher.sum_up(present):
            print(words)
        return 0 if watcher.ended in ("", "complete") and watcher.is_trustworthy else 1
    names = list(process_list.processes)
    runner.start(names)
    runner.wait(names, "ready", arguments.timeout)
    say(f"{len(names)} processes on {len(hosts)} nodes are ready after {time.monotonic() - began:.1f} s")
    return 0


def _name(arguments: Namespace) -> str:
    name = arguments.name or Path(arguments.file).stem
    if not LIST_NAME.fullmatch(name):
        rule = "a list's name has letters, digits, _ . and -, at most 48"
        raise UserError(f"'{name}' can't be used: {rule}; give --name NAME.")
    return name


def _assignments(process_list: ProcessList, arguments: Namespace) -> list[str]:
    """All settings of the run that differ from the defaults."""
    on_lan = is_on_lan(arguments)
    assignments = network_assignments(arguments.port, on_lan)
    if on_lan and has_map_on_several_hosts(process_list):
        assignments.append(f"bus.max_local_message_bytes={LAN_MESSAGE_BYTES}")
    assignments += process_list.settings
    assignments.append(f"bus.run_dir={LOCAL_RUN_DIR}")
    if arguments.out:
        assignments.append(f"evaluator.out_dir={absolute(arguments.out)}")
    return assignments + arguments.settings


def has_map_on_several_hosts(process_list: ProcessList) -> bool:
    """Whether images, features and the map are exchanged over the network: extractors alone take no part in that."""
    return len({each.host for each in process_list.processes.values() if each.command != "extractor"}) > 1


def _merge(assignments: list[str]) -> Settings:
    """All settings. Raises UserError if one is wrong."""
    with tempfile.TemporaryDirectory() as folder:
        return write_settings(assignments, Path(folder) / "settings.yaml")


def _secret(sheriff: Sheriff, process_list: ProcessList, values: Settings) -> bytes | None:
    """Of the members of the list; None with `bus.run_dir=`, where messages are neither signed nor checked.

    What runs on this bus already keeps its secret, so that another `up` need not start it again; else it is a new one.
    It is left in this user's folder, for commands that listen to the list.
    """
    bus = values["bus"]
    if bus["run_dir"] != LOCAL_RUN_DIR:
        if bus["run_dir"]:
            raise UserError("bus.run_dir is made by each deputy: leave it out, or give --set bus.run_dir= for none.")
        return None
    run_dir = run_dir_of(key_folder(), bus["main_url"], bus["channel_prefix"])
    known = run_dir.secret() if _is_in_use(sheriff, bus) else None
    has_extractors = any(process.command == "extractor" for process in process_list.processes.values())
    if values["extractor"]["robots"] or not has_extractors:
        known = pool_secret(key_folder())
    run_dir.lock(f"a stack of `tessera run` is on the bus {bus['main_url']}: end it, or give --port N.")
    secret = known or draw_secret()
    run_dir.make(secret)
    run_dir.unlock()
    return secret


def _is_in_use(sheriff: Sheriff, bus: dict[str, Any]) -> bool:
    """Whether processes of a list speak on this bus, with these channels."""
    lists = [each for deputy in sheriff.deputies.values() for each in deputy.status.lists]
    return any(
        (each.main_url, each.channel_prefix) == (bus["main_url"], bus["channel_prefix"])
        and any(process.pid for process in each.processes)
        for each in lists
    )


def _refuse_clash(sheriff: Sheriff, name: str, process_list: ProcessList, bus: dict[str, Any]) -> None:
    """Two stages of one name on one bus, with the same prefix, would answer each other's messages."""
    stages = {process.name for process in process_list.processes.values() if process.options.ready == "status"}
    for each in [each for deputy in sheriff.deputies.values() for each in deputy.status.lists]:
        if each.name == name or (each.main_url, each.channel_prefix) != (bus["main_url"], bus["channel_prefix"]):
            continue
        if common := [process.name for process in each.processes if process.pid and process.name in stages]:
            raise UserError(
                f"the list {each.name} has a '{common[0]}' on the same bus: end it (procman/tessera down {each.name}), "
                f"or give this list channels of its own: --set bus.channel_prefix={name.upper()}_"
            )
