"""A result in sentences for people: what was found, and what they should know about it."""

import itertools

import numpy as np

from tessera_cli.runs.run_folder import Result, Summary
from tessera_cli.runs.trajectories import length_m
from tessera_cli.text import focal_words

# A tracker that waits less than this per frame (95 %) is not slowed down by it.
NOTABLE_WAIT_MS = 10.0
MAX_RANGES = 6


def count(number: int, one: str, many: str = "") -> str:
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def num_loops(result: Result) -> int | None:
    """None: the run did not look for loops."""
    closed = result.summary.get("loops_closed")
    return closed if closed is not None else len(result.loops) or None


def headline(result: Result) -> list[str]:
    """Sentences, the most important first."""
    sentences = [
        _tracked(result),
        _error(result),
        _speed(result),
        _loops(result),
        _drift(result),
        _lens(result),
        _right_camera(result),
        _readout(result),
        _own_body(result),
        _repeated(result),
        _failures(result),
    ]
    return [sentence for sentence in sentences if sentence]


def _tracked(result: Result) -> str:
    summary = result.summary
    if "frames" not in summary:
        return ""
    frames, tracked, before = summary["frames"], summary["frames_tracked"], summary.get("frames_initializing") or 0
    if tracked == 0:
        return f"No pose was found for any of {frames:,} frames."
    if tracked == frames:
        return f"All {frames:,} frames were tracked."
    if tracked + before == frames:
        first = f"the first {before:,}" if before > 1 else "the first"
        return f"All {frames:,} frames were tracked except {first}, with which the map began."
    return f"{tracked:,} of {frames:,} frames were tracked ({100 * tracked / max(frames, 1):.1f} %)."


def _error(result: Result) -> str:
    error = result.error
    if error is None:
        return f"The error is not known: {result.error_note}." if result.error_note else ""
    length = length_m(error.truth)
    share = f", {100 * error.rms_m / length:.2f} % of the path's {length:,.0f} m" if length > 1 else ""
    scale = f" with scale {error.scale:.4g}" if error.alignment == "Sim(3)" else ""
    distance = f"{error.rms_m:.3f} m (RMS) from the true ones{share}"
    return f"The estimated positions are {distance}, after alignment by {error.alignment}{scale}."


def _speed(result: Result) -> str:
    rate = result.summary.get("frames_per_s")
    if not rate:
        return ""
    sentence = f"The stack processed {rate:.1f} frames a second"
    times_s = result.frames.times_s if result.frames is not None else np.zeros(0)
    if len(times_s) < 2 or times_s[-1] <= times_s[0]:
        return f"{sentence}."
    of_camera = (len(times_s) - 1) / (times_s[-1] - times_s[0])
    if rate > 1.05 * of_camera:
        return f"{sentence}, {rate / of_camera:.1f} times as fast as the camera took them."
    return f"{sentence}; the camera took {of_camera:.1f}."


def _loops(result: Result) -> str:
    loops = num_loops(result)
    if loops is None:
        return ""
    return f"{count(loops, 'loop')} {'was' if loops == 1 else 'were'} closed." if loops else "No loop was closed."


def _drift(result: Result) -> str:
    """By how much the scale of mono may have changed; loops take some of it back."""
    drift = _values(result, "tracker").get("scale_drift")
    if not drift or result.summary.get("sensor") != "mono":
        return ""
    loops = ", which loops have corrected in part" if num_loops(result) else ""
    return (
        f"The scale may have drifted by about {100 * drift:.0f} % since the map began (one standard deviation){loops}."
    )


def _lens(result: Result) -> str:
    values = _values(result, "mapper")
    error, radial = values.get("focal_error"), values.get("lens_radial")
    if not error:
        return ""
    edges = (
        f", and edges of the image drawn {100 * abs(radial):.1f} % {'out' if radial > 0 else 'in'}ward,"
        if radial
        else ""
    )
    return (
        f"Focal lengths {focal_words(error)} than the calibration's{edges} explain the images better, and were used: "
        "calibrate the camera anew."
    )


def _right_camera(result: Result) -> str:
    """How the rows of a stereo pair's images were put straight."""
    values = _values(result, "camera")
    pitch_deg, twist_deg = values.get("right_pitch_deg") or 0.0, values.get("right_twist_deg") or 0.0
    if not (pitch_deg or twist_deg):
        return ""
    looks = f"looks {abs(pitch_deg):.2f}\N{DEGREE SIGN} {'higher' if pitch_deg >= 0 else 'lower'}"
    return (
        f"The right camera {looks} than its calibration says, and is turned by {twist_deg:.2f}\N{DEGREE SIGN} about "
        "its axis: its images were put straight; calibrate the pair anew."
    )


def _values(result: Result, stage: str) -> dict[str, float]:
    """What this stage told last in STATUS; runs of older versions know less."""
    return (result.summary.get("stage_values") or {}).get(stage, {})


