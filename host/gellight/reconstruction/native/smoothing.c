/* Slopes with less noise: `smoothing.py` says why and has the formulas. */
#include "filters.h"

#define TINY 1.17549435e-38f
#define SPAN 4 /* cells that are done together: vectors are full */
#define GAP 2  /* as few spans between two that count are done with them */

/* `Smoother.prefilter` on two planes: smoothed by the narrowest filter, and the variance of the noise of one pixel in planes
 * (2, h, w): the mean square of what the filter takes, over 9 x 9 cells, by the share of white noise that it takes.
 * work: 2 width + 2 reach + w + 40; energy: w h. */
EXPORT void prefilter(const float *slopes, float *smoothed, const float *taps, int reach, float share, float *noise,
                   float *energy, float *work, int width, int height) {
    const int w = cells_of(width), h = cells_of(height);
    const ptrdiff_t plane = (ptrdiff_t)width * height;
    float *squares = work, *padded = work + (width + 15) / 16 * 16;
    for (int o = 0; o < 2; o++, slopes += plane, smoothed += plane, noise += (ptrdiff_t)w * h) {
        for (int i = 0; i < h; i++) {
            const int end = smaller_int(CELL * (i + 1), height);
            for (int x = 0; x < width; x++) squares[x] = 0;
            for (int y = CELL * i; y < end; y++) {
                const float *restrict row = slopes + (ptrdiff_t)y * width;
                float *restrict out = smoothed + (ptrdiff_t)y * width, *restrict sums = squares;
                smooth_row(slopes, width, y, taps, reach, padded, out, 0, width, width, height);
                for (int x = 0; x < width; x++) sums[x] += squared(row[x] - out[x]);
            }
            cell_means(squares, energy + (ptrdiff_t)i * w, end - CELL * i, width);
        }
        for (int i = 0; i < h; i++) {
            float *restrict out = noise + (ptrdiff_t)i * w;
            box_row(energy, i, 4, padded, out, w, h);
            for (int j = 0; j < w; j++) out[j] *= 1.0f / share;
        }
    }
}

/* At which row of cells each step of `smooth_adaptively` is, behind the first one: it waits for the rows that it reads, and the
 * last one changes no row that is still read. */
typedef struct {
    int weighed, reconciled, filtered[3], chosen[3], added, furthest; /* cells at which the energy of a change is looked at */
} Schedule;

static Schedule schedule_of(const int32_t *reach) {
    Schedule s = {.weighed = reach[4], .reconciled = reach[4] + 1};
    s.furthest = larger_int(larger_int(reach[5], reach[6]), reach[7]);
    for (int l = 0, at = s.reconciled + cells_of(reach[3]); l < 3; l++, at += s.furthest) {
        s.filtered[l] = at;
        s.chosen[l] = at += reach[5 + l];
    }
    s.added = larger_int(s.chosen[2] + 1, s.filtered[2] + cells_of(reach[3]));
    return s;
}

/* Rows of pixels for which the changes by filter l are kept. */
static int kept_of(const Schedule *s, int l) { return CELL * (s->added - s->filtered[l] + 1); }

/* Rows of pixels that `smooth_adaptively` needs for the changes of one slope. */
EXPORT int kept_rows(const int32_t *reach) {
    const Schedule s = schedule_of(reach);
    return kept_of(&s, 0) + kept_of(&s, 1) + kept_of(&s, 2);
}

/* A rectangle of the image that begins at a cell, and what `smooth_adaptively` needs in it.
 *
 * It goes down the rows of cells once, each step as far behind the one before as it needs, so that all it reads is still in
 * the cache. What a filter changes is kept for so many rows of pixels alone, and found only where it may count. */
typedef struct {
    int width, height, w, h, kept[3];
    Schedule at;
    ptrdiff_t stride, plane;
    const float *measured, *taps, *energies;
    const int32_t *reach;
    float *slopes, *noise, *shares, *energy, *changes[3], *work;
    uint8_t *flags, *marks;
} Region;

/* Row y of a slope of the rectangle: of the surface, or as measured. */
INLINE ptrdiff_t at_row(const Region *a, int o, int y) { return o * a->plane + y * a->stride; }

