"""Planted defects: one line of the program is made wrong at a time, and the named tests must fail. Golden runs, which
any change of a number moves, are not among them: the physics must see it.

    python tests/mutants.py [--only PATTERN] [--judges relations] [--jobs 2]

works on copies of the checkout and writes evidence/mutants.csv; exit code 1 where fewer than 95 % are caught. The
test that caught a defect last time runs first, the others where it passes."""

from __future__ import annotations

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "evidence" / "mutants.csv"
LEAST = 0.95  # share that must be caught
LONGEST = 900  # s for the tests of one defect
LEFT_OUT = shutil.ignore_patterns("__pycache__", ".*_cache", ".hypothesis", ".git", ".venv")
BUILD = """
from gearfmu.kernel.build import HERE, PORTABLE, build_library, host_platform, STEM, SUFFIX
name = host_platform()
build_library(out=HERE / "lib" / name / (STEM + SUFFIX[name]), compiler=("cc", "-O1", PORTABLE, "-lm"))
"""


@dataclass(frozen=True)
class Mutant:
    """A defect: `old` stands once in the file of that name and becomes `new`; `tests`: files below tests/, in order."""

    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def of(file: str, tests: str, *edits: tuple[str, str]) -> Iterable[Mutant]:
    """Several defects of one file."""
    return (Mutant(file, old, new, tuple(tests.split())) for old, new in edits)


