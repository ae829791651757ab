/* Cast shadows, and the light of depth, on cells: `cast_shadows.py` and `led_light.py` have the formulas. */
#include "frame_path.h"

#define BEYOND 1e3f
#define DIAGONAL 1.00001f

/* x^p for x > 0, else 0; to 1e-6 of it. Plain C, as there is no library, and without branches, so that loops are vectors. */
INLINE float power(float x, float p) {
    union { float value; int32_t bits; } a = {x}, b;
    const int32_t e = (a.bits - 0x3f3504f3) >> 23; /* makes the mantissa lie around 1 */
    a.bits -= e * (1 << 23);
    const float s = (a.value - 1) / (a.value + 1), q = s * s;
    const float log2 = (float)e + s * (2.885390082f + q * (0.961796694f + q * (0.577078016f + q * (0.412198583f + q * 0.320598898f))));
    const float y = larger(smaller(p * log2, 126), -126), whole = __builtin_floorf(y + 0.5f), f = y - whole;
    b.bits = ((int32_t)whole + 127) * (1 << 23);
    const float fine = 1 + f * (0.693147181f + f * (0.240226507f + f * (0.0555041087f + f * (0.00961812911f + f * (0.00133335581f + f * 1.54035304e-4f)))));
    return x > 0 ? b.value * fine : 0;
}

/* Means of two planes of slopes over cells; beyond the image its last row and column continue. work: width. */
EXPORT void slope_means(const float *slopes, float *means, float *work, int width, int height) {
    const int w = cells_of(width), whole = width / CELL;
    for (int o = 0; o < 2; o++, slopes += (ptrdiff_t)width * height)
        for (int i = 0; i < cells_of(height); i++) {
            float *restrict sum = work, *restrict out = means + ((ptrdiff_t)o * cells_of(height) + i) * w;
            const float *row[CELL];
            for (int k = 0; k < CELL; k++) row[k] = slopes + (ptrdiff_t)clamped(CELL * i + k, height) * width;
            for (int x = 0; x < width; x++) sum[x] = (row[0][x] + row[1][x]) + (row[2][x] + row[3][x]);
            for (int j = 0; j < whole; j++)
                out[j] = ((sum[4 * j] + sum[4 * j + 1]) + (sum[4 * j + 2] + sum[4 * j + 3])) * (1.0f / 16);
            if (whole < w) {
                out[whole] = 0;
                for (int x = CELL * whole; x < CELL * w; x++) out[whole] += sum[clamped(x, width)] * (1.0f / 16);
            }
        }
}

/* A LED: its foot, and the place of the picture from which its shadows fall. Then 9 planes of its light on cells, and twice
 * 4 planes of its rays, with columns for rows the second time: see `led_light.OnCells`. */
typedef struct {
    float x, y, from_x, from_y;
} Led;

/* A surface on cells, w along a row and h down, under a camera 1 / nearness high. */
typedef struct {
    int w, h;
    const float *x, *y, *z, *gx, *gy, *upright;
    float nearness;
} Surface;

/* Depths on cells as a LED's rays go over them, w along a row and h down, or turned so that columns are rows. */
typedef struct {
    int w, h;
    float nearest; /* a cell's smaller side */
    const float *x, *y, *z;
    const uint8_t *away; /* rows in which some cell is turned away from the LED */
    float *hidden;
    float furthest; /* cells along a row that a ray may move in one row down */
} Field;

INLINE float parabola(float a, float b, float c, float z) { return a + z * (b + z * c); }

/* How much of a LED is hidden from row i: the smallest slope at which light left it on each ray comes from the row before,
 * `least`, and goes on to `next`. Returns whether any is. */
ONCE int hide_row(const Field *s, float led_x, float led_y, const float *rays, int i, float edge_mm, const float *restrict least,
                  float *restrict next) {
    const ptrdiff_t at = (ptrdiff_t)i * s->w, plane = (ptrdiff_t)s->h * s->w;
    const float *restrict z = s->z + at, *restrict px = s->x, *restrict v0 = rays + at, *restrict v1 = v0 + plane,
                *restrict v2 = v1 + plane, *restrict per_row = v2 + plane;
    float *restrict hidden = s->hidden + at;
    const float ly = led_y - s->y[i], per_edge = 1 / edge_mm, furthest = s->furthest, nearest = s->nearest;
    const int w = s->w;
    int any = 0;
    for (int j = 0; j < w; j++) {
        const float lx = led_x - px[j], ahead = per_row[j], slant = parabola(v0[j], v1[j], v2[j], z[j]);
        const float right = smaller(larger(ahead, 0), 1), left = smaller(larger(-ahead, 0), 1);
        const float before = least[j] + right * (least[j + 1] - least[j]) + left * (least[j - 1] - least[j]);
        const float away = larger(__builtin_sqrtf(lx * lx + ly * ly), nearest);
        const float part = smaller(larger(0.5f + (slant - before) * away * per_edge, 0), 1);
        next[j] = smaller(before, slant);
        hidden[j] = __builtin_fabsf(ahead) <= furthest ? part : 0;
    }
    for (int j = 0; j < w; j++) any |= hidden[j] > 0;
    return any;
}

