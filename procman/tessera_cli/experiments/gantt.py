"""The picture of one frame's way through the processes, of each commit."""

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from tessera_cli.experiments.timeline import Step, busy_shares, row_order, typical_frame
from tessera_cli.report.drawing import Drawing
from tessera_cli.report.svg import BAD, INK, SERIES, TRUTH, drawing_style, new_figure, to_svg

WIDTH, PHONE_WIDTH = 820, 400
HEIGHT = 390  # for each commit
BAR, WAIT = 0.58, 0.13  # heights of work and, below it, of waiting, in rows
MARGIN = 0.06  # of the frame's way, before and after it
# Of a bar in the SVG's units, in which texts are 11 high: wide enough for the frame's number.
NUMBERED_FROM = 26
NOTE = (
    "From a run that was recorded, which slows it down. Blue: work on this frame. Red: the frame waits, since the "
    "process works on another one or needs the map. Gray: work on other frames. Percent: how busy the process was over "
    "all frames. A bar begins when inputs and process were there, and ends when the process sent what it made. Dashed: "
    "the frame has its pose."
)


@dataclass(frozen=True)
class Way:
    """A frame on its way, with what else was done meanwhile."""

    name: str  # of the commit
    frame: int
    steps: list[Step]  # of all frames

    @property
    def own_steps(self) -> list[Step]:
        return sorted((step for step in self.steps if step.frame == self.frame), key=lambda step: step.began_us)

    @property
    def began_us(self) -> int:
        return self.own_steps[0].began_us

    @property
    def ended_ms(self) -> float:
        return self.ms(max(step.ended_us for step in self.own_steps))

    def ms(self, time_us: int) -> float:
        """Since its way began."""
        return (time_us - self.began_us) / 1000


def draw_gantt(sequence: str, steps_of: dict[str, list[Step]]) -> Drawing | None:
    """`steps_of`: of each commit, by its name. None if no frame of any went all the way."""
    ways = [Way(name, frame, steps) for name, steps in steps_of.items() if (frame := typical_frame(steps)) is not None]
    if not ways:
        return None
    title = f"{sequence}: a frame's way through the processes"
    label = f"{title}, in milliseconds. {' '.join(map(_in_words, ways))}"
    with drawing_style():
        svg, svg_phone = (to_svg(_draw(ways, width), f"{title} {width}", label) for width in (WIDTH, PHONE_WIDTH))
    return Drawing(title, label, NOTE, svg, svg_phone, is_hero=True)


def _draw(ways: list[Way], width: int) -> Figure:
    figure = new_figure(width, HEIGHT * len(ways))
    all_axes = figure.subplots(len(ways), 1, sharex=True, squeeze=False)[:, 0]
    longest_ms = max(way.ended_ms for way in ways)
    for axes, way in zip(all_axes, ways):
        axes.set_xlim(-MARGIN * longest_ms, (1 + MARGIN) * longest_ms)
        _draw_way(axes, way, width)
    all_axes[-1].set_xlabel("time since the camera began with the frame [ms]")
    patches = {"this frame": SERIES[0], "it waits": BAD, "other frames": TRUTH}
    handles = [Patch(color=color, label=text) for text, color in patches.items()]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, handlelength=1.2, borderpad=0.1)
    return figure


def _draw_way(axes: Axes, way: Way, width: int) -> None:
    shares = busy_shares(way.steps)
    rows = {process: row for row, process in enumerate(row_order(set(shares)))}
    low_ms, high_ms = axes.get_xlim()
    for step in way.steps:
        began_ms, ended_ms = max(way.ms(step.began_us), low_ms), min(way.ms(step.ended_us), high_ms)
        if began_ms < ended_ms:
            row, length_ms = rows[step.process], ended_ms - began_ms
            color = SERIES[0] if step.frame == way.frame else TRUTH
            axes.barh(row, length_ms, left=began_ms, height=BAR, color=color, edgecolor=INK, linewidth=0.4)
            if step.frame != way.frame and width * length_ms > NUMBERED_FROM * (high_ms - low_ms):
                axes.text(began_ms + length_ms / 2, row, str(step.frame), ha="center", va="center", fontsize=11)
    for step in way.own_steps:
        ready_ms, began_ms = way.ms(step.ready_us), way.ms(step.began_us)
        axes.barh(rows[step.process] + (BAR + WAIT) / 2, began_ms - ready_ms, left=ready_ms, height=WAIT, color=BAD)
        if step.process == "tracker":
            axes.axvline(way.ms(step.ended_us), color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
    axes.set_yticks(list(rows.values()), [f"{process} {100 * shares[process]:.0f} %" for process in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    separator = " " if width == WIDTH else "\n"
    axes.set_title(f"{way.name}, frame {way.frame}:{separator}{_milestones(way)}", loc="left", pad=8)
    axes.grid(axis="y", visible=False)


def _milestones(way: Way) -> str:
    """When the frame had its pose, and when it was in the map."""
    ends_ms = {step.process: way.ms(step.ended_us) for step in way.own_steps}
    return f"pose after {ends_ms['tracker']:.0f} ms, in the map after {ends_ms['mapper']:.0f} ms"


def _in_words(way: Way) -> str:
    words = []
    for step in way.own_steps:
        waited_ms, worked_ms = (step.began_us - step.ready_us) / 1000, (step.ended_us - step.began_us) / 1000
        waited = f"waited {waited_ms:.1f} and " if waited_ms >= 0.05 else ""
        words.append(f"{step.process} {waited}worked {worked_ms:.1f}, until {way.ms(step.ended_us):.1f}")
    return f"{way.name}, frame {way.frame}: {'; '.join(words)}."