def _readout(result: Result) -> str:
    """What the tracker learned of when rows, depths and right images are taken."""
    values = _values(result, "tracker")
    down_ms, across_ms = values.get("readout_ms") or 0.0, values.get("readout_across_ms") or 0.0
    delay_ms, right_ms = values.get("depth_delay_ms") or 0.0, values.get("right_delay_ms") or 0.0
    found = []
    if down_ms or across_ms:
        if across_ms:
            way = " from left to right" if across_ms > 0 else " from right to left"
        else:
            way = "" if down_ms > 0 else " from the bottom up"
        found.append(f"the camera takes {abs(down_ms or across_ms):.0f} ms to read an image{way} (a rolling shutter)")
    if delay_ms:
        found.append(f"depths are measured {abs(delay_ms):.0f} ms {_after(delay_ms)} the time they are said to be of")
    if right_ms:
        found.append(f"the right camera takes its image {abs(right_ms):.1f} ms {_after(right_ms)} the left one")
    if not found:
        return ""
    sentence = " and ".join(found)
    return f"{sentence[0].upper()}{sentence[1:]}; keypoints were corrected for it."


def _after(delay_ms: float) -> str:
    return "after" if delay_ms > 0 else "before"


def _own_body(result: Result) -> str:
    """What moves with the camera, as far as the tracker has found any."""
    values = _values(result, "tracker")
    share = values.get("own_body_share") or 0.0
    if not share:
        return ""
    return (
        f"{100 * share:.0f} % of the image moves with the camera (what carries it, a time stamp, dirt on the lens): "
        "keypoints there were left out."
    )


def _repeated(result: Result) -> str:
    """Images that came once more in place of new ones."""
    num = int(_values(result, "tracker").get("images_repeated") or 0)
    if not num:
        return ""
    return (
        f"{count(num, 'image')} of {result.summary.get('frames', 0):,} only repeated the one before, as those of a "
        "busy camera do, or of a video of raised rate: the pose stays there until the next."
    )


def _failures(result: Result) -> str:
    failures = result.summary.get("tracking_failures")
    if failures is None or not result.summary.get("frames_tracked"):
        return ""
    if failures == 0:
        return "Tracking never failed."
    sentence = f"Tracking failed {'once' if failures == 1 else f'{failures:,} times'}"
    relocalized = result.summary.get("relocalizations")
    return (
        f"{sentence}, and the camera was relocalized {count(relocalized, 'time')}." if relocalized else f"{sentence}."
    )


def remarks(result: Result) -> list[str]:
    """What went wrong or was repaired; empty if nothing."""
    summary, found = result.summary, []
    ended = summary.get("ended", "complete")
    if ended == "interrupted":
        found.append("The run was interrupted before its source ended; all figures are of the frames until then.")
    elif ended != "complete":
        found.append(f"The run failed: {ended}")
    found += _lost(result) + parts_sentences(summary)
    if (wait := summary.get("map_wait_ms")) and wait["p95"] >= NOTABLE_WAIT_MS:
        found.append(
            f"The tracker waited for the mapper {wait['mean']:.1f} ms a frame on average, and {wait['p95']:.0f} ms or "
            "more in one frame of twenty: mapping limits the speed of this run."
        )
    found += _messages(summary)
    if restarts := summary.get("extractor_restarts"):
        found.append(f"Extractors were restarted {count(restarts, 'time')}; nothing was lost.")
    return found + summary.get("warnings", []) + result.log_warnings


def _lost(result: Result) -> list[str]:
    if result.frames is None:
        return []
    numbers = [int(number) for number, state in zip(result.frames.numbers, result.frames.states) if state == "lost"]
    if not numbers:
        return []
    # Consecutive numbers have the same distance from their index in the list.
    runs = [list(run) for _, run in itertools.groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0])]
    ranges = [f"{run[0][1]} to {run[-1][1]}" if len(run) > 1 else str(run[0][1]) for run in runs]
    more = f" and {count(len(ranges) - MAX_RANGES, 'more range')}" if len(ranges) > MAX_RANGES else ""
    return [f"{count(len(numbers), 'frame')} got no pose: {', '.join(ranges[:MAX_RANGES])}{more}."]


def parts_sentences(summary: Summary) -> list[str]:
    """Empty if the map is in one piece."""
    parts = summary.get("parts") or []
    if len(parts) < 2:
        return []
    main = next(part for part in parts if part["is_main"])
    others = count(sum(part["frames"] for part in parts if not part["is_main"]), "other frame")
    largest = f"the largest has {count(main['keyframes'], 'keyframe')} and places {count(main['frames'], 'frame')}"
    return [
        f"The map is in {len(parts):,} parts that nothing joins: {largest}; the positions of "
        f"{others} can't be compared with these."
    ]


def _messages(summary: Summary) -> list[str]:
    found = []
    if repaired := summary.get("messages_repaired"):
        was = "was" if repaired == 1 else "were"
        found.append(f"{count(repaired, 'message')} got lost on the network and {was} sent again; nothing is missing.")
    if lost := summary.get("messages_lost"):
        found.append(f"{count(lost, 'message')} stayed lost: the run may not be repeatable.")
    if undecodable := summary.get("messages_undecodable"):
        was = "was" if undecodable == 1 else "were"
        invalid = f"{count(undecodable, 'message')} could not be decoded and {was} ignored"
        found.append(f"{invalid}: does another program use this bus?")
    if strangers := summary.get("messages_of_strangers"):
        found.append(strangers_sentence(strangers))
    return found


def strangers_sentence(num_messages: int) -> str:
    was = "was" if num_messages == 1 else "were"
    return f"{count(num_messages, 'message')} of strangers {was} passed over: they changed nothing."
