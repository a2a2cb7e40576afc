/* The blob: header, table of sections, sections (docs/file-formats.md, "Model blob"). Everything is checked once, here,
 * in the order in which it becomes safe to read: size → header → hash → table → contents. Arithmetic on sizes is 64-bit
 * and compares before it adds. */
#include "base/gk_check.h"
#include "base/gk_blob.h"
#include "base/gk_sha256.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "a model blob is little-endian and is used in place"
#endif

enum {
    FORMAT = 2,
    HEADER = 64,
    HASH_OFFSET = 8,
    HASHED_FROM = 40,
    ENTRY = 48,
    NAME = 24,
    ALIGNMENT = 64,
    MOST_SECTIONS = 1024
};
typedef enum section_type { F64 = 1, I32 = 2, TEXT = 3, F32 = 4 } section_type;

typedef struct section {
    const char *name;
    uint32_t type, repeated; /* repeated: 1 + number of an earlier section with the same contents, stored once; or 0 */
    uint64_t count, offset;
} section;

static uint32_t u32_at(const unsigned char *p)
{
    uint32_t v;
    memcpy(&v, p, sizeof v);
    return v;
}

static uint64_t u64_at(const unsigned char *p)
{
    uint64_t v;
    memcpy(&v, p, sizeof v);
    return v;
}

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static gk_outcome refuse(char message[GK_MESSAGE], const char *format, ...)
{
    va_list values;
    va_start(values, format);
    vsnprintf(message, GK_MESSAGE, format, values);
    va_end(values);
    return GK_BAD_BLOB;
}

static section section_at(const gk_blob *blob, uint32_t i)
{
    const unsigned char *entry = blob->bytes + HEADER + (size_t)i * ENTRY;
    return (section){(const char *)entry, u32_at(entry + 24), u32_at(entry + 28), u64_at(entry + 32),
                     u64_at(entry + 40)};
}

