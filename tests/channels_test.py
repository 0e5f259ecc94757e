"""The table of channels that people read agrees with the one that the programs use."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def documented() -> dict[str, str]:
    """Bus by channel, from lcmtypes/README.md."""
    rows = re.findall(r"^\| `([A-Z_]+)(?:<n>)?` \| (\w+)", (ROOT / "lcmtypes/README.md").read_text(), re.MULTILINE)
    return {channel: bus for channel, bus in rows if bus != "procman"}


def defined() -> dict[str, str]:
    """Bus by channel, from messages/topics.h."""
    text = (ROOT / "modules/messages/topics.h").read_text()
    return {channel: bus.lower() for channel, bus in re.findall(r'"([A-Z_]+)".*?BusKind::k(\w+)', text, re.DOTALL)}


def test_every_channel_is_documented_with_its_bus() -> None:
    assert len(defined()) > 20
    assert documented() == defined()


def test_every_message_type_is_used_by_a_layout_or_by_the_command() -> None:
    sources = "".join(path.read_text() for path in (ROOT / "modules/wire").glob("*") if path.suffix in (".h", ".cc"))
    texts = "".join(path.read_text() for path in (ROOT / "lcmtypes").glob("*.lcm"))
    unused = [
        path.stem
        for path in (ROOT / "lcmtypes").glob("*_t.lcm")
        if not path.stem.startswith("procman_")
        and not re.search(rf"\b{path.stem}\b", sources)
        and not re.search(rf"^  {path.stem} ", texts, re.MULTILINE)
    ]
    assert not unused
