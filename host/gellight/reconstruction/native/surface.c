/* Slopes to depth and back: `integration.py` has the formulas. */
#include "frame_path.h"

/* Integral of a slope over the edge between two samples, a and the next, with two more on both sides, in pixels. */
INLINE float inner_edge(const float *a, ptrdiff_t step) {
    return (802 * (a[0] + a[step]) - 93 * (a[-step] + a[2 * step]) + 11 * (a[-2 * step] + a[3 * step])) * (1.0f / 1440);
}

/* The same between samples i and i + 1 of n >= 6 (`integration._edge_integrals`). */
INLINE float edge(const float *s, int i, int n, ptrdiff_t step) {
    const float *a = s + i * step, *b = a + step;
    if (i == 0) return (9 * a[0] + 19 * b[0] - 5 * b[step] + b[2 * step]) * (1.0f / 24);
    if (i == n - 2) return (9 * b[0] + 19 * a[0] - 5 * a[-step] + a[-2 * step]) * (1.0f / 24);
    if (i == 1 || i == n - 3) return (13 * (a[0] + b[0]) - (a[-step] + b[step])) * (1.0f / 24);
    return inner_edge(a, step);
}

/* Right-hand side of Poisson's equation, mm: edge integrals that leave a pixel less those that enter
 * (`integration._divergence`). work: 3 (width + 1). */
EXPORT void divergence(const float *slopes, float *out, float size_x, float size_y, float *work, int width, int height) {
    const float *gx = slopes, *gy = slopes + (ptrdiff_t)width * height;
    float *across = work, *up = work + width + 1, *down = up + width;
    for (int x = 0; x < width; x++) up[x] = 0;
    across[0] = across[width] = 0;
    for (int y = 0; y < height; y++) {
        const float *row = gx + (ptrdiff_t)y * width;
        float *restrict edges = across + 1;
        for (int x = 2; x < width - 3; x++) edges[x] = inner_edge(row + x, 1);
        for (int k = 0; k < 2; k++) {
            edges[k] = edge(row, k, width, 1);
            edges[width - 2 - k] = edge(row, width - 2 - k, width, 1);
        }
        float *restrict below = down;
        if (y == height - 1)
            for (int x = 0; x < width; x++) below[x] = 0;
        else if (y > 1 && y < height - 3)
            for (int x = 0; x < width; x++) below[x] = inner_edge(gy + (ptrdiff_t)y * width + x, width);
        else
            for (int x = 0; x < width; x++) below[x] = edge(gy + x, y, height, width);
        float *restrict f = out + (ptrdiff_t)y * width;
        const float *restrict above = up;
        for (int x = 0; x < width; x++)
            f[x] = size_x * (across[x + 1] - across[x]) + size_y * (below[x] - above[x]);
        float *swap = up;
        up = down;
        down = swap;
    }
}

/* Poisson's equation after a cosine transform along the rows: for each wave number one tridiagonal system down the column,
 *
 *     z[y - 1] - (2 + lambda) z[y] + z[y + 1] = f[y],   lambda = 2 - 2 cos(pi x / width),   natural ends,
 *
 * by elimination, in place. factors: (height, width), 1 over each pivot. Column 0 has lambda = 0: it is summed twice, in
 * double precision, and its mean set to 0. first: height. */
EXPORT void solve_columns(float *f, const float *factors, double *first, int width, int height) {
    double mean = 0, slope = 0, value = 0, total = 0;
    for (int y = 0; y < height; y++) mean += f[(ptrdiff_t)y * width] / height;
    for (int y = 0; y < height; y++) {
        first[y] = value;
        total += value;
        slope += f[(ptrdiff_t)y * width] - mean;
        value += slope;
    }
    for (int x = 0; x < width; x++) f[x] *= factors[x];
    for (int y = 1; y < height; y++) {
        float *restrict row = f + (ptrdiff_t)y * width;
        const float *restrict above = row - width, *restrict k = factors + (ptrdiff_t)y * width;
        for (int x = 0; x < width; x++) row[x] = (row[x] - above[x]) * k[x];
    }
    for (int y = height - 2; y >= 0; y--) {
        float *restrict row = f + (ptrdiff_t)y * width;
        const float *restrict below = row + width, *restrict k = factors + (ptrdiff_t)y * width;
        for (int x = 0; x < width; x++) row[x] -= k[x] * below[x];
    }
    for (int y = 0; y < height; y++) f[(ptrdiff_t)y * width] = (float)(first[y] - total / height);
}

/* Collect the depth of every `step`th pixel that is at rest: in no touched cell, and in a far cell of 8 x 8 pixels
 * (`at_rest.far_from_touch`), far_h x far_w of them, the last continued. Returns how many. */
