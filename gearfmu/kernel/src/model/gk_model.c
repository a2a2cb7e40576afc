/* Blob → gk_model: every section present, of the right size and plausible, or one message that says which is not.
 * Nothing is trusted before it is checked. */
#include <stdio.h>
#include "model/gk_core.h"

#define GK_MODEL_VERSION 1
enum { PAIR_NUMBERS = 9, GEAR_NUMBERS = 18, PORT_NUMBERS = 8, NAME_MAX_LENGTH = 64 };

static gk_outcome refuse(char message[GK_MESSAGE], const char *what, const char *why)
{
    snprintf(message, GK_MESSAGE, "model blob: %s %s; make the model again with this version of gearfmu", what, why);
    return GK_BAD_BLOB;
}

static const double *numbers(const gk_blob *blob, const char *name, uint64_t wanted)
{
    uint64_t count;
    const double *v = gk_blob_f64(blob, name, &count);
    return v && count == wanted ? v : NULL;
}

static const double *gear_numbers(const gk_blob *blob, const char *stem, int g, uint64_t wanted)
{
    char name[24];
    snprintf(name, sizeof name, "%s%d", stem, g);
    return numbers(blob, name, wanted);
}

static const int32_t *gear_integers(const gk_blob *blob, const char *stem, int g, uint64_t wanted)
{
    char name[24];
    uint64_t count;
    snprintf(name, sizeof name, "%s%d", stem, g);
    const int32_t *v = gk_blob_i32(blob, name, &count);
    return v && count == wanted ? v : NULL;
}

static int between(double x, double low, double high) { return x >= low && x <= high; }

/* rows of mass-normalised modes are of order 1/√m, compliances of tooth and bore far below 1 */
static int bounded(const double *v, uint64_t count, double limit)
{
    for (uint64_t i = 0; i < count; i++)
        if (!between(v[i], -limit, limit)) return 0;
    return 1;
}

static int plausible_gear(const gk_gear *g)
{
    return between(g->teeth, 1, 1000) && g->teeth == gk_floor(g->teeth) && between(g->r_b, 1e-4, 10) &&
           between(g->s_form, 0, 10) && g->s_tip > g->s_form + 1e-6 && between(g->s_tip, 0, 20) &&
           between(g->psi_b, 0, 4) && between(g->phase, -10, 10) && between(g->mass, 1e-9, 1e7) &&
           between(g->inertia, 1e-12, 1e7) && between(g->width, 1e-6, 10) && between(g->local, 1e-20, 1) &&
           between(g->strip, 1e-6, 0.1) && between(g->relief, 0, 1e4) && between(g->relief_start, -1, 20) &&
           between(g->edge, 1e-6, 0.1) && between(g->corner_radius, 1e-4, 20) && between(g->corner_angle, -10, 10) &&
           between(g->bearing_k, 1, 1e15) && between(g->bearing_c, 0, 1e12);
}

