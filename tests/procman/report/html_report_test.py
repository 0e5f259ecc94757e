"""report.html: whole, self-contained, told in words, and readable for those who can't see its figures."""

import re
from pathlib import Path
from typing import Any

import pytest

from helpers.made_run import LOST, NUM_FRAMES, write_run
from helpers.page import Page
from tessera_cli.report.html_report import write_report
from tessera_cli.report.page import TEMPLATES
from tessera_cli.report.sentences import headline, remarks
from tessera_cli.runs.run_folder import Result, read_pair, read_run

# Namespaces are names that nobody fetches.
NAMESPACES = ("http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink")
FIGURES_OF_A_RUN = 9


def make_page(folder: Path, *results: Result) -> Page:
    write_report(list(results), folder / "report.html")
    assert not list(folder.glob(".unfinished*"))
    return Page(folder / "report.html")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("report")
    return make_page(folder, read_run(write_run(folder / 'drive <1> & "2"')))


def test_it_is_one_document(page: Page) -> None:
    assert page.source.lstrip().startswith("<!DOCTYPE html>")
    for tag in ("html", "head", "title", "body", "main", "h1"):
        assert len(page.root.all(tag)) >= 1, tag
    assert page.root.all("h1")[0].words().strip() == 'drive <1> & "2"'


def test_nothing_is_fetched(page: Page) -> None:
    for element in page.every():
        assert element.tag not in ("script", "link", "iframe", "object", "embed"), element.tag
        for name, value in element.attributes.items():
            if name in ("src", "href", "xlink:href", "srcset", "action", "data"):
                assert value.startswith(("#", "data:")), f"<{element.tag} {name}={value}>"
    without = page.source
    for namespace in NAMESPACES:
        without = without.replace(f'="{namespace}"', "")
    assert not re.search(r"https?://|@import|url\((?!#)", without)


def test_ids_are_unique_and_references_lead_somewhere(page: Page) -> None:
    ids = [element.attributes["id"] for element in page.every() if "id" in element.attributes]
    assert len(ids) == len(set(ids))
    references = re.findall(r'url\(#([^)]+)\)|xlink:href="#([^"]+)"', page.source)
    assert references and {first or second for first, second in references} <= set(ids)


def test_every_figure_is_told_in_words(page: Page) -> None:
    figures = page.root.all("figure")
    assert len(figures) == FIGURES_OF_A_RUN
    for figure in figures:
        assert figure.all("figcaption")[0].words().strip() and figure.all("h3")[0].words().strip()
        for svg in figure.all("svg"):
            assert svg.attributes["role"] == "img"
            assert len(svg.attributes["aria-label"].split()) > 5, figure.all("h3")[0].words()
    assert all(image.attributes.get("alt") for image in page.root.all("img"))


def test_tables_scroll_and_have_headings(page: Page) -> None:
    for region in page.every():
        if "scroll" in (region.attributes.get("class") or "").split():
            assert region.attributes["tabindex"] == "0" and region.attributes["aria-label"]
    assert all(table.all("th") for table in page.root.all("table"))
    assert all(heading.attributes.get("scope") for heading in page.root.all("th"))


def test_the_result_is_told_in_words(page: Page) -> None:
    words = re.sub(r"\s+", " ", page.root.all("main")[0].words())
    tracked = NUM_FRAMES - len(LOST)
    for sentence in (
        f"{tracked} of {NUM_FRAMES} frames were tracked",
        "1 loop was closed.",
        "Tracking failed 2 times",
        "relocalized 2 times",
        "4 frames got no pose: 40 to 42, 77.",
        "4.3 times as fast as the camera",
    ):
        assert sentence in words, words[:1000]
    assert "num_features" in words and "1234" in words and "0123456789ab" in words


def test_figures_follow_the_colors_of_the_page(page: Page) -> None:
    """Only variables of the style sheet, which has them for light and dark."""
    for svg in re.findall(r"<svg.*?</svg>", page.source, re.DOTALL):
        assert not re.search(r"(fill|stroke): #", svg)
    used = set(re.findall(r"var\((--[a-z0-9-]+)\)", page.source))
    light, dark = (set(scheme) for scheme in colors_of_schemes())
    assert used <= light and light == dark


