/* Difference image to slopes, between what the network answers: `cells.py` has the formulas. */
#include "frame_path.h"

/* Colours of all rows (h w, 5) of cells, or (h2 w2, 5) of blocks of 2 x 2 cells; the places are in them already. */
EXPORT void mean_rows(const float *means, float *cells, float *blocks, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), columns = 2 * ((width + 7) / 8), lines = 2 * ((height + 7) / 8);
    for (int c = 0; c < 3; c++) {
        const float *plane = means + (ptrdiff_t)c * lines * columns;
        for (int i = 0; i < h; i++)
            for (int j = 0; j < w; j++) cells[5 * ((ptrdiff_t)i * w + j) + c] = plane[i * columns + j];
        for (int i = 0; i < lines / 2; i++)
            for (int j = 0; j < columns / 2; j++) {
                const float *m = plane + (ptrdiff_t)2 * i * columns + 2 * j;
                blocks[5 * ((ptrdiff_t)i * (columns / 2) + j) + c] =
                    (m[0] + m[1] + m[columns] + m[columns + 1]) * 0.25f;
            }
    }
}

/* Whether a pixel in a cell that is not touched takes its slopes from block (i, j) of 2 x 2 cells. */
static int reaches_out(const uint8_t *touched, int i, int j, int w, int h) {
    for (int a = larger_int(2 * i - 1, 0); a < h && a <= 2 * i + 2; a++)
        for (int b = larger_int(2 * j - 1, 0); b < w && b <= 2 * j + 2; b++)
            if (!touched[a * w + b]) return 1;
    return 0;
}

/* Slopes of blocks less zero, (h2 w2, 2): J m with the Jacobian at no difference, (h2 w2, 6), as the differences are small
 * where nothing touches. strong: the blocks that differ by more than `limit` in a channel and still count outside the
 * touched cells; the caller asks the network for those. Returns how many. */
EXPORT int coarse_slopes(const float *blocks, const float *jacobian, const uint8_t *touched, float limit, float *slopes,
                         uint8_t *strong, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), w2 = (w + 1) / 2, h2 = (h + 1) / 2;
    int count = 0;
    for (int i = 0; i < h2; i++)
        for (int j = 0; j < w2; j++) {
            const ptrdiff_t at = (ptrdiff_t)i * w2 + j;
            const float *m = blocks + 5 * at, *row = jacobian + 6 * at;
            for (int o = 0; o < 2; o++)
                slopes[2 * at + o] = row[3 * o] * m[0] + row[3 * o + 1] * m[1] + row[3 * o + 2] * m[2];
            const float most = larger(larger(__builtin_fabsf(m[0]), __builtin_fabsf(m[1])), __builtin_fabsf(m[2]));
            strong[at] = most > limit && reaches_out(touched, i, j, w, h);
            count += strong[at];
        }
    return count;
}

/* Divide the cells near a touch: those of low contrast, which differ from each of the four blocks that they are blended from
 * by at most `limit` in all channels, and those of high contrast. around: the blocks that low contrast is blended from.
 * Returns how many are of low contrast. */
EXPORT int split_cells(const float *cells, const float *blocks, const uint8_t *near, float limit, uint8_t *high_contrast,
                       uint8_t *low_contrast, uint8_t *around, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), w2 = (w + 1) / 2, h2 = (h + 1) / 2;
    int count = 0;
    for (int at = 0; at < w2 * h2; at++) around[at] = 0;
    for (int i = 0; i < h; i++)
        for (int j = 0; j < w; j++) {
            const ptrdiff_t at = (ptrdiff_t)i * w + j;
            high_contrast[at] = low_contrast[at] = 0;
            if (!near[at]) continue;
            const int rows[2] = {(i - 1) / 2, clamped((i + 1) / 2, h2)}, columns[2] = {(j - 1) / 2, clamped((j + 1) / 2, w2)};
            for (int k = 0; k < 4; k++) {
                const float *m = cells + 5 * at, *block = blocks + 5 * ((ptrdiff_t)rows[k / 2] * w2 + columns[k % 2]);
                for (int c = 0; c < 3; c++) high_contrast[at] |= __builtin_fabsf(m[c] - block[c]) > limit;
            }
            if (high_contrast[at]) continue;
            low_contrast[at] = 1;
            count++;
            for (int k = 0; k < 4; k++) around[rows[k / 2] * w2 + columns[k % 2]] = 1;
        }
    return count;
}

