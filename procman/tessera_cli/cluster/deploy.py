"""tessera deploy: copies the sources or the built tree to nodes by ssh and rsync, and reports what each node lacks."""

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
    NodeFacts,
    Problem,
    Requirements,
    copy_blockers,
    missing_requirements,
    own_key_name,
    parse_facts,
    probe,
    read_packages,
    warnings,
)
from tessera_cli.console import say
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import BUILD, PROCMAN, ROOT

NODE = re.compile(
    r"(?P<login>(?:[A-Za-z0-9_][A-Za-z0-9_.-]*@)?[A-Za-z0-9][A-Za-z0-9_.-]*)"
    r"(?::(?P<folder>[A-Za-z0-9_./][A-Za-z0-9_./+-]*))?"
)
DEFAULT_FOLDER = "tessera"  # in the home folder
PREBUILT = "build/.prebuilt"  # tells `tessera setup` there that nothing is to be built
BUILT = ("build/bin/*", "build/lcmtypes/python/tessera/*.py", "build/versions.json", "build/tessera_types.jar")
# Files are compared by content, and their times are left alone: what a copy changed is newer than the last build.
RSYNC = ("rsync", "--recursive", "--links", "--perms", "--checksum", "--itemize-changes", "--files-from=-", "--from0")
SSH_FAILED = 255


@dataclass(frozen=True)
class Node:
    """Where to copy to."""

    text: str  # as it was typed
    login: str  # [USER@]HOST
    folder: str  # absolute or from the home folder


def parse_node(text: str) -> Node:
    match = NODE.fullmatch(text)
    folder = PurePosixPath((match["folder"] if match else None) or DEFAULT_FOLDER)
    if match is None or ".." in folder.parts or str(folder) in ("/", "."):
        raise UserError(f"'{text}' is no node: give [USER@]HOST or [USER@]HOST:FOLDER.")
    return Node(text, match["login"], str(folder))


def deploy(arguments: Namespace) -> int:
    """Exit status 0 if all nodes are ready in the end."""
    nodes = [parse_node(text) for text in arguments.nodes]
    shell = shlex.split(arguments.ssh)
    for program in (*(shell[:1] or ["ssh"]), "rsync", "git"):
        if not shutil.which(program):
            raise UserError(f"deploy needs {program}: sudo apt-get install openssh-client rsync git")
    files = files_to_copy(arguments.built)
    required = find_requirements()
    are_ready = [Deployment(node, shell, files, required, arguments).run() for node in nodes]
    return 0 if all(are_ready) else 1


def files_to_copy(is_built: bool) -> list[str]:
    """Paths from the root: what git tracks, and with `is_built` what a node needs to run without a build of its own."""
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True)
    if listed.returncode != 0:
        raise UserError(f"{ROOT} is no git checkout, and git has to tell which files are sources.")
    files = [name for name in listed.stdout.split("\0") if name and (ROOT / name).exists()]
    if is_built:
        if BUILD != ROOT / "build" or not (BUILD / "bin" / "tessera-tracker").exists():
            raise UserError("--built: there is no complete build in build/; procman/tessera setup makes it.")
        files += [str(path.relative_to(ROOT)) for pattern in BUILT for path in ROOT.glob(pattern)]
    return sorted(files)


def find_requirements() -> Requirements:
    """What nodes must have to run what this machine asks for."""
    packages, ring = read_packages(PROCMAN / "packages.txt"), KeyRing(key_folder())
    return Requirements(
        local=parse_facts(probe([], str(ROOT), packages).stdout),
        packages=packages,
        requirements=hashlib.sha256((PROCMAN / "requirements.txt").read_bytes()).hexdigest(),
        key=ring.own_public_key(),
        key_name=own_key_name(getpass.getuser(), os.uname().nodename),
        trusted=frozenset(map(to_text, ring.trusted().values())),
    )


