"""Every finding on an FMU, one a line; exit code: their number."""

import sys

from evidence.fmu_probes.everything import findings

found = findings(sys.argv[1])
print(*found, sep="\n")
sys.exit(min(len(found), 99))
