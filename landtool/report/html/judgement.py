"""What stands first on a page: the judgement in a word, what follows from it, and how serious it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Level = Literal["good", "warn", "bad", "none"]
# Of a run: the word, how serious, and what it means for who steers by it
_RUNS: dict[str, tuple[str, Level, str]] = {
    "tracked": (
        "Tracked",
        "good",
        "The platform's place was known all the way: a controller could have steered by it.",
    ),
    "bridged": (
        "Tracked, with gaps",
        "warn",
        "In the gaps only the prediction told where the platform is; it is as good as its error below.",
    ),
    "lost": (
        "Lost",
        "bad",
        "For a time nothing was known of the platform: a controller would have had to break off the landing.",
    ),
    "sighted": ("Sighted only", "bad", "The pad was seen too seldom for a track: there was nothing to steer by."),
    "no_clock": (
        "Measured, without a clock",
        "warn",
        "There are poses, but no track, speed or prediction: give the frame rate with --fps.",
    ),
    "no_pad": ("No pad found", "bad", "Nothing was measured. The frames below say why; check --pad and --camera."),
    "no_frames": ("No frames", "bad", "The recording holds no picture, so there is nothing to judge."),
}
_MARKS: dict[Level, str] = {"good": "\N{HEAVY CHECK MARK}", "warn": "!", "bad": "\N{HEAVY BALLOT X}", "none": "–"}


@dataclass(frozen=True)
class Judgement:
    """word: the headline. lines: the facts, as they were printed."""

    word: str
    level: Level
    consequence: str
    lines: tuple[str, ...]

    @property
    def mark(self) -> str:
        """A sign that tells the level without colour."""
        return _MARKS[self.level]


def judge_run(record: Mapping[str, Any]) -> Judgement:
    """Return what a run's verdict says; a judgement this version does not know is shown as it is."""
    verdict = record["verdict"]
    name = str(verdict.get("judgement", "unknown"))
    word, level, consequence = _RUNS.get(name, (name, "none", ""))
    lines = verdict.get("lines")
    if not isinstance(lines, list):
        lines = ["run.json holds no verdict in words: it is of an earlier landtool. Its numbers are below."]
    return Judgement(word, level, consequence, tuple(str(line) for line in lines))


def judge_evaluation(record: Mapping[str, Any]) -> Judgement:
    """Return what an evaluation's gate says, or that there was none."""
    gate = record.get("gate")
    defined = sum(metric.get("value") is not None for metric in record["metrics"])
    count = len(record["metrics"])
    said = (f"{defined} of {count} numbers are defined" if count else "no number at all: undefined, 0 of 0",)
    if not isinstance(gate, Mapping):
        advice = "No baseline was given, so nothing says whether this is better or worse than before: --baseline FILE."
        return Judgement("Measured, no gate", "none", advice, said)
    verdicts = [str(row.get("verdict")) for row in gate.get("rows", [])]
    counted = tuple(
        f"{verdicts.count(word)} {text}"
        for word, text in (
            ("worse", "worse than allowed"),
            ("gone", "gone: in the baseline, but not measured"),
            ("better", "better"),
            ("noise", "changed, but within its interval"),
            ("same", "the same"),
            ("new", "new: not in the baseline"),
        )
        if word in verdicts
    )
    against = f"against {gate.get('baseline')}"
    if gate.get("passed"):
        return Judgement("Gate met", "good", f"Nothing left its tolerance, {against}.", counted + said)
    if not {"worse", "gone"} & set(verdicts):
        consequence = f"Nothing could be compared, {against}. The command ends with exit code 1."
        return Judgement("Gate not met", "bad", consequence, counted + said)
    consequence = f"Something left its tolerance, {against}: the table says what. The command ends with exit code 1."
    return Judgement("Gate not met", "bad", consequence, counted + said)