def colors_of_schemes() -> list[dict[str, str]]:
    """The variables of the light and the dark scheme."""
    blocks = re.findall(r":root \{(.*?)\}", (TEMPLATES / "report.css").read_text(), re.DOTALL)
    return [dict(re.findall(r"(--[a-z0-9-]+): (#[0-9a-f]{6})", block)) for block in blocks]


def luminance(color: str) -> float:
    """Relative luminance by WCAG 2."""
    parts = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("scheme", [0, 1], ids=["light", "dark"])
def test_colors_have_the_contrast_that_wcag_asks_for(scheme: int) -> None:
    colors = colors_of_schemes()[scheme]
    for text in ("--ink", "--soft"):
        for ground in ("--card", "--page"):
            assert contrast(colors[text], colors[ground]) >= 4.5, (text, ground)
    assert contrast(colors["--ink"], colors["--note"]) >= 4.5
    assert contrast(colors["--good"], colors["--page"]) >= 4.5
    for name, color in colors.items():
        if name.startswith("--series") or name == "--bad":
            assert contrast(color, colors["--card"]) >= 3, name


def test_a_run_without_ground_truth(tmp_path: Path) -> None:
    page = make_page(tmp_path, read_run(write_run(tmp_path / "drive", truth=False, sensor="mono")))
    words = page.root.all("main")[0].words()
    assert "no ground truth" in words and "map units" in words
    assert len(page.root.all("figure")) == FIGURES_OF_A_RUN - 1


def test_the_drift_of_the_scale_is_told_of_mono_alone(tmp_path: Path) -> None:
    values = {"tracker": {"scale_drift": 0.124}}
    for sensor, loops, words in [
        ("mono", False, "drifted by about 12 % since the map began (one standard deviation)."),
        ("mono", True, "(one standard deviation), which loops have corrected in part."),
        ("stereo", False, ""),
    ]:
        folder = write_run(tmp_path / f"{sensor} {loops}", loops=loops, sensor=sensor, stage_values=values)
        told = [sentence for sentence in headline(read_run(folder)) if "scale may" in sentence]
        assert len(told) == bool(words)
        assert not told or words in told[0]


def test_other_focal_lengths_than_the_calibration_s_are_told(tmp_path: Path) -> None:
    for error, words in [(-0.0187, "Focal lengths 1.9 % shorter than"), (0.01, "1.0 % longer"), (0.0, "")]:
        folder = write_run(tmp_path / f"{error}", sensor="mono", stage_values={"mapper": {"focal_error": error}})
        told = [sentence for sentence in headline(read_run(folder)) if "ocal lengths" in sentence]
        assert len(told) == bool(words) and (not told or words in told[0])
    folder = write_run(
        tmp_path / "lens", sensor="mono", stage_values={"mapper": {"focal_error": -0.008, "lens_radial": -0.0062}}
    )
    assert "0.8 % shorter than the calibration's, and edges of the image drawn 0.6 % inward, explain" in " ".join(
        headline(read_run(folder))
    )


def test_a_rolling_shutter_and_late_depths_are_told(tmp_path: Path) -> None:
    for down_ms, across_ms, delay_ms, words in [
        (22.4, 0.0, 0.0, "The camera takes 22 ms to read an image (a rolling shutter); keypoints"),
        (-22.4, 0.0, 0.0, "The camera takes 22 ms to read an image from the bottom up (a rolling shutter); keypoints"),
        (0.0, 20.0, 0.0, "takes 20 ms to read an image from left to right (a rolling shutter); keypoints"),
        (0.0, -20.0, 0.0, "takes 20 ms to read an image from right to left (a rolling shutter); keypoints"),
        (0.0, 0.0, -11.8, "Depths are measured 12 ms before the time they are said to be of; keypoints"),
        (22.4, 0.0, 7.0, "(a rolling shutter) and depths are measured 7 ms after the time"),
        (0.0, 0.0, 0.0, ""),
    ]:
        values = {"tracker": {"readout_ms": down_ms, "readout_across_ms": across_ms, "depth_delay_ms": delay_ms}}
        folder = write_run(tmp_path / f"{down_ms} {across_ms} {delay_ms}", sensor="rgbd", stage_values=values)
        told = [sentence for sentence in headline(read_run(folder)) if "corrected for it" in sentence]
        assert len(told) == bool(words) and (not told or words in told[0])


