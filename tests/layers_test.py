"""The layers of modules/: includes point down, no stage knows another, only runtime sees LCM, only wire its types."""

import re
from pathlib import Path

import pytest

from helpers.includes import INCLUDE, MODULES, includes

LCM_HEADER = re.compile(r"^lcm/")
TYPE_HEADER = re.compile(r"^tessera/(\w+_t\.hpp|type_texts\.h)$")  # generated from lcmtypes/


def layers() -> list[str]:
    """Bottom to top, from the list that the build itself follows."""
    text = (MODULES / "CMakeLists.txt").read_text()
    match = re.search(r"foreach\(module ([a-z_ \n]+)\)", text)
    assert match
    return match[1].split()


def sources() -> list[Path]:
    return sorted(path for path in MODULES.rglob("*") if path.suffix in (".h", ".cc"))


def layer_of(path: Path) -> str:
    return path.relative_to(MODULES).parts[0]


def stage_of(path: str) -> str | None:
    parts = Path(path).parts
    return parts[1] if len(parts) > 2 and parts[0] == "stages" else None


def test_every_folder_is_a_layer() -> None:
    folders = {layer_of(path) for path in sources()}
    assert folders, "modules/ holds no sources"
    assert folders <= set(layers())


def test_includes_point_down() -> None:
    order = {layer: height for height, layer in enumerate(layers())}
    wrong = []
    for path in sources():
        for quote, header in includes(path):
            layer = header.split("/")[0]
            if TYPE_HEADER.match(header):
                continue  # another test is about them
            if quote == '"' and layer not in order:
                wrong.append(f'{path.relative_to(MODULES)}: "{header}" names no layer; write the path from modules/')
            elif quote == '"' and order[layer] > order[layer_of(path)]:
                wrong.append(f'{path.relative_to(MODULES)} includes "{header}", which is above it')
    assert not wrong, "\n".join(wrong)


def test_no_stage_includes_another() -> None:
    wrong = [
        f'{path.relative_to(MODULES)} includes "{header}"'
        for path in sources()
        for _, header in includes(path)
        if stage_of(header) and stage_of(header) != stage_of(str(path.relative_to(MODULES)))
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("layer, pattern", [("runtime", LCM_HEADER), ("wire", TYPE_HEADER)])
def test_one_layer_alone_sees(layer: str, pattern: re.Pattern[str]) -> None:
    """LCM itself, and the types that it generates."""
    users = {(layer_of(path), header) for path in sources() for _, header in includes(path) if pattern.match(header)}
    assert users, "nobody includes them: the pattern is wrong"
    assert {user for user, _ in users} == {layer}, sorted(users)


def test_stages_do_not_reach_into_the_engine() -> None:
    """Stages see the runtime through stage.h and what is built on it."""
    allowed = {"runtime/stage.h", "runtime/map_subscription.h"}
    wrong = [
        f'{path.relative_to(MODULES)} includes "{header}"'
        for path in sources()
        if layer_of(path) == "stages"
        for _, header in includes(path)
        if header.startswith("runtime/") and header not in allowed
    ]
    assert not wrong, "\n".join(wrong)


def test_nothing_is_drawn_at_random_without_a_seed() -> None:
    wrong = [
        str(path.relative_to(MODULES))
        for path in sources()
        if re.search(r"random_device|\b(rand|srand)\(", path.read_text())
    ]
    assert not wrong, "\n".join(wrong)


def test_pure_modules_have_no_clock_and_no_threads() -> None:
    """Logical time only: below the runtime nothing reads a clock or starts a thread."""
    forbidden = {"chrono", "ctime", "time.h", "sys/time.h", "thread", "mutex", "atomic", "future"}
    wrong = [
        f"{path.relative_to(MODULES)} includes <{header}>"
        for path in sources()
        if layer_of(path) not in ("runtime", "stages")
        for _, header in includes(path)
        if header in forbidden
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("line, header", [('#include "a/b.h"', "a/b.h"), ("  #  include <lcm/lcm.h>", "lcm/lcm.h")])
def test_includes_are_recognized(line: str, header: str) -> None:
    assert INCLUDE.findall(line)[0][1] == header
