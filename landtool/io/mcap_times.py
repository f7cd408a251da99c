"""The times of a log's image topics, read without decoding a picture."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from landtool.io.mcap_cdr import BrokenMessageError
from landtool.io.mcap_clock import ClockCheck
from landtool.io.mcap_messages import IMAGE_PARSERS, parse_image, plain_type
from landtool.io.mcap_stream import LogMessage, LogReader


@dataclass(frozen=True)
class TopicTimes:
    """One image topic. times_ns: in the order of the log. clock: what gave them. broken: messages without a header."""

    times_ns: tuple[int, ...]
    clock: str
    broken: int


@dataclass(frozen=True)
class LogTimes:
    """Every image topic of a log by name, and what is wrong with the log.

    lost_chunks: parts that cannot be read, whatever they held. truncated: the log ends early. notes: one sentence each.
    """

    topics: Mapping[str, TopicTimes]
    lost_chunks: int
    truncated: bool
    notes: tuple[str, ...]


@dataclass
class _Collected:
    stamps_ns: list[int] = field(default_factory=list)
    log_ns: list[int] = field(default_factory=list)
    check: ClockCheck = field(default_factory=ClockCheck)
    broken: int = 0

    def add(self, event: LogMessage, schema: str) -> None:
        parser = IMAGE_PARSERS.get((plain_type(schema), event.channel.message_encoding))
        try:
            if parser is None:
                raise BrokenMessageError("its type is not read")
            stamp_ns = parse_image(parser, event.data).stamp_ns
        except BrokenMessageError:
            self.broken += 1
            return
        self.stamps_ns.append(stamp_ns)
        self.log_ns.append(event.log_time_ns)
        self.check.add(stamp_ns, event.log_time_ns)

    def times(self) -> TopicTimes:
        if self.check.fault:
            return TopicTimes(tuple(self.log_ns), f"times of logging (the stamps {self.check.fault})", self.broken)
        return TopicTimes(tuple(self.stamps_ns), "header stamps", self.broken)


def read_image_times(path: Path, topics: Collection[str]) -> LogTimes:
    """Read a log through for the times of its image topics, by the same clock `McapSource` takes.

    Raises InputError for what is no MCAP log and for a compression that is not known.
    """
    reader = LogReader(path)
    collected = {name: _Collected() for name in topics}
    reasons: list[str] = []
    for event in reader.read(collected.keys()):
        if isinstance(event, LogMessage):
            schema = reader.schemas.get(event.channel.schema_id)
            collected[event.channel.topic].add(event, schema.name if schema else "")
        else:
            reasons.append(event.reason)
    notes = tuple(dict.fromkeys([*reader.notes, *reasons]))
    return LogTimes({name: seen.times() for name, seen in collected.items()}, len(reasons), reader.truncated, notes)