/* Row y of what filter l changes in slope o. */
INLINE float *change_row(const Region *a, int l, int o, int y) {
    return a->changes[l] + ((ptrdiff_t)o * a->kept[l] + y % a->kept[l]) * a->width;
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

INLINE int spans_of(const Region *a) { return (a->w + SPAN - 1) / SPAN; }

/* Flag the spans of row i of cells in which some share l is not `usual`. */
static void flag_row(const Region *a, int l, int i, float usual) {
    const float *restrict share = a->shares + ((ptrdiff_t)l * a->h + i) * a->w;
    uint8_t *restrict flags = a->flags + ((ptrdiff_t)l * a->h + i) * spans_of(a);
    const int whole = a->w / SPAN;
    for (int s = 0; s < whole; s++) {
        const float *four = share + SPAN * s;
        flags[s] = (four[0] != usual) | (four[1] != usual) | (four[2] != usual) | (four[3] != usual);
    }
    if (whole < spans_of(a)) flags[whole] = 1;
}

/* Row y of the shares of the pixels of cells first to last - 1. */
static void share_row(const Region *a, const float *share, int y, int first, int last, float *cells, float *out) {
    between_rows(share, CELL, y, a->h, a->w, first, last, cells);
    between_columns(cells, last - first, out);
}

/* Row i of cells of the energy of the surface against the measured slopes. */
ONCE void compare(const Region *a, int i) {
    for (int o = 0; o < 2; o++) {
        float *restrict squares = a->work;
        for (int x = 0; x < a->width; x++) squares[x] = 0;
        for (int y = CELL * i; y < end_of(a, i); y++) {
            const float *restrict surface = a->slopes + at_row(a, o, y), *restrict measured = a->measured + at_row(a, o, y);
            for (int x = 0; x < a->width; x++) squares[x] += squared(surface[x] - measured[x]);
        }
        cell_means(squares, energy_row(a, 3, o, i), end_of(a, i) - CELL * i, a->width);
    }
}

/* How far row i of the surface is taken: where it differs from the measured slopes by more than noise explains, they are,
 * and the noise of the result grows by 1 + (1 - share)^2 (`Smoother._reconcile`). */
ONCE void surface_weights(const Region *a, int i) {
    float *share = a->shares + (ptrdiff_t)(3 * a->h + i) * a->w;
    for (int j = 0; j < a->w; j++) share[j] = 1;
    noise_weights(a, 3, i, a->reach[4], a->energies[0], share);
    flag_row(a, 3, i, 1);
    for (int o = 0; o < 2; o++) {
        float *restrict noise = a->noise + ((ptrdiff_t)o * a->h + i) * a->w;
        for (int j = 0; j < a->w; j++) noise[j] *= 1 + (1 - share[j]) * (1 - share[j]);
    }
}

/* Mark the spans of row i of cells that have a flag of shares l in one of the rows `reach` up and down, or in a span that as
 * many cells to the side reach. Returns whether any is. */
static int mark_near(const Region *a, int l, int i, int reach) {
    const int spans = spans_of(a), beside = (reach + SPAN - 1) / SPAN;
    uint8_t *restrict marks = a->marks, *restrict flags = a->marks + spans;
    int any = 0;
    for (int s = 0; s < spans + 2 * beside; s++) flags[s] = 0;
    for (int k = larger_int(i - reach, 0); k <= smaller_int(i + reach, a->h - 1); k++) {
        const uint8_t *restrict row = a->flags + ((ptrdiff_t)l * a->h + k) * spans;
        for (int s = 0; s < spans; s++) flags[beside + s] |= row[s];
    }
    for (int s = 0; s < spans; s++) marks[s] = 0;
    for (int k = 0; k <= 2 * beside; k++)
        for (int s = 0; s < spans; s++) marks[s] |= flags[s + k];
    for (int s = 0; s < spans; s++) any |= marks[s];
    return any;
}

/* The next marked spans from cell *last on, and short gaps between them. Returns 0 where there are none. */
static int next_run(const Region *a, int *first, int *last) {
    const int spans = spans_of(a);
    int s = (*last + SPAN - 1) / SPAN, end;
    while (s < spans && !a->marks[s]) s++;
    *first = SPAN * s;
    for (end = s; s < spans && s <= end + GAP; s++)
        if (a->marks[s]) end = s + 1;
    *last = smaller_int(SPAN * end, a->w);
    return *first < *last;
}

/* slope = measured + share (slope - measured) in row i of cells, where the share is not 1. */
ONCE void reconcile(const Region *a, int i) {
    const float *share = a->shares + (ptrdiff_t)3 * a->h * a->w;
    float *row = a->work, *cells = row + a->width + 8;
    if (!mark_near(a, 3, i, 1)) return;
    for (int first, last = 0; next_run(a, &first, &last);)
        for (int y = CELL * i; y < end_of(a, i); y++) {
            share_row(a, share, y, first, last, cells, row);
            for (int o = 0; o < 2; o++) {
                const ptrdiff_t at = at_row(a, o, y) + CELL * first;
                const float *restrict measured = a->measured + at, *restrict part = row;
                float *restrict slope = a->slopes + at;
                const int count = smaller_int(CELL * last, a->width) - CELL * first;
                for (int x = 0; x < count; x++) slope[x] = measured[x] + (slope[x] - measured[x]) * part[x];
            }
        }
}

/* A row of what wider filter l changes against the next narrower one, columns left to right - 1 of slope o, and its squares
 * added to `squares`. The changes of narrower filters are there: theirs reach at least as far. */
INLINE void change_of(const Region *a, int l, int o, int y, const float *restrict wide, int left, int right,
                      float *restrict squares) {
    const float *restrict slope = a->slopes + at_row(a, o, y), *restrict first = change_row(a, 0, o, y),
                *restrict second = change_row(a, 1, o, y);
    float *restrict change = change_row(a, l, o, y);
    for (int x = left; x < right; x++) {
        float found = wide[x] - slope[x];
        if (l > 0) found -= first[x];
        if (l > 1) found -= second[x];
        change[x] = found;
        squares[x] += found * found;
    }
}

/* What wider filter l changes in row i of cells, and its energy, where the share of the next narrower one lets it count. */
ONCE void wider_filter(const Region *a, int l, int i) {
    const float *taps = a->taps;
    float *wide = a->work, *squares = wide + a->width, *padded = squares + a->width;
    for (int k = 0; k < l; k++) taps += a->reach[1 + k] + 1;
    if (l > 0 && !mark_near(a, l - 1, i, a->at.furthest)) return;
    for (int s = 0; l == 0 && s < spans_of(a); s++) a->marks[s] = 1;
    for (int first, last = 0; next_run(a, &first, &last);) {
        const int left = CELL * first, right = smaller_int(CELL * last, a->width);
        for (int o = 0; o < 2; o++) {
            for (int x = left; x < right; x++) squares[x] = 0;
            for (int y = CELL * i; y < end_of(a, i); y++) {
                const float *slope = a->slopes + o * a->plane;
                smooth_row(slope, a->stride, y, taps, a->reach[1 + l], padded, wide, left, right, a->width, a->height);
                if (l == 0) change_of(a, 0, o, y, wide, left, right, squares);
                if (l == 1) change_of(a, 1, o, y, wide, left, right, squares);
                if (l == 2) change_of(a, 2, o, y, wide, left, right, squares);
            }
            cell_means(squares + left, energy_row(a, l, o, i) + first, end_of(a, i) - CELL * i, right - left);
        }
    }
}

/* How far row i of filter l is taken: as far as noise explains what it and all narrower ones change. */
ONCE void choose(const Region *a, int l, int i) {
    const ptrdiff_t size = (ptrdiff_t)a->w * a->h;
    float *share = a->shares + l * size + (ptrdiff_t)i * a->w;
    for (int j = 0; j < a->w; j++) share[j] = l ? share[j - size] : 1;
    noise_weights(a, l, i, a->reach[5 + l], a->energies[1 + l], share);
    flag_row(a, l, i, 0);
}

/* Add the changes by their shares in row i of cells, where these are not 0: slope += sum over filters of share change. */
ONCE void add_changes(const Region *a, int i) {
    float *row = a->work, *cells = row + a->width + 8;
    for (int l = 0; l < 3; l++) {
        const float *share = a->shares + (ptrdiff_t)l * a->w * a->h;
        if (!mark_near(a, l, i, 1)) return; /* nor have wider filters any */
        for (int first, last = 0; next_run(a, &first, &last);)
            for (int y = CELL * i; y < end_of(a, i); y++) {
                share_row(a, share, y, first, last, cells, row);
                for (int o = 0; o < 2; o++) {
                    const int left = CELL * first, count = smaller_int(CELL * last, a->width) - left;
                    float *restrict slope = a->slopes + at_row(a, o, y) + left;
                    const float *restrict change = change_row(a, l, o, y) + left, *restrict part = row;
                    for (int x = 0; x < count; x++) slope[x] += part[x] * change[x];
                }
            }
    }
}

/* Whether there is a row i of cells. */
INLINE int is_row(const Region *a, int i) { return i >= 0 && i < a->h; }

/* `Smoother.smooth_adaptively` inside the rectangle of pixels [left, right) x [top, bottom), left and top at cells.
 *
 * slopes: two planes of the integrated surface, changed in place; measured, noise: what `prefilter` made. taps: of the three
 * wider filters one after the other. reach: of the filters, then of the cells that their energy is taken over; energies: what
 * white noise makes. Both begin with those of the narrowest filter. small: 14 planes of cells; changes: 2 `kept_rows` rows;
 * work: 4 width + 2 reach[3] + 64; flags: 4 planes of cells and 2 w + 2 reach[3]. */
EXPORT void smooth_adaptively(float *slopes, const float *measured, const float *noise, const float *taps,
                              const int32_t *reach, const float *energies, float *small, float *changes, float *work,
                              uint8_t *flags, int left, int top, int right, int bottom, int width, int height) {
    const ptrdiff_t begin = (ptrdiff_t)top * width + left, all = (ptrdiff_t)cells_of(width) * cells_of(height);
    Region a = {.width = right - left, .height = bottom - top, .stride = width, .plane = (ptrdiff_t)width * height,
                .at = schedule_of(reach), .measured = measured + begin, .slopes = slopes + begin, .taps = taps,
                .reach = reach, .energies = energies, .work = work, .flags = flags};
    for (int l = 0; l < 3; l++) {
        a.kept[l] = kept_of(&a.at, l), a.changes[l] = changes;
        changes += 2 * (ptrdiff_t)a.kept[l] * width;
    }
    a.w = cells_of(a.width), a.h = cells_of(a.height);
    const ptrdiff_t size = (ptrdiff_t)a.w * a.h;
    a.noise = small, a.shares = small + 2 * size, a.energy = small + 6 * size, a.marks = flags + 4 * size;
    for (int o = 0; o < 2; o++)
        for (int i = 0; i < a.h; i++) {
            const float *row = noise + o * all + (ptrdiff_t)(top / CELL + i) * cells_of(width) + left / CELL;
            for (int j = 0; j < a.w; j++) a.noise[o * size + i * a.w + j] = row[j] + TINY;
        }
    for (ptrdiff_t at = 0; at < 8 * size; at++) a.energy[at] = 0;
    for (int i = 0; i < a.h + a.at.added; i++) {
        if (is_row(&a, i)) compare(&a, i);
        if (is_row(&a, i - a.at.weighed)) surface_weights(&a, i - a.at.weighed);
        if (is_row(&a, i - a.at.reconciled)) reconcile(&a, i - a.at.reconciled);
        for (int l = 0; l < 3; l++) {
            if (is_row(&a, i - a.at.filtered[l])) wider_filter(&a, l, i - a.at.filtered[l]);
            if (is_row(&a, i - a.at.chosen[l])) choose(&a, l, i - a.at.chosen[l]);
        }
        if (is_row(&a, i - a.at.added)) add_changes(&a, i - a.at.added);
    }
}
