"""tessera deploy: copies the sources, or the built tree, to nodes by ssh and rsync, and tells what each of them lacks."""

import getpass
import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from argparse import Namespace
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import PurePosixPath

from tessera_cli.cluster.keys import KeyRing, key_folder, to_text
from tessera_cli.cluster.node_facts import (
    Fault,
    Here,
    NodeFacts,
    obstacles,
    own_key_name,
    parse_facts,
    probe,
    read_packages,
    remarks,
    shortcomings,
)
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BUILD, ROOT
from tessera_cli.supervision.sheriff_commands import say

NODE = re.compile(
    r"(?P<login>(?:[A-Za-z0-9_][A-Za-z0-9_.-]*@)?[A-Za-z0-9][A-Za-z0-9_.-]*)(?::(?P<folder>[A-Za-z0-9_./][A-Za-z0-9_./+-]*))?"
)
DEFAULT_FOLDER = "tessera"  # in the home folder
PREBUILT = "build/.prebuilt"  # tells `tessera setup` there that nothing is to be built
BUILT = ("build/bin/*", "build/lcmtypes/python/tessera/*.py", "build/versions.json", "build/tessera_types.jar")
SSH_FAILED = 255


@dataclass(frozen=True)
class Node:
    text: str  # as it was typed
    login: str  # [USER@]HOST
    folder: str  # absolute or from the home folder


def parse_node(text: str) -> Node:
    match = NODE.fullmatch(text)
    folder = PurePosixPath(match["folder"] or DEFAULT_FOLDER) if match else None
    if match is None or ".." in folder.parts or str(folder) in ("/", "."):
        raise UserError(f"'{text}' is no node: give [USER@]HOST or [USER@]HOST:FOLDER.")
    return Node(text, match["login"], str(folder))


def main(arguments: Namespace) -> int:
    nodes = [parse_node(text) for text in arguments.nodes]
    shell = shlex.split(arguments.ssh)
    for program in (shell[:1] or ["ssh"]) + ["rsync", "git"]:
        if not shutil.which(program):
            raise UserError(f"deploy needs {program}: sudo apt-get install openssh-client rsync git")
    files = files_to_copy(arguments.built)
    here = look_here()
    are_ready = [Deployment(node, shell, files, here, arguments).carry_out() for node in nodes]
    return 0 if all(are_ready) else 1


def files_to_copy(is_built: bool) -> list[str]:
    """Paths from the root: what git tracks, and with `is_built` what a node needs to run without a build of its own."""
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True)
    if listed.returncode != 0:
        raise UserError(f"{ROOT} is no git checkout, which would say what the sources are.")
    files = [name for name in listed.stdout.split("\0") if name and (ROOT / name).exists()]
    if is_built:
        if BUILD != ROOT / "build" or not (BUILD / "bin" / "tessera-tracker").exists():
            raise UserError("--built: there is no whole build in build/; procman/tessera setup makes it.")
        files += [str(path.relative_to(ROOT)) for pattern in BUILT for path in ROOT.glob(pattern)]
    return sorted(files)


def look_here() -> Here:
    packages = read_packages(ROOT / "procman" / "packages.txt")
    facts = parse_facts(probe([], str(ROOT), packages).stdout)
    requirements = hashlib.sha256((ROOT / "procman" / "requirements.txt").read_bytes()).hexdigest()
    key = to_text(KeyRing(key_folder()).signing_key().verify_key.encode())
    return Here(facts, packages, requirements, key, own_key_name(getpass.getuser(), os.uname().nodename))


