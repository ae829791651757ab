/* Difference image to slopes, between what the network answers: `linearised.py` has the formulas. */
#include "frame_path.h"

/* Rows (n, 5) of the network for the chosen cells: mean difference of three channels, x and y of the middle in px.
 * Returns n; index: (n) which cell each row is. */
EXPORT int cell_rows(const float *means, const uint8_t *chosen, int32_t *index, float *rows, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), columns = 2 * ((width + 7) / 8);
    const ptrdiff_t plane = (ptrdiff_t)columns * 2 * ((height + 7) / 8);
    int count = 0;
    for (int i = 0; i < h; i++)
        for (int j = 0; j < w; j++) {
            if (!chosen[i * w + j]) continue;
            float *row = rows + 5 * (ptrdiff_t)count;
            for (int c = 0; c < 3; c++) row[c] = means[c * plane + i * columns + j];
            row[3] = (float)(CELL * j) + 1.5f;
            row[4] = (float)(CELL * i) + 1.5f;
            index[count++] = i * w + j;
        }
    return count;
}

/* The same for every 2 x 2 cells, whose places are in `rows` already. */
EXPORT void coarse_rows(const float *means, float *rows, int width, int height) {
    const int columns = 2 * ((width + 7) / 8), lines = 2 * ((height + 7) / 8);
    for (int i = 0; i < lines / 2; i++)
        for (int j = 0; j < columns / 2; j++)
            for (int c = 0; c < 3; c++) {
                const float *m = means + ((ptrdiff_t)c * lines + 2 * i) * columns + 2 * j;
                rows[5 * ((ptrdiff_t)i * (columns / 2) + j) + c] = (m[0] + m[1] + m[columns] + m[columns + 1]) * 0.25f;
            }
}

/* Keep what the network answers to `count` rows of cells as 11 planes (h, w): g - J m / 2 of both slopes, the mean m of
 * three channels, J of both slopes. slopes (n, 2), jacobian (n, 6), zero (h w, 2): its answer to no difference. */
EXPORT void store_cells(const int32_t *index, const float *rows, const float *slopes, const float *jacobian,
                        const float *zero, float *planes, int count, int width, int height) {
    const ptrdiff_t size = (ptrdiff_t)cells_of(width) * cells_of(height);
    for (int n = 0; n < count; n++) {
        const float *m = rows + 5 * (ptrdiff_t)n;
        float *cell = planes + index[n];
        for (int o = 0; o < 2; o++) {
            const float *j = jacobian + 6 * (ptrdiff_t)n + 3 * o;
            const float g = slopes[2 * (ptrdiff_t)n + o] - zero[2 * (ptrdiff_t)index[n] + o];
            cell[o * size] = g - 0.5f * (j[0] * m[0] + j[1] * m[1] + j[2] * m[2]);
            for (int c = 0; c < 3; c++) cell[(5 + 3 * o + c) * size] = j[c];
        }
        for (int c = 0; c < 3; c++) cell[(2 + c) * size] = m[c];
    }
}

/* One row of slopes from the means of 8 x 8 pixels, linear in between. coarse: (h8 w8, 2) slopes less zero. */
static void gentle_row(const float *coarse, int y, float *const out[2], float *work, int width, int height) {
    const int w = (width + 7) / 8, h = (height + 7) / 8, i = (2 * y + 9) / 16 - 1;
    const float share = ((float)y + 0.5f) / 8 - 0.5f - (float)i;
    const float *above = coarse + 2 * (ptrdiff_t)clamped(i, h) * w, *below = coarse + 2 * (ptrdiff_t)clamped(i + 1, h) * w;
    for (int o = 0; o < 2; o++) {
        float *restrict cells = work + 1, *restrict to = out[o];
        for (int j = 0; j < w; j++) cells[j] = above[2 * j + o] + share * (below[2 * j + o] - above[2 * j + o]);
        cells[-1] = cells[0];
        cells[w] = cells[w - 1];
        float *pixels = work + w + 2;
        for (int j = 0; j < w; j++) {
            const float here = cells[j], left = cells[j - 1] - here, right = cells[j + 1] - here;
            for (int p = 0; p < 4; p++) pixels[8 * j + p] = here + (3.5f - (float)p) / 8 * left;
            for (int p = 4; p < 8; p++) pixels[8 * j + p] = here + ((float)p - 3.5f) / 8 * right;
        }
        for (int x = 0; x < width; x++) to[x] = pixels[x];
    }
}

