"""What a run says on its way, as Foxglove's Log."""

from __future__ import annotations

from foxglove_schemas_protobuf.Log_pb2 import Log

from landtool.io.mcap_proto import Built, built, stamp


def status(stamp_ns: int, text: str, *, warn: bool) -> Built:
    """Return a line of a log, as a warning or as information."""
    level = Log.WARNING if warn else Log.INFO
    return built(Log(timestamp=stamp(stamp_ns), level=level, message=text, name="landtool"))