static gk_outcome open_gear(gk_model *model, int i, char message[GK_MESSAGE])
{
    gk_gear *g = &model->gear[i];
    const double *v = gear_numbers(&model->blob, "gear", i, GEAR_NUMBERS);
    const int32_t *size = gear_integers(&model->blob, "size", i, 3);
    if (!v || !size) return refuse(message, "gear data", "are missing or of the wrong length");
    g->teeth = v[0], g->r_b = v[1], g->s_form = v[2], g->s_tip = v[3], g->psi_b = v[4], g->phase = v[5], g->mass = v[6],
    g->inertia = v[7], g->width = v[8];
    g->local = v[9], g->strip = v[10], g->relief = v[11], g->relief_start = v[12], g->edge = v[13],
    g->corner_radius = v[14], g->corner_angle = v[15];
    g->bearing_k = v[16], g->bearing_c = v[17];
    if (!plausible_gear(g)) return refuse(message, "gear data", "are out of range");
    g->z = (int)g->teeth, g->modes = size[0], g->rolls = size[1], g->functions = size[2];
    if (g->modes < 0 || g->modes > MAX_MODES || g->rolls < 4 || g->rolls > 1000 || g->functions < 1 ||
        g->functions > MAX_FUNCTIONS)
        return refuse(message, "table sizes", "are out of range");
    uint64_t n = (uint64_t)g->modes, R = (uint64_t)g->rolls, A = (uint64_t)g->functions;
    g->omega = gear_numbers(&model->blob, "omega", i, n);
    g->zeta = gear_numbers(&model->blob, "zeta", i, n);
    g->rows = gear_numbers(&model->blob, "rows", i, 2 * R * A * n);
    g->bore = gear_numbers(&model->blob, "bore", i, BORE_ROWS * n);
    g->c_ff = gear_numbers(&model->blob, "c_ff", i, 4 * OFFSETS * R * R * A * A);
    g->c_fb = gear_numbers(&model->blob, "c_fb", i, 2 * R * A * 3);
    g->c_bb = gear_numbers(&model->blob, "c_bb", i, 9);
    g->diameter = gear_integers(&model->blob, "diameter", i, n);
    g->part = gear_integers(&model->blob, "part", i, n);
    if (!g->omega || !g->zeta || !g->rows || !g->bore || !g->c_ff || !g->c_fb || !g->c_bb || !g->diameter || !g->part)
        return refuse(message, "mode or compliance tables", "are missing or of the wrong length");
    if (!bounded(g->rows, 2 * R * A * n, 1e6) || !bounded(g->bore, BORE_ROWS * n, 1e6) ||
        !bounded(g->c_ff, 4 * OFFSETS * R * R * A * A, 1e3) || !bounded(g->c_fb, 2 * R * A * 3, 1e3) ||
        !bounded(g->c_bb, 9, 1e3))
        return refuse(message, "mode or compliance tables", "are out of range");
    for (uint64_t k = 0; k < n; k++) {
        if (!between(g->omega[k], 1e-3, 1e12) || !between(g->zeta[k], 0, 0.9))
            return refuse(message, "frequencies or damping ratios", "are out of range");
        if (k && g->omega[k] < g->omega[k - 1] * (1 - 1e-6)) return refuse(message, "frequencies", "are not sorted");
        if (g->diameter[k] < 0 || g->diameter[k] > g->z || g->part[k] < 0 || g->part[k] > 2)
            return refuse(message, "nodal diameters or parts", "are out of range");
        if ((g->part[k] == 1 && (k + 1 == n || g->part[k + 1] != 2)) ||
            (g->part[k] == 2 && (k == 0 || g->part[k - 1] != 1)))
            return refuse(message, "mode pairs", "are torn");
    }
    return GK_OK;
}

/* optional section: index deviation of every tooth, rad, flank by flank */
static gk_outcome open_index(gk_model *model, int i, char message[GK_MESSAGE])
{
    static const char *const names[2] = {"index0", "index1"};
    gk_gear *g = &model->gear[i];
    uint64_t count;
    g->index = gk_blob_f64(&model->blob, names[i], &count);
    g->index_most = 0.0;
    if (!g->index) return GK_OK;
    if (count != 2 * (uint64_t)g->z || !bounded(g->index, count, 0.1 / g->teeth))
        return refuse(message, "index deviations", "are not two small angles a tooth");
    for (uint64_t k = 0; k < count; k++) g->index_most = gk_max(g->index_most, g->r_b * fabs(g->index[k]));
    return GK_OK;
}

static gk_outcome open_port(gk_model *model, int i, char message[GK_MESSAGE])
{
    gk_port *p = &model->port[i];
    const double *v = gear_numbers(&model->blob, "port", i, PORT_NUMBERS);
    if (!v) return refuse(message, "port data", "are missing or of the wrong length");
    if (!(v[0] == PORT_SPRING || v[0] == PORT_TORQUE || v[0] == PORT_FIXED) || !(v[1] == 0 || v[1] == 1))
        return refuse(message, "port kind", "is unknown");
    p->kind = (gk_port_kind)(int)v[0], p->chain = (int)v[1];
    p->k = v[2], p->c = v[3], p->inertia = v[4], p->disc = v[5], p->shaft_k = v[6], p->shaft_c = v[7];
    if (p->kind != PORT_TORQUE && !(between(p->k, 1e-6, 1e15) && between(p->c, 0, 1e12)))
        return refuse(message, "port stiffness or damping", "is out of range");
    if (p->chain && (p->kind != PORT_SPRING || !between(p->inertia, 1e-12, 1e7) || !between(p->disc, 1e-12, 1e7) ||
                     !between(p->shaft_k, 1e-6, 1e15) || !between(p->shaft_c, 0, 1e12)))
        return refuse(message, "port chain", "is out of range");
    return GK_OK;
}

