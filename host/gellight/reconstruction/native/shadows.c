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

typedef struct {
    float x, y, z, axis_x, axis_y, axis_z;
} Led;

/* A surface on cells, w along a row and h down, or turned so that its columns are the rows. */
typedef struct {
    int w, h;
    float size_x, size_y;
    const float *x, *y, *z, *gx, *gy, *upright;
    const uint8_t *away; /* rows in which some cell is turned away from the LED */
    float *lost;
    float furthest; /* cells along a row that a ray may move in one row down */
} Surface;

typedef struct {
    float edge_mm, exponent;
} Rules;

/* How much of a LED is hidden from row i, columns first to last - 1: the smallest slope at which it stands on each ray
 * comes from the row before, `least`, and goes on to `next`. Returns whether any is. */
ONCE int hide_row(const Surface *s, const Led *led, int i, int first, int last, float edge_mm, const float *restrict least,
                    float *restrict next, float *restrict hidden) {
    const float *restrict z = s->z + (ptrdiff_t)i * s->w, *restrict px = s->x;
    const float ly = led->y - s->y[i], down = larger(__builtin_fabsf(ly), 1e-6f), per_row = s->size_y / (down * s->size_x);
    const float nearest = smaller(s->size_x, s->size_y), per_edge = 1 / edge_mm, furthest = s->furthest;
    int any = 0;
    for (int j = first; j < last; j++) {
        const float lx = led->x - px[j], lz = led->z - z[j], ahead = lx * per_row;
        const float right = smaller(larger(ahead, 0), 1), left = smaller(larger(-ahead, 0), 1);
        const float before = least[j] + right * (least[j + 1] - least[j]) + left * (least[j - 1] - least[j]);
        const float away = larger(__builtin_sqrtf(lx * lx + ly * ly), nearest);
        const float part = smaller(larger(0.5f + (lz - before * away) * per_edge, 0), 1);
        next[j] = smaller(before, lz / away);
        hidden[j] = __builtin_fabsf(ahead) <= furthest ? part : 0;
    }
    for (int j = first; j < last; j++) any |= hidden[j] > 0;
    return any;
}

/* How the light of a LED differs from that at depth 0, but for its angle to the surface. */
INLINE float falls_off(const Led *led, float lx, float ly, float lz, float exponent) {
    const float sideways = lx * lx + ly * ly, ratio = (sideways + led->z * led->z) / (sideways + lz * lz);
    const float across = lx * led->axis_x + ly * led->axis_y;
    const float leaving = larger((across + lz * led->axis_z) / (across + led->z * led->axis_z), 0);
    return exponent == 1 ? ratio * ratio * leaving : power(ratio, 0.5f * (3 + exponent)) * power(leaving, exponent);
}

/* Add the light that row i lacks: share at rest x hidden x what the light would be. */
INLINE void add_lost(const Surface *s, const Led *led, const float *shares, int i, int first, int last, float exponent,
                     const float *restrict hidden) {
    const ptrdiff_t at = (ptrdiff_t)i * s->w, plane = at + (ptrdiff_t)(s->h - i) * s->w;
    const float *restrict z = s->z + at, *restrict gx = s->gx + at, *restrict gy = s->gy + at, *restrict px = s->x;
    const float *restrict upright = s->upright + at, *restrict red = shares + at, *restrict green = red + plane,
                *restrict blue = green + plane;
    float *restrict r = s->lost + at, *restrict g = r + plane, *restrict b = g + plane;
    const Led here = *led;
    const float ly = here.y - s->y[i];
    for (int j = first; j < last; j++) {
        const float lx = here.x - px[j], lz = here.z - z[j], falls = falls_off(&here, lx, ly, lz, exponent);
        const float light = hidden[j] * falls / here.z * upright[j] * larger(lz - gx[j] * lx - gy[j] * ly, 0);
        r[j] += red[j] * light;
        g[j] += green[j] * light;
        b[j] += blue[j] * light;
    }
}

