/* Depth map to contact: `contact.py` says what counts as one. */
#include "frame_path.h"

/* Of `contact.py`, which has their reasons. */
enum { LEVELS = 32, FIRST_LEVEL = 6, LAST_LEVEL = 26, FEWEST_BLOCKS = 16 };
#define STEEP 0.95F

/* Second largest depth of 2 x 2 pixels, (ceil(height / 2), ceil(width / 2)); an odd last row or column is doubled. */
static void second_largest(const float *depth, float *blocks, int width, int height) {
    const int w = (width + 1) / 2, h = (height + 1) / 2;
    for (int i = 0; i < h; i++) {
        const float *a = depth + 2 * (ptrdiff_t)i * width, *b = 2 * i + 1 < height ? a + width : a;
        float *restrict out = blocks + (ptrdiff_t)i * w;
        for (int j = 0; j < width / 2; j++) {
            const float p = a[2 * j], q = a[2 * j + 1], r = b[2 * j], s = b[2 * j + 1];
            const float high = larger(p, q), low = smaller(p, q), high2 = larger(r, s), low2 = smaller(r, s);
            out[j] = larger(smaller(high, high2), high > high2 ? low : low2);
        }
        if (width % 2) out[w - 1] = larger(a[width - 1], b[width - 1]);
    }
}

static int root(int32_t *parent, int a) {
    while (parent[a] != a) a = parent[a] = parent[parent[a]];
    return a;
}

/* Join the regions of two labels; return that of both. */
static int join(int32_t *parent, float *deepest, int a, int b) {
    a = root(parent, a), b = root(parent, b);
    if (a == b) return a;
    deepest[a] = larger(deepest[a], deepest[b]);
    return parent[b] = a;
}

/* Label the regions of blocks deeper than the threshold, eight neighbours a block; 0 elsewhere. Returns how many labels. */
static int label_regions(const float *blocks, float threshold, int32_t *label, int32_t *parent, float *deepest, int w, int h) {
    int labels = 1;
    for (int i = 0; i < h; i++) {
        const float *row = blocks + (ptrdiff_t)i * w;
        int any = 0;
        for (int j = 0; j < w; j++) any |= row[j] > threshold;
        for (int j = 0; j < w; j++) label[(ptrdiff_t)i * w + j] = 0;
        for (int j = 0; any && j < w; j++) {
            const ptrdiff_t at = (ptrdiff_t)i * w + j;
            if (!(blocks[at] > threshold)) continue;
            const int before[4] = {j ? label[at - 1] : 0, i && j ? label[at - w - 1] : 0, i ? label[at - w] : 0,
                                   i && j < w - 1 ? label[at - w + 1] : 0};
            int mine = 0;
            for (int k = 0; k < 4; k++)
                if (before[k] && before[k] != mine)
                    mine = mine ? join(parent, deepest, mine, before[k]) : root(parent, before[k]);
            if (!mine) {
                mine = labels++;
                parent[mine] = mine;
                deepest[mine] = 0;
            }
            label[at] = mine;
            deepest[mine] = larger(deepest[mine], blocks[at]);
        }
    }
    return labels;
}

/* Mark the pixels of row y that are as deep as the level of their block, and add them to the result; level: 0 for none. */
static void mark_row(const float *restrict row, const float *restrict level, uint8_t *restrict out, int y, double *result,
                     int width) {
    int count = 0, places = 0;
    if (!level)
        for (int x = 0; x < width; x++) out[x] = 0;
    for (int j = 0; level && j < width / 2; j++) {
        const int left = row[2 * j] >= level[j], right = row[2 * j + 1] >= level[j];
        out[2 * j] = (uint8_t)left;
        out[2 * j + 1] = (uint8_t)right;
        count += left + right;
        places += left * 2 * j + right * (2 * j + 1);
    }
    if (level && width % 2) {
        const int last = row[width - 1] >= level[width / 2];
        out[width - 1] = (uint8_t)last;
        count += last;
        places += last * (width - 1);
    }
    result[0] += count;
    result[2] += places;
    result[3] += (double)count * y;
}

/* Steepness of the surface at a block, to a factor; 0 where it is not known. */
static float steepness(const float *blocks, int i, int j, float aspect, int w, int h) {
    const float *row = blocks + (ptrdiff_t)i * w;
    const float x = row[smaller_int(j + 1, w - 1)] - row[larger_int(j - 1, 0)];
    const float y = (blocks[(ptrdiff_t)smaller_int(i + 1, h - 1) * w + j] - blocks[(ptrdiff_t)larger_int(i - 1, 0) * w + j]) * aspect;
    const float slope = __builtin_sqrtf(x * x + y * y);
    return slope == slope ? slope : 0;
}

