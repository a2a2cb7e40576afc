"""Defects that were chosen by hand: file, text that stands once in it, what it becomes. Some were planted from outside,
by readers who did not know the tests."""

from __future__ import annotations

from collections.abc import Iterator

from draw import ROOT, Defect

CHOSEN: dict[str, tuple[tuple[str, str], ...]] = {
    "gk_law.c": (
        ("law->beta = 2.0 * law->a /", "law->beta = 2.2 * law->a /"),
        ("GK_CHOOSE(low, law->c_low + 2.0 * q * f,", "GK_CHOOSE(low, law->c_low + 1.0 * q * f,"),
        ("(0.5 * secant - 0.125 * law->a) + law->phi_log", "(0.5 * secant - 0.125 * law->a)"),
    ),
    "gk_section.c": (
        ("l.cosine = (dx * R + sg * dy * l.L) / a2;", "l.cosine = (dx * R - sg * dy * l.L) / a2;"),
        ("const double radial = -sg * R / (a2 * l.L);", "const double radial = sg * R / (a2 * l.L);"),
        ("*slope = 2.0 * towards_tip * gear->relief * over;", "*slope = 1.0 * towards_tip * gear->relief * over;"),
        ("/ gk_max(p->roll[0], 1e-4) + sense /", "/ gk_max(p->roll[0], 1e-4) - sense /"),
    ),
    "gk_balance.c": (
        ("return 0.5 * (s->force0[i] + s->force[i] +", "return 0.5 * (s->force[i] + s->force[i] +"),
        ("b.defect += share(s, i) * change;", "b.defect += 0.99 * share(s, i) * change;"),
        ("fabs(s->stored0), 0.0};", "fabs(s->stored0), 1.0};"),
    ),
    "gk_frame.c": (
        ("((1.0 + c) * q - b * p)", "((1.0 + c) * q + b * p)"),
        ("const double kick = -f->d11[i] /", "const double kick = f->d11[i] /"),
        (
            "GK_QUAD_OF(*v, j) = x + GK_QUAD_OF(s, j) * (y - GK_QUAD_OF(t, j) * x);",
            "GK_QUAD_OF(*v, j) = x + GK_QUAD_OF(s, j) * (y + GK_QUAD_OF(t, j) * x);",
        ),
        ("a[i] += twice * v[m->pairs + i];", "a[i] -= twice * v[m->pairs + i];"),
    ),
    "gk_film.c": (
        ("= 13.328648814475098 *", "= 12.9 *"),
        ("return film->closes[i] * (sunk + late / mean);", "return 0.0;"),
        ("film->factor[i] * (u * u * u - far * far * far);", "film->factor[i] * (u * u * u + far * far * far);"),
    ),
    "gk_friction.c": (
        ("0.5 * ratio * s->force0[j]", "0.4 * ratio * s->force0[j]"),
        ("glide->limit[j] * slid_in_step(glide, j) > -", "glide->limit[j] * slid_in_step(glide, j) < -"),
    ),
    "gk_tally.c": (
        ("tally->mesh[e] += (side[0] - side[1]) * h;", "tally->mesh[e] += (side[0] + side[1]) * h;"),
        ("meshing->impacts += meshing->apart;", "meshing->impacts += 1;"),
        ("const double half = 0.5 * h;", "const double half = 0.51 * h;"),
        ("meshing->open_time += h;", "meshing->open_time += 0.5 * h;"),
    ),
    "gk_supports.c": (
        ("[q] = x[q] - kappa[q] * f[q];", "[q] = x[q] + kappa[q] * f[q];"),
        ("of_spring[s] = out[s] - model->ground", "of_spring[s] = out[s] + model->ground"),
        ("force[s + 1] = sine * x + cosine * y;", "force[s + 1] = cosine * y - sine * x;"),
    ),
    "gk_outputs.c": (
        ("v[V_FORCE_COAST] = side[1];", "v[V_FORCE_COAST] = side[0];"),
        ("pairs += touches;", "pairs |= touches;"),
    ),
    "gk_comm.c": (
        ("tau * (m.w + 0.5 * m.a * tau)", "tau * (m.w + m.a * tau)"),
        ("if (!gk_finite(time) || !gk_finite(H) || !(H > 0.0) || H > 1e6)", "if (!gk_finite(time) || !gk_finite(H))"),
    ),
    "fmi2.c": (("f->step_status = fmi2Discard;", ""),),
    "involute.py": (
        ("17 / 315", "17 / 351"),
        ("np.square(roll) / (2 * r_b)", "np.square(roll) / r_b"),
    ),
    "iso6336.py": (("0.24188 * b.x * v_2", "0.24188 * b.x * v_1"),),
    "iso1328.py": (("0.55 * math.sqrt(d) + 0.7 * m", "0.55 * math.sqrt(d) + 0.77 * m"),),
    "shifts.py": (("2 * total * math.tan(alpha) / teeth", "total * math.tan(alpha) / teeth"),),
    "hex20.py": (
        ("(x + y + z - 2)", "(x + y + z - 1)"),
        ("gradient[:, middle_axis, nodes] = -0.5 *", "gradient[:, middle_axis, nodes] = -0.25 *"),
    ),
    "beam.py": (
        ("return math.pi / 64 *", "return math.pi / 32 *"),
        ("(20 + 12 * poisson) * m)", "(12 + 12 * poisson) * m)"),
    ),
    "frf.py": (("_bore_held(exact - rigid / squared)", "_bore_held(exact + rigid / squared)"),),
    "efficiency.py": (("shape = 1.0 - (recess + approach)", "shape = 1.0 + (recess + approach)"),),
    "windup.py": (("exerted / port.k,", "-exerted / port.k,"),),
    "masters.py": (("(last - first) / h if h", "(first - last) / h if h"),),
    "metrics.py": (
        ("amplitude / np.sinc(frequency * averaged)", "amplitude * np.sinc(frequency * averaged)"),
        ("np.cumsum(0.5 * (rate[1:] + rate[:-1])", "np.cumsum(rate[1:]"),
    ),
    "units.py": (('("µm", "m"): 1e-6', '("µm", "m"): 1e-3'),),
    "gk_flank.c": (
        (
            "slide[RXA] = -sense * up * ey, slide[RYA] = sense * up",
            "slide[RXA] = sense * up * ey, slide[RYA] = -sense * up",
        ),
        (
            "const double ex = sg * t->n[1], ey = -sg * t->n[0];",
            "const double ex = sg * sg * t->n[1], ey = -sg * sg * t->n[0];",
        ),
        ("slide[RXA] = -sense * up * ey,", "slide[RXA] = sense * up * ey,"),
        ("roll = sg * gear->r_b * angle;", "roll = sg * sg * gear->r_b * angle;"),
        ("p->curvature *= mesh->cosine;", ""),
    ),
    "gk_ground.c": (("A[i * s->stride + j] -= gk_dot_quads(yields,", "A[i * s->stride + j] += gk_dot_quads(yields,"),),
    "gk_setup.c": (("[V_BACKLASH] - engagement->nominal", "[V_BACKLASH] + engagement->nominal"),),
    "gk_lubrication.c": (("gk_log(29660.0 * load", "gk_log(31143.0 * load"),),
    "gk_deviation.c": (
        ("motion[SPACE * w + TURNING[i]] += turn[", "motion[SPACE * w + TURNING[i]] += (i < 2) * turn["),
    ),
    "gk_grid.c": (("w[3] = k[2] + 3.0 * k[3]", "w[3] = k[2] + 2.0 * k[3]"),),
    "gk_adopt.c": (("[d] -= c->k->rigid_kappa *", "[d] -= 0.0 * c->k->rigid_kappa *"),),
    "meshes.py": (
        ("- (first - gamma) * pair.gears[0].r_b / pair", "- (first - gamma) * 1.001 * pair.gears[0].r_b / pair"),
    ),
    "tripwires.py": (
        ("for mesh in self.meshes)", "for mesh in self.meshes[:1])"),
        ("FALLBACK = 2", "FALLBACK = 256"),
        ("ENERGY = 0.05", "ENERGY = 0.5"),
        ("better = replace(better, h=0.5 * choice.h)", "pass"),
    ),
    "run.py": (
        ("if known is None or known.name != OK or (", "if known is None or ("),
        ("fingerprint, program()]", "fingerprint]"),
    ),
    "journal.py": (("[math.nan if v is None else v for v in values]", "list(values)"),),
    "gears.py": (
        ("if at is None or begin - 1e-9 <= at <= begin + length + 1e-9:", "if True:"),
        ('draft.put(f"{place}.face_width", millimetres(gear.face_width), gear.origin)', ""),
    ),
}


def chosen() -> Iterator[Defect]:
    """The whole lines of these texts; SystemExit where one does not stand once in one file."""
    for name, edits in CHOSEN.items():
        files = sorted((ROOT / "gearfmu").rglob(name))
        for old, new in edits:
            found = [
                (path, number, line.strip())
                for path in files
                for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
                if old in line
            ]
            if len(found) != 1:
                raise SystemExit(f"{name}: {old!r} does not stand there once: adapt tests/mutants/chosen.py")
            path, number, line = found[0]
            yield Defect(path.relative_to(ROOT).as_posix(), number, "chosen", line, line.replace(old, new).strip())