def test_a_right_camera_that_is_late_is_told(tmp_path: Path) -> None:
    for delay_ms, words in [
        (4.93, "The right camera takes its image 4.9 ms after the left one"),
        (-2.06, "The right camera takes its image 2.1 ms before the left one"),
        (0.0, ""),
    ]:
        values = {"tracker": {"right_delay_ms": delay_ms}}
        folder = write_run(tmp_path / f"{delay_ms}", sensor="stereo", stage_values=values)
        told = [sentence for sentence in headline(read_run(folder)) if "corrected for it" in sentence]
        assert len(told) == bool(words) and (not told or told[0].startswith(words))


def test_a_right_camera_that_stands_otherwise_is_told(tmp_path: Path) -> None:
    for pitch_deg, twist_deg, words in [
        (0.204, -0.013, "looks 0.20° higher than its calibration says, and is turned by -0.01° about its axis"),
        (-0.1, 0.5, "looks 0.10° lower than its calibration says, and is turned by 0.50° about its axis"),
        (0.0, 0.0, ""),
    ]:
        values = {"camera": {"right_pitch_deg": pitch_deg, "right_twist_deg": twist_deg}}
        folder = write_run(tmp_path / f"{pitch_deg}", sensor="stereo", stage_values=values)
        told = [sentence for sentence in headline(read_run(folder)) if "put straight" in sentence]
        assert len(told) == bool(words) and (not told or words in told[0])


def test_what_moves_with_the_camera_is_told(tmp_path: Path) -> None:
    for share, words in [(0.057, "6 % of the image moves with the camera"), (0.0, "")]:
        folder = write_run(tmp_path / f"{share}", sensor="rgbd", stage_values={"tracker": {"own_body_share": share}})
        told = [sentence for sentence in headline(read_run(folder)) if "moves with the camera" in sentence]
        assert len(told) == bool(words) and (not told or words in told[0])


def test_images_that_only_repeat_the_one_before_are_told(tmp_path: Path) -> None:
    for num, words in [(12, "12 images of "), (1, "1 image of "), (0, "")]:
        folder = write_run(tmp_path / f"{num}", stage_values={"tracker": {"images_repeated": num}})
        told = [sentence for sentence in headline(read_run(folder)) if "only repeated the one before" in sentence]
        assert len(told) == bool(words) and (not told or told[0].startswith(words))


def test_a_run_in_which_no_frame_was_tracked(tmp_path: Path) -> None:
    folder = write_run(
        tmp_path / "drive", loops=False, frames_tracked=0, pose_time_ms=None, latency_ms=None, map_wait_ms=None
    )
    for name in ("trajectory.txt", "trajectory_live.txt", "keyframes.txt"):
        (folder / name).write_text("# timestamp tx ty tz qx qy qz qw\n")
    (folder / "frames.csv").unlink()
    page = make_page(tmp_path, read_run(folder))
    assert "no frame was tracked" in page.root.all("main")[0].words()


def test_an_older_run_without_what_came_later(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "drive", loops=False, loops_closed=None, relocalizations=None, versions={})
    for name in ("settings.yaml", "trajectory_live.txt"):
        (folder / name).unlink()
    words = make_page(tmp_path, read_run(folder)).root.all("main")[0].words()
    assert "did not record" in words and "loop" not in words.split("Figures")[0]


def test_two_trajectory_files(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "drive")
    page = make_page(tmp_path, read_pair(folder / "trajectory.txt", folder / "ground_truth.txt"))
    assert len(page.root.all("figure")) == 3
    assert "RMS" in page.root.all("main")[0].words()