/* Add the light that cells first to last - 1 of row i would have more at the depth of the gel at rest. */
INLINE void add_by_depth(const Surface *s, const Led *led, const float *shares, int i, int first, int last, float exponent) {
    const ptrdiff_t at = (ptrdiff_t)i * s->w, plane = (ptrdiff_t)s->h * s->w;
    const float *restrict z = s->z + at, *restrict gx = s->gx + at, *restrict gy = s->gy + at, *restrict px = s->x;
    const float *restrict upright = s->upright + at, *restrict red = shares + at, *restrict green = red + plane,
                *restrict blue = green + plane;
    float *restrict r = s->lost + at, *restrict g = r + plane, *restrict b = g + plane;
    const Led here = *led;
    const float ly = here.y - s->y[i];
    for (int j = first; j < last; j++) {
        const float lx = here.x - px[j], lz = here.z - z[j], sloped = gx[j] * lx + gy[j] * ly;
        const float now = falls_off(&here, lx, ly, lz, exponent) * larger(lz - sloped, 0);
        const float light = upright[j] * (larger(here.z - sloped, 0) - now) / here.z;
        r[j] += red[j] * light;
        g[j] += green[j] * light;
        b[j] += blue[j] * light;
    }
}

/* Go down the rows on one side of a LED (step 1 or -1), away from it, over the rays that cross more rows than columns. */
ONCE void sweep(const Surface *s, const Led *led, const float *shares, int step, const Rules *rules, float *work) {
    const int w = s->w, end = step > 0 ? s->h : -1;
    float *least = work + 16, *next = least + w + 32, *hidden = next + w + 32;
    int begin = step > 0 ? 0 : s->h - 1, final;
    while (begin != end && (step > 0 ? s->y[begin] < led->y : s->y[begin] >= led->y)) begin += step;
    const int nearest = begin;
    while (begin != end && !s->away[begin]) begin += step;
    if (begin == end) return;
    for (final = end - step; !s->away[final]; final -= step);
    if (begin != nearest) begin -= step; /* one row that faces the light, before the first that does not */
    for (int j = -1; j <= w; j++) least[j] = next[j] = BEYOND;
    for (int i = begin; i != end; i += step) {
        const float wide = __builtin_fabsf(led->y - s->y[i]) * s->size_x / s->size_y;
        const int first = clamped((int)((led->x - wide - s->x[0]) / s->size_x) - 3, w + 1);
        const int last = larger_int(clamped((int)((led->x + wide - s->x[0]) / s->size_x) + 5, w + 1), first);
        const int any = hide_row(s, led, i, first, last, rules->edge_mm, least, next, hidden);
        if (!any && (step > 0 ? i > final : i < final)) return;
        float *swap = least;
        least = next;
        next = swap;
        if (!any) continue;
        if (rules->exponent == 1)
            add_lost(s, led, shares, i, first, last, 1, hidden);
        else
            add_lost(s, led, shares, i, first, last, rules->exponent, hidden);
    }
}

ONCE void transpose(const float *from, float *to, int w, int h) {
    for (int top = 0; top < h; top += 16)
        for (int left = 0; left < w; left += 16)
            for (int j = left; j < smaller_int(left + 16, w); j++)
                for (int i = top; i < smaller_int(top + 16, h); i++) to[(ptrdiff_t)j * h + i] = from[(ptrdiff_t)i * w + j];
}

/* Mark rows and columns in which some cell is turned away from a LED; returns whether any is. */
ONCE int turned_away(const Surface *s, const Led *led, uint8_t *rows, uint8_t *restrict columns) {
    int any = 0;
    for (int j = 0; j < s->w; j++) columns[j] = 0;
    for (int i = 0; i < s->h; i++) {
        const ptrdiff_t at = (ptrdiff_t)i * s->w;
        const float *restrict z = s->z + at, *restrict gx = s->gx + at, *restrict gy = s->gy + at, *restrict px = s->x;
        const float ly = led->y - s->y[i], led_x = led->x, led_z = led->z;
        int found = 0;
        for (int j = 0; j < s->w; j++) {
            const int away = led_z - z[j] - gx[j] * (led_x - px[j]) - gy[j] * ly < 0;
            columns[j] |= (uint8_t)away;
            found |= away;
        }
        rows[i] = (uint8_t)found;
        any |= found;
    }
    return any;
}

