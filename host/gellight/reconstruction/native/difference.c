/* Camera frame to difference image, to means over cells, to the mask of touched cells. */
#include "frame_path.h"

/* difference = image - reference - shift, (height, width, 3) grey levels; shift: (width, 3), the drift of the light.
 *
 * means: planes (3, rows, columns) of the mean over each cell, rows and columns even so that 2 x 2 cells make one of 8 x 8
 * pixels; beyond the image its last row and column continue. work: 3 width. (`light_drift.py`, `gelnet.cell_means`) */
EXPORT void difference_and_means(const uint8_t *image, const float *reference, const float *shift, float *difference,
                                 float *means, float *work, int width, int height) {
    const int columns = 2 * ((width + 7) / 8), rows = 2 * ((height + 7) / 8), wide = 3 * width;
    for (int i = 0; i < rows; i++) {
        for (int x = 0; x < wide; x++) work[x] = 0;
        for (int y = CELL * i; y < CELL * (i + 1); y++) {
            const ptrdiff_t at = (ptrdiff_t)clamped(y, height) * wide;
            const uint8_t *restrict seen = image + at;
            const float *restrict rest = reference + at;
            float *restrict out = difference + at, *restrict sum = work;
            for (int x = 0; x < wide; x++) {
                const float d = (float)seen[x] - rest[x] - shift[x];
                out[x] = d;
                sum[x] += d;
            }
        }
        const int whole = width / CELL;
        for (int c = 0; c < 3; c++) {
            float *restrict out = means + ((ptrdiff_t)c * rows + i) * columns;
            const float *s = work + c;
            for (int j = 0; j < whole; j++)
                out[j] = (s[12 * j] + s[12 * j + 3] + s[12 * j + 6] + s[12 * j + 9]) * (1.0f / 16);
            for (int j = whole; j < columns; j++) {
                out[j] = 0;
                for (int x = CELL * j; x < CELL * (j + 1); x++) out[j] += s[3 * clamped(x, width)] * (1.0f / 16);
            }
        }
    }
}

/* The sums of `side` cells down, for row i of the three channels: with the row above from 2 on, and the one below at 3.
 * sums: w + 2 for each channel. At the border the cells beyond it are those that move the square inwards: a cell that
 * counted twice would bring twice its noise. */
INLINE void sum_down(const float *means, int side, int i, int columns, int rows, float *sums, int w, int h) {
    for (int c = 0; c < 3; c++) {
        const float *plane = means + (ptrdiff_t)c * rows * columns, *row = plane + (ptrdiff_t)i * columns;
        const float *above = plane + (ptrdiff_t)(i > 0 ? i - 1 : side - 1) * columns;
        const float *below = plane + (ptrdiff_t)(i < h - 1 ? i + 1 : h - side) * columns;
        float *restrict sum = sums + c * (w + 2) + 1;
        for (int j = 0; j < w; j++) sum[j] = row[j] + (side > 1 ? above[j] : 0) + (side > 2 ? below[j] : 0);
        sum[-1] = sum[side - 1];
        sum[w] = sum[w - side];
    }
}

/* Mark the cells of one row where the mean m over side x side cells is too large to be noise:
 * sum over channels m^2 > limits[0]^2 and max |m| > limits[1]. sums: as sum_down left them. */
INLINE void mark_row(const float *sums, int side, const float *limits, uint8_t *restrict marked, int w) {
    const float *restrict r = sums, *restrict g = r + w + 2, *restrict b = g + w + 2;
    const float cells = (float)(side * side), together = cells * limits[0] * cells * limits[0], one = cells * limits[1];
    for (int j = 0; j < w; j++) {
        const float left = side > 1, right = side > 2;
        const float x = left * r[j] + r[j + 1] + right * r[j + 2], y = left * g[j] + g[j + 1] + right * g[j + 2];
        const float z = left * b[j] + b[j + 1] + right * b[j + 2];
        const float largest = larger(larger(__builtin_fabsf(x), __builtin_fabsf(y)), __builtin_fabsf(z));
        marked[j] |= (uint8_t)((x * x + y * y + z * z > together) & (largest > one));
    }
}

/* Mark every cell that lies at most `reach` cells from a marked one, along both axes. along: w h bytes of work. */
static void dilate(const uint8_t *from, uint8_t *to, int reach, uint8_t *along, int w, int h) {
    for (int at = 0; at < w * h; at++) along[at] = to[at] = 0;
    for (int i = 0; i < h; i++)
        for (int k = -reach; k <= reach; k++) {
            const uint8_t *restrict row = from + (ptrdiff_t)i * w + k;
            uint8_t *restrict out = along + (ptrdiff_t)i * w;
            for (int j = k < 0 ? -k : 0; j < (k > 0 ? w - k : w); j++) out[j] |= row[j];
        }
    for (int i = 0; i < h; i++)
        for (int a = i < reach ? 0 : i - reach; a <= i + reach && a < h; a++) {
            const uint8_t *restrict row = along + (ptrdiff_t)a * w;
            uint8_t *restrict out = to + (ptrdiff_t)i * w;
            for (int j = 0; j < w; j++) out[j] |= row[j];
        }
}

/* The mask as `GradientNetwork.touched_cells`; returns how many cells are touched.
 *
 * limits: two for each square, of 1, 2 and 3 cells a side. near: touched cells and their neighbours, between which slopes
 * are blended. work: 3 (w + 2); bytes: 2 w h. */
EXPORT int touched_cells(const float *means, const float *limits, uint8_t *touched, uint8_t *near, float *work,
                         uint8_t *bytes, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), columns = 2 * ((width + 7) / 8), rows = 2 * ((height + 7) / 8);
    uint8_t *marked = bytes, *along = bytes + (ptrdiff_t)w * h;
    int any = 0;
    for (int i = 0; i < h; i++) {
        uint8_t *row = marked + (ptrdiff_t)i * w;
        for (int j = 0; j < w; j++) row[j] = 0;
        sum_down(means, 1, i, columns, rows, work, w, h);
        mark_row(work, 1, limits, row, w);
        sum_down(means, 2, i, columns, rows, work, w, h);
        mark_row(work, 2, limits + 2, row, w);
        sum_down(means, 3, i, columns, rows, work, w, h);
        mark_row(work, 3, limits + 4, row, w);
        for (int j = 0; j < w; j++) any |= row[j];
    }
    if (!any) return 0;
    dilate(marked, touched, 2, along, w, h);
    dilate(touched, near, 1, along, w, h);
    int count = 0;
    for (int at = 0; at < w * h; at++) count += touched[at];
    return count;
}
