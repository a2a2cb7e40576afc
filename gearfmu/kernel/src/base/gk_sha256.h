/* SHA-256 (FIPS 180-4) of one block of memory. */
#ifndef GK_SHA256_H
#define GK_SHA256_H
#include <stddef.h>
void gk_sha256(const void *bytes, size_t size, unsigned char digest[32]);
#endif