/* Mean of a histogram's bin and its neighbours, which count half; 0 where nothing is in them. */
static float mean_of_bin(const float *count, const float *sum, int k) {
    const float n = 2 * count[k] + count[k - 1] + count[k + 1];
    return n > 0 ? (2 * sum[k] + sum[k - 1] + sum[k + 1]) / n : 0;
}

/* The level of the rim as a share of the deepest: down from the steepest while the surface is nearly as steep. */
static float rim_of(const float *count, const float *sum) {
    float mean[LAST_LEVEL];
    int k = FIRST_LEVEL;
    for (int i = FIRST_LEVEL; i < LAST_LEVEL; i++) {
        mean[i] = mean_of_bin(count, sum, i);
        if (mean[i] > mean[k]) k = i;
    }
    const float least = STEEP * mean[k];
    while (k > FIRST_LEVEL && mean[k - 1] >= least) k--;
    const float back = k > FIRST_LEVEL ? (mean[k] - least) / (mean[k] - mean[k - 1]) : 0;
    return ((float)k + 0.5F - back) / LEVELS;
}

/* Put the depth at the rim of each region's contact where its largest depth was. slot: of the regions that are large
 * enough, which histogram they have; histogram: 2 LEVELS for each, of how many blocks have a depth, and how steep. */
static void rim_levels(const float *blocks, float threshold, float aspect, const int32_t *label, int32_t *parent, float *deepest,
                       int32_t *slot, float *histogram, int labels, int w, int h) {
    int slots = 0;
    for (int a = 0; a < labels; a++) slot[a] = 0;
    for (ptrdiff_t at = 0; at < (ptrdiff_t)w * h; at++)
        if (label[at]) slot[root(parent, label[at])]++;
    for (int a = 1; a < labels; a++) slot[a] = slot[a] >= FEWEST_BLOCKS ? slots++ : -1;
    for (int k = 0; k < 2 * LEVELS * slots; k++) histogram[k] = 0;
    for (int i = 0; i < h; i++)
        for (int j = 0; j < w; j++) {
            if (!label[(ptrdiff_t)i * w + j]) continue;
            const int a = root(parent, label[(ptrdiff_t)i * w + j]);
            if (slot[a] < 0) continue;
            float *bin = histogram + 2 * LEVELS * (ptrdiff_t)slot[a];
            bin += smaller_int((int)(blocks[(ptrdiff_t)i * w + j] * (LEVELS / deepest[a])), LEVELS - 1);
            bin[0] += 1;
            bin[LEVELS] += steepness(blocks, i, j, aspect, w, h);
        }
    for (int a = 1; a < labels; a++) {
        const float *count = histogram + 2 * LEVELS * (ptrdiff_t)slot[a];
        deepest[a] = larger(deepest[a] * (slot[a] < 0 ? 0.5F : rim_of(count, count + LEVELS)), threshold);
    }
}

/* `find_contact`: mask of what is deeper than the rim of its region's contact.
 *
 * aspect: width of a pixel over its height. result: pixels in contact, largest depth, sums of their columns and rows.
 * blocks, label: ceil(width / 2) ceil(height / 2); parent, deepest, slot: one more; histogram: 2 LEVELS for each
 * FEWEST_BLOCKS of the blocks; level: ceil(width / 2). */
EXPORT void find_contact(const float *depth, float threshold, float aspect, uint8_t *mask, double *result, float *blocks,
                         int32_t *label, int32_t *parent, float *deepest, int32_t *slot, float *histogram, float *level,
                         int width, int height) {
    const int w = (width + 1) / 2, h = (height + 1) / 2;
    second_largest(depth, blocks, width, height);
    const int labels = label_regions(blocks, threshold, label, parent, deepest, w, h);
    for (int k = 0; k < 4; k++) result[k] = 0;
    for (int a = 1; a < labels; a++)
        if (root(parent, a) == a && deepest[a] > result[1]) result[1] = deepest[a];
    rim_levels(blocks, threshold, aspect, label, parent, deepest, slot, histogram, labels, w, h);
    for (int i = 0; i < h; i++) {
        int any = 0;
        for (int j = 0; j < w; j++) {
            const int a = label[(ptrdiff_t)i * w + j];
            level[j] = a ? deepest[root(parent, a)] : __builtin_inff();
            any |= a;
        }
        for (int y = 2 * i; y < 2 * i + 2 && y < height; y++)
            mark_row(depth + (ptrdiff_t)y * width, any ? level : 0, mask + (ptrdiff_t)y * width, y, result, width);
    }
}

