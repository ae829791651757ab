/* GelNet, 5-32-32-32-32-2 with tanh after each layer and tan(steepest tanh) at the end, and its Jacobian in the colours,
 * for some rows at a time side by side in vectors. `network.py` packs the weights. */
#include "frame_path.h"

enum { INPUTS = 5, HIDDEN = 32, TILE = 8, COLOURS = 3 };
/* Numbers in a vector, and vectors side by side: as many as leave the sums of a tile of outputs in registers. */
#if defined(__AVX512F__)
enum { NUMBERS = 16, SIDE = 2 };
#elif defined(__AVX2__)
enum { NUMBERS = 8, SIDE = 1 };
#elif defined(__aarch64__)
enum { NUMBERS = 4, SIDE = 2 };
#else
enum { NUMBERS = 4, SIDE = 1 };
#endif
enum { TOGETHER = NUMBERS * SIDE };
typedef float Numbers __attribute__((vector_size(4 * NUMBERS), aligned(4 * NUMBERS)));
typedef int32_t Bits __attribute__((vector_size(4 * NUMBERS)));
typedef Numbers Units[HIDDEN][SIDE];

typedef struct {
    const float *in, *hidden[3], *out, *back_out, *back_hidden[3], *back_in, *bias[5];
    float steepest;
} Network;

/* Weights in the order of `network.py`: each layer, the layers backwards from the last but one, biases, steepest angle. */
static Network network_of(const float *p) {
    Network n;
    n.in = p, p += HIDDEN * INPUTS;
    for (int k = 0; k < 3; k++, p += HIDDEN * HIDDEN) n.hidden[k] = p;
    n.out = p, p += TILE * HIDDEN;
    for (int k = 0; k < 3; k++, p += HIDDEN * HIDDEN) n.back_hidden[k] = p;
    n.back_in = p, p += TILE * HIDDEN;
    for (int k = 0; k < 4; k++, p += HIDDEN) n.bias[k] = p;
    n.bias[4] = p, p += TILE;
    n.back_out = p, p += 2 * HIDDEN;
    n.steepest = *p;
    return n;
}

INLINE Numbers all(float a) { return a - (Numbers){0}; }

/* x, or `most` or -most where it is beyond. */
INLINE Numbers bounded(Numbers x, float most) {
#if __has_builtin(__builtin_elementwise_min)
    return __builtin_elementwise_min(__builtin_elementwise_max(x, all(-most)), all(most));
#else
    for (int k = 0; k < NUMBERS; k++) x[k] = smaller(larger(x[k], -most), most);
    return x;
#endif
}

/* 1 - 2 / (1 + e^2x), to 1e-7; e^2x = 2^(n + f), n whole, which the sum with 1.5 2^23 leaves in the lowest bits. */
INLINE Numbers tanh_of(Numbers x) {
    const Numbers rounding = all(12582912.0f), y = bounded(x, 10) * 2.88539008f;
    const Numbers t = y + rounding, f = y - (t - rounding);
    Numbers e = f * 1.33908634e-3f + 9.67603192e-3f;
    e = e * f + 5.55035711e-2f;
    e = e * f + 2.40221075e-1f;
    e = e * f + 6.93147188e-1f;
    e = e * f + 1.00000008f;
    e = (Numbers)((Bits)e + ((Bits)t << 23));
    return 1 - 2 / (1 + e);
}

/* sin / cos by their series, to 1e-7 for |a| < 1.5 */
INLINE Numbers tan_of(Numbers a) {
    const Numbers s = a * a;
    Numbers sine = s * 1.6059044e-10f - 2.5052108e-8f, cosine = s * -1.1470746e-11f + 2.0876757e-9f;
    sine = sine * s + 2.7557319e-6f, cosine = cosine * s - 2.7557319e-7f;
    sine = sine * s - 1.9841270e-4f, cosine = cosine * s + 2.4801587e-5f;
    sine = sine * s + 8.3333333e-3f, cosine = cosine * s - 1.3888889e-3f;
    sine = sine * s - 1.6666667e-1f, cosine = cosine * s + 4.1666667e-2f;
    sine = sine * s + 1, cosine = cosine * s - 0.5f;
    return a * sine / (cosine * s + 1);
}

/* out = weights in + bias, a tile of outputs at a time. */
INLINE void layer(const float *weights, const float *bias, int inputs, int outputs, Numbers (*const in)[SIDE], Numbers (*out)[SIDE]) {
    for (int o = 0; o < outputs; o += TILE, weights += TILE * inputs) {
        Numbers sum[TILE][SIDE];
        for (int q = 0; q < TILE; q++)
            for (int v = 0; v < SIDE; v++) sum[q][v] = all(bias[o + q]);
        for (int i = 0; i < inputs; i++)
            for (int q = 0; q < TILE; q++)
                for (int v = 0; v < SIDE; v++) sum[q][v] += weights[TILE * i + q] * in[i][v];
        for (int q = 0; q < TILE; q++)
            for (int v = 0; v < SIDE; v++) out[o + q][v] = sum[q][v];
    }
}

