/* A small importer in C: loads the binary of an FMU and drives it. Compiled natively and, for Windows, with the cross
 * compiler. host LIBRARY RESOURCES GUID run STEPS H REFERENCE,… [REFERENCE=BASE+SLOPE …]   hex of the outputs after
 * every step; inputs follow BASE + k·SLOPE host LIBRARY RESOURCES GUID fuzz SEED CALLS REFERENCES random calls, wrong
 * ones too; exit code 1 when an answer is wrong */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "fmi2FunctionTypes.h"
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(_WIN32)
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
static void *symbol(void *library, const char *name)
{
    return (void *)(uintptr_t)GetProcAddress((HMODULE)library, name);
}
static void *load(const char *path) { return (void *)LoadLibraryA(path); }
#else
#include <dlfcn.h>
static void *symbol(void *library, const char *name) { return dlsym(library, name); }
static void *load(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
#endif

#define FUNCTIONS(X)                                                                                                   \
    X(SetDebugLogging)                                                                                                 \
    X(Instantiate)                                                                                                     \
    X(FreeInstance)                                                                                                    \
    X(SetupExperiment)                                                                                                 \
    X(EnterInitializationMode)                                                                                         \
    X(ExitInitializationMode)                                                                                          \
    X(Terminate)                                                                                                       \
    X(Reset)                                                                                                           \
    X(GetReal)                                                                                                         \
    X(GetInteger)                                                                                                      \
    X(GetBoolean)                                                                                                      \
    X(SetReal)                                                                                                         \
    X(SetInteger)                                                                                                      \
    X(SetBoolean)                                                                                                      \
    X(GetFMUstate)                                                                                                     \
    X(SetFMUstate)                                                                                                     \
    X(FreeFMUstate)                                                                                                    \
    X(SerializedFMUstateSize)                                                                                          \
    X(SerializeFMUstate) X(DeSerializeFMUstate) X(DoStep) X(CancelStep) X(GetStatus) X(GetRealStatus)
#define X(name) static fmi2##name##TYPE *name;
FUNCTIONS(X)
#undef X

static void *lookup(void *library, const char *name)
{
    void *found = symbol(library, name);
    if (!found) {
        fprintf(stderr, "no function %s in the library\n", name);
        exit(2);
    }
    return found;
}

static void find_functions(void *library)
{
#define X(name) *(void **)&name = lookup(library, "fmi2" #name);
    FUNCTIONS(X)
#undef X
}

static long blocks; /* given out and not yet taken back */
static void *allocate(size_t count, size_t size)
{
    blocks++;
    return calloc(count, size);
}
static void release(void *block)
{
    blocks -= block != NULL;
    free(block);
}
static int loud;
static void say(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String message,
                ...)
{
    (void)e;
    if (loud) fprintf(stderr, "%s %d %s: %s\n", name, status, category, message);
}
static const fmi2CallbackFunctions environment = {say, allocate, release, NULL, NULL};

static void need(int condition, const char *what)
{
    if (condition) return;
    fprintf(stderr, "failed: %s\n", what);
    exit(1);
}

/* ---- run ---- */
#define MOST 256
typedef struct inputs {
    int count;
    fmi2ValueReference reference[MOST];
    double base[MOST], slope[MOST], value[MOST];
} inputs;

static int read_references(const char *text, fmi2ValueReference references[])
{
    int n = 0;
    for (char *end; n < MOST && *text; text = *end ? end + 1 : end)
        references[n++] = (fmi2ValueReference)strtoul(text, &end, 10);
    return n;
}

static void read_inputs(inputs *in, int count, char **text)
{
    in->count = count;
    for (int i = 0; i < count; i++) {
        char *end;
        in->reference[i] = (fmi2ValueReference)strtoul(text[i], &end, 10);
        in->base[i] = strtod(end + 1, &end);
        in->slope[i] = strtod(end + 1, &end);
    }
}

static void set_inputs(fmi2Component c, inputs *in, long k)
{
    for (int i = 0; i < in->count; i++) in->value[i] = in->base[i] + (double)k * in->slope[i];
    need(SetReal(c, in->reference, (size_t)in->count, in->value) == fmi2OK, "fmi2SetReal");
}

static void start(fmi2Component c, inputs *in)
{
    need(c != NULL, "fmi2Instantiate");
    need(SetupExperiment(c, 0, 0, 0, 0, 0) == fmi2OK, "fmi2SetupExperiment");
    need(EnterInitializationMode(c) == fmi2OK, "fmi2EnterInitializationMode");
    set_inputs(c, in, 0);
    need(ExitInitializationMode(c) == fmi2OK, "fmi2ExitInitializationMode");
}

static int run(fmi2Component c, int count, char **arguments)
{
    static inputs in;
    fmi2ValueReference outputs[MOST];
    double values[MOST], H = strtod(arguments[1], NULL);
    long steps = strtol(arguments[0], NULL, 10);
    int n = read_references(arguments[2], outputs);
    read_inputs(&in, count - 3, arguments + 3);
    start(c, &in);
    for (long k = 0; k < steps; k++) {
        set_inputs(c, &in, k);
        need(DoStep(c, (double)k * H, H, fmi2True) == fmi2OK, "fmi2DoStep");
        need(GetReal(c, outputs, (size_t)n, values) == fmi2OK, "fmi2GetReal");
        for (int i = 0; i < n; i++) {
            uint64_t bits;
            memcpy(&bits, &values[i], sizeof bits);
            printf("%08lx%08lx%c", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffffu),
                   i + 1 < n ? ' ' : '\n');
        }
    }
    FreeInstance(c);
    need(blocks == 0, "all memory given back");
    return 0;
}