/* Whether some cell of a surface that is all `deepest` mm deep is turned away from a LED. work: h w; the rest as below. */
EXPORT int may_shade(const float *slopes, const float *x, const float *y, const float *leds, int count, float deepest, float *work,
                     uint8_t *flags, int w, int h) {
    for (ptrdiff_t at = 0; at < (ptrdiff_t)w * h; at++) work[at] = deepest;
    const Surface s = {.w = w, .h = h, .x = x, .y = y, .z = work, .gx = slopes, .gy = slopes + (ptrdiff_t)w * h};
    for (int k = 0; k < count; k++) {
        const Led led = {.x = leds[6 * k], .y = leds[6 * k + 1], .z = leds[6 * k + 2]};
        if (turned_away(&s, &led, flags, flags + h)) return 1;
    }
    return 0;
}

/* Add it to each row from the first to the last cell that is `near`. */
ONCE void depth_light(const Surface *s, const Led *led, const float *shares, const uint8_t *near, float exponent) {
    for (int i = 0; i < s->h; i++, near += s->w) {
        int first = 0, last = s->w;
        while (first < last && !near[first]) first++;
        while (last > first && !near[last - 1]) last--;
        if (exponent == 1)
            add_by_depth(s, led, shares, i, first, last, 1);
        else
            add_by_depth(s, led, shares, i, first, last, exponent);
    }
}

/* The light that cells lack, (3, h, w), in shares of the light at rest: for the shadows of a surface where it can `hide`
 * LEDs, and for cells that are `near` against gel at the depth of rest where the network answers `by_depth`.
 *
 * depth: (h, w) mm. slopes: (2, h, w). x: (w) and y: (h) middles of the cells, mm. leds: (count, 6) position and axis. shares:
 * of each LED in the light of each channel at rest, (count, 3, h, w), then the same with columns for rows. edge_mm: see
 * `cast_shadows.EDGE_MM`. near: (h, w). work: 8 h w + 4 (w + h + 64); flags: w + h. Returns whether there is any. */
EXPORT int lost_light(const float *depth, const float *slopes, const float *x, const float *y, const float *leds, int count,
                      const float *shares, float size_x, float size_y, float edge_mm, float exponent, float *lost, float *work,
                      uint8_t *flags, const uint8_t *near, int hide, int by_depth, int w, int h) {
    const ptrdiff_t n = (ptrdiff_t)w * h;
    float *upright = work, *turned = upright + n, *turned_lost = turned + 4 * n, *rows = turned_lost + 3 * n;
    const Rules rules = {edge_mm, exponent};
    for (ptrdiff_t at = 0; at < n; at++) upright[at] = 1 / __builtin_sqrtf(1 + squared(slopes[at]) + squared(slopes[n + at]));
    for (ptrdiff_t at = 0; at < 3 * n; at++) lost[at] = turned_lost[at] = 0;
    const Surface down = {w, h, size_x, size_y, x, y, depth, slopes, slopes + n, upright, flags, lost, DIAGONAL};
    const Surface across = {h, w, size_y, size_x, y, x, turned, turned + n, turned + 2 * n, turned + 3 * n, flags + h,
                            turned_lost, 1 / DIAGONAL};
    int any = 0;
    for (int k = 0; k < count; k++) {
        const float *p = leds + 6 * k, *share = shares + (ptrdiff_t)3 * n * k, *turned_share = share + (ptrdiff_t)3 * n * count;
        const Led led = {p[0], p[1], p[2], p[3], p[4], p[5]}, turned_led = {p[1], p[0], p[2], p[4], p[3], p[5]};
        if (by_depth) depth_light(&down, &led, share, near, exponent);
        if (!hide || !turned_away(&down, &led, flags, flags + h)) continue;
        if (!any++) {
            transpose(depth, turned, w, h);
            transpose(slopes + n, turned + n, w, h);
            transpose(slopes, turned + 2 * n, w, h);
            transpose(upright, turned + 3 * n, w, h);
        }
        for (int step = -1; step < 2; step += 2) {
            sweep(&down, &led, share, step, &rules, rows);
            sweep(&across, &turned_led, turned_share, step, &rules, rows);
        }
    }
    for (int c = 0; any && c < 3; c++) {
        transpose(turned_lost + c * n, turned, h, w);
        for (ptrdiff_t at = 0; at < n; at++) lost[c * n + at] += turned[at];
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
