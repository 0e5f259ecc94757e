"""What a node has (told by probe.sh, which runs there), and what it lacks to run Tessera."""

import json
import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

PROBE = Path(__file__).with_name("probe.sh")
ARCHITECTURES = ("x86_64", "aarch64")
# x86-64-v3 in short, as the build assumes and `tessera setup` checks.
CPU_FLAGS = {"x86_64": ("avx2", "bmi2", "fma"), "aarch64": ()}
WANTED_RMEM_BYTES = 4194304
# /proc/net/route: the default route, and that of 224.0.0.0/4.
MULTICAST_ROUTES = {("00000000", "00000000"), ("000000E0", "000000F0")}


@dataclass
class NodeFacts:
    host: str = ""
    architecture: str = ""
    system: str = ""  # ID VERSION_ID of os-release
    flags: set[str] = field(default_factory=set)
    rmem_max: int | None = None  # bytes
    routes: set[tuple[str, str]] = field(default_factory=set)  # destination, mask
    programs: set[str] = field(default_factory=set)
    packages: set[str] = field(default_factory=set)  # of those asked for, what is installed
    trusted: set[str] = field(default_factory=set)  # public keys
    home: str = ""  # the folder as an absolute path; empty: there is none
    is_git: bool = False
    deployed: list[str] = field(default_factory=list)  # files that an earlier deploy brought
    python: str = ""  # stamp of .venv; it holds the digest of requirements.txt
    versions: dict[str, str] = field(default_factory=dict)  # of the build
    build: str = ""  # "current", "old"; empty: there is none
    libraries: list[str] = field(default_factory=list)  # that the programs need and don't find


@dataclass(frozen=True)
class Here:
    """What this machine asks for."""

    facts: NodeFacts
    packages: tuple[str, ...]
    requirements: str  # digest of requirements.txt
    key: str  # this user's public one
    key_name: str


@dataclass(frozen=True)
class Fault:
    sentence: str
    is_mended_by_setup: bool = False


def read_packages(path: Path) -> tuple[str, ...]:
    """Rows of packages.txt."""
    return tuple(words[0] for line in path.read_text().splitlines() if (words := line.partition("#")[0].split()))


def probe(shell: list[str], folder: str, packages: tuple[str, ...]) -> subprocess.CompletedProcess:
    """Runs the probe by `shell`, which stands before a remote command."""
    return subprocess.run(
        [*shell, "sh", "-s", "--", folder, *packages],
        input=PROBE.read_text(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def parse_facts(text: str) -> NodeFacts:
    """Lines that make no sense are left out: what they would tell is then missing."""
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
            case "route" if len(value.split()) == 2:
                facts.routes.add(tuple(value.upper().split()))
            case "program" | "package":
                getattr(facts, word + "s").add(value)
            case "trusted" if len(words := value.partition("#")[0].split()) == 2:
                facts.trusted.add(words[1])
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


def obstacles(facts: NodeFacts, here: Here, is_built: bool) -> list[Fault]:
    """Why nothing can be copied there. `is_built`: the programs of this machine are to run there."""
    faults = []
    if facts.architecture not in ARCHITECTURES:
        faults.append(
            Fault(
                f"its CPU is {facts.architecture or 'unknown'}, and Tessera is built for {' and '.join(ARCHITECTURES)}"
            )
        )
    if lacking := [flag for flag in CPU_FLAGS.get(facts.architecture, ()) if flag not in facts.flags]:
        faults.append(Fault(f"its CPU lacks {', '.join(lacking)}: Tessera needs x86-64-v3"))
    if "apt-get" not in facts.programs:
        faults.append(
            Fault(
                f"its system ({facts.system or 'unknown'}) has no apt-get: Tessera is set up on Debian 12 or Ubuntu 24.04"
            )
        )
    if "rsync" not in facts.programs:
        faults.append(Fault("it has no rsync; do there: sudo apt-get install rsync"))
    if facts.is_git:
        faults.append(Fault(f"{facts.home} is a git checkout: pull there, or name another folder (NODE:FOLDER)"))
    for what, there, own in (
        ("CPU", facts.architecture, here.facts.architecture),
        ("system", facts.system, here.facts.system),
    ):
        if is_built and there != own:
            faults.append(
                Fault(
                    f"its {what} is {there} and this machine's {own}: deploy without --built, and build there (--setup)"
                )
            )
    return faults


def shortcomings(facts: NodeFacts, here: Here) -> list[Fault]:
    """What is missing there to run processes that this user orders."""
    faults = []
    if missing := [package for package in here.packages if package not in facts.packages]:
        faults.append(Fault(f"packages are missing: {' '.join(missing)}", True))
    if here.requirements not in facts.python.split():
        faults.append(
            Fault(
                "its Python environment .venv is of other packages"
                if facts.python
                else "it has no Python environment .venv",
                True,
            )
        )
    if facts.build != "current":
        faults.append(Fault("its build is older than its sources" if facts.build else "it has no build", True))
    elif facts.libraries:
        faults.append(Fault(f"its programs don't find {', '.join(facts.libraries)}", True))
    if not facts.routes & MULTICAST_ROUTES:
        faults.append(Fault("no route for multicast; do there: sudo ip route add 224.0.0.0/4 dev DEVICE"))
    if here.key not in facts.trusted:
        faults.append(
            Fault(
                f"it does not trust this user's key; do there, when it is set up: procman/tessera keys trust {here.key_name} {here.key}"
            )
        )
    return faults


def remarks(facts: NodeFacts, here: Here) -> list[str]:
    """What it runs with, but not as well as it could."""
    found = []
    if facts.rmem_max is not None and facts.rmem_max < WANTED_RMEM_BYTES:
        found.append(
            f"its receive buffers have {facts.rmem_max} bytes at most, and bursts of tiles need {WANTED_RMEM_BYTES}: "
            f"sudo sysctl -w net.core.rmem_max={WANTED_RMEM_BYTES}"
        )
    for name, version in facts.versions.items():
        if name in here.facts.versions and version != (own := here.facts.versions[name]):
            found.append(f"its {name} is {version} and this machine's {own}: results may differ in the last bits")
    return found


def own_key_name(user: str, host: str) -> str:
    """A name for `tessera keys trust`."""
    return re.sub(r"[^A-Za-z0-9_.@-]", "_", f"{user}@{host}")[:64]