ENERGY = "stage/test_energy.py stage/test_energy_more.py"
MUTANTS: tuple[Mutant, ...] = (
    # ---- kernel: forces ----
    *of(
        "gk_law.c",
        f"kernel/test_contact.py kernel/test_kernel_slices.py {ENERGY}",
        ("law->beta = 2.0 * law->a /", "law->beta = 2.2 * law->a /"),
        ("GK_CHOOSE(low, law->c_low + 2.0 * q * f,", "GK_CHOOSE(low, law->c_low + 1.0 * q * f,"),
        ("(0.5 * secant - 0.125 * law->a) + law->phi_log", "(0.5 * secant - 0.125 * law->a)"),
    ),
    *of(
        "gk_section.c",
        "kernel/test_contact.py stage/test_internal_pair.py stage/test_physics.py",
        ("l.cosine = (dx * R + sg * dy * l.L) / a2;", "l.cosine = (dx * R - sg * dy * l.L) / a2;"),
        ("const double radial = -sg * R / (a2 * l.L);", "const double radial = sg * R / (a2 * l.L);"),
        ("*slope = 2.0 * towards_tip * gear->relief * over;", "*slope = 1.0 * towards_tip * gear->relief * over;"),
        ("/ gk_max(p->roll[0], 1e-4) + sense /", "/ gk_max(p->roll[0], 1e-4) - sense /"),
    ),
    # ---- kernel: the step ----
    *of(
        "gk_balance.c",
        ENERGY,
        ("return 0.5 * (s->force0[i] + s->force[i] +", "return 0.5 * (s->force[i] + s->force[i] +"),
        ("b.defect += share(s, i) * change;", "b.defect += 0.99 * share(s, i) * change;"),
        ("fabs(s->stored0), 0.0};", "fabs(s->stored0), 1.0};"),
    ),
    *of(
        "gk_frame.c",
        "kernel/test_gyroscopic.py stage/test_planetary_theory.py stage/test_planetary_motion.py",
        ("((1.0 + c) * q - b * p)", "((1.0 + c) * q + b * p)"),
        ("const double kick = -f->d11[i] /", "const double kick = f->d11[i] /"),
        ("first[i] = a + s * (b - t * a);", "first[i] = a + s * (b + t * a);"),
        ("a[i] += twice * v[m->pairs + i];", "a[i] -= twice * v[m->pairs + i];"),
    ),
    *of(
        "gk_film.c",
        "stage/test_film.py",
        ("return 13.328648814475098 *", "return 12.9 *"),
        ("return film->closes[i] * (sunk + late / mean);", "return 0.0;"),
        ("film->factor[i] * (u * u * u - far * far * far);", "film->factor[i] * (u * u * u + far * far * far);"),
    ),
    *of(
        "gk_friction.c",
        "stage/test_friction.py stage/test_friction_of_stages.py",
        ("0.5 * ratio * (s->force0[j] + s->begin[j])", "0.4 * ratio * (s->force0[j] + s->begin[j])"),
        ("glide->limit[j] * glide->slid[j] > -glide->creep[j]", "glide->limit[j] * glide->slid[j] < -glide->creep[j]"),
    ),
    # ---- kernel: what is reported ----
    *of(
        "gk_tally.c",
        "stage/test_counted_outputs.py stage/test_bearing_forces.py stage/test_force_outputs.py",
        ("tally->mesh[e] += (side[0] - side[1]) * h;", "tally->mesh[e] += (side[0] + side[1]) * h;"),
        ("meshing->impacts += meshing->apart;", "meshing->impacts += 1;"),
        ("const double half = 0.5 * h;", "const double half = 0.51 * h;"),
        ("meshing->open_time += h;", "meshing->open_time += 0.5 * h;"),
    ),
    *of(
        "gk_supports.c",
        "stage/test_bearing_forces.py stage/test_planetary_statics.py stage/test_planetary_motion.py",
        ("[q] = x[q] - kappa[q] * f[q];", "[q] = x[q] + kappa[q] * f[q];"),
        ("of_spring[s] = out[s] - model->ground", "of_spring[s] = out[s] + model->ground"),
        ("force[s + 1] = sine * x + cosine * y;", "force[s + 1] = cosine * y - sine * x;"),
    ),
    *of(
        "gk_outputs.c",
        "stage/test_physics.py stage/test_observed.py stage/test_simulate.py stage/test_friction.py",
        ("v[V_FORCE_COAST] = side[1];", "v[V_FORCE_COAST] = side[0];"),
        ("pairs += touches;", "pairs |= touches;"),
    ),
    *of(
        "gk_comm.c",
        "kernel/test_time.py stage/test_counted_outputs.py cosim/test_masters.py",
        ("tau * (m.w + 0.5 * m.a * tau)", "tau * (m.w + m.a * tau)"),
        ("if (!gk_finite(time) || !gk_finite(H) || !(H > 0.0) || H > 1e6)", "if (!gk_finite(time) || !gk_finite(H))"),
    ),
    *of(
        "fmi2.c",
        "fmu/test_fmu_calls.py fmu/test_fmu_state.py",
        ("    f->step_status = fmi2Discard;\n", ""),
    ),
    # ---- geometry ----
    *of(
        "involute.py",
        "geometry/test_involute.py",
        ("17 / 315", "17 / 351"),
        ("np.square(roll) / (2 * r_b)", "np.square(roll) / r_b"),
    ),
    *of("iso6336.py", "geometry", ("0.24188 * b.x * v_2", "0.24188 * b.x * v_1")),
    *of("iso1328.py", "geometry", ("0.55 * math.sqrt(d) + 0.7 * m", "0.55 * math.sqrt(d) + 0.77 * m")),
    *of(
        "shifts.py",
        "geometry",
        ("2 * total * math.tan(alpha) / teeth", "total * math.tan(alpha) / teeth"),
    ),
    # ---- finite elements and reduction ----
    *of(
        "hex20.py",
        "fem/test_hex20.py",
        ("(x + y + z - 2)", "(x + y + z - 1)"),
        ("gradient[:, middle_axis, nodes] = -0.5 *", "gradient[:, middle_axis, nodes] = -0.25 *"),
    ),
    *of(
        "beam.py",
        "body/test_beam.py",
        ("return math.pi / 64 *", "return math.pi / 32 *"),
        ("(20 + 12 * poisson) * m)", "(12 + 12 * poisson) * m)"),
    ),
    *of(
        "frf.py",
        "test_frf.py reduction",
        ("_bore_held(exact - rigid / squared)", "_bore_held(exact + rigid / squared)"),
    ),
    # ---- running a stage, coupling, report ----
    *of(
        "efficiency.py",
        "stage/test_friction.py",
        ("shape = 1.0 - (recess + approach)", "shape = 1.0 + (recess + approach)"),
    ),
    *of("windup.py", "fmu/test_fmu_starts.py", ("exerted / port.k,", "-exerted / port.k,")),
    *of(
        "masters.py",
        "cosim/test_masters.py cosim/test_coupled_run.py",
        ("(last - first) / h if h", "(first - last) / h if h"),
    ),
    *of(
        "metrics.py",
        "report/test_metrics.py report/test_runup_report.py",
        ("amplitude / np.sinc(frequency * averaged)", "amplitude * np.sinc(frequency * averaged)"),
        ("np.cumsum(0.5 * (rate[1:] + rate[:-1])", "np.cumsum(rate[1:]"),
    ),
    *of("units.py", "spec/test_units.py", ('("µm", "m"): 1e-6', '("µm", "m"): 1e-3')),
    # ---- planted from outside: what relations, constants and planning must see ----
    *of(
        "gk_flank.c",
        "relations/test_mirror.py relations/test_place.py relations/test_balance.py",
        (
            "const double ex = sg * t->n[1], ey = -sg * t->n[0];",
            "const double ex = sg * sg * t->n[1], ey = -sg * sg * t->n[0];",
        ),
        ("slide[RXA] = -sense * up * ey,", "slide[RXA] = sense * up * ey,"),
        ("roll = sg * gear->r_b * angle;", "roll = sg * sg * gear->r_b * angle;"),
    ),
    *of("gk_flank.c", "stage/test_constants.py", ("    p->curvature *= mesh->cosine;\n", "")),
    *of("gk_lubrication.c", "stage/test_constants.py", ("gk_log(29660.0 * load", "gk_log(31143.0 * load")),
    *of(
        "gk_deviation.c",
        "relations/test_reciprocal.py relations/test_mirror.py relations/test_place.py",
        ("motion[SPACE * w + TURNING[i]] += turn[", "motion[SPACE * w + TURNING[i]] += (i < 2) * turn["),
    ),
    *of("gk_grid.c", "relations/test_continuity.py", ("w[3] = k[2] + 3.0 * k[3]", "w[3] = k[2] + 2.0 * k[3]")),
    *of("gk_adopt.c", "relations/test_split.py", ("[d] -= c->k->rigid_kappa *", "[d] -= 0.0 * c->k->rigid_kappa *")),
    *of(
        "meshes.py",
        "relations/test_any_order.py relations/test_place.py",
        ("- (first - gamma) * pair.gears[0].r_b / pair", "- (first - gamma) * 1.001 * pair.gears[0].r_b / pair"),
    ),
    *of(
        "tripwires.py",
        "planning/test_tripwires.py",
        ("for mesh in self.meshes)", "for mesh in self.meshes[:1])"),
        ("FALLBACK = 2\n", "FALLBACK = 256\n"),
        ("ENERGY = 0.05", "ENERGY = 0.5"),
        ("better = replace(better, h=0.5 * choice.h)", "pass"),
    ),
    *of(
        "run.py",
        "sweeps/test_resume.py",
        ("if known is None or known.name != OK or (", "if known is None or ("),
        ("fingerprint, program()]", "fingerprint]"),
    ),
    *of("journal.py", "sweeps/test_resume.py", ("[math.nan if v is None else v for v in values]", "list(values)")),
    *of(
        "gears.py",
        "rexs",
        ("if at is None or begin - 1e-9 <= at <= begin + length + 1e-9:", "if True:"),
        ('    draft.put(f"{place}.face_width", millimetres(gear.face_width), gear.origin)\n', ""),
    ),
)


