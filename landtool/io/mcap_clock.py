"""Which of a topic's two clocks tells when its messages happened."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Steps:
    """How the times of one clock follow each other; fed in the order of the log."""

    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    lowest_ns: int = 0
    highest_ns: int = 0
    back: int = 0
    repeated: int = 0

    def add(self, t_ns: int) -> None:
        """Take in the next time."""
        if not self.count:
            self.first_ns = self.lowest_ns = self.highest_ns = t_ns
        else:
            self.back += t_ns < self.last_ns
            self.repeated += t_ns == self.last_ns
            self.lowest_ns, self.highest_ns = min(self.lowest_ns, t_ns), max(self.highest_ns, t_ns)
        self.count += 1
        self.last_ns = t_ns


@dataclass
class ClockCheck:
    """Decides between the stamps in the messages' headers and the times of logging.

    The stamps are the better clock: they are of the exposure. They are not used when they do not increase from the
    first message to the last, when all are 0, or when they go back more often than the times of logging. Repeated
    stamps alone are no reason.
    """

    stamps: Steps = field(default_factory=Steps)
    log: Steps = field(default_factory=Steps)

    def add(self, stamp_ns: int, log_time_ns: int) -> None:
        """Take in the next message's two times."""
        self.stamps.add(stamp_ns)
        self.log.add(log_time_ns)

    @property
    def fault(self) -> str:
        """Why the stamps are not used; empty when they are."""
        if self.stamps.count and self.stamps.lowest_ns == self.stamps.highest_ns == 0:
            return "are all 0"
        if self.stamps.count > 1 and self.stamps.lowest_ns == self.stamps.highest_ns:
            return "are all the same"
        if self.stamps.back > self.log.back or self.stamps.last_ns < self.stamps.first_ns:
            return f"go back {_often(self.stamps.back)}"
        return ""

    @property
    def chosen(self) -> Steps:
        """The clock that is used."""
        return self.log if self.fault else self.stamps

    def notes(self, topic: str) -> list[str]:
        """Return what the user should hear about the clock, one sentence each."""
        notes = []
        if self.fault:
            notes.append(f"the header stamps of {topic} {self.fault}: the times of logging are used instead")
        if self.chosen.back:
            notes.append(f"the times of {topic} go back {_often(self.chosen.back)}")
        if self.chosen.repeated:
            notes.append(f"times of {topic} that repeat the one before: {self.chosen.repeated}")
        return notes

    def t_ns(self, stamp_ns: int, log_time_ns: int) -> int:
        """Return a message's time on the chosen clock."""
        return log_time_ns if self.fault else stamp_ns


def _often(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
