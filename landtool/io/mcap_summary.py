"""What an MCAP log holds, topic by topic."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from mcap.records import Channel, Schema

from landtool.errors import InputError, UsageError
from landtool.io.mcap_camera import camera_topic
from landtool.io.mcap_messages import CALIBRATION_PARSERS, CALIBRATION_TYPES, IMAGE_PARSERS, IMAGE_TYPES, plain_type
from landtool.io.mcap_poses import POSE_PARSERS
from landtool.io.mcap_stream import LogMessage, LogReader

Role = Literal["image", "calibration", "pose", "other"]
_LISTED = 12


@dataclass(frozen=True)
class McapTopic:
    """A topic: message type and encoding as the log names them, count: its messages."""

    name: str
    type: str
    encoding: str
    count: int

    @property
    def role(self) -> Role:
        """What landtool can use its messages for."""
        kind = plain_type(self.type)
        if kind in IMAGE_TYPES:
            return "image"
        if kind in CALIBRATION_TYPES:
            return "calibration"
        return "pose" if (kind, self.encoding) in POSE_PARSERS else "other"

    def __str__(self) -> str:
        return f"{self.name} ({self.type or 'no type'}, {self.count})"


@dataclass(frozen=True)
class McapSummary:
    """A log as its index tells it, or, without one, as reading it through does.

    start_ns, end_ns: first and last time of logging, None without messages. indexed: the index was there and told.
    problems: one sentence each.
    """

    path: Path
    profile: str
    library: str
    start_ns: int | None
    end_ns: int | None
    indexed: bool
    topics: tuple[McapTopic, ...]
    problems: tuple[str, ...]

    @property
    def image_topics(self) -> tuple[McapTopic, ...]:
        """Topics of pictures; `/camera/image` and `/camera/image/compressed` are two."""
        return tuple(topic for topic in self.topics if topic.role == "image")

    @property
    def camera_topics(self) -> tuple[McapTopic, ...]:
        """Topics of calibrations."""
        return tuple(topic for topic in self.topics if topic.role == "calibration")

    @property
    def pose_topics(self) -> tuple[McapTopic, ...]:
        """Topics `read_poses` takes."""
        return tuple(topic for topic in self.topics if topic.role == "pose")

    def camera_topic_of(self, image_topic: str) -> McapTopic | None:
        """Return the calibration topic that belongs to an image topic."""
        readable = [t for t in self.camera_topics if (plain_type(t.type), t.encoding) in CALIBRATION_PARSERS]
        ros = [topic.name for topic in readable if topic.encoding == "cdr"]
        foxglove = [topic.name for topic in readable if topic.encoding != "cdr"]
        name = camera_topic(image_topic, ros, foxglove, len(self.image_topics))
        return next((topic for topic in readable if topic.name == name), None)

    def choose_image_topic(self, name: str | None) -> McapTopic:
        """Return the image topic of that name, or the only one with messages.

        Raises UsageError when the name or the log leaves no single topic, InputError when there is none to choose.
        """
        if not self.image_topics:
            reason = f"holds no image topic; it holds {listed(self.topics)}"
            raise InputError(reason, file=self.path, hint="record the camera's topic")
        if name is not None:
            found = [topic for topic in self.image_topics if topic.name == name]
            if not found:
                reason = f"has no image topic '{name}'; it has {listed(self.image_topics)}"
                raise UsageError(reason, file=self.path, hint="choose one with --topic")
        else:
            found = [topic for topic in self.image_topics if topic.count] or list(self.image_topics)
            if len(found) > 1:
                reason = f"holds {len(found)} image topics: {listed(found)}"
                raise UsageError(reason, file=self.path, hint="choose one with --topic")
        return self._readable(found[0])

    def _readable(self, topic: McapTopic) -> McapTopic:
        if (plain_type(topic.type), topic.encoding) not in IMAGE_PARSERS:
            reason = f"the image topic {topic} is encoded as '{topic.encoding}', which is not supported"
            hint = "convert the log to ROS 2 (cdr) or Foxglove protobuf"
            raise InputError(reason, file=self.path, hint=hint)
        if not topic.count:
            raise InputError(f"the image topic {topic.name} has no messages", file=self.path, hint="record it again")
        return topic


def describe_mcap(path: Path) -> McapSummary:
    """Tell what a log holds: from its index, or by reading it through when it has none.

    Raises InputError for a file that is no MCAP log or is cut before its first topic.
    """
    reader = LogReader(path)
    header = reader.read_header()
    summary = _from_index(reader) or _from_reading(reader)
    if not summary.topics and reader.truncated:
        raise InputError("is cut before its first topic", file=path, hint="copy or record it again")
    return replace(summary, profile=header.profile, library=header.library) if header else summary


def listed(topics: Iterable[McapTopic]) -> str:
    """Return topics with type and count as one line, the long tail left out."""
    names = [str(topic) for topic in topics]
    if not names:
        return "no topics"
    more = [f"and {len(names) - _LISTED} more"] if len(names) > _LISTED else []
    return ", ".join(names[:_LISTED] + more)


def _from_index(reader: LogReader) -> McapSummary | None:
    """Use the index; None when it does not tell every topic and count."""
    index = reader.index
    if index is None or index.statistics is None:
        return None
    statistics = index.statistics
    counts = statistics.channel_message_counts
    if statistics.channel_count > len(index.channels) or set(counts) - set(index.channels):
        return None
    if statistics.message_count != sum(counts.values()):
        return None  # some writers leave the counts a topic out
    topics = _topics(index.channels, index.schemas, counts)
    some = statistics.message_count > 0
    start_ns = statistics.message_start_time if some else None
    end_ns = statistics.message_end_time if some else None
    return McapSummary(reader.path, "", "", start_ns, end_ns, True, topics, ())


def _from_reading(reader: LogReader) -> McapSummary:
    counts: Counter[int] = Counter()
    problems: list[str] = []
    start_ns: int | None = None
    end_ns: int | None = None
    for event in reader.read():
        if not isinstance(event, LogMessage):
            problems.append(event.reason)
            continue
        counts[event.channel.id] += 1
        start_ns = event.log_time_ns if start_ns is None else min(start_ns, event.log_time_ns)
        end_ns = event.log_time_ns if end_ns is None else max(end_ns, event.log_time_ns)
    topics = _topics(reader.channels, reader.schemas, counts)
    problems += ["the log has no index, it was read through", *reader.notes]
    return McapSummary(reader.path, "", "", start_ns, end_ns, False, topics, tuple(problems))


def _topics(channels: dict[int, Channel], schemas: dict[int, Schema], counts: dict[int, int]) -> tuple[McapTopic, ...]:
    """Join the channels of a topic, of which every publisher may have its own."""
    joined: Counter[tuple[str, str, str]] = Counter()
    for number, channel in channels.items():
        schema = schemas.get(channel.schema_id)
        joined[channel.topic, schema.name if schema else "", channel.message_encoding] += counts.get(number, 0)
    return tuple(McapTopic(*key, count) for key, count in sorted(joined.items()))