/* Go down the rows on one side of a LED (step 1 or -1), away from it, over the rays that cross more rows than columns.
 * led: x, y and from where its shadows fall, along the rows. */
ONCE void sweep(const Field *s, float led_x, float led_y, float from_y, const float *rays, int step, float edge_mm, float *work) {
    const int w = s->w, end = step > 0 ? s->h : -1;
    float *least = work + 16, *next = least + w + 32;
    int begin = step > 0 ? 0 : s->h - 1, final;
    while (begin != end && (step > 0 ? s->y[begin] < from_y : s->y[begin] >= from_y)) begin += step;
    const int nearest = begin;
    while (begin != end && !s->away[begin]) begin += step;
    if (begin == end) return;
    for (final = end - step; !s->away[final]; final -= step);
    if (begin != nearest) begin -= step; /* one row that faces the light, before the first that does not */
    for (int j = -1; j <= w; j++) least[j] = next[j] = BEYOND;
    for (int i = begin; i != end; i += step) {
        const int any = hide_row(s, led_x, led_y, rays, i, edge_mm, least, next);
        if (!any && (step > 0 ? i > final : i < final)) return;
        float *swap = least;
        least = next;
        next = swap;
    }
}

/* Add the light that row i lacks, columns first to last - 1: that at the depth of rest, where the network answers `by_depth`,
 * less what is not hidden of that at its own. */
INLINE void add_lost(const Surface *s, const Led *led, const float *light, const float *restrict hidden, int i, int first,
                     int last, float by_depth, float *lost) {
    const ptrdiff_t at = (ptrdiff_t)i * s->w, plane = (ptrdiff_t)s->h * s->w;
    const float *restrict z = s->z + at, *restrict gx = s->gx + at, *restrict gy = s->gy + at, *restrict px = s->x, *restrict upright = s->upright + at;
    const float *restrict a0 = light + at, *restrict a1 = a0 + plane, *restrict a2 = a1 + plane, *restrict b1 = a2 + plane,
                *restrict b2 = b1 + plane, *restrict b3 = b2 + plane, *restrict red = b3 + plane, *restrict green = red + plane,
                *restrict blue = green + plane;
    float *restrict r = lost + at, *restrict g = r + plane, *restrict b = g + plane;
    const float led_x = led->x, ly = led->y - s->y[i], y = s->y[i] * s->nearness, nearness = s->nearness;
    for (int j = first; j < last; j++) {
        const float d = z[j], level = a0[j] - gx[j] * (led_x - px[j]) - gy[j] * ly;
        const float now = level + d * (a1[j] + d * a2[j] - gx[j] * px[j] * nearness - gy[j] * y);
        const float lit = larger(parabola(1, b1[j], b2[j] + d * b3[j], d), 0) * larger(now, 0);
        const float less = upright[j] * (by_depth * (larger(level, 0) - lit) + hidden[j] * lit);
        r[j] += red[j] * less;
        g[j] += green[j] * less;
        b[j] += blue[j] * less;
    }
}

ONCE void transpose(const float *from, float *to, int w, int h) {
    for (int top = 0; top < h; top += 16)
        for (int left = 0; left < w; left += 16)
            for (int j = left; j < smaller_int(left + 16, w); j++)
                for (int i = top; i < smaller_int(top + 16, h); i++) to[(ptrdiff_t)j * h + i] = from[(ptrdiff_t)i * w + j];
}

