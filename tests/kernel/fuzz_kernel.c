/* Reads cases from standard input, each a u64 seed, a u64 size and the bytes of a blob; opens, prepares and initialises
 * it and runs 20 communication steps with random parameters and inputs, saves, damages and restores the state on the
 * way. One line a case: its number, the last call and its outcome, or what it should not have done: an output that is
 * not finite after GK_OK, a refusal without a message. A finding of a sanitizer ends the process, and so does a case
 * that takes longer than CASE_SECONDS. */
#define _POSIX_C_SOURCE 200112L
#include "setup/gk_setup.h"
#include <stdio.h>
#include <stdlib.h>
#include <sys/time.h>

enum { STEPS = 20, CASE_SECONDS = 120 };
static uint64_t state;

static double uniform(void)
{ /* xorshift64* (Vigna 2016) */
    state ^= state >> 12, state ^= state << 25, state ^= state >> 27;
    return (double)((state * 0x2545f4914f6cdd1dULL) >> 11) * 0x1p-53;
}

static void *memory(size_t size)
{ /* exact size, so that a sanitizer sees every byte beyond */
    void *p = NULL;
    if (posix_memalign(&p, 64, size ? size : 1)) abort();
    return p;
}

static double plausible(const gk_variable_info *v)
{
    double top = v->maximum < 1e3 ? v->maximum : v->unit[0] == 'r' && v->unit[3] == 0 ? 0.02 : 300.0;
    double low = v->minimum > -top ? v->minimum : -top;
    if (v->maximum > 0 && !strcmp(v->name, "h")) return 1e-7 * gk_exp(uniform() * 9.2);
    double value = uniform() < 0.03 ? (uniform() < 0.5 ? v->minimum : v->maximum) : low + (top - low) * uniform();
    return v->type == GK_REAL ? value : floor(value + 0.5);
}

/* some variables of one causality, to values they should take, or to ones they must refuse */
static void set_some(const gk_model *model, gk_data *data, gk_causality causality, double share)
{
    gk_variable_info v;
    for (int i = 0; gk_variable(model, i, &v) == GK_OK; i++) {
        if (v.causality != causality || uniform() > share) continue;
        (void)gk_set(model, data, v.reference, uniform() < 0.02 ? NAN : plausible(&v));
    }
}

/* name of a variable that is not finite, "" when all are */
static const char *not_finite(const gk_model *model, const gk_data *data)
{
    static gk_variable_info v;
    for (int i = 0; gk_variable(model, i, &v) == GK_OK; i++) {
        double value = NAN;
        if (gk_get(model, data, v.reference, &value) != GK_OK || !(value - value == 0.0)) return v.name;
    }
    return "";
}

/* a damaged state is refused, or steps on without harm; what it then says is as good as the state was */
static void step_from_damage(const gk_model *model, const gk_setup *setup, gk_work *work, const void *saved,
                             size_t size)
{
    gk_data *data = memory(gk_data_size(model));
    unsigned char *bytes = (unsigned char *)data;
    memset(data, 0, gk_data_size(model));
    memcpy(data, saved, size);
    for (int k = 0; k < 3; k++) {
        size_t at = (size_t)(uniform() * (double)size) & ~(size_t)3;
        if (uniform() < 0.5)
            bytes[at + (size_t)(uniform() * 4.0)] ^= (unsigned char)(1 << (int)(uniform() * 8.0));
        else
            memset(bytes + at, uniform() < 0.5 ? 0xff : 0x7f, at + 8 <= size ? 8 : size - at);
    }
    if (gk_state_check(model, setup, data, size) == GK_OK)
        for (int k = 0; k < 2; k++) (void)gk_step(model, setup, work, data, gk_time(data), setup->h);
    free(data);
}

/* what went wrong, or "" */
static const char *run_steps(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                             gk_outcome *outcome)
{
    size_t size = gk_state_size(setup);
    void *saved = memory(size);
    const char *wrong = not_finite(model, data);
    for (int i = 0; i < STEPS && *outcome == GK_OK && !wrong[0]; i++) {
        if (i % 3 == 0) set_some(model, data, GK_INPUT, 0.5);
        memcpy(saved, data, size);
        *outcome = gk_step(model, setup, work, data, gk_time(data), setup->h * (1.0 + floor(3.0 * uniform())));
        if (*outcome == GK_OK) wrong = not_finite(model, data);
        if (i % 5 == 4) step_from_damage(model, setup, work, saved, size);
        if (i % 7 == 6 && gk_state_check(model, setup, saved, size) == GK_OK) memcpy(data, saved, size);
    }
    free(saved);
    return wrong;
}

static void run_case(unsigned long number, const void *blob, size_t size)
{
    char message[GK_MESSAGE] = "";
    gk_model *model = memory(gk_model_size());
    const char *call = "open", *wrong = "";
    gk_outcome chosen, *outcome = &chosen;
    *outcome = gk_model_open(model, blob, size, message);
    if (*outcome == GK_OK) {
        gk_setup *setup = memory(gk_setup_size(model));
        gk_work *work = memory(gk_work_size(model));
        gk_data *data = memory(gk_data_size(model));
        call = "defaults", *outcome = gk_defaults(model, data);
        if (uniform() < 0.7) set_some(model, data, GK_PARAMETER, 0.15);
        if (uniform() < 0.5) set_some(model, data, GK_INPUT, 0.5);
        call = "prepare", *outcome = gk_prepare(model, data, setup, work, message);
        if (*outcome == GK_OK) call = "initialize", *outcome = gk_initialize(model, setup, work, data, 0.0);
        if (*outcome == GK_OK) call = "step", wrong = run_steps(model, setup, work, data, outcome);
        free(setup);
        free(work);
        free(data);
    } else if (!message[0]) {
        wrong = "no-message";
    }
    free(model);
    printf("%lu %s %d %s\n", number, call, (int)chosen, wrong);
    fflush(stdout);
}

int main(void)
{
    uint64_t head[2];
    for (unsigned long number = 0; fread(head, sizeof head, 1, stdin) == 1; number++) {
        void *blob = memory(head[1]);
        if (head[1] && fread(blob, head[1], 1, stdin) != 1) return 2;
        state = head[0] * 0x9e3779b97f4a7c15ULL + 1;
        setitimer(ITIMER_VIRTUAL, &(struct itimerval){.it_value.tv_sec = CASE_SECONDS}, NULL);
        run_case(number, blob, head[1]);
        free(blob);
    }
    return 0;
}
