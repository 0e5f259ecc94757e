"""Figures of matplotlib as SVG inside a page, in the page's own colors, so that they follow its light and dark themes.

A figure is drawn in placeholder colors (INK, GRID, TRUTH, SERIES ...); in the SVG each becomes a CSS variable.
"""

import hashlib
import io
import re
from contextlib import AbstractContextManager
from typing import Any
from xml.etree import ElementTree

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

SVG = "http://www.w3.org/2000/svg"
XLINK = "http://www.w3.org/1999/xlink"
INK, GRID, TRUTH, BAD = "#0a0b01", "#0a0b02", "#0a0b03", "#0a0b04"
NUM_SERIES = 8
SERIES = [f"#0a0c{number:02x}" for number in range(1, NUM_SERIES + 1)]
VARIABLES = {
    INK: "--ink",
    GRID: "--grid",
    TRUTH: "--truth",
    BAD: "--bad",
    **{color: f"--series-{number}" for number, color in enumerate(SERIES, start=1)},
}
# Texts stay texts: readable for screen readers and searchable; the page gives them its font.
STYLE: Any = {
    "svg.fonttype": "none",
    "text.parse_math": False,  # a name may hold a $
    "font.size": 12,
    "axes.titlesize": 12,
    "axes.labelsize": 12,
    "xtick.labelsize": 11,
    "ytick.labelsize": 11,
    "legend.fontsize": 11,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": GRID,
    "axes.titlecolor": INK,
    "xtick.color": GRID,
    "ytick.color": GRID,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "path.simplify_threshold": 0.3,
    "axes.formatter.useoffset": False,
}
POINTS_PER_INCH = 72


def new_figure(width: float, height: float) -> Figure:
    """`width` and `height` in the SVG's own units, in which texts are 11 and 12 high. Use within `drawing_style()`."""
    engine = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03)
    return Figure(figsize=(width / POINTS_PER_INCH, height / POINTS_PER_INCH), dpi=POINTS_PER_INCH, layout=engine)


def drawing_style() -> AbstractContextManager[None]:
    """A context in which to draw and to save."""
    return rc_context(STYLE)


def to_svg(figure: Figure, key: str, label: str) -> str:
    """An <svg> element for a page. `key` must be the figure's own on the page; `label` says in words what it shows."""
    buffer = io.StringIO()
    with rc_context({"svg.hashsalt": key}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", XLINK)
    root = ElementTree.fromstring(buffer.getvalue())
    for metadata in root.findall(f"{{{SVG}}}metadata"):
        root.remove(metadata)
    _make_ids_unique(root, hashlib.sha256(key.encode()).hexdigest()[:6])
    for size in ("width", "height"):
        root.attrib.pop(size, None)
    root.set("role", "img")
    root.set("aria-label", label)
    text = ElementTree.tostring(root, encoding="unicode")
    for color, variable in VARIABLES.items():
        text = text.replace(color, f"var({variable})")
    # In the page's font, not the one that matplotlib measured with.
    return re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1", text)


def standalone(svg: str, style: str) -> str:
    """Of `to_svg`, as a file of its own, in the light colors of `style`: the content of report.css."""
    light = style[: style.index("}")]
    colors = dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6});", light))
    text = re.sub(r"var\((--[\w-]+)\)", lambda match: colors[match[1]], svg)
    opening = text.index(">") + 1
    background = f'<rect width="100%" height="100%" fill="{colors["--card"]}" />'
    font = "font-family: system-ui, 'Noto Sans', 'DejaVu Sans', sans-serif"
    return f'{text[: opening - 1]} style="{font}">{background}{text[opening:]}\n'


def _make_ids_unique(root: ElementTree.Element, suffix: str) -> None:
    """Ids that nothing refers to are removed; the others get a suffix, since they must be unique on the whole page."""
    used: set[str] = set()
    for element in root.iter():
        for value in element.attrib.values():
            used.update(re.findall(r"url\(#([^)]+)\)", value))
        if reference := element.get(f"{{{XLINK}}}href"):
            used.add(reference.removeprefix("#"))
    for element in root.iter():
        for name, value in element.attrib.items():
            if name == f"{{{XLINK}}}href":
                element.set(name, f"{value}-{suffix}" if value.startswith("#") else value)
            else:
                element.set(name, re.sub(r"url\(#([^)]+)\)", rf"url(#\1-{suffix})", value))
        if (own := element.attrib.pop("id", None)) in used:
            element.set("id", f"{own}-{suffix}")
