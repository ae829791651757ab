/* Cosine transforms of rows, type 2 and back, orthonormal, of some rows at a time side by side in vectors.
 *
 * After Makhoul (1980) a row of n numbers x, n even, is put in the order v = x[0], x[2], ... x[3], x[1]; two of them make a
 * complex number, and these m = n / 2 go through a Fourier transform (Stockham's, which leaves them in order). With Z what
 * comes out, X[k] - i X[n - k] = a[k] Z[k] + b[k] conj Z[m - k]. Back it is the same the other way round.
 * `cosine.py` has the factors. */
#include "frame_path.h"

/* Rows at a time: with more the numbers of a row would not stay in the nearest cache. */
#if defined(__AVX2__)
enum { ROWS = 8 };
#else
enum { ROWS = 4 };
#endif
typedef float Numbers __attribute__((vector_size(4 * ROWS), aligned(4 * ROWS)));

typedef struct {
    Numbers re, im;
} Complex;

INLINE Complex sum_of(Complex a, Complex b) { return (Complex){a.re + b.re, a.im + b.im}; }
INLINE Complex less(Complex a, Complex b) { return (Complex){a.re - b.re, a.im - b.im}; }
INLINE Complex times(Complex a, float re, float im) { return (Complex){a.re * re - a.im * im, a.re * im + a.im * re}; }
INLINE Complex scaled(Complex a, float by) { return (Complex){a.re * by, a.im * by}; }
INLINE Complex by_minus_i(Complex a) { return (Complex){a.im, -a.re}; }

/* Fourier transform of 2 to 5 numbers, in place. */
INLINE void short_transform(Complex *a, int radix) {
    if (radix == 2) {
        const Complex first = a[0];
        a[0] = sum_of(first, a[1]), a[1] = less(first, a[1]);
    } else if (radix == 3) {
        const Complex both = sum_of(a[1], a[2]), turned = by_minus_i(scaled(less(a[1], a[2]), 0.866025404f));
        const Complex rest = less(a[0], scaled(both, 0.5f));
        a[0] = sum_of(a[0], both), a[1] = sum_of(rest, turned), a[2] = less(rest, turned);
    } else if (radix == 4) {
        const Complex even = sum_of(a[0], a[2]), odd = sum_of(a[1], a[3]), across = less(a[0], a[2]);
        const Complex turned = by_minus_i(less(a[1], a[3]));
        a[0] = sum_of(even, odd), a[1] = sum_of(across, turned), a[2] = less(even, odd), a[3] = less(across, turned);
    } else {
        const Complex s1 = sum_of(a[1], a[4]), s2 = sum_of(a[2], a[3]), d1 = less(a[1], a[4]), d2 = less(a[2], a[3]);
        const Complex c1 = sum_of(a[0], sum_of(scaled(s1, 0.309016994f), scaled(s2, -0.809016994f)));
        const Complex c2 = sum_of(a[0], sum_of(scaled(s1, -0.809016994f), scaled(s2, 0.309016994f)));
        const Complex t1 = by_minus_i(sum_of(scaled(d1, 0.951056516f), scaled(d2, 0.587785252f)));
        const Complex t2 = by_minus_i(less(scaled(d1, 0.587785252f), scaled(d2, 0.951056516f)));
        a[0] = sum_of(a[0], sum_of(s1, s2));
        a[1] = sum_of(c1, t1), a[2] = sum_of(c2, t2), a[3] = less(c2, t2), a[4] = less(c1, t1);
    }
}

/* One pass over m numbers: transforms of `radix` of them, m / radix apart, then turned. `stride` transforms lie side by side. */
INLINE void pass(const Complex *restrict in, Complex *restrict out, const float *turns, int radix, int m, int stride) {
    const int apart = m / radix;
    for (int p = 0; p < apart / stride; p++, turns += 2 * (radix - 1))
        for (int q = 0; q < stride; q++) {
            Complex a[5];
            for (int k = 0; k < radix; k++) a[k] = in[q + stride * p + apart * k];
            short_transform(a, radix);
            Complex *to = out + q + stride * radix * p;
            to[0] = a[0];
            for (int j = 1; j < radix; j++) to[stride * j] = times(a[j], turns[2 * j - 2], turns[2 * j - 1]);
        }
}

/* Fourier transform of m numbers, whose radices end with 0; returns where it lies: in a or b, the other is work. */
static Complex *transform(Complex *a, Complex *b, const int32_t *radices, const float *turns, int m) {
    for (int stride = 1; *radices; stride *= *radices++) {
        if (*radices == 2) pass(a, b, turns, 2, m, stride);
        if (*radices == 3) pass(a, b, turns, 3, m, stride);
        if (*radices == 4) pass(a, b, turns, 4, m, stride);
        if (*radices == 5) pass(a, b, turns, 5, m, stride);
        turns += 2 * (*radices - 1) * (m / *radices / stride);
        Complex *swap = a;
        a = b;
        b = swap;
    }
    return a;
}

