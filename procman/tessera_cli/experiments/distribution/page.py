"""The page of one distribution experiment, or of two beside each other, and its figures as files."""

from collections.abc import Sequence
from pathlib import Path

from tessera_cli.experiments.distribution.claims import Claim, check_claims
from tessera_cli.experiments.distribution.drawings import draw_all
from tessera_cli.experiments.distribution.outcome import Outcome
from tessera_cli.experiments.distribution.tables import make_grids
from tessera_cli.files import write_text
from tessera_cli.report.drawing import Drawing
from tessera_cli.report.page import page_style, write_page
from tessera_cli.report.svg import drawing_style, standalone
from tessera_cli.versions import collect_versions


def write_distribution_page(path: Path, outcomes: Sequence[Outcome], remarks: list[str]) -> list[Drawing]:
    """Returns its figures."""
    with drawing_style():
        drawings = draw_all(outcomes)
    names = [outcome.name for outcome in outcomes]
    experiments = [outcome.experiment.name for outcome in outcomes]
    title = f"Experiment {experiments[0]}" if len(outcomes) == 1 else f"{' and '.join(names)}, beside each other"
    claims = [check_claims(outcome) for outcome in outcomes]
    write_page(
        path,
        "distribution.html",
        title=title,
        outcomes=[
            {"name": each.name, "summary": each.experiment.summary, "note": _note(each), "claims": of_each}
            for each, of_each in zip(outcomes, claims)
        ],
        headline=headline(claims[0]) if len(outcomes) == 1 else "",
        remarks=remarks,
        groups=list(zip(*(make_grids(outcome) for outcome in outcomes))),
        drawings=drawings,
        versions=collect_versions(),
    )
    return drawings


def headline(claims: list[Claim]) -> str:
    missed = sum(not claim.is_met for claim in claims)
    return f"{len(claims) - missed} of {len(claims)} claims are met."


def _note(outcome: Outcome) -> str:
    runs = sum(len(cell.runs) for cell in outcome.cells.values())
    return f"{outcome.sequence}, {outcome.num_frames} frames, {runs} runs"


def write_pictures(folder: Path, drawings: list[Drawing]) -> None:
    """Each as a file of its own, for documents."""
    folder.mkdir(parents=True, exist_ok=True)
    for drawing in drawings:
        name = "".join(letter if letter.isalnum() else "-" for letter in drawing.title.lower()).strip("-")
        write_text(folder / f"{name}.svg", standalone(drawing.svg_phone or drawing.svg, page_style()))
