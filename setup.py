"""Builds the kernel library into the package; everything else is in pyproject.toml.

Reports carry plotly's script: the build takes this one file of 61 MB out of the package, which nobody needs afterwards.
A source install builds the host's kernel only. GEARFMU_PLATFORMS="linux64 win64" (make wheel, with ziglang) puts
several into one wheel; "none" leaves the library to whoever sets it (make, which compiles beside pip)."""

import importlib.util
import os
import re
import shutil
import sys
from importlib.metadata import distribution
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


def take_plotly():
    """plotly.min.js and its licence beside the other scripts of reports."""
    package = distribution("plotly")
    script = next(p for p in package.files if p.name == "plotly.min.js")
    licence = next(p for p in package.files if p.name.startswith("LICENSE") and ".dist-info" in p.parts[0])
    for file, name in ((script, "plotly.min.js"), (licence, "plotly.LICENSE")):
        shutil.copyfile(file.locate(), ROOT / "gearfmu" / "report" / "web" / name)


def page_of_the_package():
    """README.md for an index of packages: its links within the checkout become addresses of this version."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    source, version = (re.search(rf'^{key} = "(.+)"$', text, re.M)[1] for key in ("Source", "version"))

    def absolute(match):
        picture, link = match[1].startswith("!"), match[2]
        if "://" in link or link.startswith("#"):
            return match[0]
        query = "?sanitize=true" if link.endswith(".svg") else ""  # else the file comes as text
        return f"{match[1]}({source}/{'raw' if picture else 'blob'}/v{version}/{link}{query})"

    return re.sub(r"(!?\[[^\[\]]*\])\(([^)\s]+)\)", absolute, (ROOT / "README.md").read_text(encoding="utf-8"))


class BuildWithKernel(build_py):
    def run(self):
        take_plotly()
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
    long_description=page_of_the_package(),
    long_description_content_type="text/markdown",
    distclass=BinaryDistribution,
    cmdclass={"build_py": BuildWithKernel, "bdist_wheel": PlatformWheel},
    setup_requires=kernel_build().build_requirements(NAMED),
)
