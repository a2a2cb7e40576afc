/* Coefficients of all oscillators and spins for one internal step h and γ (gk_oscillator.c), in the type of their
 * states, and the mesh mode at which they are exact. */
#include "setup/gk_setup.h"
#include "setup/gk_oscillator.h"

static const double MESH_STIFFNESS = 0.1125; /* over 2(1 − ν²)/(πE) of both gears: 20 N/(mm µm) for steel */
static const double MATCHED_HIGHEST = 2.0 * GK_PI * 12e3; /* rad/s */
static const double MATCHED_MOST = 2.2;                   /* of 1/h */

/* The flow in gk_real: a11 − 1, a12, a21, a22 − 1, which keeps frequencies to 1e-7 at any h. Rounded one by one to
 * single precision the four numbers let a mode grow or fade by up to 1e-7 of its energy every step, always the same
 * way. Where damping does not cover that, the nearest values and their next neighbours, each with the a21 that belongs
 * to it, are searched for the best determinant: some 1e-9 off the exact one, e^(−2ζωh). */
static void round_flow(const gk_oscillator *o, gk_real out[4])
{
    const double wanted = o->a11 * o->a22 - o->a12 * o->a21, ulp = 1e-7, d11 = o->a11 - 1.0, d22 = o->a22 - 1.0,
                 covered = 1e-5;
    double least = INFINITY;
    out[0] = (gk_real)d11, out[1] = (gk_real)o->a12, out[2] = (gk_real)o->a21, out[3] = (gk_real)d22;
    if (sizeof(gk_real) > sizeof(float) || 1.0 - wanted > covered) return;
    for (int choice = 0; choice < 27; choice++) {
        const gk_real a[3] = {(gk_real)(d11 * (1.0 + ulp * (choice % 3 - 1))),
                              (gk_real)(o->a12 * (1.0 + ulp * (choice / 9 - 1))),
                              (gk_real)(d22 * (1.0 + ulp * (choice / 3 % 3 - 1)))};
        const double product = (1.0 + (double)a[0]) * (1.0 + (double)a[2]) - wanted; /* what a12·a21 should be */
        const gk_real a21 = (gk_real)(product / a[1]);
        const double error = fabs(product - (double)a[1] * a21);
        if (error < least) least = error, out[0] = a[0], out[1] = a[1], out[2] = a21, out[3] = a[2];
    }
}

static void store(gk_flow *f, int i, const gk_oscillator *o)
{
    gk_real a[4] = {0, 0, 0, 0};
    if (o->a12 != 0.0) round_flow(o, a);
    f->d11[i] = a[0], f->a12[i] = a[1], f->a21[i] = a[2], f->d22[i] = a[3];
    f->b0q[i] = (gk_real)o->b0q, f->b0v[i] = (gk_real)o->b0v, f->bq[i] = (gk_real)o->bq, f->bv[i] = (gk_real)o->bv;
    f->mobility[i] = (gk_real)o->mobility;
    f->kappa[i] = (gk_real)o->kappa, f->inverse_s2[i] = (gk_real)o->inverse_s2;
    f->unit[i] = (gk_real)o->unit, f->lead[i] = (gk_real)o->lead, f->hold[i] = (gk_real)o->hold;
}

/* Σ centre² over the dynamic ground oscillators: 1/mass that a gear's own motion in row c meets */
static double mobility_of_centre(const gk_base *base, int g, int c)
{
    const double *row = base->centre[g] + c * base->n + base->from[g];
    return gk_dot_quads(row, row, base->width[g] / 4);
}

/* rad/s: the highest mesh mode of the engagements, gears as rigid bodies on the mesh stiffness of ISO 6336-1 */
static double mesh_mode(const gk_model *model, const gk_setup *setup)
{
    double highest = 0.0;
    for (int e = 0; e < model->engagements; e++) {
        const gk_engagement *engagement = &model->engagement[e];
        double mobility = 0.0, soft = 0.0;
        if (engagement->kind == MESH_FLAT) continue;
        for (int w = 0; w < 2; w++) {
            const int g = engagement->gear[w];
            const gk_gear *gear = &model->gear[g];
            const double turns = setup->inverse_inertia[gear->rotor] + mobility_of_centre(&setup->base, g, 5);
            mobility += gear->r_b * gear->r_b * turns;
            mobility += 0.5 * (mobility_of_centre(&setup->base, g, 0) + mobility_of_centre(&setup->base, g, 1));
            soft += gear->local;
        }
        highest = gk_max(highest, sqrt(MESH_STIFFNESS / soft * engagement->width * mobility));
    }
    return highest;
}

