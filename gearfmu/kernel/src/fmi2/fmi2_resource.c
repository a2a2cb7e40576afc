/* From fmi2Instantiate's resource location to the bytes of resources/model.gkb. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "fmi2/fmi2_face.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>
#if defined(_WIN32)
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

#define PATH_BYTES 4096
#define FILE_NAME "model.gkb"

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/* %41 → A (RFC 3986); 0 when a digit is missing, a NUL is hidden in it, or the result does not fit. */
static int percent_decode(const char *from, char *to, size_t room)
{
    for (; *from; from++) {
        if (room-- <= 1) return 0;
        if (*from != '%') {
            *to++ = *from;
            continue;
        }
        int high = hex_digit(from[1]), low = high < 0 ? -1 : hex_digit(from[2]);
        if (low < 0 || (high | low) == 0) return 0;
        *to++ = (char)(high * 16 + low);
        from += 2;
    }
    *to = '\0';
    return 1;
}

/* file:///p, file:/p, file://localhost/p and a plain path; on Windows also file:///C:/p and file://server/share. */
static int path_of(const char *location, char *path, size_t room)
{
    int is_uri = strncmp(location, "file:", 5) == 0;
    const char *rest = is_uri ? location + 5 : location;
    if (is_uri && strncmp(rest, "//", 2) == 0) {
        const char *host = rest + 2;
        if (strncmp(host, "localhost/", 10) == 0) host += 9;
#if defined(_WIN32)
        if (*host == '/') rest = host; /* else a server: keep both slashes */
#else
        rest = host;
#endif
    }
#if defined(_WIN32)
    if (is_uri && rest[0] == '/' && rest[1] != '\0' && rest[2] == ':') rest++;
#endif
    if (is_uri ? !percent_decode(rest, path, room) : strlen(rest) + 1 > room) return 0;
    if (!is_uri) memcpy(path, rest, strlen(rest) + 1);
    size_t n = strlen(path);
    while (n > 1 && (path[n - 1] == '/' || path[n - 1] == '\\')) path[--n] = '\0';
    if (n == 0 || n + sizeof FILE_NAME + 1 > room) return 0;
    memcpy(path + n, "/" FILE_NAME, sizeof FILE_NAME + 1);
    return 1;
}

static FILE *open_utf8(const char *path)
{
#if defined(_WIN32)
    wchar_t wide[PATH_BYTES];
    if (!MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, PATH_BYTES)) return NULL;
    for (wchar_t *c = wide; *c; c++)
        if (*c == L'/') *c = L'\\';
    return _wfopen(wide, L"rb");
#else
    return fopen(path, "rb");
#endif
}

static long file_size(FILE *file)
{
    if (fseek(file, 0, SEEK_END)) return -1;
    long size = ftell(file);
    return fseek(file, 0, SEEK_SET) ? -1 : size;
}

void *face_read_model(fmi2String location, const fmi2CallbackFunctions *environment, const unsigned char **bytes,
                      size_t *size, char message[GK_MESSAGE])
{
    char path[PATH_BYTES];
    if (!location || !path_of(location, path, sizeof path)) {
        snprintf(message, GK_MESSAGE, "fmuResourceLocation %.300s is not a file URI of the unpacked resources folder",
                 location ? location : "(null)");
        return NULL;
    }
    FILE *file = open_utf8(path);
    if (!file) {
        snprintf(message, GK_MESSAGE, "cannot open %.400s (%s): unpack the FMU again", path, strerror(errno));
        return NULL;
    }
    long length = file_size(file);
    void *block = length > 0 ? face_allocate(environment, (size_t)length + FACE_ALIGNMENT) : NULL;
    unsigned char *start = block ? face_align(block) : NULL;
    size_t got = start ? fread(start, 1, (size_t)length, file) : 0;
    fclose(file);
    if (!start || got != (size_t)length) {
        snprintf(message, GK_MESSAGE, "cannot read %.400s (%ld bytes, %zu read): unpack the FMU again", path, length,
                 got);
        face_release(environment, block);
        return NULL;
    }
    *bytes = start;
    *size = got;
    return block;
}
