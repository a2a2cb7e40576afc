"""Runs of test modules in forks of one process, which has imported what all of them import."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import pkgutil
import sys

import pytest

import gearfmu

PACKAGES = "bearing body cosim fem femesh geometry modes planning reduction report rexs scenefile sound stage".split()
PACKAGES += ["stagefile", "study", "sweeps"]
OTHERS = (
    "scipy.linalg scipy.sparse.linalg scipy.optimize scipy.signal h5py hypothesis matplotlib.pyplot coverage".split()
)


def serve() -> None:
    """Runs the module that each line of standard input names, and answers with its exit code."""
    for name in OTHERS:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    for package in pkgutil.walk_packages(gearfmu.__path__, "gearfmu."):
        if package.name.split(".")[1] in PACKAGES:
            importlib.import_module(package.name)
    for line in sys.stdin:
        child = os.fork()
        if not child:
            with contextlib.redirect_stdout(io.StringIO()):
                pytest.main(["-q", "-p", "no:cacheprovider", "-p", "watched", line.strip()])
            sys.exit(0)  # an end in order: the counts of gcov are written
        print(os.waitpid(child, 0)[1], flush=True)