EXPORT int resting_depths(const float *depth, const uint8_t *touched, const uint8_t *far, int far_w, int far_h, int step,
                          float *out, int width, int height) {
    int count = 0;
    for (int y = (height - 1) % step / 2; y < height; y += step) {
        const uint8_t *mask = touched + (ptrdiff_t)(y / CELL) * cells_of(width);
        const uint8_t *resting = far + (ptrdiff_t)clamped(y / 8, far_h) * far_w;
        for (int x = (width - 1) % step / 2; x < width; x += step)
            if (!mask[x / CELL] && resting[clamped(x / 8, far_w)]) out[count++] = depth[(ptrdiff_t)y * width + x];
    }
    return count;
}

/* Sample i of n, or beyond its ends the quadratic through the three samples there (`integration._continued`). */
INLINE float continued(const float *z, int i, int n, ptrdiff_t step) {
    if (i >= 0 && i < n) return z[i * step];
    const int k = i < 0 ? -i : i - n + 1;
    const float *end = i < 0 ? z : z + (n - 1) * step;
    const ptrdiff_t in = i < 0 ? step : -step;
    const float a = end[0], b = end[in], c = end[2 * in];
    return a + (float)k * ((a - b) + (a - 2 * b + c) * ((float)(k + 1) * 0.5f));
}

/* Central difference over seven samples, exact to degree 6; ahead and behind: 1, 2 and 3 steps away. */
INLINE float central(float a1, float b1, float a2, float b2, float a3, float b3, float scale) {
    return (0.75f * (a1 - b1) - 0.15f * (a2 - b2) + (1.0f / 60) * (a3 - b3)) * scale;
}

/* Take `level` off a depth map and differentiate it, two planes (`integration.surface_gradient`). work: width + 6. */
EXPORT void level_and_slopes(float *depth, float level, float *slopes, float size_x, float size_y, float *work, int width,
                             int height) {
    const float per_x = 1 / size_x, per_y = 1 / size_y;
    const ptrdiff_t w = width, plane = w * height;
    for (ptrdiff_t at = 0; at < plane; at++) depth[at] -= level;
    for (int y = 0; y < height; y++) {
        const float *row = depth + y * w;
        float *restrict gx = slopes + y * w, *restrict gy = slopes + plane + y * w, *t = work + 3;
        for (int x = -3; x < 0; x++) t[x] = continued(row, x, width, 1);
        for (int x = 0; x < width; x++) t[x] = row[x];
        for (int x = width; x < width + 3; x++) t[x] = continued(row, x, width, 1);
        for (int x = 0; x < width; x++)
            gx[x] = central(t[x + 1], t[x - 1], t[x + 2], t[x - 2], t[x + 3], t[x - 3], per_x);
        if (y > 2 && y < height - 3)
            for (int x = 0; x < width; x++)
                gy[x] = central(row[x + w], row[x - w], row[x + 2 * w], row[x - 2 * w], row[x + 3 * w], row[x - 3 * w], per_y);
        else
            for (int x = 0; x < width; x++) {
                float v[7];
                for (int k = -3; k <= 3; k++) v[k + 3] = continued(depth + x, y + k, height, w);
                gy[x] = central(v[4], v[2], v[5], v[1], v[6], v[0], per_y);
            }
    }
}

/* Two planes of slopes g to g / (1 + towards (x, y) . g), in place: with 1 those of the gel to those over the picture, with -1
 * back (`perspective.py`). x: (width) and y: (height), in heights of the camera. Gel without a slope has none in either. */
EXPORT void slopes_by_view(float *slopes, const float *x, const float *y, float towards, int width, int height) {
    for (int row = 0; row < height; row++) {
        float *restrict gx = slopes + (ptrdiff_t)row * width, *restrict gy = gx + (ptrdiff_t)height * width;
        const float along = towards * y[row];
        for (int i = 0; i < width; i++) {
            const float share = 1 / (1 + towards * x[i] * gx[i] + along * gy[i]);
            gx[i] *= share;
            gy[i] *= share;
        }
    }
}

/* What was integrated from slopes over the picture to the depth, in place: H (1 - exp(-L / H)) as a series, nearness: 1 / H. */
EXPORT void depth_by_view(float *depth, float nearness, int width, int height) {
    for (ptrdiff_t at = 0; at < (ptrdiff_t)width * height; at++) {
        const float t = depth[at] * nearness;
        depth[at] *= 1 - t * 0.5f * (1 - t * (1.0f / 3) * (1 - t * 0.25f * (1 - t * 0.2f)));
    }
}

/* Two planes of slopes to (height, width, 2). */
EXPORT void gradient_map(const float *slopes, float *map, int width, int height) {
    const ptrdiff_t count = (ptrdiff_t)width * height;
    const float *restrict gx = slopes, *restrict gy = slopes + count;
    float *restrict g = map;
    for (ptrdiff_t at = 0; at < count; at++) {
        g[2 * at] = gx[at];
        g[2 * at + 1] = gy[at];
    }
}