/* a[k] z + b[k] conj y; ends: (m + 1, 4), a and b. */
INLINE Complex joined(const float *ends, Complex z, Complex y) {
    const Complex first = times(z, ends[0], ends[1]), second = times((Complex){y.re, -y.im}, ends[2], ends[3]);
    return sum_of(first, second);
}

#if defined(__AVX2__)
#define LOWER(a, b) __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11)
#define UPPER(a, b) __builtin_shufflevector(a, b, 4, 12, 5, 13, 6, 14, 7, 15)
#else
#define LOWER(a, b) __builtin_shufflevector(a, b, 0, 4, 1, 5)
#define UPPER(a, b) __builtin_shufflevector(a, b, 2, 6, 3, 7)
#endif

/* Transpose a square of vectors: each shuffle moves the highest bit of a number's row behind the bits of its column. */
INLINE void transpose_square(Numbers *square) {
    Numbers other[ROWS], *from = square, *to = other;
    for (int moved = 1; moved < ROWS; moved *= 2) {
        for (int r = 0; r < ROWS / 2; r++) {
            to[2 * r] = LOWER(from[r], from[r + ROWS / 2]);
            to[2 * r + 1] = UPPER(from[r], from[r + ROWS / 2]);
        }
        Numbers *swap = from;
        from = to;
        to = swap;
    }
    if (from != square) __builtin_memcpy(square, other, sizeof other);
}

/* Where number x of a row lies: there, or in the order of v with the two numbers of a pair exchanged or not. */
enum { PLAIN, PAIRS, EXCHANGED };
INLINE int place_of(int x, int order, int n) {
    if (order == PLAIN) return x;
    return (x % 2 ? n - 1 - x / 2 : x / 2) ^ (order == EXCHANGED);
}

/* The rows from `first` on, the last of them again where there are no more, to vectors of columns. n >= ROWS */
INLINE void columns_of(const float *all, int first, int order, Numbers *columns, int n, int rows) {
    for (int x = 0; x < n; x += ROWS) {
        Numbers square[ROWS];
        const int at = smaller_int(x, n - ROWS);
        for (int r = 0; r < ROWS; r++)
            __builtin_memcpy(&square[r], all + (ptrdiff_t)smaller_int(first + r, rows - 1) * n + at, sizeof square[r]);
        transpose_square(square);
        for (int r = 0; r < ROWS; r++) columns[place_of(at + r, order, n)] = square[r];
    }
}

/* Vectors of columns to the rows from `first` on. */
INLINE void rows_of(const Numbers *columns, int first, int order, float *all, int n, int rows) {
    for (int x = 0; x < n; x += ROWS) {
        Numbers square[ROWS];
        const int at = smaller_int(x, n - ROWS);
        for (int r = 0; r < ROWS; r++) square[r] = columns[place_of(at + r, order, n)];
        transpose_square(square);
        for (int r = 0; r < smaller_int(ROWS, rows - first); r++)
            __builtin_memcpy(all + (ptrdiff_t)(first + r) * n + at, &square[r], sizeof square[r]);
    }
}

/* Type 2 of (rows, n), in place, n >= ROWS. factors: (m + 1, 4), then what each pass turns by. work: 3 n vectors. */
EXPORT void cosines(float *all, const int32_t *radices, const float *factors, float *work, int n, int rows) {
    const int m = n / 2;
    Numbers *in = (Numbers *)work, *out = in + 2 * n;
    for (int first = 0; first < rows; first += ROWS) {
        columns_of(all, first, PAIRS, in, n, rows);
        const Complex *z = transform((Complex *)in, (Complex *)(in + n), radices, factors + 4 * (m + 1), m);
        for (int k = 0; k <= m; k++) {
            const Complex both = joined(factors + 4 * k, z[k < m ? k : 0], z[k ? m - k : 0]);
            if (k) out[n - k] = -both.im;
            out[k] = both.re;
        }
        rows_of(out, first, PLAIN, all, n, rows);
    }
}

/* The way back: (rows, n) in place. */
EXPORT void from_cosines(float *all, const int32_t *radices, const float *factors, float *work, int n, int rows) {
    const int m = n / 2;
    Numbers *in = (Numbers *)work + 2 * n;
    Complex *a = (Complex *)work;
    for (int first = 0; first < rows; first += ROWS) {
        columns_of(all, first, PLAIN, in, n, rows);
        for (int k = 0; k < m; k++) {
            const Complex y = {in[k], k ? -in[n - k] : in[0] * 0}, other = {in[m - k], k ? -in[m + k] : -in[m]};
            const Complex z = joined(factors + 4 * k, y, other);
            a[k] = (Complex){z.im, z.re}; /* parts exchanged, there and back: the transform runs backwards */
        }
        const Complex *z = transform(a, a + m, radices, factors + 4 * (m + 1), m);
        rows_of((const Numbers *)z, first, EXCHANGED, all, n, rows);
    }
}
