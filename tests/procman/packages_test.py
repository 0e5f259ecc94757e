"""The shape of procman/tessera_cli: packages import lower ones only, functions are short, modules say their concern."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from helpers.stack import ROOT

PACKAGE = ROOT / "procman" / "tessera_cli"
# Bottom to top; modules outside of packages are below them all (procman/README.md).
LAYERS = ("cluster", "supervision", "spy", "maps", "runs", "report", "export", "viewing", "experiments", "cli")
MAX_FUNCTION_LINES = 60


def modules() -> list[Path]:
    found = sorted(PACKAGE.rglob("*.py"))
    assert len(found) > len(LAYERS)
    return found


def layer_of(parts: tuple[str, ...]) -> int:
    """-1 for modules outside of packages."""
    return LAYERS.index(parts[0]) if parts and parts[0] in LAYERS else -1


def imports(tree: ast.AST) -> Iterator[str]:
    """Names of all imported modules, also of imports within functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_packages_import_lower_ones_only() -> None:
    wrong = []
    for path in modules():
        parts = path.relative_to(PACKAGE).parts
        for name in imports(ast.parse(path.read_text())):
            is_entry = parts == ("__main__.py",)
            if (
                name.startswith("tessera_cli.")
                and layer_of(tuple(name.split(".")[1:])) > layer_of(parts)
                and not is_entry
            ):
                wrong.append(f"{path.relative_to(PACKAGE)} imports {name}, which is above it")
    assert not wrong, "\n".join(wrong)


def test_one_module_uses_lcm() -> None:
    users = [path.name for path in modules() if "lcm" in imports(ast.parse(path.read_text()))]
    assert users == ["lcm_bus.py"]


def test_the_command_line_needs_nothing_installed() -> None:
    """Its modules import only the standard library, and modules that do so too, before a command runs."""
    wrong = []
    for path in modules():
        if path.relative_to(PACKAGE).parts[0] != "cli":
            continue
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = {name.split(".")[0] for name in imports(node)}
                wrong += [f"{path.name} imports {name}" for name in names - {*sys.stdlib_module_names, "tessera_cli"}]
                layers = {layer_of(tuple(name.split(".")[1:])) for name in imports(node)}
                wrong += [f"{path.name} imports {LAYERS[layer]}" for layer in layers - {-1, LAYERS.index("cli")}]
    assert not wrong, "\n".join(wrong)


def test_modules_begin_with_a_sentence() -> None:
    wrong = []
    for path in modules():
        summary = (ast.get_docstring(ast.parse(path.read_text())) or "").split("\n\n")[0]
        if not summary.endswith("."):
            wrong.append(f"{path.relative_to(PACKAGE)}: '{summary}'")
    assert not wrong, "\n".join(wrong)


def test_functions_are_short() -> None:
    long = []
    for path in [*modules(), *sorted((ROOT / "tests").rglob("*.py"))]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and (node.end_lineno or 0) - node.lineno + 1 > MAX_FUNCTION_LINES:
                long.append(f"{path.relative_to(ROOT)}: {node.name}")
    assert not long, "\n".join(long)