/* ---- fuzz ---- */
static uint64_t seed;
static unsigned dice(unsigned sides)
{
    seed ^= seed << 13, seed ^= seed >> 7, seed ^= seed << 17; /* xorshift64, Marsaglia */
    return (unsigned)((seed >> 33) % sides);
}
static double odd_number(void)
{
    static const double odd[] = {0, 1, -1, 1e-3, 1e-4, -1e-4, 1e300, -1e300, 5e-324, 2, 4};
    unsigned k = dice(14);
    return k < 11 ? odd[k] : k == 11 ? NAN : k == 12 ? INFINITY : -INFINITY;
}

typedef struct subject {
    fmi2Component c, freed;
    fmi2FMUstate states[3];
    double time;
} subject;
typedef struct fuzz {
    const char *guid, *resources;
    unsigned references;
    subject subjects[3];
    char *image;
    size_t size;
    long answers[7], forged; /* forged: states accepted although one of their bits was changed */
} fuzz;

static fmi2Component component(subject *s)
{
    unsigned k = dice(200);
    return k == 0 ? NULL : k == 1 ? (fmi2Component)(uintptr_t)(12345u * dice(99999)) : k < 10 ? s->freed : s->c;
}

static void renew(fuzz *f, subject *s)
{
    if (s->c) s->freed = s->c, FreeInstance(s->c);
    s->c = Instantiate("fuzz", dice(20) ? fmi2CoSimulation : fmi2ModelExchange, dice(20) ? f->guid : "?",
                       dice(20) ? f->resources : "file:///%zz", &environment, 0, 1);
    memset(s->states, 0, sizeof s->states);
    s->time = 0;
}

static fmi2Status fuzz_values(fuzz *f, fmi2Component c)
{
    fmi2ValueReference references[4];
    double reals[4];
    int whole[4];
    size_t n = dice(5);
    for (size_t i = 0; i < 4; i++)
        references[i] = dice(f->references + 3), reals[i] = odd_number(), whole[i] = (int)dice(7) - 2;
    switch (dice(6)) {
    case 0: return SetReal(c, references, n, reals);
    case 1: return SetInteger(c, references, n, whole);
    case 2: return SetBoolean(c, references, n, whole);
    case 3: return GetInteger(c, references, n, whole);
    case 4: return GetBoolean(c, references, n, whole);
    default: break;
    }
    fmi2Status status = GetReal(c, references, n, dice(20) ? reals : NULL);
    for (size_t i = 0; status == fmi2OK && i < n; i++) need(isfinite(reals[i]), "a value got with fmi2OK is finite");
    return status;
}

/* give damaged bytes a right checksum (docs/file-formats.md), so that the deeper checks are reached */
static void forge(char *image, size_t size)
{
    uint64_t check = 14695981039346656037u;
    for (size_t i = 24; i < size; i++) check = (check ^ (unsigned char)image[i]) * 1099511628211u;
    if (size > 24) memcpy(image + 16, &check, sizeof check);
}