/* Rows (n, 5) of the chosen ones of `all`. Returns n; index: (n) which each row is. */
EXPORT int chosen_rows(const float *all, const uint8_t *chosen, int32_t *index, float *rows, int size) {
    int count = 0;
    for (int at = 0; at < size; at++) {
        if (!chosen[at]) continue;
        for (int c = 0; c < 5; c++) rows[5 * (ptrdiff_t)count + c] = all[5 * (ptrdiff_t)at + c];
        index[count++] = at;
    }
    return count;
}

/* Keep what the network answers to `count` rows of cells or blocks as 11 planes of `size`: g - J m / 2 of both slopes, the
 * mean m of three channels, J of both slopes. slopes (n, 2), jacobian (n, 6), zero (size, 2): its answer to no difference. */
EXPORT void store_cells(const int32_t *index, const float *rows, const float *slopes, const float *jacobian,
                        const float *zero, float *planes, int count, int size) {
    for (int n = 0; n < count; n++) {
        const float *m = rows + 5 * (ptrdiff_t)n;
        float *cell = planes + index[n];
        for (int o = 0; o < 2; o++) {
            const float *j = jacobian + 6 * (ptrdiff_t)n + 3 * o;
            const float g = slopes[2 * (ptrdiff_t)n + o] - zero[2 * (ptrdiff_t)index[n] + o];
            cell[(ptrdiff_t)o * size] = g - 0.5f * (j[0] * m[0] + j[1] * m[1] + j[2] * m[2]);
            for (int c = 0; c < 3; c++) cell[(ptrdiff_t)(5 + 3 * o + c) * size] = j[c];
        }
        for (int c = 0; c < 3; c++) cell[(ptrdiff_t)(2 + c) * size] = m[c];
    }
}

/* The planes of cells of low contrast from those of the blocks around: the formula of the pixels, with a cell's mean m_i for d:
 * q_i = q + J (m_i - m) / 2 and J_i = J, where q, m and J are blended. work: 12 (w + 16). */
EXPORT void cells_from_blocks(const float *blocks, const float *cells, const uint8_t *low_contrast, float *planes,
                              float *work, int width, int height) {
    const int w = cells_of(width), h = cells_of(height), w2 = (w + 1) / 2, h2 = (h + 1) / 2, stride = w + 16;
    const ptrdiff_t size = (ptrdiff_t)w * h;
    for (int i = 0; i < h; i++) {
        const uint8_t *row = low_contrast + (ptrdiff_t)i * w;
        int any = 0;
        for (int j = 0; j < w; j++) any |= row[j];
        if (!any) continue;
        for (int k = 0; k < 11; k++) {
            between_rows(blocks + (ptrdiff_t)k * w2 * h2, 2, i, h2, w2, 0, w2, work + 11 * stride);
            between_pairs(work + 11 * stride, w2, work + k * stride);
        }
        for (int j = 0; j < w; j++) {
            if (!row[j]) continue;
            const float *m = cells + 5 * ((ptrdiff_t)i * w + j);
            float *cell = planes + (ptrdiff_t)i * w + j, *blended = work + j;
            for (int o = 0; o < 2; o++) {
                float q = blended[o * stride];
                for (int c = 0; c < 3; c++) {
                    const float slope = blended[(5 + 3 * o + c) * stride];
                    q += 0.5f * slope * (m[c] - blended[(2 + c) * stride]);
                    cell[(5 + 3 * o + c) * size] = slope;
                }
                cell[o * size] = q;
            }
            for (int c = 0; c < 3; c++) cell[(2 + c) * size] = m[c];
        }
    }
}

