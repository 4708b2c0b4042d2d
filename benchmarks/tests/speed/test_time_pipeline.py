"""What the commands of the pipeline take."""

import sys

from benchmarks.speed.time_pipeline import _run


def test_a_run_counts_the_processor_time_and_the_memory_of_children(tmp_path):
    burn = (
        "import time; held = bytearray(300_000_000); held[::4096] = bytes(len(held[::4096])); s = time.process_time()\n"
    )
    burn += "while time.process_time() < s + 0.3: pass"
    found = _run(
        str(tmp_path), sys.executable, "-c", f"import subprocess, sys; subprocess.run([sys.executable, '-c', {burn!r}])"
    )
    assert found.processor_s >= 0.3
    assert found.seconds > 0
    assert found.peak_mb >= 300