ONCE void hidden_layer(const float *weights, const float *bias, Numbers (*const in)[SIDE], Units out) {
    layer(weights, bias, HIDDEN, HIDDEN, in, out);
}

ONCE void bend(Units units) {
    for (int k = 0; k < HIDDEN; k++)
        for (int v = 0; v < SIDE; v++) units[k][v] = tanh_of(units[k][v]);
}

/* What is behind a layer of tanh times its derivative, 1 - tanh^2. */
INLINE void through(Units back, Numbers (*const units)[SIDE]) {
    for (int k = 0; k < HIDDEN; k++)
        for (int v = 0; v < SIDE; v++) back[k][v] *= 1 - units[k][v] * units[k][v];
}

/* All layers of rows (TOGETHER, 5); bent: (2) the last tanh. */
ONCE void forwards(const Network *n, const float *rows, Units *units, Numbers (*bent)[SIDE]) {
    Numbers in[INPUTS][SIDE], out[TILE][SIDE];
    for (int c = 0; c < INPUTS; c++)
        for (int r = 0; r < TOGETHER; r++) in[c][r / NUMBERS][r % NUMBERS] = rows[INPUTS * r + c];
    layer(n->in, n->bias[0], INPUTS, HIDDEN, in, units[0]);
    bend(units[0]);
    for (int k = 0; k < 3; k++) {
        hidden_layer(n->hidden[k], n->bias[k + 1], units[k], units[k + 1]);
        bend(units[k + 1]);
    }
    layer(n->out, n->bias[4], HIDDEN, TILE, units[3], out);
    for (int o = 0; o < 2; o++)
        for (int v = 0; v < SIDE; v++) bent[o][v] = tanh_of(out[o][v]);
}

/* The rows from `at` on, the last of `count` again where there are no more. */
INLINE const float *rows_at(const float *rows, int at, int count, float *copy) {
    if (at + TOGETHER <= count) return rows + INPUTS * (ptrdiff_t)at;
    for (int r = 0; r < TOGETHER; r++)
        for (int c = 0; c < INPUTS; c++) copy[INPUTS * r + c] = rows[INPUTS * (ptrdiff_t)smaller_int(at + r, count - 1) + c];
    return copy;
}

/* Slopes (count, 2) of rows (count, 5). */
EXPORT void network_slopes(const float *weights, const float *rows, float *slopes, int count) {
    const Network n = network_of(weights);
    float copy[INPUTS * TOGETHER];
    Units units[4];
    Numbers bent[2][SIDE];
    for (int at = 0; at < count; at += TOGETHER) {
        forwards(&n, rows_at(rows, at, count, copy), units, bent);
        for (int o = 0; o < 2; o++)
            for (int v = 0; v < SIDE; v++) bent[o][v] = tan_of(n.steepest * bent[o][v]);
        for (int r = 0; r < smaller_int(TOGETHER, count - at); r++)
            for (int o = 0; o < 2; o++) slopes[2 * (ptrdiff_t)(at + r) + o] = bent[o][r / NUMBERS][r % NUMBERS];
    }
}

/* Slopes (count, 2) of rows (count, 5), and d(slope x)/d(colours), d(slope y)/d(colours), (count, 6). */
EXPORT void network_jacobian(const float *weights, const float *rows, float *slopes, float *jacobian, int count) {
    const Network n = network_of(weights);
    float copy[INPUTS * TOGETHER];
    const float no_bias[HIDDEN] = {0};
    Units units[4], back, before;
    Numbers bent[2][SIDE], colours[TILE][SIDE];
    for (int at = 0; at < count; at += TOGETHER) {
        const int rest = smaller_int(TOGETHER, count - at);
        forwards(&n, rows_at(rows, at, count, copy), units, bent);
        for (int o = 0; o < 2; o++) {
            for (int v = 0; v < SIDE; v++) {
                const Numbers slope = tan_of(n.steepest * bent[o][v]);
                const Numbers change = n.steepest * (1 + slope * slope) * (1 - bent[o][v] * bent[o][v]);
                bent[o][v] = slope;
                for (int k = 0; k < HIDDEN; k++) back[k][v] = change * n.back_out[o * HIDDEN + k];
            }
            through(back, units[3]);
            hidden_layer(n.back_hidden[2], no_bias, back, before);
            through(before, units[2]);
            hidden_layer(n.back_hidden[1], no_bias, before, back);
            through(back, units[1]);
            hidden_layer(n.back_hidden[0], no_bias, back, before);
            through(before, units[0]);
            layer(n.back_in, no_bias, HIDDEN, TILE, before, colours);
            for (int r = 0; r < rest; r++) {
                slopes[2 * (ptrdiff_t)(at + r) + o] = bent[o][r / NUMBERS][r % NUMBERS];
                for (int c = 0; c < COLOURS; c++)
                    jacobian[6 * (ptrdiff_t)(at + r) + 3 * o + c] = colours[c][r / NUMBERS][r % NUMBERS];
            }
        }
    }
}
