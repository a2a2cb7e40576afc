/* Saved states of an instance. A state is kept in the form in which it is serialised: head, settings, bytes of gk_data.
 * The settings are part of it, so that a fresh process can prepare the same tables before it takes the bytes over. */
#include "fmi2/fmi2_face.h"
#include <string.h>

static const char MAGIC[8] = {'G', 'F', 'M', 'U', 'S', 'T', '0', '1'};
#define CHECKED_FROM offsetof(face_head, hash)

static double *values_of(const face_state *state) { return (double *)(void *)(state + 1); }
static unsigned char *bytes_of(const face_state *state)
{
    return (unsigned char *)(values_of(state) + state->head.values);
}

/* FNV-1a, 64 bit (Fowler, Noll, Vo) */
static uint64_t fnv(const unsigned char *bytes, size_t size)
{
    uint64_t check = 14695981039346656037u;
    for (size_t i = 0; i < size; i++) check = (check ^ bytes[i]) * 1099511628211u;
    return check;
}

/* a state of this instance that has not been freed, or NULL: compares addresses, looks into nothing it does not own */
face_state *face_state_find(const face *f, const void *state)
{
    face_state *s = f->states;
    while (s && s != state) s = s->next;
    return s;
}

void face_state_free(face *f, face_state *state)
{
    face_state **link = &f->states;
    while (*link && *link != state) link = &(*link)->next;
    if (*link) *link = state->next;
    face_release(&f->environment, state);
}

/* *state: an own state to be overwritten, or NULL; afterwards one with room for `size` bytes */
static int make_room(face *f, face_state **state, size_t size)
{
    if (*state && (*state)->capacity >= size) return 1;
    face_state *fresh = face_allocate(&f->environment, offsetof(face_state, head) + size);
    if (!fresh) return 0;
    if (*state) face_state_free(f, *state);
    fresh->capacity = size;
    fresh->next = f->states;
    *state = f->states = fresh;
    return 1;
}

static int runs(face_mode mode) { return (mode & (MODE_STEP | MODE_DISCARDED | MODE_TERMINATED)) != 0; }

fmi2Status face_state_save(face *f, face_state **state)
{
    size_t values = (size_t)f->settables, bytes = runs(f->mode) ? gk_state_size(f->setup) : 0;
    size_t size = sizeof(face_head) + values * sizeof(double) + bytes;
    if (!make_room(f, state, size)) return REFUSE(f, "no memory for a saved state of %zu bytes", size);
    face_head *head = &(*state)->head;
    memset(head, 0, sizeof *head);
    memcpy(head->magic, MAGIC, sizeof MAGIC);
    memcpy(head->hash, gk_model_hash(f->model), sizeof head->hash);
    head->size = size;
    head->start = f->start, head->stop = f->stop, head->last_good = f->last_good;
    head->stop_defined = (uint32_t)f->stop_defined, head->mode = f->mode;
    head->values = (uint32_t)values, head->bytes = bytes;
    for (size_t k = 0; k < values; k++) gk_get(f->model, f->given, f->settable[k], values_of(*state) + k);
    memcpy(bytes_of(*state), f->data, bytes);
    return fmi2OK;
}

static gk_outcome take_settings(const face *f, gk_data *data, const double *values)
{
    gk_outcome outcome = gk_defaults(f->model, data);
    for (int k = 0; outcome == GK_OK && k < f->settables; k++)
        outcome = gk_set(f->model, data, f->settable[k], values[k]);
    return outcome;
}

fmi2Status face_state_restore(face *f, const face_state *state)
{
    const face_head *head = &state->head;
    f->settled = 0;
    f->mode = MODE_ERROR; /* until all of it is back */
    if (take_settings(f, f->given, values_of(state)) != GK_OK)
        return REFUSE(f, "the settings of the saved state were refused");
    if (head->bytes && face_prepare(f) != fmi2OK) return fmi2Error;
    memcpy(f->data, bytes_of(state), head->bytes);
    f->start = head->start, f->stop = head->stop, f->last_good = head->last_good;
    f->stop_defined = (int)head->stop_defined;
    f->step_status = head->mode == MODE_DISCARDED ? fmi2Discard : fmi2OK;
    f->mode = (face_mode)head->mode;
    return fmi2OK;
}

