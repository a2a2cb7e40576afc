/* What a load on a tooth of a gear displaces at once at its other engagements (docs/theory.md, 3.14). Far from the load
 * only its resultants count: both are FAR patterns U on a tooth, and U S(m) Uᵀ is what everything in the gear that is
 * not dynamic at this level yields m teeth after the load, S(m) = Σ a₀ aₘᵀ/ω². Between teeth of one engagement the
 * tables of the side hold it exactly. */
#include "setup/gk_setup.h"

/* does the model know the patterns of a gear, and do engagements share it? */
int gk_far_known(const gk_model *model, const gk_setup *setup, int g)
{
    return model->gear[g].far_rows && setup->engagements_of[g] > 1;
}

/* a column of coefficients */
typedef struct column {
    double at[FAR];
} column;

static column column_of(const float *from, int columns)
{
    column c;
    for (int i = 0; i < FAR; i++) c.at[i] = (double)from[(size_t)i * (size_t)columns];
    return c;
}

/* sum += f a bᵀ */
static void add_product(double *sum, double f, const column *a, const column *b)
{
    for (int i = 0; i < FAR; i++) {
        const double by = f * a->at[i];
        for (int j = 0; j < FAR; j++) sum[i * FAR + j] += by * b->at[j];
    }
}

/* modes of the gear group that are not dynamic, m teeth after the load: those of a pair turn into each other */
static void add_modes(const gk_gear *gear, int dynamic, int m, double *sum)
{
    for (int k = dynamic; k < gear->modes; k++) {
        const double f = 1.0 / (gear->omega[k] * gear->omega[k]);
        const column a = column_of(gear->far_modes + k, gear->modes);
        const int64_t turned = (int64_t)gear->diameter[k] * m % gear->z;
        double sine, cosine;
        gk_sincos(2.0 * GK_PI * (double)turned / gear->z, &sine, &cosine);
        add_product(sum, f * cosine, &a, &a);
        if (gear->member[k] != 1) continue;
        const column b = column_of(gear->far_modes + k + 1, gear->modes);
        add_product(sum, f * cosine, &b, &b);
        add_product(sum, -f * sine, &b, &a);
        add_product(sum, f * sine, &a, &b);
        k++;
    }
}

/* Ground oscillators that are not dynamic, as a mean over all angles of the loaded tooth: these are stiff enough to
 * feel little of what is not the same in all directions */
static void add_ground(const gk_model *model, const gk_setup *setup, int g, int m, double *sum)
{
    const gk_base *base = &setup->base;
    const int reads = model->gear[g].ground[base->set].reads;
    const int32_t *list = model->gear[g].ground[base->set].list;
    const double *omega = model->ground[base->set].omega;
    double sine, cosine;
    gk_sincos(2.0 * GK_PI * m / model->gear[g].z, &sine, &cosine);
    for (int k = 0; k < reads; k++) {
        if (base->slot[list[k]] >= 0) continue;
        const double f = 1.0 / (omega[list[k]] * omega[list[k]]);
        const float *from = model->gear[g].ground[base->set].far + k;
        const column all = column_of(from, reads), c = column_of(from + (size_t)FAR * reads, reads),
                     s = column_of(from + 2 * (size_t)FAR * reads, reads);
        add_product(sum, f, &all, &all);
        add_product(sum, 0.5 * f * cosine, &c, &c);
        add_product(sum, 0.5 * f * cosine, &s, &s);
        add_product(sum, 0.5 * f * sine, &s, &c);
        add_product(sum, -0.5 * f * sine, &c, &s);
    }
}

static int any_static(const gk_model *model, const gk_setup *setup, int g)
{
    const int set = setup->base.set;
    int any = setup->modal[g].count < model->gear[g].modes;
    for (int k = 0; k < model->gear[g].ground[set].reads; k++)
        any |= setup->base.slot[model->gear[g].ground[set].list[k]] < 0;
    return any;
}

/* what a tooth does to another is what that does to it, to the last bit; `itself`: one tooth, or half way round */
static void keep(const double *sum, int itself, gk_real *there, gk_real *back)
{
    for (int i = 0; i < FAR; i++)
        for (int j = 0; j < FAR; j++) {
            if (itself && i > j) continue;
            there[i * LANES + j] = back[j * LANES + i] = (gk_real)sum[i * FAR + j];
        }
}

/* S for every number of teeth, where something is not dynamic */
void gk_far_fill(const gk_model *model, gk_setup *setup, int g)
{
    setup->far_on[g] = setup->on.residual && gk_far_known(model, setup, g) && any_static(model, setup, g);
    memset(setup->far[g], 0, setup->far_on[g] ? (size_t)model->gear[g].z * FAR * LANES * sizeof(gk_real) : 0);
    for (int m = 0; 2 * m <= model->gear[g].z && setup->far_on[g]; m++) {
        const int z = model->gear[g].z, back = (z - m) % z;
        double sum[FAR * FAR] = {0};
        add_modes(&model->gear[g], setup->modal[g].count, m, sum);
        add_ground(model, setup, g, m, sum);
        keep(sum, m == back, setup->far[g] + (size_t)m * FAR * LANES, setup->far[g] + (size_t)back * FAR * LANES);
    }
}