/* Mark rows and columns in which some cell is turned away from a LED; returns whether any is. */
ONCE int turned_away(const Surface *s, const Led *led, const float *light, uint8_t *rows, uint8_t *restrict columns) {
    const ptrdiff_t plane = (ptrdiff_t)s->h * s->w;
    int any = 0;
    for (int j = 0; j < s->w; j++) columns[j] = 0;
    for (int i = 0; i < s->h; i++) {
        const ptrdiff_t at = (ptrdiff_t)i * s->w;
        const float *restrict z = s->z + at, *restrict gx = s->gx + at, *restrict gy = s->gy + at, *restrict px = s->x;
        const float *restrict a0 = light + at, *restrict a1 = a0 + plane, *restrict a2 = a1 + plane;
        const float ly = led->y - s->y[i], y = s->y[i] * s->nearness, led_x = led->x, nearness = s->nearness;
        int found = 0;
        for (int j = 0; j < s->w; j++) {
            const float lx = led_x - px[j] + px[j] * nearness * z[j];
            const int away = parabola(a0[j], a1[j], a2[j], z[j]) - gx[j] * lx - gy[j] * (ly + y * z[j]) < 0;
            columns[j] |= (uint8_t)away;
            found |= away;
        }
        rows[i] = (uint8_t)found;
        any |= found;
    }
    return any;
}

/* Whether some cell of a surface that is all `deepest` mm deep is turned away from a LED. work: h w; the rest as below. */
EXPORT int may_shade(const float *slopes, const float *x, const float *y, const float *leds, const float *light, int count,
                     float nearness, float deepest, float *work, uint8_t *flags, int w, int h) {
    const ptrdiff_t n = (ptrdiff_t)w * h;
    for (ptrdiff_t at = 0; at < n; at++) work[at] = deepest;
    const Surface s = {w, h, x, y, work, slopes, slopes + n, work, nearness};
    for (int k = 0; k < count; k++)
        if (turned_away(&s, (const Led *)leds + k, light + 9 * n * k, flags, flags + h)) return 1;
    return 0;
}

/* How much of a LED is hidden from each cell. z, hidden: of the surface, then the same turned. */
ONCE void hide(const Surface *s, const Led *led, const float *rays, float size_x, float size_y, float edge_mm, float *turned_z,
               float *hidden, const uint8_t *flags, float *work) {
    const ptrdiff_t n = (ptrdiff_t)s->w * s->h;
    const float nearest = smaller(size_x, size_y);
    float *turned = hidden + n;
    for (ptrdiff_t at = 0; at < 2 * n; at++) hidden[at] = 0;
    const Field down = {s->w, s->h, nearest, s->x, s->y, s->z, flags, hidden, DIAGONAL};
    const Field across = {s->h, s->w, nearest, s->y, s->x, turned_z, flags + s->h, turned, 1 / DIAGONAL};
    for (int step = -1; step < 2; step += 2) {
        sweep(&down, led->x, led->y, led->from_y, rays, step, edge_mm, work);
        sweep(&across, led->y, led->x, led->from_x, rays + 4 * n, step, edge_mm, work);
    }
    for (int i = 0; i < s->h; i++)
        for (int j = 0; j < s->w; j++) hidden[(ptrdiff_t)i * s->w + j] += turned[(ptrdiff_t)j * s->h + i];
}

/* The light that cells which are `near` lack, (3, h, w), in shares of the light at rest: for the shadows of a surface where it
 * `may_hide` LEDs, and against gel at the depth of rest where the network answers `by_depth`.
 *
 * depth: (h, w) mm. slopes: (2, h, w). x: (w) and y: (h) middles of the cells, mm. leds: (count, 4), light: (count, 9, h, w) and
 * rays: (count, 2, 4, h w), see Led. nearness: 1 / the camera's height. edge_mm: see `cast_shadows.EDGE_MM`. near: (h, w). work:
 * 5 h w + 3 (w + h + 64); flags: w + h. Returns whether there is any. */
EXPORT int lost_light(const float *depth, const float *slopes, const float *x, const float *y, const float *leds,
                      const float *light, const float *rays, int count, float nearness, float size_x, float size_y, float edge_mm,
                      float *lost, float *work, uint8_t *flags, const uint8_t *near, int may_hide, int by_depth, int w, int h) {
    const ptrdiff_t n = (ptrdiff_t)w * h;
    float *upright = work, *turned = upright + n, *hidden = turned + n, *none = hidden + 2 * n, *rows = none + w + h;
    const Surface s = {w, h, x, y, depth, slopes, slopes + n, upright, nearness};
    for (ptrdiff_t at = 0; at < n; at++) upright[at] = 1 / __builtin_sqrtf(1 + squared(slopes[at]) + squared(slopes[n + at]));
    for (ptrdiff_t at = 0; at < 3 * n; at++) lost[at] = 0;
    for (int j = 0; j < w; j++) none[j] = 0;
    int any = 0;
    for (int k = 0; k < count; k++) {
        const Led *led = (const Led *)leds + k;
        const float *of_led = light + 9 * n * k;
        const int hides = may_hide && turned_away(&s, led, of_led, flags, flags + h);
        if (!hides && !by_depth) continue;
        if (hides && !any++) transpose(depth, turned, w, h);
        if (hides) hide(&s, led, rays + 8 * n * k, size_x, size_y, edge_mm, turned, hidden, flags, rows);
        const uint8_t *in = near;
        for (int i = 0; i < h; i++, in += w) {
            int first = 0, last = w;
            while (first < last && !in[first]) first++;
            while (last > first && !in[last - 1]) last--;
            add_lost(&s, led, of_led, hides ? hidden + (ptrdiff_t)i * w : none, i, first, last, (float)by_depth, lost);
        }
    }
    return any || by_depth;
}