static gk_oscillator oscillator_of(const gk_setup *setup, const gk_pace *pace, double omega, double zeta)
{
    const gk_oscillator nothing = {.unit = 1.0};
    return omega > 0.0 ? gk_oscillator_of(pace, omega, GK_ON(setup, modal_damping) ? zeta : 0.0) : nothing;
}

static void fill_gear(const gk_setup *setup, const gk_pace *pace, gk_coefficients *k, int g)
{
    const gk_modal *modal = &setup->modal[g];
    int yields = 0;
    for (int i = 0; i < modal->n; i++) {
        const gk_oscillator o = oscillator_of(setup, pace, modal->omega[i], modal->zeta[i]);
        if (o.kappa != 0.0 && i % modal->pairs + 1 > yields) yields = i % modal->pairs + 1;
        store(&k->flow[g], i, &o);
    }
    k->flow[g].softest = yields;
    k->flow[g].yields = (yields + LANES - 1) / LANES * LANES;
}

/* what half a step leaves of the speed along every dashpot of the supports, an exact contraction of the invariant's
 * speeds to those at rest (docs/theory.md, 3.4): v ← v − (s²e/n)(1 − e^(−dh/2)) e·(v − M f), n = Σ s²e², d = c n */
static void fill_dampers(const gk_model *model, const gk_setup *setup, gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    gk_ground_flow *f = &k->ground;
    for (int d = 0; d < model->supports; d++) {
        const double *e = base->damper_rows + d * base->n;
        double mass = 0.0;
        for (int i = 0; i < base->n; i++)
            if (base->omega[i] > 0.0) mass += e[i] * e[i] / f->inverse_s2[i];
        f->decay[d] = 1.0 - gk_exp(-0.5 * model->ground[base->set].damper[d] * mass * k->h);
        f->gain[d] = mass > 0.0 ? f->decay[d] / mass : 0.0;
        f->loss[d] = 0.5 * f->gain[d] * (2.0 - f->decay[d]);
        for (int i = 0; i < base->n; i++) {
            f->pulls[d * base->n + i] = base->omega[i] > 0.0 && mass > 0.0 ? e[i] / (f->inverse_s2[i] * mass) : 0.0;
            f->holds[d * base->n + i] = e[i] * f->hold[i];
        }
    }
}

/* rows that turn into each other, on the invariant's speeds y = v/s (gk_frame.c) */
static void fill_turns(const gk_setup *setup, gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    gk_ground_flow *f = &k->ground;
    for (int r = 0; r < 2 * base->turns; r++)
        for (int i = 0; i < base->n; i++) {
            const double row = base->turn_rows[r * base->n + i], s = sqrt(f->inverse_s2[i]);
            f->turns[r * base->n + i] = row * s;
            f->turned[r * base->n + i] = row / s;
        }
    for (int i = 0; i < base->turns; i++) {
        const double *x = f->turns + 2 * i * base->n, *to_x = f->turned + 2 * i * base->n, *to_y = to_x + base->n;
        f->products[3 * i] = gk_dot_quads(x, to_x, base->n / 4);
        f->products[3 * i + 1] = gk_dot_quads(x + base->n, to_y, base->n / 4);
        f->products[3 * i + 2] = gk_dot_quads(x, to_y, base->n / 4);
    }
}

/* pairs of the crowd, members x of all before members y */
static void fill_crowd_turns(const gk_base *base, gk_ground_flow *f)
{
    const int n = base->n, from = base->crowd.from, width = base->crowd.width, wide = gk_whole_halves(width);
    const int lanes = gk_whole_halves(base->crowd_pairs), rows = 2 * lanes;
    const double *row[2 * MOST_CROWD], *moved[2 * MOST_CROWD];
    int at = 0;
    memset(row, 0, sizeof row);
    for (int i = 0; i < base->turns; i++) {
        if (!gk_in_crowd(base, base->turn_span[i])) continue;
        for (int member = 0; member < 2; member++) {
            row[member * lanes + at] = f->turns + (2 * i + member) * n + from;
            moved[member * lanes + at] = f->turned + (2 * i + member) * n + from;
        }
        at++;
    }
    for (int r = 0; r < rows; r++) {
        for (int i = 0; i < width; i++) f->crowd.turns[i * rows + r] = row[r] ? (gk_real)row[r][i] : 0;
        for (int i = 0; i < wide; i++) f->crowd.turned[r * wide + i] = row[r] && i < width ? (gk_real)moved[r][i] : 0;
        for (int other = 0; other < rows; other++)
            f->crowd.turning[r * rows + other] = row[r] && row[other]
                                                     ? (gk_real)gk_dot_quads(moved[r], row[other], width / 4)
                                                     : 0;
    }
}

