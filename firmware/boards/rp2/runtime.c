/* What compilers call by themselves, under the names of C and of the Arm run-time ABI, so that no library is needed. */
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *to, const void *from, size_t count);
void *memset(void *to, int value, size_t count);
void __aeabi_memcpy(void *to, const void *from, size_t count);
void __aeabi_memcpy4(void *to, const void *from, size_t count);
void __aeabi_memclr(void *to, size_t count);
void __aeabi_memclr4(void *to, size_t count);
void __aeabi_memclr8(void *to, size_t count);

uint32_t __aeabi_uidiv(uint32_t numerator, uint32_t denominator);
uint64_t __aeabi_uidivmod(uint32_t numerator, uint32_t denominator);
int64_t __aeabi_lmul(int64_t a, int64_t b);

/* Volatile, or the compiler would recognise the loop and call the function itself. */
void *memcpy(void *to, const void *from, size_t count)
{
    volatile uint8_t *out = to;
    const uint8_t *in = from;
    while (count--)
        *out++ = *in++;
    return to;
}

void *memset(void *to, int value, size_t count)
{
    volatile uint8_t *out = to;
    while (count--)
        *out++ = (uint8_t)value;
    return to;
}

void __aeabi_memcpy(void *to, const void *from, size_t count)
{
    memcpy(to, from, count);
}

void __aeabi_memcpy4(void *to, const void *from, size_t count)
{
    memcpy(to, from, count);
}

void __aeabi_memclr(void *to, size_t count)
{
    memset(to, 0, count);
}

void __aeabi_memclr4(void *to, size_t count)
{
    memset(to, 0, count);
}

void __aeabi_memclr8(void *to, size_t count)
{
    memset(to, 0, count);
}

/* Remainder in the high half, quotient in the low half; division by zero gives zero, as on cores that can divide. */
uint64_t __aeabi_uidivmod(uint32_t numerator, uint32_t denominator)
{
    uint32_t quotient = 0, remainder = 0;
    if (!denominator)
        return (uint64_t)numerator << 32;
    for (int bit = 31; bit >= 0; bit--) {
        uint32_t carry = remainder >> 31;
        remainder = remainder << 1 | (numerator >> bit & 1);
        if (carry || remainder >= denominator) {
            remainder -= denominator;
            quotient |= 1u << bit;
        }
    }
    return (uint64_t)remainder << 32 | quotient;
}

uint32_t __aeabi_uidiv(uint32_t numerator, uint32_t denominator)
{
    return (uint32_t)__aeabi_uidivmod(numerator, denominator);
}

/* 32 x 32 -> 64 from four products of 16 bits. */
static uint64_t product(uint32_t a, uint32_t b)
{
    uint32_t low = (a & 0xffff) * (b & 0xffff), high = (a >> 16) * (b >> 16);
    uint32_t cross = (a >> 16) * (b & 0xffff), other = (a & 0xffff) * (b >> 16);
    uint32_t middle = (low >> 16) + (cross & 0xffff) + (other & 0xffff);
    high += (cross >> 16) + (other >> 16) + (middle >> 16);
    return (uint64_t)high << 32 | (middle << 16 | (low & 0xffff));
}

int64_t __aeabi_lmul(int64_t a, int64_t b)
{
    uint32_t a_low = (uint32_t)a, b_low = (uint32_t)b;
    uint32_t a_high = (uint32_t)((uint64_t)a >> 32), b_high = (uint32_t)((uint64_t)b >> 32);
    uint64_t low = product(a_low, b_low);
    uint32_t high = (uint32_t)(low >> 32) + a_high * b_low + a_low * b_high;
    return (int64_t)((uint64_t)high << 32 | (uint32_t)low);
}