static gk_outcome open_names(gk_model *model, char message[GK_MESSAGE])
{
    uint64_t count;
    const char *shafts = gk_blob_text(&model->blob, "shafts", &count), *bar;
    model->name = gk_blob_text(&model->blob, "name", &count);
    if (!model->name || !count || strlen(model->name) > NAME_MAX_LENGTH || !shafts)
        return refuse(message, "name or shafts", "are missing or too long");
    bar = strchr(shafts, '|');
    if (!bar || bar == shafts || (size_t)(bar - shafts) >= sizeof model->shaft[0] || !bar[1] ||
        strlen(bar + 1) >= sizeof model->shaft[1])
        return refuse(message, "shaft names", "are not two short names");
    memset(model->shaft, 0, sizeof model->shaft);
    memcpy(model->shaft[0], shafts, (size_t)(bar - shafts));
    memcpy(model->shaft[1], bar + 1, strlen(bar + 1));
    return GK_OK;
}

gk_outcome gk_model_open(gk_model *model, const void *blob, size_t size, char message[GK_MESSAGE])
{
    memset(model, 0, sizeof *model);
    message[0] = 0;
    gk_outcome outcome = gk_blob_open(&model->blob, blob, size, message);
    if (outcome) return outcome;
    uint64_t count;
    const int32_t *format = gk_blob_i32(&model->blob, "model", &count);
    if (!format || count != 4) return refuse(message, "section 'model'", "is missing");
    if (format[0] != GK_MODEL_VERSION) return refuse(message, "model version", "is not the one this kernel reads");
    if (format[1] != KIND_PAIR && format[1] != KIND_FLAT) return refuse(message, "kind of engagement", "is unknown");
    model->kind = (gk_kind)format[1];
    model->slices = format[2];
    model->coast_shift = format[3];
    const double *v = numbers(&model->blob, "pair", PAIR_NUMBERS);
    if (!v) return refuse(message, "section 'pair'", "is missing");
    model->distance = v[0], model->backlash = v[1], model->damping = v[2], model->torque_max = v[3],
    model->speed_max = v[4];
    model->cut[0] = v[5], model->cut[1] = v[6], model->h_max = v[7], model->nominal_backlash = v[8];
    if (!between(model->distance, -1, 100) || !between(model->backlash, -1e-3, 1e-2) ||
        !between(model->nominal_backlash, -1e-2, 1e-2) || !between(model->damping, 0, 1e9) ||
        !between(model->torque_max, 1e-9, 1e9) || !between(model->speed_max, 1e-6, 1e6) ||
        !between(model->cut[0], 0, 1e9) || !between(model->cut[1], 0, 1e9) || !between(model->h_max, 1e-9, 1e-3) ||
        model->slices < 1 || model->slices > MAX_SLICES || model->coast_shift < -2 || model->coast_shift > 2)
        return refuse(message, "stage data", "are out of range");
    if ((outcome = open_names(model, message))) return outcome;
    for (int i = 0; i < 2; i++)
        if ((outcome = open_gear(model, i, message)) || (outcome = open_index(model, i, message)) ||
            (outcome = open_port(model, i, message)))
            return outcome;
    if (model->gear[0].functions != model->gear[1].functions)
        return refuse(message, "width functions", "differ between the gears");
    if (model->kind == KIND_PAIR && !(model->distance > (model->gear[0].r_b + model->gear[1].r_b) * 1.0001))
        return refuse(message, "centre distance", "is smaller than the base radii allow");
    model->overlap_max = model->kind == KIND_FLAT ? 1.0 : 0.25 * (model->gear[0].s_tip - model->gear[0].s_form);
    const int32_t *degree = gk_blob_i32(&model->blob, "degrees", &count);
    if (!degree || count != (uint64_t)model->gear[0].functions)
        return refuse(message, "degrees of the width functions", "are missing");
    for (uint64_t k = 0; k < count; k++) {
        if (degree[k] < 0 || degree[k] > 20)
            return refuse(message, "degrees of the width functions", "are out of range");
        model->degree[k] = degree[k];
    }
    return GK_OK;
}

size_t gk_model_size(void) { return sizeof(gk_model); }
const char *gk_model_name(const gk_model *model) { return model->name; }
const char *gk_model_hash(const gk_model *model) { return model->blob.hash; }
int gk_abi(void) { return GK_ABI; }

const char *gk_outcome_text(gk_outcome outcome)
{
    static const char *const text[GK_OUTCOMES] = {
        "ok",
        "bad model blob",
        "no such variable in this model",
        "value refused: not finite or out of range",
        "call not allowed now",
        "communication step refused: not positive, not finite or not at the current time",
        "internal step too large for this model",
        "no static equilibrium found for the start",
        "diverged: state not finite even with the smallest step and the fallback scheme",
        "teeth overlap beyond what the model can mean",
        "energy balance broken"};
    return (int)outcome >= 0 && outcome < GK_OUTCOMES ? text[outcome] : "unknown outcome";
}