/* By how much the network answers otherwise to `near` cells with the light `lost`, two planes, 0 elsewhere: by the Jacobian in
 * `planes`. Rows (n, 5) of the network are made where a channel changes by more than `limit` grey levels; returns n.
 *
 * planes: as store_cells has them. cells: (size, 5) all rows. lost: 3 planes. rest: (size, 3) grey levels of the gel at rest.
 * black: (3). index: (n) which rows they are. See `LedLight.with_light`. */
EXPORT int relit(const float *planes, const float *cells, const uint8_t *near, const float *lost, const float *rest,
                 const float *black, float gamma, float limit, int32_t *index, float *rows, float *change, int size) {
    int count = 0;
    for (int at = 0; at < size; at++) {
        change[at] = change[size + at] = 0;
        if (!near[at]) continue;
        const float *seen = cells + 5 * (ptrdiff_t)at;
        float lit[3], most = 0;
        for (int c = 0; c < 3; c++) {
            const float light = lost[(ptrdiff_t)c * size + at], span = 255 - black[c], dim = rest[3 * (ptrdiff_t)at + c] - black[c];
            if (gamma == 1)
                lit[c] = larger(larger(dim + seen[c], 0) + light * larger(dim, 0), 0) - dim;
            else
                lit[c] = span * power(power((dim + seen[c]) / span, gamma) + light * power(dim / span, gamma), 1 / gamma) - dim;
            most = larger(most, __builtin_fabsf(lit[c] - seen[c]));
        }
        for (int o = 0; o < 2; o++)
            for (int c = 0; c < 3; c++) change[o * size + at] += planes[(ptrdiff_t)(5 + 3 * o + c) * size + at] * (lit[c] - seen[c]);
        if (!(most > limit)) continue;
        float *row = rows + 5 * (ptrdiff_t)count;
        for (int c = 0; c < 5; c++) row[c] = c < 3 ? lit[c] : seen[c];
        index[count++] = at;
    }
    return count;
}

/* The change at `count` cells by what the network answered, less zero, less its answer to the cell as it was seen. */
EXPORT void answered(const int32_t *index, const float *answer, const float *zero, const float *planes, float *change, int count,
                     int size) {
    for (int k = 0; k < count; k++) {
        const float *cell = planes + index[k];
        for (int o = 0; o < 2; o++) {
            float seen = cell[(ptrdiff_t)o * size];
            for (int c = 0; c < 3; c++)
                seen += 0.5f * cell[(ptrdiff_t)(5 + 3 * o + c) * size] * cell[(ptrdiff_t)(2 + c) * size];
            change[o * size + index[k]] = answer[2 * (ptrdiff_t)k + o] - zero[2 * (ptrdiff_t)index[k] + o] - seen;
        }
    }
}

/* Add two planes of cells to the slopes of the pixels, linear between cells. work: 5 cells_of(width) + 2. */
EXPORT void add_change(const float *change, float *slopes, float *work, int width, int height) {
    const int w = cells_of(width), h = cells_of(height);
    for (int y = 0; y < height; y++)
        for (int o = 0; o < 2; o++) {
            float *restrict pixels = work + w + 2, *restrict to = slopes + ((ptrdiff_t)o * height + y) * width;
            between_rows(change + (ptrdiff_t)o * w * h, CELL, y, h, w, 0, w, work);
            int first = 0, last = w;
            while (first < w && work[1 + first] == 0) first++;
            while (last > first && work[last] == 0) last--;
            if (first == last) continue;
            first = larger_int(first - 1, 0), last = smaller_int(last + 1, w);
            between_columns(work + first, last - first, pixels);
            for (int x = CELL * first; x < smaller_int(CELL * last, width); x++) to[x] += pixels[x - CELL * first];
        }
}