static uint64_t aligned(uint64_t n) { return (n + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT; }

static uint64_t element_size(uint32_t type)
{
    return type == F64 ? 8 : type == I32 || type == F32 ? 4 : type == TEXT ? 1 : 0;
}

/* printable ASCII without space, then NUL to the end */
static int name_is_good(const char *name)
{
    size_t length = 0;
    while (length < NAME && name[length] > ' ' && name[length] <= '~') length++;
    for (size_t i = length; i < NAME; i++)
        if (name[i] != 0) return 0;
    return length > 0 && length < NAME;
}

static int all_finite(const unsigned char *values, uint64_t count)
{
    const uint64_t exponent = (uint64_t)0x7ff << 52;
    for (uint64_t i = 0; i < count; i++)
        if ((u64_at(values + 8 * i) & exponent) == exponent) return 0;
    return 1;
}

static int all_finite_f32(const unsigned char *values, uint64_t count)
{
    const uint32_t exponent = (uint32_t)0xff << 23;
    for (uint64_t i = 0; i < count; i++)
        if ((u32_at(values + 4 * i) & exponent) == exponent) return 0;
    return 1;
}

/* RFC 3629, without NUL: length of the first character's code, 0 when it is not UTF-8 */
static uint64_t character_length(const unsigned char *p, uint64_t left)
{
    uint64_t length = p[0] < 0x80                   ? 1
                      : p[0] >= 0xc2 && p[0] < 0xe0 ? 2
                      : p[0] >= 0xe0 && p[0] < 0xf0 ? 3
                      : p[0] >= 0xf0 && p[0] < 0xf5 ? 4
                                                    : 0;
    if (p[0] == 0 || length > left) return 0;
    for (uint64_t i = 1; i < length; i++)
        if ((p[i] & 0xc0) != 0x80) return 0;
    if (p[0] == 0xe0 && p[1] < 0xa0) return 0;  /* longer than needed */
    if (p[0] == 0xed && p[1] >= 0xa0) return 0; /* surrogate          */
    if (p[0] == 0xf0 && p[1] < 0x90) return 0;  /* longer than needed */
    if (p[0] == 0xf4 && p[1] >= 0x90) return 0; /* above U+10FFFF     */
    return length;
}

static int is_text(const unsigned char *text, uint64_t count)
{
    if (count == 0 || text[count - 1] != 0) return 0;
    for (uint64_t i = 0, length; i < count - 1; i += length)
        if ((length = character_length(text + i, count - 1 - i)) == 0) return 0;
    return 1;
}

static gk_outcome check_header(const gk_blob *blob, char message[GK_MESSAGE])
{
    const unsigned char *b = blob->bytes;
    if (blob->size < HEADER)
        return refuse(message, "model blob: %llu bytes are too few for a header of %d", (unsigned long long)blob->size,
                      HEADER);
    if (memcmp(b, "GFMB", 4))
        return refuse(message, "model blob: does not begin with GFMB, this is not a gearfmu model");
    if (u32_at(b + 4) != FORMAT)
        return refuse(message, "model blob: format version %lu, this kernel reads version %d: assemble the stage again",
                      (unsigned long)u32_at(b + 4), FORMAT);
    if (u64_at(b + 40) != blob->size)
        return refuse(message, "model blob: header says %llu bytes, there are %llu: the blob is cut short or padded",
                      (unsigned long long)u64_at(b + 40), (unsigned long long)blob->size);
    if (blob->sections > MOST_SECTIONS || HEADER + (uint64_t)blob->sections * ENTRY > blob->size)
        return refuse(message, "model blob: %lu sections do not fit", (unsigned long)blob->sections);
    for (int i = 52; i < HEADER; i++)
        if (b[i]) return refuse(message, "model blob: reserved bytes of the header are not zero");
    return GK_OK;
}

static gk_outcome check_hash(gk_blob *blob, char message[GK_MESSAGE])
{
    unsigned char digest[32];
    gk_sha256(blob->bytes + HASHED_FROM, blob->size - HASHED_FROM, digest);
    for (int i = 0; i < 32; i++) {
        blob->hash[2 * i] = "0123456789abcdef"[digest[i] >> 4];
        blob->hash[2 * i + 1] = "0123456789abcdef"[digest[i] & 15];
    }
    blob->hash[64] = 0;
    if (memcmp(blob->bytes + HASH_OFFSET, digest, sizeof digest))
        return refuse(message, "model blob: contents do not match their SHA-256, the blob is damaged");
    return GK_OK;
}

/* section i shares the contents of an earlier one that has its own */
static int repeats(const gk_blob *blob, uint32_t i, section s)
{
    if (s.repeated > i) return 0;
    const section first = section_at(blob, s.repeated - 1);
    return first.repeated == 0 && first.type == s.type && first.count == s.count && first.offset == s.offset;
}

/* Sections follow each other in table order, each at the first multiple of 64 that is free; so they can neither overlap
 * nor leave the blob. One that repeats an earlier one has no contents of its own. `end`: end of the section before. */
static gk_outcome check_section(const gk_blob *blob, uint32_t i, uint64_t *end, char message[GK_MESSAGE])
{
    section s = section_at(blob, i);
    if (!name_is_good(s.name))
        return refuse(message, "model blob: the name of section %lu is not 1 to 23 printable characters",
                      (unsigned long)i);
    uint64_t size = element_size(s.type);
    if (size == 0)
        return refuse(message, "model blob: section '%s' is of unknown type %lu", s.name, (unsigned long)s.type);
    for (uint32_t j = 0; j < i; j++)
        if (!memcmp(section_at(blob, j).name, s.name, NAME))
            return refuse(message, "model blob: section '%s' is there twice", s.name);
    if (s.repeated) {
        if (repeats(blob, i, s)) return GK_OK;
        return refuse(message, "model blob: section '%s' does not repeat an earlier one", s.name);
    }
    if (s.offset != aligned(*end))
        return refuse(message, "model blob: section '%s' does not begin where the one before it ends", s.name);
    if (s.offset > blob->size || s.count > (blob->size - s.offset) / size)
        return refuse(message, "model blob: section '%s' reaches beyond the end", s.name);
    const unsigned char *contents = blob->bytes + s.offset;
    if ((s.type == F64 && !all_finite(contents, s.count)) || (s.type == F32 && !all_finite_f32(contents, s.count)))
        return refuse(message, "model blob: section '%s' holds a value that is not finite", s.name);
    if (s.type == TEXT && !is_text(contents, s.count))
        return refuse(message, "model blob: section '%s' is not UTF-8 text that ends with NUL", s.name);
    *end = s.offset + s.count * size;
    return GK_OK;
}

static gk_outcome check_sections(const gk_blob *blob, char message[GK_MESSAGE])
{
    uint64_t end = HEADER + (uint64_t)blob->sections * ENTRY;
    for (uint32_t i = 0; i < blob->sections; i++) {
        gk_outcome outcome = check_section(blob, i, &end, message);
        if (outcome != GK_OK) return outcome;
    }
    if (aligned(end) != blob->size)
        return refuse(message, "model blob: sections end at %llu, the blob at %llu", (unsigned long long)end,
                      (unsigned long long)blob->size);
    return GK_OK;
}

gk_outcome gk_blob_open(gk_blob *blob, const void *bytes, size_t size, char message[GK_MESSAGE])
{
    GK_ASSERT(blob && message);
    message[0] = 0;
    *blob = (gk_blob){bytes, size, 0, ""};
    if (bytes == NULL || (uintptr_t)bytes % 8) return refuse(message, "model blob: needs memory aligned to 8 bytes");
    if (size >= HEADER) blob->sections = u32_at(blob->bytes + 48);
    gk_outcome outcome = check_header(blob, message);
    if (outcome == GK_OK) outcome = check_hash(blob, message);
    if (outcome == GK_OK) outcome = check_sections(blob, message);
    if (outcome != GK_OK) blob->sections = 0;
    return outcome;
}

static const void *find(const gk_blob *blob, const char *name, section_type type, uint64_t *count)
{
    *count = 0;
    for (uint32_t i = 0; i < blob->sections; i++) {
        section s = section_at(blob, i);
        if (s.type == (uint32_t)type && !strcmp(s.name, name)) {
            *count = s.count;
            return blob->bytes + s.offset;
        }
    }
    return NULL;
}

const double *gk_blob_f64(const gk_blob *blob, const char *name, uint64_t *count)
{
    GK_ASSERT(blob && name && count);
    return find(blob, name, F64, count);
}
const float *gk_blob_f32(const gk_blob *blob, const char *name, uint64_t *count)
{
    GK_ASSERT(blob && name && count);
    return find(blob, name, F32, count);
}
const int32_t *gk_blob_i32(const gk_blob *blob, const char *name, uint64_t *count)
{
    GK_ASSERT(blob && name && count);
    return find(blob, name, I32, count);
}
const char *gk_blob_text(const gk_blob *blob, const char *name, uint64_t *count)
{
    GK_ASSERT(blob && name && count);
    return find(blob, name, TEXT, count);
}