def test_several_runs_beside_each_other(tmp_path: Path) -> None:
    """One plot for those of one truth, one more for another; all in one table."""
    runs = [read_run(write_run(tmp_path / name, seed)) for seed, name in enumerate(("one", "two"))]
    without = read_run(write_run(tmp_path / "three", 3, truth=False))
    page = make_page(tmp_path, *runs, without)
    titles = [figure.all("h3")[0].words().strip() for figure in page.root.all("figure")]
    assert titles[:4] == [
        "The path from above: one, two",
        "The path from the side: one, two",
        "The path from above: three",
        "The path from the side: three",
    ]
    headings = [heading.words().strip() for heading in page.root.all("table")[0].all("thead")[0].all("th")]
    assert headings == ["figure", "one", "two", "three"]


@pytest.mark.parametrize("number", [1, 12])
def test_more_runs_than_colors(tmp_path: Path, number: int) -> None:
    runs = [read_run(write_run(tmp_path / f"run {index}", index)) for index in range(number)]
    assert len(make_page(tmp_path, *runs).root.all("table")[0].all("thead")[0].all("th")) == number + 1


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"ended": "interrupted"}, "was interrupted"),
        ({"ended": "tracker died."}, "The run failed: tracker died."),
        (
            {
                "map_parts": 2,
                "parts": [
                    {"frames": 9, "keyframes": 3, "is_main": False},
                    {"frames": 100, "keyframes": 21, "is_main": True},
                ],
            },
            "in 2 parts that nothing joins: the largest has 21 keyframes and places 100 frames; the positions of 9",
        ),
        ({"messages_repaired": 1}, "1 message got lost on the network and was"),
        ({"messages_lost": 2}, "2 messages stayed lost"),
        ({"messages_undecodable": 5}, "5 messages could not be decoded"),
        ({"messages_of_strangers": 37}, "37 messages of strangers were passed over"),
        ({"extractor_restarts": 1}, "restarted 1 time"),
        ({"warnings": ["mapper was killed."]}, "mapper was killed."),
        ({"map_wait_ms": {"mean": 20.0, "p95": 80.0, "median": 1.0}}, "waited for the mapper 20.0 ms"),
    ],
)
def test_what_went_wrong_is_told(tmp_path: Path, change: dict[str, Any], sentence: str) -> None:
    assert any(sentence in remark for remark in remarks(read_run(write_run(tmp_path / "drive", **change))))


def test_a_run_without_a_pose_says_so_first(tmp_path: Path) -> None:
    assert headline(read_run(write_run(tmp_path / "drive", frames_tracked=0)))[0] == (
        "No pose was found for any of 120 frames."
    )


def test_what_processes_reported_is_told(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "drive")
    (folder / "stages" / "tracker.log").write_text(
        "10:00:00.000 tracker info: all well\n10:00:01.000 tracker warning: a gap: 3 frames\n"
    )
    assert "tracker reported 1 problem, the first: a gap: 3 frames" in remarks(read_run(folder))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("num_frames", [1, 2, 3])
def test_a_run_of_a_few_frames(tmp_path: Path, num_frames: int) -> None:
    """Nothing to draw a line through, no spread and no duration: told without a warning."""
    folder = write_run(
        tmp_path / "drive", loops=False, frames=num_frames, frames_tracked=num_frames, wall_s=0.0, frames_per_s=None
    )
    for name, lines_before in (
        ("trajectory.txt", 1),
        ("trajectory_live.txt", 1),
        ("ground_truth.txt", 0),
        ("frames.csv", 1),
    ):
        lines = (folder / name).read_text().splitlines(keepends=True)
        (folder / name).write_text("".join(lines[: lines_before + num_frames]))
    page = make_page(tmp_path, read_run(folder))
    assert page.root.all("figure") and "nan" not in page.root.all("main")[0].words().split()


@pytest.mark.filterwarnings("error")
def test_frames_of_which_nothing_is_known(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "drive", loops=False)
    rows = (folder / "frames.csv").read_text().splitlines()
    (folder / "frames.csv").write_text(
        "\n".join([rows[0]] + [",".join(row.split(",")[:2]) + ",initializing,,,,,,,,0,0" for row in rows[1:]]) + "\n"
    )
    assert make_page(tmp_path, read_run(folder)).root.all("figure")