/* Runs of the mask, numbered from 0 on in the order of their rows: where each begins and ends in the image, and whose number
 * its part of the contact has. Runs that meet, at corners too, are of one part, whose number is the smallest of theirs. */
static int find_runs(const uint8_t *mask, int32_t *begin, int32_t *end, int32_t *parent, int width, int height) {
    int count = 0, above = 0;
    for (int y = 0; y < height; y++) {
        const int first = count, row = y * width;
        int any = 0;
        for (int x = 0; x < width; x++) any |= mask[row + x];
        for (int x = 0; any && x < width; x++) {
            if (!mask[row + x]) continue;
            begin[count] = row + x;
            while (x < width && mask[row + x]) x++;
            end[count] = row + x;
            parent[count] = count;
            for (; above < first && end[above] + width < begin[count]; above++);
            for (int k = above; k < first && begin[k] + width <= end[count]; k++) {
                const int a = root(parent, k), b = root(parent, count);
                parent[larger_int(a, b)] = smaller_int(a, b);
            }
            count++;
        }
        above = first;
    }
    return count;
}

/* Measure the connected parts of a contact (`contact.measure_patches`), in the order of their first pixels.
 *
 * slopes: two planes. view_x: (W) and view_y: (H) pixels from the axis, in heights of the camera; nearness: 1 / its height, 0
 * along parallel rays. fewest: pixels, smaller parts are left out. runs: 4 H ceil(W / 2); parts: (H W / fewest, 6) pixels of
 * gel at rest that are as large (`Perspective.shares`), sums of their columns and rows, largest depth, sum of depth, largest
 * square of the slope. Returns how many parts, or -1 where one has no pixel in a touched cell: that is no contact. */
EXPORT int measure_parts(const uint8_t *mask, const uint8_t *touched, const float *depth, const float *slopes,
                         const float *view_x, const float *view_y, float nearness, int fewest, int32_t *runs, double *parts,
                         int width, int height) {
    const ptrdiff_t most = (ptrdiff_t)height * ((width + 1) / 2), plane = (ptrdiff_t)width * height;
    int32_t *begin = runs, *end = begin + most, *parent = end + most, *size = parent + most;
    const int count = find_runs(mask, begin, end, parent, width, height);
    int found = 0;
    for (int k = 0; k < count; k++) size[k] = 0; /* pixels; below 0 while nothing of it is touched */
    for (int k = 0; k < count; k++) {
        const int a = root(parent, k), y = begin[k] / width, x = begin[k] % width, pixels = end[k] - begin[k];
        const uint8_t *cells = touched + (ptrdiff_t)(y / CELL) * cells_of(width);
        int felt = size[a] > 0;
        for (int j = x / CELL; j <= (x + pixels - 1) / CELL; j++) felt |= cells[j];
        size[a] = (size[a] < 0 ? -size[a] : size[a]) + pixels;
        if (!felt) size[a] = -size[a];
    }
    for (int k = 0; k < count; k++) {
        if (size[k] < 0) return -1;
        if (parent[k] != k) continue;
        const int number = size[k] >= fewest ? found++ : -1;
        for (int c = 0; number >= 0 && c < 6; c++) parts[6 * (ptrdiff_t)number + c] = c == 3 ? -__builtin_inf() : 0;
        size[k] = number;
    }
    for (int k = 0; k < count; k++) {
        const int number = size[root(parent, k)], y = begin[k] / width;
        if (number < 0) continue;
        double *part = parts + 6 * (ptrdiff_t)number, sum = 0, pixels = end[k] - begin[k], columns, rows;
        const int x = begin[k] % width;
        float deepest = (float)part[3], steepest = (float)part[5];
        for (int at = begin[k]; at < end[k]; at++) {
            sum += depth[at];
            deepest = larger(deepest, depth[at]);
            steepest = larger(steepest, squared(slopes[at]) + squared(slopes[plane + at]));
        }
        columns = pixels * (x + (pixels - 1) / 2), rows = pixels * y;
        if (nearness > 0) {
            const double middle_x = (width - 1) / 2.0, middle_y = (height - 1) / 2.0;
            pixels = columns = rows = sum = 0;
            for (int at = begin[k], j = x; at < end[k]; at++, j++) {
                const float share = 1 - depth[at] * nearness;
                const float here = share * share / (1 + view_x[j] * slopes[at] + view_y[y] * slopes[plane + at]);
                pixels += here;
                columns += here * (middle_x + share * (j - middle_x));
                rows += here * (middle_y + share * (y - middle_y));
                sum += here * depth[at];
            }
        }
        part[0] += pixels;
        part[1] += columns;
        part[2] += rows;
        part[3] = deepest;
        part[4] += sum;
        part[5] = steepest;
    }
    return found;
}
