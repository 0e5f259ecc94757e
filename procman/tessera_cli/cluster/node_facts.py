"""What a node has, as reported by probe.sh, which runs there, and what it lacks to run Tessera."""

import json
import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from tessera_cli.cluster.keys import OWN_NAME
from tessera_cli.constants import RECEIVE_BUFFER_BYTES

PROBE = Path(__file__).with_name("probe.sh")
ARCHITECTURES = ("x86_64", "aarch64")
# Stand for x86-64-v3, which the build assumes and `tessera setup` checks.
CPU_FLAGS: dict[str, tuple[str, ...]] = {"x86_64": ("avx2", "bmi2", "fma"), "aarch64": ()}
# In /proc/net/route: the default route, and that of 224.0.0.0/4.
MULTICAST_ROUTES = {("00000000", "00000000"), ("000000E0", "000000F0")}


@dataclass
class NodeFacts:
    """What the probe reports."""

    host: str = ""
    architecture: str = ""
    system: str = ""  # ID VERSION_ID of os-release
    flags: set[str] = field(default_factory=set)
    rmem_max: int | None = None  # bytes
    routes: set[tuple[str, str]] = field(default_factory=set)  # destination, mask
    programs: set[str] = field(default_factory=set)
    packages: set[str] = field(default_factory=set)  # of those asked for, the installed ones
    trusted: set[str] = field(default_factory=set)  # public keys
    own_key: str = ""  # the public key of the user there, which its deputy signs with; empty: it has none yet
    home: str = ""  # the folder as an absolute path; empty: there is none
    is_git: bool = False
    deployed: list[str] = field(default_factory=list)  # files that an earlier deploy copied
    python: str = ""  # stamp of .venv; it holds the digest of requirements.txt
    versions: dict[str, str] = field(default_factory=dict)  # of the build
    build: str = ""  # "current", "old"; empty: there is none
    libraries: list[str] = field(default_factory=list)  # that the programs need and don't find


@dataclass(frozen=True)
class Requirements:
    """What a node needs, and the machine that asks for it."""

    local: NodeFacts
    packages: tuple[str, ...]
    requirements: str  # digest of requirements.txt
    key: str  # this user's public one
    key_name: str
    trusted: frozenset[str] = frozenset()  # public keys that this user trusts, besides its own


@dataclass(frozen=True)
class Problem:
    """One sentence about what a node lacks."""

    sentence: str
    is_fixed_by_setup: bool = False


def read_packages(path: Path) -> tuple[str, ...]:
    """Rows of packages.txt."""
    return tuple(words[0] for line in path.read_text().splitlines() if (words := line.partition("#")[0].split()))


def probe(shell: list[str], folder: str, packages: tuple[str, ...]) -> "subprocess.CompletedProcess[str]":
    """Runs the probe. `shell`: the words before a remote command; none for this machine."""
    command = [*shell, "sh", "-s", "--", folder, *packages]
    return subprocess.run(command, input=PROBE.read_text(), capture_output=True, text=True)


def parse_facts(text: str) -> NodeFacts:
    """Invalid lines are ignored: what they would report is then missing."""
    facts = NodeFacts()
    for line in text.splitlines():
        word, _, value = line.partition(" ")
        match word:
            case "host" | "architecture" | "system" | "home" | "python" | "build":
                setattr(facts, word, value)
            case "flags":
                facts.flags = set(value.split())
            case "rmem_max":
                facts.rmem_max = int(value) if value.isdecimal() else None
            case "route" if len(words := value.upper().split()) == 2:
                facts.routes.add((words[0], words[1]))
            case "program" | "package":
                getattr(facts, word + "s").add(value)
            case "trusted" if len(words := value.partition("#")[0].split()) == 2:
                facts.trusted.add(words[1])
                if words[0] == OWN_NAME:
                    facts.own_key = words[1]
            case "git":
                facts.is_git = True
            case "deployed":
                facts.deployed.append(value)
            case "versions":
                facts.versions = _parse_versions(value)
            case "library":
                facts.libraries.append(value)
    return facts


