"""faults.html: the table of faults and a picture of the pauses, in one file that needs no network."""

from collections.abc import Sequence
from pathlib import Path

from tessera_cli.constants import FAULT_KINDS
from tessera_cli.experiments.faults.outcome import Outcome
from tessera_cli.experiments.faults.tables import HEADINGS, MEANINGS, headline, make_rows
from tessera_cli.report.drawing import CARD, Drawing, add_legend, color_of, in_order
from tessera_cli.report.page import write_page
from tessera_cli.report.svg import INK, drawing_style, new_figure, to_svg
from tessera_cli.versions import collect_versions

ROW_HEIGHT = 20


def write_faults_page(path: Path, title: str, undisturbed: Outcome, runs: Sequence[Outcome]) -> None:
    """`title`: of the sequence."""
    with drawing_style():
        drawings = [drawing for drawing in [draw_pauses(undisturbed, runs)] if drawing]
    write_page(
        path,
        "faults.html",
        title=f"Faults: {title}",
        sentences=headline(undisturbed, runs),
        headings=HEADINGS,
        rows=make_rows(undisturbed, runs),
        drawings=drawings,
        versions=collect_versions(),
    )


def draw_pauses(undisturbed: Outcome, runs: Sequence[Outcome]) -> Drawing | None:
    """A dot for each fault: the longest pause that is attributed to it. None if no pose followed any fault."""
    known = [(fault, fault.pause_s) for run in runs for fault in run.faults if fault.pause_s is not None]
    if not known:
        return None
    names = in_order({fault.kind_of_process for fault, _ in known})
    figure = new_figure(CARD[0], max(CARD[1], 90 + ROW_HEIGHT * len(names)))
    axes = figure.subplots()
    words = []
    for index, kind in enumerate(FAULT_KINDS):
        chosen = [(names.index(fault.kind_of_process), pause) for fault, pause in known if fault.kind == kind]
        if chosen:
            heights = [row + 0.18 * (index - 1.5) for row, _ in chosen]  # kinds above each other, so that all are seen
            pauses = [pause for _, pause in chosen]
            axes.plot(pauses, heights, "o", color=color_of(index), label=MEANINGS[kind], markersize=4, alpha=0.8)
            words.append(f"{MEANINGS[kind]}: at most {max(pauses):.1f} s")
    axes.axvline(undisturbed.longest_pause_s, color=INK, linewidth=1, linestyle=(0, (4, 3)))
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set(xlabel="pause [s]", xlim=(0, None))
    add_legend(figure, 2)
    label = f"The longest pause between two poses after each fault. {'; '.join(words)}."
    note = "A dot for each fault. Dashed: the longest pause of the undisturbed run."
    return Drawing("Longest pause after each fault", label, note, to_svg(figure, "pauses", label))
