"""Processes that draw."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest

from tests.shared import ROOT

# in a program of its own: multiprocessing starts its helper once in a process
PROGRAM = """
    import signal
    from landtool.synth.dataset.work import keep_signals_blocked
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    keep_signals_blocked()
    from multiprocessing import resource_tracker
    resource_tracker.ensure_running()
    print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
"""


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
def test_ctrl_c_stays_blocked_where_it_was_when_processes_start() -> None:
    said = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(PROGRAM)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert said.stdout.strip() == "True"
