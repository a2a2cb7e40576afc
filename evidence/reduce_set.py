"""What `gearfmu reduce planetary54` costs: wall time, processor time and memory of all its processes together.

    python evidence/reduce_set.py [--out FOLDER]

Memory is the largest sum of resident memory over the processes, sampled ten times a second (Linux); what the processes
share is counted twice. BLAS on one thread.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def main() -> None:
    """Run the verb into an empty folder and print its own lines and the cost."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", help="folder of the bodies; a temporary one when not given")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.out or temporary
        command = [sys.executable, "-m", "gearfmu.cli", "reduce", "planetary54", "--force", "--out", folder]
        before, started, peak = os.times(), time.perf_counter(), 0.0
        process = subprocess.Popen(command)
        while process.poll() is None:
            peak = max(peak, resident(process.pid))
            time.sleep(0.1)
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    print(f"wall {time.perf_counter() - started:.0f} s, CPU {cpu:.0f} s, memory {peak:.2f} GB, load average "
          f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")  # fmt: skip
    sys.exit(process.returncode)


def resident(pid: int) -> float:
    """Resident memory (GB) of a process and its children; 0 where /proc does not tell."""
    total = 0.0
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        total = pages * os.sysconf("SC_PAGE_SIZE") / 1e9
    except (OSError, ValueError, IndexError):
        return total
    return total + sum(resident(int(child)) for child in children)


if __name__ == "__main__":
    main()