/* slope = q + J (d - m / 2) for `count` pixels; pixels: 11 rows, `stride` apart. single: where |d - m| > limit. */
static void blend_run(const float *restrict d, const float *restrict pixels, ptrdiff_t stride, float limit,
                      float *restrict gx, float *restrict gy, uint8_t *restrict single, int count) {
    const float *restrict qx = pixels, *restrict qy = pixels + stride, *restrict m0 = pixels + 2 * stride,
                *restrict m1 = pixels + 3 * stride, *restrict m2 = pixels + 4 * stride,
                *restrict x0 = pixels + 5 * stride, *restrict x1 = pixels + 6 * stride,
                *restrict x2 = pixels + 7 * stride, *restrict y0 = pixels + 8 * stride,
                *restrict y1 = pixels + 9 * stride, *restrict y2 = pixels + 10 * stride;
    for (int x = 0; x < count; x++) {
        const float a0 = d[3 * x] - 0.5f * m0[x], a1 = d[3 * x + 1] - 0.5f * m1[x], a2 = d[3 * x + 2] - 0.5f * m2[x];
        gx[x] = qx[x] + x0[x] * a0 + x1[x] * a1 + x2[x] * a2;
        gy[x] = qy[x] + y0[x] * a0 + y1[x] * a1 + y2[x] * a2;
        const float away = larger(larger(__builtin_fabsf(a0 - 0.5f * m0[x]), __builtin_fabsf(a1 - 0.5f * m1[x])),
                                  __builtin_fabsf(a2 - 0.5f * m2[x]));
        single[x] = away > limit;
    }
}

/* Slopes of all pixels, two planes: outside the touched cells from coarse means, inside blended between cells.
 *
 * Returns how many pixels differ from the mean around them by more than `limit`; index: which. The caller asks the network
 * for those. coarse: not read where all cells are touched. work: 14 (width + 16); flags: width + 4 bytes. */
EXPORT int blend(const float *difference, const uint8_t *touched, int touched_count, const float *planes,
                 const float *coarse, float limit, float *slopes, int32_t *index, float *work, uint8_t *flags, int width,
                 int height) {
    const int w = cells_of(width), h = cells_of(height);
    const ptrdiff_t size = (ptrdiff_t)w * h, plane = (ptrdiff_t)width * height, stride = width + 16;
    float *cells = work + 11 * stride;
    int found = 0;
    for (int y = 0; y < height; y++) {
        float *const out[2] = {slopes + (ptrdiff_t)y * width, slopes + plane + (ptrdiff_t)y * width};
        const uint8_t *mask = touched + (ptrdiff_t)(y / CELL) * w;
        if (touched_count < w * h) gentle_row(coarse, y, out, cells, width, height);
        for (int first = 0, last; first < w; first = last) {
            for (last = first; last < w && mask[last] == mask[first]; last++);
            if (!mask[first]) continue;
            for (int k = 0; k < 11; k++) {
                between_rows(planes + k * size, CELL, y, h, w, first, last, cells);
                between_columns(cells, last - first, work + k * stride);
            }
            const int x0 = CELL * first, count = (CELL * last < width ? CELL * last : width) - x0;
            const float *d = difference + 3 * ((ptrdiff_t)y * width + x0);
            blend_run(d, work, stride, limit, out[0] + x0, out[1] + x0, flags, count);
            for (int x = 0; x < count; x++)
                if (flags[x]) index[found++] = y * width + x0 + x;
        }
    }
    return found;
}

/* Rows (count, 5) of the network for single pixels. */
EXPORT void pixel_rows(const float *difference, const int32_t *index, float *rows, int count, int width) {
    for (int n = 0; n < count; n++) {
        const float *d = difference + 3 * (ptrdiff_t)index[n];
        float *row = rows + 5 * (ptrdiff_t)n;
        for (int c = 0; c < 3; c++) row[c] = d[c];
        row[3] = (float)(index[n] % width);
        row[4] = (float)(index[n] / width);
    }
}

/* Keep what the network answers to them, (count, 2), less its answer to no difference, zero (height width, 2). */
EXPORT void store_pixels(const int32_t *index, const float *answer, const float *zero, float *slopes, int count, int width,
                         int height) {
    const ptrdiff_t plane = (ptrdiff_t)width * height;
    for (int n = 0; n < count; n++)
        for (int o = 0; o < 2; o++)
            slopes[o * plane + index[n]] = answer[2 * (ptrdiff_t)n + o] - zero[2 * (ptrdiff_t)index[n] + o];
}