def _parse_versions(text: str) -> dict[str, str]:
    try:
        versions = json.loads(text)
    except ValueError:
        return {}
    return versions if isinstance(versions, dict) else {}


def copy_blockers(facts: NodeFacts, required: Requirements, is_built: bool) -> list[Problem]:
    """Why nothing can be copied there. `is_built`: the programs of this machine are to run there."""
    found = []
    if facts.architecture not in ARCHITECTURES:
        supported = " and ".join(ARCHITECTURES)
        found.append(Problem(f"its CPU is {facts.architecture or 'unknown'}, and Tessera is built for {supported}"))
    if missing := [flag for flag in CPU_FLAGS.get(facts.architecture, ()) if flag not in facts.flags]:
        found.append(Problem(f"its CPU lacks {', '.join(missing)}: Tessera needs x86-64-v3"))
    if "apt-get" not in facts.programs:
        system = facts.system or "unknown"
        found.append(Problem(f"its system ({system}) has no apt-get: Tessera is set up on Debian 12 or 13"))
    if "rsync" not in facts.programs:
        found.append(Problem("it has no rsync; do there: sudo apt-get install rsync"))
    if facts.is_git:
        found.append(Problem(f"{facts.home} is a git checkout: pull there, or name another folder (NODE:FOLDER)"))
    local = required.local
    for what, there, here in (("CPU", facts.architecture, local.architecture), ("system", facts.system, local.system)):
        if is_built and there != here:
            advice = "deploy without --built, and build there (--setup)"
            found.append(Problem(f"its {what} is {there} and this machine's {here}: {advice}"))
    return found


def missing_requirements(facts: NodeFacts, required: Requirements) -> list[Problem]:
    """What is missing there to run processes that this user orders."""
    found = []
    if missing := [package for package in required.packages if package not in facts.packages]:
        found.append(Problem(f"packages are missing: {' '.join(missing)}", True))
    if not facts.python:
        found.append(Problem("it has no Python environment .venv", True))
    elif required.requirements not in facts.python.split():
        found.append(Problem("its Python environment .venv has other packages", True))
    if facts.build != "current":
        found.append(Problem("its build is older than its sources" if facts.build else "it has no build", True))
    elif facts.libraries:
        found.append(Problem(f"its programs don't find {', '.join(facts.libraries)}", True))
    if not facts.routes & MULTICAST_ROUTES:
        found.append(Problem("no route for multicast; do there: sudo ip route add 224.0.0.0/4 dev DEVICE"))
    if required.key not in facts.trusted:
        command = f"procman/tessera keys trust {required.key_name} {required.key}"
        found.append(Problem(f"it does not trust this user's key; do there, when it is set up: {command}"))
    if facts.own_key and facts.own_key not in required.trusted | {required.key}:
        command = f"procman/tessera keys trust {own_key_name('me', facts.host or 'node')} {facts.own_key}"
        found.append(Problem(f"this user does not trust its key, and would not believe its deputy; do here: {command}"))
    return found


def warnings(facts: NodeFacts, required: Requirements) -> list[str]:
    """What it runs with, but not as well as it could."""
    found = []
    if facts.rmem_max is not None and facts.rmem_max < RECEIVE_BUFFER_BYTES:
        found.append(
            f"its receive buffers are limited to {facts.rmem_max} bytes, and bursts of tiles need "
            f"{RECEIVE_BUFFER_BYTES}: sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER_BYTES}"
        )
    local = required.local.versions
    for name, version in facts.versions.items():
        if name in local and version != local[name]:
            difference = f"its {name} is {version} and this machine's {local[name]}"
            found.append(f"{difference}: results may differ in the last bits")
    return found


def own_key_name(user: str, host: str) -> str:
    """A name for `tessera keys trust`."""
    return re.sub(r"[^A-Za-z0-9_.@-]", "_", f"{user}@{host}")[:64]
