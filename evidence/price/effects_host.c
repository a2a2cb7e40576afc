/* Runs a stage model through gk_ for evidence/price/effects_cost.py, which counts the instructions of `measured`:
 *   effects_host LIBRARY BLOB WARM STEPS H WHAT=BASE+SLOPE …     WHAT: p<reference> parameter, i<reference> input,
 * which follows BASE + SLOPE·time Prints the internal steps of the measured part and the bits of the watched outputs
 * (w<reference>) at its end. */
#define _POSIX_C_SOURCE 200809L
#include "gk.h"
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <valgrind/callgrind.h>

enum { MOST = 64 };
typedef struct entry {
    char kind;
    uint32_t reference;
    double base, slope;
} entry;
typedef struct run {
    gk_model *model;
    gk_setup *setup;
    gk_work *work;
    gk_data *data;
    double H;
    int entries;
    entry entry[MOST];
} run;

static size_t (*model_size)(void), (*setup_size)(const gk_model *), (*data_size)(const gk_model *),
    (*work_size)(const gk_model *);
static gk_outcome (*model_open)(gk_model *, const void *, size_t, char *), (*defaults)(const gk_model *, gk_data *);
static gk_outcome (*set)(const gk_model *, gk_data *, uint32_t, double),
    (*get)(const gk_model *, const gk_data *, uint32_t, double *);
static gk_outcome (*prepare)(const gk_model *, const gk_data *, gk_setup *, gk_work *, char *),
    (*initialize)(const gk_model *, const gk_setup *, gk_work *, gk_data *, double);
static gk_outcome (*step)(const gk_model *, const gk_setup *, gk_work *, gk_data *, double, double);
static int (*variable_count)(const gk_model *);
static gk_outcome (*variable)(const gk_model *, int, gk_variable_info *);

static void must(int good, const char *what)
{
    if (good) return;
    fprintf(stderr, "effects_host: %s\n", what);
    exit(2);
}

static void bind(const char *path)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    must(library != NULL, "the library does not load");
    const struct {
        void *to;
        const char *name;
    } table[] = {{&model_size, "gk_model_size"},
                 {&setup_size, "gk_setup_size"},
                 {&data_size, "gk_data_size"},
                 {&work_size, "gk_work_size"},
                 {&model_open, "gk_model_open"},
                 {&defaults, "gk_defaults"},
                 {&set, "gk_set"},
                 {&get, "gk_get"},
                 {&prepare, "gk_prepare"},
                 {&initialize, "gk_initialize"},
                 {&step, "gk_step"},
                 {&variable_count, "gk_variable_count"},
                 {&variable, "gk_variable"}};
    for (size_t i = 0; i < sizeof table / sizeof *table; i++) {
        void *found = dlsym(library, table[i].name);
        must(found != NULL, table[i].name);
        memcpy(table[i].to, &found, sizeof found);
    }
}

static void *bytes(size_t size)
{
    void *p = NULL;
    must(posix_memalign(&p, 64, size + 64) == 0, "out of memory");
    memset(p, 0, size + 64);
    return p;
}

static void *whole_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    must(file && !fseek(file, 0, SEEK_END), "no blob");
    *size = (size_t)ftell(file);
    rewind(file);
    void *p = bytes(*size);
    must(fread(p, 1, *size, file) == *size, "the blob cannot be read");
    fclose(file);
    return p;
}

static void put(run *r, char kind, double time)
{
    for (int i = 0; i < r->entries; i++)
        if (r->entry[i].kind == kind)
            must(set(r->model, r->data, r->entry[i].reference, r->entry[i].base + r->entry[i].slope * time) == GK_OK,
                 "a value is refused");
}

static void advance(run *r, int from, int to)
{
    for (int k = from; k < to; k++) {
        put(r, 'i', k * r->H);
        must(step(r->model, r->setup, r->work, r->data, k * r->H, r->H) == GK_OK, "a step failed");
    }
}

/* callgrind collects inside this function and nowhere else */
__attribute__((noinline)) void measured(run *r, int from, int to) { advance(r, from, to); }

static double steps_done(const run *r)
{
    gk_variable_info info;
    double value = 0.0;
    for (int i = 0; i < variable_count(r->model); i++)
        if (variable(r->model, i, &info) == GK_OK && !strcmp(info.name, "solver.steps"))
            get(r->model, r->data, info.reference, &value);
    return value;
}

int main(int count, char **text)
{
    run r = {0};
    size_t size;
    char message[GK_MESSAGE];
    must(count > 5 && count - 6 <= MOST, "usage: effects_host LIBRARY BLOB WARM STEPS H WHAT=BASE+SLOPE ...");
    bind(text[1]);
    void *blob = whole_file(text[2], &size);
    const int warm = atoi(text[3]), end = warm + atoi(text[4]);
    r.H = atof(text[5]);
    for (int i = 6; i < count; i++, r.entries++) {
        entry *e = &r.entry[r.entries];
        must(sscanf(text[i], "%c%u=%lf+%lf", &e->kind, &e->reference, &e->base, &e->slope) >= 2, text[i]);
    }
    r.model = bytes(model_size());
    must(model_open(r.model, blob, size, message) == GK_OK, message);
    r.setup = bytes(setup_size(r.model));
    r.work = bytes(work_size(r.model));
    r.data = bytes(data_size(r.model));
    defaults(r.model, r.data);
    put(&r, 'p', 0.0);
    put(&r, 'i', 0.0);
    must(prepare(r.model, r.data, r.setup, r.work, message) == GK_OK, message);
    must(initialize(r.model, r.setup, r.work, r.data, 0.0) == GK_OK, "no equilibrium");
    advance(&r, 0, warm);
    const double before = steps_done(&r);
    CALLGRIND_START_INSTRUMENTATION; /* what comes before is a preparation of seconds and need not be slow */
    measured(&r, warm, end);
    CALLGRIND_STOP_INSTRUMENTATION;
    printf("%.0f", steps_done(&r) - before);
    for (int i = 0; i < r.entries; i++) {
        double value = 0.0;
        if (r.entry[i].kind != 'w') continue;
        get(r.model, r.data, r.entry[i].reference, &value);
        printf(" %a", value);
    }
    printf("\n");
    return 0;
}
