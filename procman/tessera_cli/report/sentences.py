"""A result told in sentences for people: what was found, and what they should know about it."""

import itertools

import numpy as np

from tessera_cli.runs.run_folder import Result
from tessera_cli.runs.trajectories import length_m

# A tracker that waits less than this per frame (95 %) is not held up.
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
    sentences = [_tracked(result), _error(result), _speed(result), _loops(result), _failures(result)]
    return [sentence for sentence in sentences if sentence]


def _tracked(result: Result) -> str:
    summary = result.summary
    if "frames" not in summary:
        return ""
    frames, tracked, before = summary["frames"], summary["frames_tracked"], summary.get("frames_initializing") or 0
    if tracked == frames:
        return f"All {frames:,} frames were tracked."
    if tracked + before == frames:
        return (
            f"All {frames:,} frames were tracked but the first {before:,}, with which the map began."
            if before > 1
            else f"All {frames:,} frames were tracked but the first, with which the map began."
        )
    return f"{tracked:,} of {frames:,} frames were tracked ({100 * tracked / max(frames, 1):.1f} %)."


def _error(result: Result) -> str:
    error = result.error
    if error is None:
        return f"There is no error to tell: {result.error_note}." if result.error_note else ""
    way = length_m(error.truth)
    share = f", {100 * error.rms_m / way:.2f} % of the way's {way:,.0f} m" if way > 1 else ""
    return (
        f"The estimated positions are {error.rms_m:.3f} m (RMS) from the true ones{share}, after alignment by {error.alignment}"
        + (f" with scale {error.scale:.4g}." if error.alignment == "Sim(3)" else ".")
    )


def _speed(result: Result) -> str:
    rate = result.summary.get("frames_per_s")
    if not rate:
        return ""
    sentence = f"The stack handled {rate:.1f} frames a second"
    times_s = result.frames.times_s if result.frames is not None else np.zeros(0)
    if len(times_s) > 1 and times_s[-1] > times_s[0]:
        of_camera = (len(times_s) - 1) / (times_s[-1] - times_s[0])
        sentence += (
            f", {rate / of_camera:.1f} times as fast as the camera took them"
            if rate > 1.05 * of_camera
            else f"; the camera took {of_camera:.1f}"
        )
    return sentence + "."


def _loops(result: Result) -> str:
    loops = num_loops(result)
    if loops is None:
        return ""
    return f"{count(loops, 'loop')} {'was' if loops == 1 else 'were'} closed." if loops else "No loop was closed."


def _failures(result: Result) -> str:
    failures = result.summary.get("tracking_failures")
    if failures is None:
        return ""
    if failures == 0:
        return "Tracking never failed."
    sentence = f"Tracking failed {'once' if failures == 1 else f'{failures:,} times'}"
    found_again = result.summary.get("relocalizations")
    return sentence + (f", and its place was found again {count(found_again, 'time')}." if found_again else ".")


def remarks(result: Result) -> list[str]:
    """What did not go by itself, in words; empty if nothing."""
    summary, found = result.summary, []
    ended = summary.get("ended", "complete")
    if ended == "interrupted":
        found.append("The run was interrupted before its source ended; the figures are of the frames until then.")
    elif ended != "complete":
        found.append(f"The run failed: {ended}")
    if dropped := summary.get("frames_dropped"):
        found.append(
            f"{count(dropped, 'frame')} never reached the tracker: they came faster than they could be handled."
        )
    found += _lost(result)
    if (wait := summary.get("map_wait_ms")) and wait["p95"] >= NOTABLE_WAIT_MS:
        found.append(
            f"The tracker waited for the mapper {wait['mean']:.1f} ms a frame on average, {wait['p95']:.0f} ms or more in one "
            "frame of twenty: mapping is what holds the run up."
        )
    found += _messages(summary)
    if restarts := summary.get("extractor_restarts"):
        found.append(f"Extractors were started again {count(restarts, 'time')}; nothing was lost by it.")
    return found + summary.get("warnings", []) + result.log_warnings


def _lost(result: Result) -> list[str]:
    if result.frames is None:
        return []
    numbers = [int(number) for number, state in zip(result.frames.numbers, result.frames.states) if state == "lost"]
    if not numbers:
        return []
    # Numbers in a row have the same distance from their place in the list.
    runs = [list(run) for _, run in itertools.groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0])]
    ranges = [f"{run[0][1]} to {run[-1][1]}" if len(run) > 1 else str(run[0][1]) for run in runs]
    more = (
        f" and {count(len(ranges) - MAX_RANGES, 'more stretch', 'more stretches')}" if len(ranges) > MAX_RANGES else ""
    )
    return [f"{count(len(numbers), 'frame')} found no pose: {', '.join(ranges[:MAX_RANGES])}{more}."]


def _messages(summary: dict) -> list[str]:
    found = []
    if repaired := summary.get("messages_repaired"):
        found.append(
            f"{count(repaired, 'message')} got lost on the way and {'was' if repaired == 1 else 'were'} sent again; "
            "nothing is missing."
        )
    if lost := summary.get("messages_lost"):
        found.append(f"{count(lost, 'message')} stayed lost: the run may not be repeatable.")
    if undecodable := summary.get("messages_undecodable"):
        found.append(
            f"{count(undecodable, 'message')} made no sense and {'was' if undecodable == 1 else 'were'} left aside: does another "
            "program speak on this bus?"
        )
    return found