class Deployment:
    """To one node."""

    def __init__(
        self, node: Node, shell: list[str], files: list[str], required: Requirements, arguments: Namespace
    ) -> None:
        self._node, self._files, self._required = node, files, required
        self._is_built, self._runs_setup, self._is_dry = arguments.built, arguments.setup, arguments.dry_run
        self._ssh_words = [*shell, "-o", "ConnectTimeout=10"]
        self._ssh = [*self._ssh_words, node.login]

    def run(self) -> bool:
        """Whether the node is ready in the end; says what it lacks."""
        try:
            facts = self._probe()
            if blockers := copy_blockers(facts, self._required, self._is_built):
                return self._conclude(blockers)
            self._copy(facts)
            if not self._is_dry:
                facts = self._probe()
                missing = missing_requirements(facts, self._required)
                if self._runs_setup and any(problem.is_fixed_by_setup for problem in missing):
                    self._set_up()
                    facts = self._probe()
            return self._conclude(missing_requirements(facts, self._required), warnings(facts, self._required))
        except RunError as error:
            self._say(f": {error}")
            return False

    def _say(self, words: str) -> None:
        say(f"{self._node.text}{words}")

    def _probe(self) -> NodeFacts:
        finished = probe(self._ssh, self._node.folder, self._required.packages)
        if finished.returncode != 0:
            what = "can't be reached" if finished.returncode == SSH_FAILED else "can't be examined"
            raise RunError(f"{what}: {_last_line(finished.stderr) or f'status {finished.returncode}'}")
        return parse_facts(finished.stdout)

    def _copy(self, facts: NodeFacts) -> None:
        obsolete = obsolete_files(facts.deployed, self._files, self._is_built)
        is_new = self._is_dry and not facts.home
        if not self._is_dry:
            self._remote(f"mkdir -p {shlex.quote(self._node.folder)}")
            self._remove(obsolete)
        options = ["-e", shlex.join(self._ssh_words), *(["--dry-run"] if self._is_dry else [])]
        command = [*RSYNC, *options, f"{ROOT}/", f"{self._node.login}:{self._node.folder}/"]
        finished = subprocess.run(command, input="\0".join(self._files), capture_output=True, text=True)
        if finished.returncode != 0 and not is_new:
            raise RunError(f"the copy failed: {_last_line(finished.stderr)}")
        num_changed = sum(line.startswith(("<f", "<L", "cL")) for line in finished.stdout.splitlines())
        if is_new:
            num_changed = len(self._files)
        if not self._is_dry:
            self._write_list()
        would_be = "would be " if self._is_dry else ""
        copied = f"{num_changed} of {len(self._files)} files {would_be}copied to {self._node.folder}/"
        self._say(f": {copied}, {len(obsolete)} {would_be}removed")

    def _remove(self, obsolete: list[str]) -> None:
        if obsolete:
            self._remote(f"cd {shlex.quote(self._node.folder)} && xargs -0 rm -f --", "\0".join(obsolete))

    def _write_list(self) -> None:
        """What was copied, so that the next deploy removes files that no longer exist here."""
        files = self._files + ([PREBUILT] if self._is_built else [])
        mark = f" && touch {PREBUILT}" if self._is_built else ""
        command = f"cd {shlex.quote(self._node.folder)} && cat > .tessera-deployed{mark}"
        self._remote(command, "".join(f"{name}\n" for name in files))

    def _remote(self, command: str, text: str = "") -> None:
        finished = subprocess.run([*self._ssh, command], input=text, capture_output=True, text=True)
        if finished.returncode != 0:
            raise RunError(f"'{command}' failed there: {_last_line(finished.stderr)}")

    def _set_up(self) -> None:
        """On this terminal, where it asks before it uses sudo."""
        self._say(": procman/tessera setup there")
        sys.stdout.flush()
        terminal = ["-t"] if sys.stdin.isatty() else []
        command = f"cd {shlex.quote(self._node.folder)} && procman/tessera setup"
        finished = subprocess.run([*self._ssh_words, *terminal, self._node.login, command])
        if finished.returncode != 0:
            raise RunError(f"setup ended there with status {finished.returncode}; its output is above.")

    def _conclude(self, problems: list[Problem], remarks: Iterable[str] = ()) -> bool:
        for sentence in remarks:
            self._say(f": {sentence}")
        if not problems:
            self._say(" is ready")
            return True
        hint = ""
        if any(problem.is_fixed_by_setup for problem in problems):
            hint = f"; procman/tessera setup there, in {self._node.folder}, or --setup here fixes the first problem"
        self._say(f" is not ready: {'; '.join(problem.sentence for problem in problems)}{hint}.")
        return False


def obsolete_files(deployed: list[str], files: list[str], is_built: bool) -> list[str]:
    """Files of an earlier deploy that this one does not copy. Paths that lead out of the folder are left alone."""
    kept = set(files) | ({PREBUILT} if is_built else set())
    inside = [name for name in deployed if not name.startswith("/") and ".." not in name.split("/")]
    return [name for name in inside if name not in kept]


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else ""
