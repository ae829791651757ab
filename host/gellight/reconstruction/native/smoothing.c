/* Slopes with less noise: `smoothing.py` says why and has the formulas. */
#include "frame_path.h"

#define TINY 1.17549435e-38f

/* Row y of a plane through a symmetric filter along both axes, borders continued. taps: from the middle outwards;
 * padded: width + 2 reach. */
INLINE void filter_row(const float *plane, ptrdiff_t stride, int y, const float *taps, int reach, float *restrict padded,
                       float *restrict out, int width, int height) {
    const float *restrict row = plane + y * stride;
    float *restrict down = padded + reach;
    if (y >= reach && y < height - reach)
        for (int x = 0; x < width; x++) {
            float sum = taps[0] * row[x];
            for (int k = 1; k <= reach; k++) sum += taps[k] * (row[x - k * stride] + row[x + k * stride]);
            down[x] = sum;
        }
    else {
        for (int x = 0; x < width; x++) down[x] = taps[0] * row[x];
        for (int k = 1; k <= reach; k++) {
            const float *restrict above = plane + clamped(y - k, height) * stride;
            const float *restrict below = plane + clamped(y + k, height) * stride;
            for (int x = 0; x < width; x++) down[x] += taps[k] * (above[x] + below[x]);
        }
    }
    for (int k = 1; k <= reach; k++) {
        down[-k] = down[0];
        down[width - 1 + k] = down[width - 1];
    }
    for (int x = 0; x < width; x++) {
        float sum = taps[0] * down[x];
        for (int k = 1; k <= reach; k++) sum += taps[k] * (down[x - k] + down[x + k]);
        out[x] = sum;
    }
}

/* The common widths get loops of a known length, which is twice as fast. */
static void smooth_row(const float *plane, ptrdiff_t stride, int y, const float *taps, int reach, float *padded, float *out,
                       int width, int height) {
    switch (reach) {
        case 2: filter_row(plane, stride, y, taps, 2, padded, out, width, height); break;
        case 3: filter_row(plane, stride, y, taps, 3, padded, out, width, height); break;
        case 5: filter_row(plane, stride, y, taps, 5, padded, out, width, height); break;
        case 9: filter_row(plane, stride, y, taps, 9, padded, out, width, height); break;
        default: filter_row(plane, stride, y, taps, reach, padded, out, width, height);
    }
}

/* Add the squares of a row, four pixels a cell; squares: width. */
static void add_squares(const float *restrict row, float *restrict squares, float *restrict cells, int width) {
    for (int x = 0; x < width; x++) squares[x] = row[x] * row[x];
    const int whole = width / CELL;
    for (int j = 0; j < whole; j++)
        cells[j] += (squares[4 * j] + squares[4 * j + 1]) + (squares[4 * j + 2] + squares[4 * j + 3]);
    for (int x = CELL * whole; x < width; x++) cells[whole] += squares[x];
}

/* Sums over row i of cells to means over the pixels of each, cut cells included. */
static void cell_means(float *cells, int i, int width, int height) {
    const int w = cells_of(width), tall = smaller_int(height - CELL * i, CELL);
    float *row = cells + (ptrdiff_t)i * w;
    for (int j = 0; j < w - 1; j++) row[j] *= 1.0f / (float)(CELL * tall);
    row[w - 1] *= 1.0f / (float)((width - CELL * (w - 1)) * tall);
}

INLINE int mirrored(int i, int n) {
    while (i < 0 || i >= n) i = i < 0 ? -1 - i : 2 * n - 1 - i;
    return i;
}

