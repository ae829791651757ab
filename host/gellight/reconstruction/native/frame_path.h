/* The frame path on planes of float32, one stage a function. Plain C, no allocation, no library: work memory comes from
 * the caller (native_path.py). The same formulas in NumPy stand in the files of the folder above, named at each stage.
 *
 * Images are width x height pixels. Cells are 4 x 4 pixels: w = ceil(width / 4) by h = ceil(height / 4) of them, the last
 * of a row or column cut where the image ends. A plane is one number a pixel or a cell, row by row; planes of one kind
 * follow each other: slopes are two planes, d(depth)/dx and d(depth)/dy. */
#ifndef GELLIGHT_FRAME_PATH_H
#define GELLIGHT_FRAME_PATH_H

#include <stddef.h>
#include <stdint.h>

#define EXPORT __attribute__((visibility("default")))
#define INLINE static inline __attribute__((always_inline))
#define ONCE static __attribute__((noinline)) /* called from several places, and too large to lie in each */
#define CELL 4

INLINE int clamped(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }
INLINE int cells_of(int pixels) { return (pixels + CELL - 1) / CELL; }
INLINE int smaller_int(int a, int b) { return a < b ? a : b; }
INLINE int larger_int(int a, int b) { return a > b ? a : b; }
INLINE float smaller(float a, float b) { return a < b ? a : b; }
INLINE float larger(float a, float b) { return a > b ? a : b; }
INLINE float squared(float a) { return a * a; }

/* Row y of pixels of a plane (h, w) of cells of `side` pixels, columns first to last - 1, linear between the middles of
 * two rows of cells; beyond the outermost middles the value continues. One more cell lies at both ends of `out`. */
INLINE void between_rows(const float *plane, int side, int y, int h, int w, int first, int last, float *restrict out) {
    const int i = (2 * y + 1 + side) / (2 * side) - 1; /* the cell whose middle is at or above y */
    const float share = ((float)y + 0.5f) / (float)side - 0.5f - (float)i;
    const float *above = plane + (ptrdiff_t)clamped(i, h) * w, *below = plane + (ptrdiff_t)clamped(i + 1, h) * w;
    for (int j = first; j < last; j++) out[1 + j - first] = above[j] + share * (below[j] - above[j]);
    out[0] = first > 0 ? above[first - 1] + share * (below[first - 1] - above[first - 1]) : out[1];
    out[1 + last - first] = last < w ? above[last] + share * (below[last] - above[last]) : out[last - first];
}

/* The pixels of `count` cells in a row, linear between the middles of cells. cells: as between_rows left them. */
INLINE void between_columns(const float *restrict cells, int count, float *restrict out) {
    for (int j = 0; j < count; j++) {
        const float here = cells[j + 1], left = cells[j] - here, right = cells[j + 2] - here;
        out[4 * j] = here + 0.375f * left;
        out[4 * j + 1] = here + 0.125f * left;
        out[4 * j + 2] = here + 0.125f * right;
        out[4 * j + 3] = here + 0.375f * right;
    }
}

/* The pixels of `count` cells in a row, each with the value of its cell. */
INLINE void spread_row(const float *restrict cells, int count, float *restrict out) {
    for (int j = 0; j < count; j++)
        for (int p = 0; p < CELL; p++) out[CELL * j + p] = cells[j];
}

/* The same as between_columns for cells of 2 x 2. */
INLINE void between_pairs(const float *restrict cells, int count, float *restrict out) {
    for (int j = 0; j < count; j++) {
        const float here = cells[j + 1];
        out[2 * j] = here + 0.25f * (cells[j] - here);
        out[2 * j + 1] = here + 0.25f * (cells[j + 2] - here);
    }
}

#endif