def _left_out(folder: str, names: list[str]) -> set[str]:
    """Caches, and of the checkout itself what builds and runs leave there."""
    made = {"build", "out"} if Path(folder) == ROOT else set()
    return LEFT_OUT(folder, names) | made & set(names)


def place_of(root: Path, mutant: Mutant) -> tuple[Path, str]:
    """File and its text; SystemExit where `old` does not stand there once."""
    for path in sorted((root / "gearfmu").rglob(mutant.file)):
        text = path.read_text(encoding="utf-8")
        if text.count(mutant.old) == 1:
            return path, text
    raise SystemExit(f"{mutant.file}: {mutant.old!r} does not stand there once: adapt tests/mutants.py")


def tried(root: Path, mutant: Mutant, first: str) -> tuple[str, str]:
    """ "caught" with the test that failed, "missed", or "broken" where it does not compile or no test runs. first: the
    test that is run before the others, or ""."""
    path, text = place_of(root, mutant)
    setting = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
    path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        if path.suffix == ".c":
            built = subprocess.run([sys.executable, "-c", BUILD], cwd=root, env=setting, capture_output=True, text=True)
            if built.returncode:
                return "broken", built.stderr.strip().splitlines()[-1][:100]
        outcome, by = _tested(root, [first], setting) if first else ("", "")
        return (outcome, by) if outcome == "caught" else _tested(root, [f"tests/{t}" for t in mutant.tests], setting)
    finally:
        path.write_text(text, encoding="utf-8")


