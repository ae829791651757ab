/* Depth map to contact: `contact.py` says what counts as one. */
#include "frame_path.h"

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

/* `find_contact`: mask of what is at least half as deep as the deepest point of its region.
 *
 * result: pixels in contact, largest depth, sums of their columns and rows. blocks, label: ceil(width / 2) ceil(height / 2);
 * parent, deepest: one more; level: ceil(width / 2). */
EXPORT void find_contact(const float *depth, float threshold, uint8_t *mask, double *result, float *blocks, int32_t *label,
                         int32_t *parent, float *deepest, float *level, int width, int height) {
    const int w = (width + 1) / 2, h = (height + 1) / 2;
    second_largest(depth, blocks, width, height);
    const int labels = label_regions(blocks, threshold, label, parent, deepest, w, h);
    for (int k = 0; k < 4; k++) result[k] = 0;
    for (int a = 1; a < labels; a++)
        if (root(parent, a) == a && deepest[a] > result[1]) result[1] = deepest[a];
    for (int i = 0; i < h; i++) {
        int any = 0;
        for (int j = 0; j < w; j++) {
            const int a = label[(ptrdiff_t)i * w + j];
            level[j] = a ? larger(deepest[root(parent, a)] / 2, threshold) : __builtin_inff();
            any |= a;
        }
        for (int y = 2 * i; y < 2 * i + 2 && y < height; y++)
            mark_row(depth + (ptrdiff_t)y * width, any ? level : 0, mask + (ptrdiff_t)y * width, y, result, width);
    }
}
