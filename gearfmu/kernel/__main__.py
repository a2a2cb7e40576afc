"""Builds the kernel library: python -m gearfmu.kernel [--platform win64] [--sanitize]."""

import sys

from gearfmu.kernel.build import main

sys.exit(main())