def _tested(root: Path, tests: list[str], setting: dict[str, str]) -> tuple[str, str]:
    """Outcome of `tried` under the named tests."""
    line = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(line, cwd=root, env=setting, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return "caught", "it never ends"
    failed = [text for text in done.stdout.splitlines() if text.startswith(("FAILED", "ERROR"))]
    if done.returncode > 1:
        return "broken", (done.stdout + done.stderr).strip().splitlines()[-1][:100]
    return ("caught", failed[0].split(" ")[1]) if failed else ("missed", "")


def known() -> dict[tuple[str, str, str], str]:
    """The test that caught a defect (file, line, what it becomes) last time."""
    if not TABLE.exists():
        return {}
    with open(TABLE, encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["by"].startswith("tests/")]
    return {(row["file"], row["line"], row["becomes"]): row["by"] for row in rows}


def worked(
    jobs: int, mutants: Sequence[Mutant], first: Mapping[tuple[str, str, str], str]
) -> list[tuple[Mutant, str, str]]:
    """All mutants, each worker in its own copy of the checkout; first: as `known`."""
    folders = [Path(tempfile.mkdtemp(prefix="mutants-")) / "copy" for _ in range(jobs)]
    for folder in folders:
        shutil.copytree(ROOT, folder, ignore=_left_out)
        subprocess.run(
            [sys.executable, "-c", BUILD], cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)}, check=True
        )
    free = list(folders)

    def one(mutant: Mutant) -> tuple[Mutant, str, str]:
        folder, started = free.pop(), time.monotonic()
        outcome, by = tried(folder, mutant, first.get((mutant.file, mutant.old.strip(), mutant.new.strip()), ""))
        free.append(folder)
        print(
            f"{outcome:6} {time.monotonic() - started:4.0f} s  {mutant.file}: {mutant.new.strip()!r}  {by}", flush=True
        )
        return mutant, outcome, by

    try:
        with ThreadPoolExecutor(jobs) as pool:
            return list(pool.map(one, mutants))
    finally:
        for folder in folders:
            shutil.rmtree(folder.parent)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="defects whose file or text matches this pattern; writes no table")
    parser.add_argument("--judges", default="", help="files or folders below tests/ in place of those named; no table")
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    mutants = [m for m in MUTANTS if re.search(chosen.only, f"{m.file} {m.old}")]
    if chosen.judges:
        mutants = [replace(m, tests=tuple(chosen.judges.split())) for m in mutants]
    for mutant in mutants:
        place_of(ROOT, mutant)
    found = worked(chosen.jobs, mutants, {} if chosen.judges else known())
    caught = sum(outcome == "caught" for _, outcome, _ in found)
    if not (chosen.only or chosen.judges):
        with open(TABLE, "w", encoding="utf-8", newline="") as out:
            rows = csv.writer(out, lineterminator="\n")
            rows.writerow(("file", "line", "becomes", "outcome", "by"))
            rows.writerows((m.file, m.old.strip(), m.new.strip(), outcome, by) for m, outcome, by in found)
    print(f"{caught} of {len(found)} caught")
    return int(caught < LEAST * len(found))


if __name__ == "__main__":
    sys.exit(main())
