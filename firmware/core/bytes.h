/* Copying and clearing without a C library; compilers turn these into their own best code. */
#ifndef GELLIGHT_BYTES_H
#define GELLIGHT_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

static inline void bytes_copy(void *to, const void *from, size_t count)
{
    uint8_t *out = to;
    const uint8_t *in = from;
    while (count--)
        *out++ = *in++;
}

static inline void bytes_fill(void *to, uint8_t value, size_t count)
{
    uint8_t *out = to;
    while (count--)
        *out++ = value;
}

static inline bool bytes_equal(const void *a, const void *b, size_t count)
{
    const uint8_t *x = a, *y = b;
    while (count--)
        if (*x++ != *y++)
            return false;
    return true;
}

#endif
