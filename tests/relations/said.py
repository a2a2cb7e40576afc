"""What a report's numbers must be, recomputed from the file trace.h5 by a few lines each, without the report's code."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import dataclass
from functools import cached_property
from html import unescape
from pathlib import Path

import h5py
import numpy as np
from scipy.signal import welch

HANN_LINES = 1.5  # noise bandwidth of a Hann window


@dataclass(frozen=True)
class Said:
    """A folder with report.html, summary.json, data/*.csv and trace.h5."""

    folder: Path

    @cached_property
    def trace(self) -> dict[str, np.ndarray]:
        with h5py.File(self.folder / "trace.h5") as file:
            return {name: np.asarray(own[()], dtype=float) for name, own in file["channels"].items()}

    @cached_property
    def time(self) -> np.ndarray:
        with h5py.File(self.folder / "trace.h5") as file:
            return np.asarray(file["time"][()])

    @cached_property
    def meta(self) -> dict:
        with h5py.File(self.folder / "trace.h5") as file:
            return json.loads(file.attrs["meta"])

    @cached_property
    def late(self) -> np.ndarray:
        """Samples after the settling time."""
        return self.time >= self.meta["settle"]

    @cached_property
    def html(self) -> str:
        return (self.folder / "report.html").read_text(encoding="utf-8")

    @cached_property
    def text(self) -> str:
        bare = re.sub(r"<script.*?</script>|<style.*?</style>", "", self.html, flags=re.S)
        return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", bare))).replace("−", "-")

    @cached_property
    def results(self) -> dict[str, float]:
        return json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))["results"]

    def rows(self, section: str) -> list[list[str]]:
        """Cells of the table rows of a section, by its heading."""
        part = self.html.split(f"<h2>{section}</h2>", 1)[1].split("</section>", 1)[0]
        found = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in re.findall(r"<tr>(.*?)</tr>", part)]
        return [[unescape(re.sub(r"<[^>]+>", "", cell)).replace("−", "-") for cell in row] for row in found]

    def table(self, name: str) -> dict[str, np.ndarray]:
        with (self.folder / "data" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            head, *rows = list(csv.reader(file))
        return dict(zip(head, np.array(rows, dtype=float).T, strict=True))

    @cached_property
    def meshes(self) -> list[str]:
        """In the order of the trace."""
        return [name.removesuffix(".force") for name in self.trace if re.fullmatch(r"\w+\.force", name)]

    @property
    def period(self) -> float:
        """Samples a mesh period of a set, by its first mesh."""
        rotor, teeth, carrier = self.meta["meshes"][self.meshes[0]]
        relative = np.abs(self.trace[f"{rotor}.gear.w"] - self.trace[f"{carrier}.gear.w"])
        return max(1, round(2 * np.pi / (teeth * np.median(relative)) / self.step))

    # ---- numbers of summary.json and of the tables of the page -----------------------------------------------------
    def result(self, key: str) -> float:
        """A number of summary.json's results by its key."""
        if key == "energy_residual_of_port_work":
            ports = [n[:-4] for n in self.trace if n.endswith(".tau") and n.count(".") == 1]
            power = sum(np.abs(self.trace[f"{p}.tau"] * self.trace[f"{p}.gear.w"]) for p in ports)
            return self.trace["energy.residual"][-1] / float(
                (0.5 * (power[1:] + power[:-1]) * np.diff(self.time)).sum()
            )
        if key.startswith("bearing_"):
            name = key.removeprefix("bearing_").removesuffix("_rms_ac_N")
            return float(np.sqrt(sum(np.var(self.trace[f"bearing.{name}.f{d}"][self.late]) for d in "xy")))
        mesh = self.meshes[0]
        if len(self.meshes) > 1:
            mesh = next(m for m in self.meshes if key.startswith(f"{m}_"))
            key = key.removeprefix(f"{mesh}_")
        force, te, contact = (self.trace[f"{mesh}.{end}"] for end in ("force", "te", "contact"))
        return {
            "mesh_force_mean_N": lambda: force[self.late].mean(),
            "mesh_force_rms_ac_N": lambda: force[self.late].std(),
            "te_mean_um": lambda: 1e6 * te[self.late].mean(),
            "te_rms_ac_um": lambda: 1e6 * te[self.late].std(),
            "contact_loss_percent": lambda: 100 * (contact == 0).mean(),
            "coast_contact_percent": lambda: 100 * (contact == -self.drive_sign(mesh)).mean(),
            "impacts": lambda: self.trace[f"{mesh}.impacts"][-1],
            "dynamic_factor": lambda: (
                np.abs(self.trace[f"{mesh}.force_max"][self.late]).max() / abs(force[self.late].mean())
            ),
        }[key]()

    def drive_sign(self, mesh: str) -> float:
        """Sign of the force under a positive torque on the first port (channel: torque of the stage on the shaft)."""
        torque = -next(values for name, values in self.trace.items() if re.fullmatch(r"\w+\.tau", name))
        return -1.0 if (self.trace[f"{mesh}.force"] * torque).sum() < 0 else 1.0

    def share(self, mesh: str) -> float:
        central = mesh.rpartition("_")[0]
        means = {m: np.abs(self.force(m)[self.late]).mean() for m in self.meshes if m.startswith(f"{central}_")}
        return means[mesh] * len(means) / sum(means.values())

    def force(self, mesh: str) -> np.ndarray:
        """The mean over the step where it was recorded."""
        return self.trace.get(f"{mesh}.force_mean", self.trace[f"{mesh}.force"])

    def face_load_factor(self, mesh: str, samples: np.ndarray) -> float:
        names = [n for n in self.trace if n.startswith(f"{mesh}.slice_") and np.any(self.trace[n])]
        means = np.abs([self.trace[name][samples].mean() for name in names])
        return float(means.max() / means.mean()) if means.any() else 0.0  # a planet without load

    # ---- columns of the CSV files ------------------------------------------------------------------------------------
    def column(self, head: str, table: dict[str, np.ndarray]) -> np.ndarray | None:
        """A column of a CSV file by its heading; None for one that this oracle does not know."""
        name = re.sub(r"_\[.*\]$", "", head)
        if name == "time" or (name in self.trace and "time_[s]" in table):
            at = np.searchsorted(self.time, table["time_[s]"] - 1e-12)
            return self.time[at] if name == "time" else self.trace[name][at]
        if found := re.fullmatch(r"(.+)_rms", name):
            return self.spectrum(found[1], self.size(table))
        if name in self.trace and head.endswith("[dB re 1 N]"):
            return 20 * np.log10(np.maximum(self.spectrum(name, self.size(table)), 1e-12))
        if name == "frequency" and "time_[s]" not in table:
            return np.arange(len(table[head])) / (self.size(table) * self.step)
        return self._of_set(name)

    def _of_set(self, name: str) -> np.ndarray | None:
        if found := re.fullmatch(r"(planet\d+)_(sun|ring)(_share)?", name):
            mesh = f"{found[2]}_{found[1]}"
            return self.over_time(mesh) if found[3] else self.trace[f"{mesh}.force"]
        if found := re.fullmatch(r"(planet\d+)_pin", name):
            return np.hypot(*(self.trace[f"pin.{found[1]}.f{d}"] for d in "xy"))
        return self.over_time(name.removesuffix("_share")) if name.endswith("_share") else None

    def over_time(self, mesh: str) -> np.ndarray:
        """Share (n,) of a mesh in the load of its central gear, by running means over a mesh period."""
        central, width = mesh.rpartition("_")[0], min(self.period, self.time.size)
        own = [m for m in self.meshes if m.startswith(f"{central}_")]
        sums = {m: np.cumsum(np.append(0.0, np.abs(self.force(m)))) for m in own}
        smooth = {m: np.full(self.time.size, np.nan) for m in own}
        for m in own:
            whole = (sums[m][width:] - sums[m][:-width]) / width
            smooth[m][(width - 1) // 2 : (width - 1) // 2 + whole.size] = whole
        return len(own) * smooth[mesh] / sum(smooth.values())

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])

    def size(self, table: dict[str, np.ndarray]) -> int:
        """Samples of the windows of a table of spectra."""
        return round(1 / (table["frequency_[Hz]"][1] * self.step))

    def spectrum(self, name: str, size: int) -> np.ndarray:
        """Rms amplitudes: Welch's method, Hann windows of `size` samples; a mean over the step without its
        averaging."""
        values, step = self.trace[name][self.late], self.step
        weights = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
        frequency, power = welch(
            values, 1 / step, "hann", size, size // 2, scaling="spectrum",
            detrend=lambda frames: frames - np.average(frames, axis=-1, weights=weights)[..., None],
        )  # fmt: skip
        return np.sqrt(power) / (np.sinc(frequency * step) if name.endswith("_mean") else 1.0)

    def octaves(self, name: str) -> dict[float, float]:
        """Level (dB re 1 N) by the middle of the octave, over the whole window."""
        samples = int(self.late.sum())
        amplitude = self.spectrum(name, samples)
        frequency = np.arange(amplitude.size) / (samples * self.step)
        found = {}
        for middle in (63, 125, 250, 500, 1000, 2000, 4000, 8000, 16000):
            inside = (frequency >= middle / np.sqrt(2)) & (frequency < middle * np.sqrt(2))
            found[middle] = 20 * np.log10(np.sqrt((amplitude[inside] ** 2).sum() / HANN_LINES) + 1e-30)
        return found
