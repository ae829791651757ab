/* Filters of planes, and means over cells, for `smoothing.c`. */
#ifndef GELLIGHT_FILTERS_H
#define GELLIGHT_FILTERS_H

#include "frame_path.h"

/* Columns left to right - 1 of row y of a plane through a symmetric filter along both axes, borders continued. taps: from
 * the middle outwards; padded: right - left + 2 reach + 32. */
INLINE void filter_row(const float *plane, ptrdiff_t stride, int y, const float *taps, int reach, float *restrict padded,
                       float *restrict out, int left, int right, int width, int height) {
    const float *restrict row = plane + y * stride;
    const int beside = (reach + 15) / 16 * 16; /* so that vectors are full */
    float *restrict down = padded + beside - left;
    const int begin = larger_int(left - beside, 0), end = smaller_int(right + beside, width);
    if (y >= reach && y < height - reach)
        for (int x = begin; x < end; x++) {
            float sum = taps[0] * row[x];
            for (int k = 1; k <= reach; k++) sum += taps[k] * (row[x - k * stride] + row[x + k * stride]);
            down[x] = sum;
        }
    else {
        for (int x = begin; x < end; x++) down[x] = taps[0] * row[x];
        for (int k = 1; k <= reach; k++) {
            const float *restrict above = plane + clamped(y - k, height) * stride;
            const float *restrict below = plane + clamped(y + k, height) * stride;
            for (int x = begin; x < end; x++) down[x] += taps[k] * (above[x] + below[x]);
        }
    }
    for (int x = left - reach; x < 0; x++) down[x] = down[0];
    for (int x = width; x < right + reach; x++) down[x] = down[width - 1];
    for (int x = left; x < right; x++) {
        float sum = taps[0] * down[x];
        for (int k = 1; k <= reach; k++) sum += taps[k] * (down[x - k] + down[x + k]);
        out[x] = sum;
    }
}

/* The common widths get loops of a known length, which is twice as fast. */
ONCE void smooth_row(const float *plane, ptrdiff_t stride, int y, const float *taps, int reach, float *padded, float *out,
                       int left, int right, int width, int height) {
    switch (reach) {
        case 2: filter_row(plane, stride, y, taps, 2, padded, out, left, right, width, height); break;
        case 3: filter_row(plane, stride, y, taps, 3, padded, out, left, right, width, height); break;
        case 5: filter_row(plane, stride, y, taps, 5, padded, out, left, right, width, height); break;
        case 9: filter_row(plane, stride, y, taps, 9, padded, out, left, right, width, height); break;
        default: filter_row(plane, stride, y, taps, reach, padded, out, left, right, width, height);
    }
}

/* Means over a row of cells, from what each column of pixels sums up to over `tall` rows; the last cell may be cut. */
INLINE void cell_means(const float *restrict sums, float *restrict cells, int tall, int width) {
    const int whole = width / CELL, rest = width - CELL * whole;
    const float scale = 1.0f / (float)(CELL * tall);
    for (int j = 0; j < whole; j++)
        cells[j] = scale * ((sums[4 * j] + sums[4 * j + 1]) + (sums[4 * j + 2] + sums[4 * j + 3]));
    if (!rest) return;
    float sum = 0;
    for (int x = CELL * whole; x < width; x++) sum += sums[x];
    cells[whole] = sum / (float)(rest * tall);
}

INLINE int mirrored(int i, int n) {
    while (i < 0 || i >= n) i = i < 0 ? -1 - i : 2 * n - 1 - i;
    return i;
}

/* Row i of the mean over 2 reach + 1 cells a side, mirrored at the border. padded: w + 2 reach. */
INLINE void box_row(const float *cells, int i, int reach, float *restrict padded, float *restrict out, int w, int h) {
    float *restrict sums = padded + reach;
    for (int j = 0; j < w; j++) sums[j] = 0;
    for (int k = -reach; k <= reach; k++) {
        const float *restrict row = cells + (ptrdiff_t)mirrored(i + k, h) * w;
        for (int j = 0; j < w; j++) sums[j] += row[j];
    }
    for (int k = 1; k <= reach; k++) {
        sums[-k] = sums[mirrored(-k, w)];
        sums[w - 1 + k] = sums[mirrored(w - 1 + k, w)];
    }
    const float scale = 1.0f / (float)((2 * reach + 1) * (2 * reach + 1));
    for (int j = 0; j < w; j++) out[j] = sums[j - reach];
    for (int k = -reach + 1; k <= reach; k++)
        for (int j = 0; j < w; j++) out[j] += sums[j + k];
    for (int j = 0; j < w; j++) out[j] *= scale;
}

#endif
