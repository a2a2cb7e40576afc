"""Builds the kernel library into the package; everything else is in pyproject.toml.

A source install builds the host's kernel only. GEARFMU_PLATFORMS="linux64 win64" (make wheel, with ziglang) puts
several into one wheel; "none" leaves the library to whoever sets it (make, which compiles beside pip)."""

import importlib.util
import os
import shutil
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
NAMED = os.environ.get("GEARFMU_PLATFORMS", "").split()
RELEASE = [platform for platform in NAMED if platform != "none"]
WHEEL_TAG = {"linux64": "manylinux2014_x86_64.manylinux_2_17_x86_64", "win64": "win_amd64"}


def kernel_build():
    """gearfmu/kernel/build.py, without importing the package: its dependencies are not installed yet."""
    sys.path.insert(0, str(ROOT))
    spec = importlib.util.spec_from_file_location("gearfmu_kernel_build", ROOT / "gearfmu" / "kernel" / "build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class BuildWithKernel(build_py):
    def run(self):
        build = kernel_build()
        libraries = [build.build_library(platform) for platform in RELEASE] if NAMED else [build.current_library()]
        super().run()
        if not self.editable_mode:  # an editable install finds both in the checkout
            for library in libraries:
                self.copy_folder(library.parent, f"kernel/lib/{library.parent.name}")
            self.copy_folder(ROOT / "reduced_models", "reduced_models")

    def copy_folder(self, source, place):
        """Into the package that is being built; what an earlier build left there is removed."""
        target = Path(self.build_lib) / "gearfmu" / place
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(source, target, ignore=shutil.ignore_patterns(".*", "*.tmp"))


class PlatformWheel(bdist_wheel):
    def get_tag(self):
        tag = ".".join(WHEEL_TAG[platform] for platform in RELEASE) if RELEASE else super().get_tag()[2]
        return "py3", "none", tag


class BinaryDistribution(Distribution):
    def has_ext_modules(self):
        return True


setup(
    distclass=BinaryDistribution,
    cmdclass={"build_py": BuildWithKernel, "bdist_wheel": PlatformWheel},
    setup_requires=kernel_build().build_requirements(NAMED),
)
