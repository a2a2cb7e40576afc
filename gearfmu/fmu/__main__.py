"""The probes of gearfmu.fmu.validate as a program: python -m gearfmu.fmu FOLDER [CHECK …]."""

import sys

from gearfmu.fmu.probes import main

main(sys.argv[1], sys.argv[2:])
