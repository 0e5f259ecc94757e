"""Pages for people: one HTML file each that needs no network, from a template of templates/."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tessera_cli.files import write_text

TEMPLATES = Path(__file__).parent / "templates"


def page_style() -> str:
    """The style sheet of all pages."""
    return (TEMPLATES / "report.css").read_text()


def write_page(path: Path, template: str, **values: Any) -> None:
    """The file is written whole or not at all."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    write_text(path, environment.get_template(template).render(**values))