/* One row of slopes from the means of 8 x 8 pixels, linear in between. coarse: (h8 w8, 2) slopes less zero. */
static void coarse_row(const float *coarse, int y, float *const out[2], float *work, int width, int height) {
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

/* Squares of bend and misfit over their limits (see cells.py) of `count` cells and those `step` further on: raise
 * what both cells have so far to it, where both are near. limits: nearest means, bend, misfit. pairs: work memory, 2 count. */
static void compare_cells(const float *planes, const uint8_t *near, ptrdiff_t step, ptrdiff_t size, const float *limits,
                          float *restrict pairs, float *bend, float *misfit, int count) {
    const float nearest = limits[0] * limits[0], bends = 1 / (limits[1] * limits[1]), misfits = 1 / (limits[2] * limits[2]);
    for (int j = 0; j < count; j++) {
        const float *a = planes + j, *b = planes + j + step;
        float moved = 0, turned = 0, misfitted = 0;
        for (int c = 0; c < 3; c++) moved += squared(b[(2 + c) * size] - a[(2 + c) * size]);
        for (int o = 0; o < 2; o++) {
            float crossed = 0;
            for (int c = 0; c < 3; c++) {
                const ptrdiff_t m = (2 + c) * size, k = (5 + 3 * o + c) * size;
                turned += squared(b[k] - a[k]);
                crossed += b[k] * a[m] - a[k] * b[m];
            }
            misfitted += squared(b[o * size] - a[o * size] + 0.5f * crossed);
        }
        const int both = near[j] & near[j + step];
        pairs[j] = both ? turned / larger(moved, nearest) * bends : 0;
        pairs[count + j] = both ? misfitted * misfits : 0;
    }
    for (int j = 0; j < count; j++) bend[j] = larger(bend[j], pairs[j]);
    for (int j = 0; j < count; j++) bend[j + step] = larger(bend[j + step], pairs[j]);
    for (int j = 0; j < count; j++) misfit[j] = larger(misfit[j], pairs[count + j]);
    for (int j = 0; j < count; j++) misfit[j + step] = larger(misfit[j + step], pairs[count + j]);
}

/* How far the planes can be trusted: two planes of cells, bend and misfit as compare_cells has them, the bend then the most of
 * the 3 x 3 cells around. work: 2 w, and a plane of cells. */
EXPORT void cell_doubts(const float *planes, const uint8_t *near, const float *limits, float *doubts, float *work, int width,
                        int height) {
    const int w = cells_of(width), h = cells_of(height);
    const ptrdiff_t size = (ptrdiff_t)w * h;
    float *bend = doubts, *misfit = doubts + size, *beside = work + 2 * w;
    for (ptrdiff_t at = 0; at < 2 * size; at++) doubts[at] = 0;
    for (int i = 0; i < h; i++) {
        const ptrdiff_t at = (ptrdiff_t)i * w;
        compare_cells(planes + at, near + at, 1, size, limits, work, bend + at, misfit + at, w - 1);
        if (i < h - 1) compare_cells(planes + at, near + at, w, size, limits, work, bend + at, misfit + at, w);
    }
    for (int i = 0; i < h; i++) {
        const float *row = bend + (ptrdiff_t)i * w;
        float *out = beside + (ptrdiff_t)i * w;
        for (int j = 1; j < w - 1; j++) out[j] = larger(row[j], larger(row[j - 1], row[j + 1]));
        out[0] = larger(row[0], row[1]);
        out[w - 1] = larger(row[w - 2], row[w - 1]);
    }
    for (int i = 0; i < h; i++) {
        const float *row = beside + (ptrdiff_t)i * w, *above = beside + (ptrdiff_t)clamped(i - 1, h) * w,
                    *below = beside + (ptrdiff_t)clamped(i + 1, h) * w;
        float *out = bend + (ptrdiff_t)i * w;
        for (int j = 0; j < w; j++) out[j] = larger(row[j], larger(above[j], below[j]));
    }
}

/* slope = q + J (d - m / 2) for `count` pixels; pixels: 11 rows, `stride` apart, then rows of bend and misfit. single: where
 * that may be too wrong (see cells.py), by the bend only where |d - m| > noise. */
static void blend_run(const float *restrict d, const float *restrict pixels, ptrdiff_t stride, float noise, float *restrict gx,
                      float *restrict gy, uint8_t *restrict single, int count) {
    const float *restrict qx = pixels, *restrict qy = pixels + stride, *restrict m0 = pixels + 2 * stride,
                *restrict m1 = pixels + 3 * stride, *restrict m2 = pixels + 4 * stride,
                *restrict x0 = pixels + 5 * stride, *restrict x1 = pixels + 6 * stride,
                *restrict x2 = pixels + 7 * stride, *restrict y0 = pixels + 8 * stride,
                *restrict y1 = pixels + 9 * stride, *restrict y2 = pixels + 10 * stride,
                *restrict bend = pixels + 11 * stride, *restrict misfit = pixels + 12 * stride;
    for (int x = 0; x < count; x++) {
        const float a0 = d[3 * x] - 0.5f * m0[x], a1 = d[3 * x + 1] - 0.5f * m1[x], a2 = d[3 * x + 2] - 0.5f * m2[x];
        const float slope_x = qx[x] + x0[x] * a0 + x1[x] * a1 + x2[x] * a2;
        const float slope_y = qy[x] + y0[x] * a0 + y1[x] * a1 + y2[x] * a2;
        const float away = larger(larger(__builtin_fabsf(a0 - 0.5f * m0[x]), __builtin_fabsf(a1 - 0.5f * m1[x])),
                                  __builtin_fabsf(a2 - 0.5f * m2[x]));
        const float allowed = 1 + squared(slope_x) + squared(slope_y);
        gx[x] = slope_x;
        gy[x] = slope_y;
        single[x] = ((away > noise) & (squared(squared(away)) * bend[x] > allowed)) | (misfit[x] > allowed);
    }
}

/* Slopes of all pixels, two planes: outside the touched cells from coarse means, inside blended between cells.
 *
 * Returns for how many pixels that may be too wrong (blend_run); index: which. The caller asks the network for those. doubts:
 * of cell_doubts. coarse: not read where all cells are touched. work: 14 (width + 16); flags: width + 4 bytes. */
EXPORT int blend(const float *difference, const uint8_t *touched, int touched_count, const float *planes, const float *doubts,
                 const float *coarse, float noise, float *slopes, int32_t *index, float *work, uint8_t *flags, int width,
                 int height) {
    const int w = cells_of(width), h = cells_of(height);
    const ptrdiff_t size = (ptrdiff_t)w * h, plane = (ptrdiff_t)width * height, stride = width + 16;
    float *cells = work + 11 * stride;
    int found = 0;
    for (int y = 0; y < height; y++) {
        float *const out[2] = {slopes + (ptrdiff_t)y * width, slopes + plane + (ptrdiff_t)y * width};
        const uint8_t *mask = touched + (ptrdiff_t)(y / CELL) * w;
        if (touched_count < w * h) coarse_row(coarse, y, out, cells, width, height);
        for (int first = 0, last; first < w; first = last) {
            for (last = first; last < w && mask[last] == mask[first]; last++);
            if (!mask[first]) continue;
            for (int k = 0; k < 11; k++) {
                between_rows(planes + k * size, CELL, y, h, w, first, last, cells);
                between_columns(cells, last - first, work + k * stride);
            }
            for (int k = 0; k < 2; k++)
                spread_row(doubts + k * size + (ptrdiff_t)(y / CELL) * w + first, last - first, work + (11 + k) * stride);
            const int x0 = CELL * first, count = (CELL * last < width ? CELL * last : width) - x0;
            const float *d = difference + 3 * ((ptrdiff_t)y * width + x0);
            blend_run(d, work, stride, noise, out[0] + x0, out[1] + x0, flags, count);
            for (int x = 0; x < count; x++)
                if (flags[x]) index[found++] = y * width + x0 + x;
        }
    }
    return found;
}

/* Rows (count, 5) of the network for single pixels. */
EXPORT void pixel_rows(const float *difference, const int32_t *index, float *rows, int count, int width) {
    int y = count ? index[0] / width : 0; /* index ascends, and a division takes as long as the rest */
    for (int n = 0; n < count; n++) {
        const float *d = difference + 3 * (ptrdiff_t)index[n];
        float *row = rows + 5 * (ptrdiff_t)n;
        while (index[n] >= (y + 1) * width) y++;
        for (int c = 0; c < 3; c++) row[c] = d[c];
        row[3] = (float)(index[n] - y * width);
        row[4] = (float)y;
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
