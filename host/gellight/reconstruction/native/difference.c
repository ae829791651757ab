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

/* Mark the cells of one row whose mean, or the mean of the 3 x 3 cells around, is too large to be noise:
 * |m| > limit or |mean of 9| > limit_around. sums: w + 2. */
static void mark_row(const float *above, const float *row, const float *below, float limit, float limit_around,
                     uint8_t *restrict marked, float *restrict sums, int w) {
    for (int j = 0; j < w; j++) sums[j + 1] = above[j] + row[j] + below[j];
    sums[0] = sums[1];
    sums[w + 1] = sums[w];
    for (int j = 0; j < w; j++) {
        const float around = sums[j] + sums[j + 1] + sums[j + 2];
        marked[j] |= (uint8_t)((__builtin_fabsf(row[j]) > limit) | (__builtin_fabsf(around) > 9 * limit_around));
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
 * near: touched cells and their neighbours, between which slopes are blended. work: w + 2; bytes: 2 w h. */
EXPORT int touched_cells(const float *means, float limit, float limit_around, uint8_t *touched, uint8_t *near,
                         float *work, uint8_t *bytes, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), columns = 2 * ((width + 7) / 8), rows = 2 * ((height + 7) / 8);
    uint8_t *marked = bytes, *along = bytes + (ptrdiff_t)w * h;
    int any = 0;
    for (int i = 0; i < h; i++) {
        uint8_t *row = marked + (ptrdiff_t)i * w;
        for (int j = 0; j < w; j++) row[j] = 0;
        for (int c = 0; c < 3; c++) {
            const float *plane = means + (ptrdiff_t)c * rows * columns;
            mark_row(plane + (ptrdiff_t)clamped(i - 1, h) * columns, plane + (ptrdiff_t)i * columns,
                     plane + (ptrdiff_t)clamped(i + 1, h) * columns, limit, limit_around, row, work, w);
        }
        for (int j = 0; j < w; j++) any |= row[j];
    }
    if (!any) return 0;
    dilate(marked, touched, 2, along, w, h);
    dilate(touched, near, 1, along, w, h);
    int count = 0;
    for (int at = 0; at < w * h; at++) count += touched[at];
    return count;
}