/* dashpots of the crowd */
static void fill_crowd_dampers(const gk_model *model, const gk_base *base, gk_ground_flow *f)
{
    const int n = base->n, from = base->crowd.from, width = base->crowd.width, wide = gk_whole_halves(width);
    const int lanes = gk_whole_halves(base->crowd_dampers);
    const gk_crowd_flow *c = &f->crowd;
    memset(c->damps, 0, (size_t)(width * lanes) * sizeof(gk_real));
    memset(c->holds, 0, (size_t)(width * lanes) * sizeof(gk_real));
    memset(c->pulls, 0, (size_t)(lanes * wide) * sizeof(gk_real));
    memset(c->pulled, 0, (size_t)(lanes * lanes) * sizeof(gk_real));
    for (int d = 0, r = 0; d < model->supports; d++) {
        if (!gk_in_crowd(base, base->damper_span[d])) continue;
        const double *pulls = f->pulls + d * n + from;
        for (int i = 0; i < width; i++) {
            c->damps[i * lanes + r] = (gk_real)base->damper_rows[d * n + from + i];
            c->holds[i * lanes + r] = (gk_real)f->holds[d * n + from + i];
            c->pulls[r * wide + i] = (gk_real)pulls[i];
        }
        for (int other = 0, k = 0; other < model->supports; other++)
            if (gk_in_crowd(base, base->damper_span[other]))
                c->pulled[r * lanes + k++] = (gk_real)gk_dot_quads(pulls, base->damper_rows + other * n + from,
                                                                   width / 4);
        r++;
    }
}

static void fill_ground(const gk_model *model, const gk_setup *setup, const gk_pace *pace, gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    gk_ground_flow *f = &k->ground;
    for (int i = 0; i < base->n; i++) {
        const gk_oscillator o = oscillator_of(setup, pace, base->omega[i], base->zeta[i]);
        const int there = base->omega[i] > 0.0;
        f->d11[i] = there ? o.a11 - 1.0 : 0.0, f->a12[i] = o.a12, f->a21[i] = o.a21,
        f->d22[i] = there ? o.a22 - 1.0 : 0.0;
        f->b0q[i] = o.b0q, f->b0v[i] = o.b0v, f->bq[i] = o.bq, f->bv[i] = o.bv;
        f->mobility[i] = o.mobility;
        f->kappa[i] = o.kappa, f->inverse_s2[i] = there ? o.inverse_s2 : 1.0;
        f->unit[i] = o.unit, f->lead[i] = o.lead, f->hold[i] = o.hold;
        f->press[i] = there && o.a12 != 0.0 ? -f->d11[i] / (o.a12 * base->omega2[i]) : 0.0;
    }
    fill_dampers(model, setup, k);
    fill_turns(setup, k);
    if (!base->crowd.width) return;
    fill_crowd_turns(base, f);
    fill_crowd_dampers(model, base, f);
}

/* A pure function of (model, level, bits of h, γ), kept in a small cache: no state */
const gk_coefficients *gk_flow_for(const gk_model *model, const gk_setup *setup, gk_room *room, double h, double gamma)
{
    GK_ASSERT(h > 0.0); /* γ may be that of a restored state */
    gk_coefficients *oldest = &room->cache[0];
    for (int i = 0; i < CACHE; i++) {
        gk_coefficients *k = &room->cache[i];
        if (k->age && k->h == h && k->gamma == gamma) {
            k->age = ++room->clock;
            return k;
        }
        if (k->age < oldest->age) oldest = k;
    }
    oldest->h = h;
    oldest->gamma = gamma;
    oldest->timeless = 0;
    const gk_pace pace = {h, gamma, gk_min(gk_min(mesh_mode(model, setup), MATCHED_HIGHEST), MATCHED_MOST / h)};
    oldest->rigid_mobility = 0.25 * h * h;
    oldest->rigid_kappa = gk_oscillator_free_kappa(&pace);
    oldest->rigid_lead = oldest->rigid_kappa - h * h / 12.0; /* as of an oscillator with ω → 0 */
    for (int g = 0; g < model->gears; g++) fill_gear(setup, &pace, oldest, g);
    fill_ground(model, setup, &pace, oldest);
    oldest->age = ++room->clock;
    return oldest;
}

/* coefficients in use, without making any: those of the explicit forms for h = 0 */
const gk_coefficients *gk_flow_known(const gk_room *room, double h, double gamma)
{
    GK_ASSERT(room);
    for (int i = 0; i < CACHE; i++)
        if (room->cache[i].age && room->cache[i].h == h && room->cache[i].gamma == gamma) return &room->cache[i];
    return &room->explicit_rows;
}