static fmi2Status fuzz_state(fuzz *f, subject *s, fmi2Component c)
{
    fmi2FMUstate *state = &s->states[dice(3)], odd = dice(20) ? *state : (fmi2FMUstate)(uintptr_t)dice(5000);
    fmi2Status status;
    switch (dice(5)) {
    case 0: return GetFMUstate(c, state);
    case 1: return SetFMUstate(c, odd);
    case 2: return FreeFMUstate(c, state);
    case 3:
        if (SerializedFMUstateSize(c, odd, &f->size) != fmi2OK) return fmi2Error;
        f->image = realloc(f->image, f->size);
        return SerializeFMUstate(c, odd, f->image, f->size - (dice(20) == 0));
    default:
        if (!f->size) return fmi2Error;
        if (dice(2)) return DeSerializeFMUstate(c, f->image, f->size, state);
        size_t at = dice((unsigned)f->size);
        f->image[at] ^= (char)(1u << dice(8));
        int forged = dice(2) != 0;
        if (forged) forge(f->image, f->size);
        status = DeSerializeFMUstate(c, f->image, f->size - (forged ? 0 : dice(2)), state);
        need(forged || status != fmi2OK, "damaged bytes are refused");
        f->forged += forged && status == fmi2OK;
        f->size = 0;
        return status;
    }
}

static fmi2Status fuzz_step(subject *s, fmi2Component c)
{
    double H = dice(4) ? 1e-4 : odd_number(), time = dice(10) ? s->time : odd_number();
    if (H > 1e-3 && H < 1e6) H = 1e-3; /* long steps are allowed, but we have no time for them */
    fmi2Status status = DoStep(c, time, H, fmi2True);
    if (status == fmi2OK) need(H > 0, "a step accepted is positive"), s->time = time + H;
    return status;
}

static fmi2Status fuzz_call(fuzz *f)
{
    subject *s = &f->subjects[dice(3)];
    fmi2Component c = component(s);
    double reached;
    switch (dice(24)) {
    case 0: return dice(4) ? fmi2OK : (renew(f, s), fmi2OK);
    case 1: return SetupExperiment(c, 0, 0, odd_number(), dice(2) != 0, odd_number());
    case 2:
    case 3: return EnterInitializationMode(c);
    case 4:
    case 5: return ExitInitializationMode(c);
    case 6: return dice(5) ? fmi2OK : Terminate(c);
    case 7: s->time = 0; return dice(3) ? fmi2OK : Reset(c);
    case 8: return GetRealStatus(c, (fmi2StatusKind)dice(5), dice(9) ? &reached : NULL);
    case 9: return dice(2) ? CancelStep(c) : SetDebugLogging(c, dice(2) != 0, dice(2), NULL);
    case 10:
    case 11:
    case 12: return fuzz_state(f, s, c);
    case 13:
    case 14:
    case 15:
    case 16:
    case 17: return fuzz_values(f, c);
    default: return fuzz_step(s, c);
    }
}

static int run_fuzz(const char *guid, const char *resources, char **arguments)
{
    static fuzz f;
    f.guid = guid, f.resources = resources;
    f.references = (unsigned)strtoul(arguments[2], NULL, 10);
    seed = strtoul(arguments[0], NULL, 10) * 2654435761u + 88172645463325252u;
    for (int k = 0; k < 3; k++) renew(&f, &f.subjects[k]);
    for (long calls = strtol(arguments[1], NULL, 10); calls > 0; calls--) f.answers[fuzz_call(&f)]++;
    for (int k = 0; k < 3; k++) FreeInstance(f.subjects[k].c);
    free(f.image);
    need(blocks == 0, "all memory given back");
    printf("ok %ld warning %ld discard %ld error %ld forged %ld\n", f.answers[0], f.answers[1], f.answers[2],
           f.answers[3], f.forged);
    return 0;
}

int main(int count, char **arguments)
{
    if (count < 7) return 2;
    const char *resources = arguments[2], *guid = arguments[3];
    void *library = load(arguments[1]);
    need(library != NULL, "load the library");
    find_functions(library);
    loud = strcmp(arguments[4], "fuzz") != 0;
    if (!loud) return run_fuzz(guid, resources, arguments + 5);
    fmi2Component c = Instantiate("host", fmi2CoSimulation, guid, resources, &environment, 0, 0);
    need(c != NULL, "fmi2Instantiate");
    return run(c, count - 5, arguments + 5);
}