class Deployment:
    """Of one node."""

    def __init__(self, node: Node, shell: list[str], files: list[str], here: Here, arguments: Namespace) -> None:
        self._node, self._files, self._here = node, files, here
        self._is_built, self._sets_up, self._is_dry = arguments.built, arguments.setup, arguments.dry_run
        self._ssh_words = [*shell, "-o", "ConnectTimeout=10"]
        self._ssh = [*self._ssh_words, node.login]

    def carry_out(self) -> bool:
        """Whether the node is ready in the end; says in sentences what it lacks."""
        try:
            facts = self._probe()
            if found := obstacles(facts, self._here, self._is_built):
                return self._conclude(found)
            self._copy(facts)
            if self._is_dry:
                return self._conclude(shortcomings(facts, self._here), remarks(facts, self._here))
            facts = self._probe()
            if self._sets_up and any(fault.is_mended_by_setup for fault in shortcomings(facts, self._here)):
                self._set_up()
                facts = self._probe()
            return self._conclude(shortcomings(facts, self._here), remarks(facts, self._here))
        except RunFailed as error:
            say(f"{self._node.text}: {error}")
            return False

    def _probe(self) -> NodeFacts:
        finished = probe(self._ssh, self._node.folder, self._here.packages)
        if finished.returncode != 0:
            raise RunFailed(
                f"{'can not be reached' if finished.returncode == SSH_FAILED else 'can not be looked at'}: "
                f"{_last_line(finished.stderr) or f'status {finished.returncode}'}"
            )
        return parse_facts(finished.stdout)

    def _copy(self, facts: NodeFacts) -> None:
        """Compares by content and leaves times alone: what changed is newer there than what was built of it before."""
        gone = obsolete_files(facts.deployed, self._files, self._is_built)
        if not self._is_dry:
            self._remote(f"mkdir -p {shlex.quote(self._node.folder)}")
            self._remove(gone)
        command = [
            "rsync",
            "--recursive",
            "--links",
            "--perms",
            "--checksum",
            "--itemize-changes",
            "--files-from=-",
            "--from0",
            "-e",
            shlex.join(self._ssh_words),
            *(["--dry-run"] if self._is_dry else []),
            f"{ROOT}/",
            f"{self._node.login}:{self._node.folder}/",
        ]
        finished = subprocess.run(command, input="\0".join(self._files), capture_output=True, text=True)
        if finished.returncode != 0 and not (self._is_dry and not facts.home):
            raise RunFailed(f"the copy failed: {_last_line(finished.stderr)}")
        num_changed = sum(line.startswith(("<f", "<L", "cL")) for line in finished.stdout.splitlines())
        if self._is_dry and not facts.home:
            num_changed = len(self._files)
        if not self._is_dry:
            self._leave_list()
        say(
            f"{self._node.text}: {num_changed} of {len(self._files)} files {'would be ' if self._is_dry else ''}copied to {self._node.folder}/, "
            f"{len(gone)} {'would be ' if self._is_dry else ''}removed"
        )

    def _remove(self, gone: list[str]) -> None:
        if gone:
            self._remote(f"cd {shlex.quote(self._node.folder)} && xargs -0 rm -f --", "\0".join(gone))

    def _leave_list(self) -> None:
        """What was brought, so that the next deploy takes away what is no more."""
        files = self._files + ([PREBUILT] if self._is_built else [])
        self._remote(
            f"cd {shlex.quote(self._node.folder)} && cat > .tessera-deployed"
            + (f" && touch {PREBUILT}" if self._is_built else ""),
            "".join(f"{name}\n" for name in files),
        )

    def _remote(self, command: str, text: str = "") -> None:
        finished = subprocess.run([*self._ssh, command], input=text, capture_output=True, text=True)
        if finished.returncode != 0:
            raise RunFailed(f"'{command}' failed there: {_last_line(finished.stderr)}")

    def _set_up(self) -> None:
        """On this terminal, where it asks before it uses sudo."""
        say(f"{self._node.text}: procman/tessera setup there")
        sys.stdout.flush()
        terminal = ["-t"] if sys.stdin.isatty() else []
        finished = subprocess.run(
            [
                *self._ssh_words,
                *terminal,
                self._node.login,
                f"cd {shlex.quote(self._node.folder)} && procman/tessera setup",
            ]
        )
        if finished.returncode != 0:
            raise RunFailed(f"setup ended there with status {finished.returncode}; its words are above.")

    def _conclude(self, faults: list[Fault], found: Iterable[str] = ()) -> bool:
        for sentence in found:
            say(f"{self._node.text}: {sentence}")
        if not faults:
            say(f"{self._node.text} is ready")
            return True
        hint = ""
        if any(fault.is_mended_by_setup for fault in faults):
            hint = f"; procman/tessera setup there, in {self._node.folder}, or --setup here mends the first of it"
        say(f"{self._node.text} is not ready: {'; '.join(fault.sentence for fault in faults)}{hint}.")
        return False


def obsolete_files(deployed: list[str], files: list[str], is_built: bool) -> list[str]:
    """Of what an earlier deploy brought, what this one would not bring. Paths that lead out of the folder are nobody's."""
    kept = set(files) | ({PREBUILT} if is_built else set())
    return [name for name in deployed if name not in kept and not name.startswith("/") and ".." not in name.split("/")]


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else ""