void face_state_write(const face_state *state, void *bytes)
{
    unsigned char *out = memcpy(bytes, &state->head, state->head.size);
    uint64_t check = fnv(out + CHECKED_FROM, state->head.size - CHECKED_FROM);
    memcpy(out + offsetof(face_head, check), &check, sizeof check);
}

/* what is wrong with a head that came from outside, or NULL */
static const char *head_fault(const face *f, const face_head *head, const unsigned char *bytes, size_t size)
{
    if (memcmp(head->magic, MAGIC, sizeof MAGIC)) return "these bytes are not a saved state of a gearfmu FMU";
    if (memcmp(head->hash, gk_model_hash(f->model), sizeof head->hash)) return "this state belongs to another model";
    if (head->size != size || head->check != fnv(bytes + CHECKED_FROM, size - CHECKED_FROM))
        return "the bytes are damaged";
    if (head->values != (uint32_t)f->settables) return "the number of settings differs";
    size_t fixed = sizeof *head + (size_t)head->values * sizeof(double);
    if (size < fixed || head->bytes != size - fixed) return "the lengths do not fit together";
    int known = runs((face_mode)head->mode) || head->mode == MODE_INSTANTIATED || head->mode == MODE_INITIALIZATION;
    if (!known || runs((face_mode)head->mode) != (head->bytes > 0)) return "the mode is unknown";
    double zero = (head->start - head->start) + (head->stop - head->stop) + (head->last_good - head->last_good);
    return zero == 0 && head->stop_defined <= 1 && head->reserved == 0 ? NULL : "a time is not finite";
}

static const char *kernel_fault(const face *f, const face_state *state, gk_data *data, gk_setup *setup, gk_work *work)
{
    char message[GK_MESSAGE] = "";
    size_t bytes = state->head.bytes;
    if (take_settings(f, data, values_of(state)) != GK_OK) return "a setting is out of its range";
    if (bytes == 0) return NULL;
    if (gk_prepare(f->model, data, setup, work, message) != GK_OK) return "the model cannot run with its parameters";
    if (gk_state_size(setup) != bytes) return "its length does not fit its parameters";
    memcpy(data, bytes_of(state), bytes);
    return gk_state_check(f->model, setup, data, bytes) == GK_OK ? NULL : "the kernel refuses its contents";
}

/* do the kernel's checks accept the settings and the bytes? in memory of their own: the instance stays as it is */
static const char *deep_fault(const face *f, const face_state *state)
{
    size_t data_size = (gk_data_size(f->model) + FACE_ALIGNMENT - 1) / FACE_ALIGNMENT * FACE_ALIGNMENT;
    size_t setup_size = (gk_setup_size(f->model) + FACE_ALIGNMENT - 1) / FACE_ALIGNMENT * FACE_ALIGNMENT;
    void *block = face_allocate(&f->environment, data_size + setup_size + gk_work_size(f->model) + FACE_ALIGNMENT);
    if (!block) return "no memory to check it";
    gk_data *data = (gk_data *)(void *)face_align(block);
    gk_setup *setup = (gk_setup *)(void *)((unsigned char *)data + data_size);
    gk_work *work = (gk_work *)(void *)((unsigned char *)setup + setup_size);
    const char *fault = kernel_fault(f, state, data, setup, work);
    face_release(&f->environment, block);
    return fault;
}

fmi2Status face_state_read(face *f, const void *bytes, size_t size, face_state **state)
{
    face_head head;
    const char *fault = "there are fewer bytes than the head of a state has";
    if (size >= sizeof head) {
        memcpy(&head, bytes, sizeof head);
        fault = head_fault(f, &head, bytes, size);
    }
    if (fault) return REFUSE(f, "fmi2DeSerializeFMUstate: %s", fault);
    face_state *fresh = NULL;
    if (!make_room(f, &fresh, size)) return REFUSE(f, "no memory for a saved state of %zu bytes", size);
    memcpy(&fresh->head, bytes, size);
    fault = deep_fault(f, fresh);
    if (fault) {
        face_state_free(f, fresh);
        return REFUSE(f, "fmi2DeSerializeFMUstate: %s", fault);
    }
    if (*state) face_state_free(f, *state);
    *state = fresh;
    return fmi2OK;
}