/* Row i of the mean over 2 reach + 1 cells a side, mirrored at the border. padded: w + 2 reach. */
static void box_row(const float *cells, int i, int reach, float *restrict padded, float *restrict out, int w, int h) {
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

/* `Smoother.prefilter` on two planes: smoothed by the narrowest filter, and the variance of the noise of one pixel in planes
 * (2, h, w): the mean square of what the filter takes, over 9 x 9 cells, by the share of white noise that it takes.
 * work: 2 width + 2 reach + w + 8; energy: w h. */
EXPORT void prefilter(const float *slopes, float *smoothed, const float *taps, int reach, float share, float *noise,
                   float *energy, float *work, int width, int height) {
    const int w = cells_of(width), h = cells_of(height);
    const ptrdiff_t plane = (ptrdiff_t)width * height;
    float *taken = work, *padded = work + width;
    for (int o = 0; o < 2; o++, slopes += plane, smoothed += plane, noise += (ptrdiff_t)w * h) {
        for (int at = 0; at < w * h; at++) energy[at] = 0;
        for (int y = 0; y < height; y++) {
            const float *restrict row = slopes + (ptrdiff_t)y * width;
            float *restrict out = smoothed + (ptrdiff_t)y * width, *restrict less = taken;
            smooth_row(slopes, width, y, taps, reach, padded, out, width, height);
            for (int x = 0; x < width; x++) less[x] = row[x] - out[x];
            add_squares(taken, padded, energy + (ptrdiff_t)(y / CELL) * w, width);
        }
        for (int i = 0; i < h; i++) cell_means(energy, i, width, height);
        for (int i = 0; i < h; i++) {
            float *restrict out = noise + (ptrdiff_t)i * w;
            box_row(energy, i, 4, padded, out, w, h);
            for (int j = 0; j < w; j++) out[j] *= 1.0f / share;
        }
    }
}

/* A rectangle of the image that begins at a cell, and what `smooth_adaptively` needs in it.
 *
 * It goes down the rows of cells once, each step as far behind the one before as it needs, so that all it reads is still in
 * the cache. What a filter changes is kept for `kept` rows of pixels alone. */
typedef struct {
    int width, height, w, h, kept;
    ptrdiff_t stride, plane;
    const float *measured, *taps, *energies;
    const int32_t *reach;
    float *slopes, *noise, *shares, *energy, *changes, *work;
} Region;

/* Row y of a slope of the rectangle: of the surface, or as measured. */
INLINE ptrdiff_t at_row(const Region *a, int o, int y) { return o * a->plane + y * a->stride; }

/* Row y of what filter l changes in slope o. */
INLINE float *change_row(const Region *a, int l, int o, int y) {
    return a->changes + ((ptrdiff_t)(2 * l + o) * a->kept + y % a->kept) * a->width;
}

/* Row i of cells of the energy that the change of filter l has in slope o; l = 3: the surface against the measured slopes. */
INLINE float *energy_row(const Region *a, int l, int o, int i) {
    return a->energy + ((ptrdiff_t)(2 * l + o) * a->h + i) * a->w;
}

/* End of row i of cells, in rows of pixels. */
INLINE int end_of(const Region *a, int i) { return smaller_int(CELL * (i + 1), a->height); }

/* Multiply a row of shares by how far noise explains the energy of a change: 1 up to 1.5 times what noise makes, 0 from 3
 * times on, for the worse of both slopes. seen: (2, w); noise: planes (2, h, w). */
static void weigh_row(const Region *a, const float *restrict seen, int i, float energy, float *restrict share) {
    const float *restrict nx = a->noise + (ptrdiff_t)i * a->w, *restrict ny = nx + (ptrdiff_t)a->w * a->h;
    const int w = a->w;
    for (int j = 0; j < w; j++) {
        const float worst = larger(seen[j] / nx[j], seen[w + j] / ny[j]);
        share[j] *= smaller(larger(2 - worst / (1.5f * energy), 0), 1);
    }
}

/* Row i of the shares of change l from its energies, over 2 reach + 1 cells a side. share: those of the narrower filter. */
static void noise_weights(const Region *a, int l, int i, int reach, float energy, float *share) {
    float *seen = a->work, *padded = a->work + 2 * a->w;
    for (int o = 0; o < 2; o++) box_row(energy_row(a, l, o, 0), i, reach, padded, seen + o * a->w, a->w, a->h);
    weigh_row(a, seen, i, energy, share);
}

/* Row y of the pixels' shares. */
static void share_row(const Region *a, const float *share, int y, float *cells, float *out) {
    between_rows(share, CELL, y, a->h, a->w, 0, a->w, cells);
    between_columns(cells, a->w, out);
}

/* Row i of cells of the energy of the surface against the measured slopes. */
static void compare(const Region *a, int i) {
    float *change = a->work, *squares = change + a->width;
    for (int o = 0; o < 2; o++) {
        for (int y = CELL * i; y < end_of(a, i); y++) {
            const float *restrict surface = a->slopes + at_row(a, o, y), *restrict measured = a->measured + at_row(a, o, y);
            float *restrict out = change;
            for (int x = 0; x < a->width; x++) out[x] = surface[x] - measured[x];
            add_squares(change, squares, energy_row(a, 3, o, i), a->width);
        }
        cell_means(energy_row(a, 3, o, 0), i, a->width, a->height);
    }
}

/* How far row i of the surface is taken: where it differs from the measured slopes by more than noise explains, they are,
 * and the noise of the result grows by 1 + (1 - share)^2 (`Smoother._reconcile`). */
static void surface_weights(const Region *a, int i) {
    float *share = a->shares + (ptrdiff_t)(3 * a->h + i) * a->w;
    for (int j = 0; j < a->w; j++) share[j] = 1;
    noise_weights(a, 3, i, a->reach[4], a->energies[0], share);
    for (int o = 0; o < 2; o++) {
        float *restrict noise = a->noise + ((ptrdiff_t)o * a->h + i) * a->w;
        for (int j = 0; j < a->w; j++) noise[j] *= 1 + (1 - share[j]) * (1 - share[j]);
    }
}

/* slope = measured + share (slope - measured) in row i of cells. */
static void reconcile(const Region *a, int i) {
    float *row = a->work, *cells = row + a->width + 8;
    for (int y = CELL * i; y < end_of(a, i); y++) {
        share_row(a, a->shares + (ptrdiff_t)3 * a->h * a->w, y, cells, row);
        for (int o = 0; o < 2; o++) {
            const float *restrict measured = a->measured + at_row(a, o, y), *restrict part = row;
            float *restrict slope = a->slopes + at_row(a, o, y);
            for (int x = 0; x < a->width; x++) slope[x] = measured[x] + (slope[x] - measured[x]) * part[x];
        }
    }
}

/* What each of three wider filters changes in row i of cells against the next narrower one, and its energy. */
static void wider_filters(const Region *a, int i) {
    float *smoothed[2] = {a->work, a->work + a->width}, *padded = a->work + 2 * a->width;
    for (int o = 0; o < 2; o++) {
        for (int y = CELL * i; y < end_of(a, i); y++) {
            const float *last = a->slopes + at_row(a, o, y), *tap = a->taps;
            for (int l = 0; l < 3; tap += a->reach[1 + l] + 1, l++) {
                float *restrict change = change_row(a, l, o, y), *wide = smoothed[l & 1];
                smooth_row(a->slopes + o * a->plane, a->stride, y, tap, a->reach[1 + l], padded, wide, a->width, a->height);
                for (int x = 0; x < a->width; x++) change[x] = wide[x] - last[x];
                add_squares(change, padded, energy_row(a, l, o, i), a->width);
                last = wide;
            }
        }
        for (int l = 0; l < 3; l++) cell_means(energy_row(a, l, o, 0), i, a->width, a->height);
    }
}

/* How far row i of each filter is taken: as far as noise explains what it and all narrower ones change. */
static void choose(const Region *a, int i) {
    const ptrdiff_t size = (ptrdiff_t)a->w * a->h;
    for (int l = 0; l < 3; l++) {
        float *share = a->shares + l * size + (ptrdiff_t)i * a->w;
        for (int j = 0; j < a->w; j++) share[j] = l ? share[j - size] : 1;
        noise_weights(a, l, i, a->reach[5 + l], a->energies[1 + l], share);
    }
}

/* Add the changes by their shares in row i of cells: slope += sum over filters of share change. */
static void add_changes(const Region *a, int i) {
    const ptrdiff_t size = (ptrdiff_t)a->w * a->h;
    float *rows = a->work, *cells = a->work + 3 * (a->width + 8);
    for (int y = CELL * i; y < end_of(a, i); y++) {
        for (int l = 0; l < 3; l++) share_row(a, a->shares + l * size, y, cells, rows + l * (a->width + 8));
        for (int o = 0; o < 2; o++) {
            float *restrict slope = a->slopes + at_row(a, o, y);
            const float *restrict c0 = change_row(a, 0, o, y), *restrict c1 = change_row(a, 1, o, y),
                        *restrict c2 = change_row(a, 2, o, y), *restrict s0 = rows, *restrict s1 = rows + a->width + 8,
                        *restrict s2 = s1 + a->width + 8;
            for (int x = 0; x < a->width; x++) slope[x] += s0[x] * c0[x] + s1[x] * c1[x] + s2[x] * c2[x];
        }
    }
}

/* Run one step of `smooth_adaptively` for row i of cells, where there is one. */
static void step(void (*run)(const Region *, int), const Region *a, int i) {
    if (i >= 0 && i < a->h) run(a, i);
}

/* `Smoother.smooth_adaptively` inside the rectangle of pixels [left, right) x [top, bottom), left and top at cells.
 *
 * slopes: two planes of the integrated surface, changed in place; measured, noise: what `prefilter` made. taps: of the three
 * wider filters one after the other. reach: of the filters, then of the cells that their energy is taken over; energies: what
 * white noise makes. Both begin with those of the narrowest filter. small: 14 planes of cells; changes: 6 planes of
 * `kept` rows; work: 6 width + 2 reach[3] + 64. */
EXPORT void smooth_adaptively(float *slopes, const float *measured, const float *noise, const float *taps,
                              const int32_t *reach, const float *energies, float *small, float *changes, float *work,
                              int kept, int left, int top, int right, int bottom, int width, int height) {
    const ptrdiff_t begin = (ptrdiff_t)top * width + left, all = (ptrdiff_t)cells_of(width) * cells_of(height);
    Region a = {.width = right - left, .height = bottom - top, .stride = width, .plane = (ptrdiff_t)width * height,
                .kept = kept, .measured = measured + begin, .slopes = slopes + begin, .taps = taps, .reach = reach,
                .energies = energies, .changes = changes, .work = work};
    a.w = cells_of(a.width), a.h = cells_of(a.height);
    const ptrdiff_t size = (ptrdiff_t)a.w * a.h;
    a.noise = small, a.shares = small + 2 * size, a.energy = small + 6 * size;
    for (int o = 0; o < 2; o++)
        for (int i = 0; i < a.h; i++) {
            const float *row = noise + o * all + (ptrdiff_t)(top / CELL + i) * cells_of(width) + left / CELL;
            for (int j = 0; j < a.w; j++) a.noise[o * size + i * a.w + j] = row[j] + TINY;
        }
    for (ptrdiff_t at = 0; at < 8 * size; at++) a.energy[at] = 0;
    /* Each step waits for the rows of cells below that it reads, and the last one changes no row that is still read. */
    const int weighed = reach[4], reconciled = weighed + 1, widened = reconciled + cells_of(reach[3]);
    const int chosen = widened + reach[7], added = larger_int(chosen + 1, widened + cells_of(reach[3]));
    for (int i = 0; i < a.h + added; i++) {
        step(compare, &a, i);
        step(surface_weights, &a, i - weighed);
        step(reconcile, &a, i - reconciled);
        step(wider_filters, &a, i - widened);
        step(choose, &a, i - chosen);
        step(add_changes, &a, i - added);
    }
}
