/* Choice among levels of roughening, per pixel and without a reference: what `opsr` does with a film of several levels.
 *
 * C99, no dependencies. One function, `opsr_resolve`, on the means of four batches of samples. The recipe of the levels:
 *
 *   one path carries K levels; level k multiplies the factors of the table by opsr_scales[k] (at most 1), level 0 is the
 *   path tracer as it is. Sample number n belongs to batch n % 4.
 *   At a vertex of roughness alpha a light sample is evaluated at the roughness of every level, with one shadow ray; where
 *   no level roughens, the light goes to all levels and to the sum of what they share, P.
 *   Features of a path, for blurs that stop at edges, zero where there is no surface: normal of the first vertex of
 *   roughness 0.05 or more, or with a diffuse base of reflectance 0.04 or more, and the length of the path to it (of the
 *   last vertex where none is); normal of the first vertex, its distance, its reflectance (that of the base below a coat
 *   or sheen). Eleven numbers, averaged over all samples.
 *
 * Formulas: docs/method.md, "Levels". Everything is linear radiance; a factor on all light changes nothing but the error.
 * Memory: about 1 kB a pixel while it runs; a large picture may be cut into tiles with 48 pixels around them.
 */
#ifndef OPSR_RESOLVE_H
#define OPSR_RESOLVE_H

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define OPSR_BATCHES 4
#define OPSR_FEATURES 11
#define OPSR_MAX_LEVELS 8

/* Scales of four levels. */
static const float opsr_scales[4] = {0.0f, 0.64f, 3.2f, 16.0f};

/* Smoothing: levels alone, or blurs too. */
enum { OPSR_SHARP, OPSR_DEFAULT };

typedef struct {
    int width, height, levels; /* 2 to OPSR_MAX_LEVELS levels */
    /* Means of the batches, rows from the top: light[((level * 4 + batch) * height * width + pixel) * 3 + channel]; after
     * the last level the light that all of them share. */
    const float *light;
    const float *features;      /* features[pixel * 11 + i] */
    float shares[OPSR_BATCHES]; /* share of each batch in the samples: 0.25 where they are equally long */
    int smoothing;
} opsr_film;

typedef struct {
    float *picture;       /* 3 a pixel */
    unsigned char *level; /* chosen level of roughening */
    float *bias2;         /* squared bias and variance over the squared picture + 0.01: their sum is the squared */
    float *variance;      /* relative error that is to be expected */
    float *error;         /* error map: relative error to be expected, at most 1; its mean is the average error of the picture */
} opsr_resolved;

/* Light of a pixel in batches. */
typedef struct {
    float v[OPSR_BATCHES][3];
} opsr_light;

typedef struct {
    int level, sharper, dark_side;
    int blur, wider; /* its blur's number, 0 for none; number of the candidate with the next wider one, or -1 */
    opsr_light *light;
    float *missing; /* 3 a pixel, or none */
} opsr_candidate;

/* ---- means over the pixels around ---- */

/* Mean over the square of this radius, of c numbers a pixel; `row` has room for a column or a row of them. */
static void opsr_box(float *a, int w, int h, int c, int radius, float *line) {
    for (int axis = 0; axis < 2; axis++) {
        int n = axis ? h : w, lines = axis ? w : h;
        size_t step = (size_t)(axis ? w : 1) * c, next = (size_t)(axis ? 1 : w) * c;
        for (int l = 0; l < lines; l++) {
            float *start = a + (size_t)l * next;
            for (int i = 0; i < n; i++) memcpy(line + (size_t)i * c, start + i * step, c * sizeof(float));
            for (int i = 0; i < n; i++) {
                int from = i > radius ? i - radius : 0, to = i + radius + 1 < n ? i + radius + 1 : n;
                for (int k = 0; k < c; k++) {
                    float sum = 0.0f;
                    for (int j = from; j < to; j++) sum += line[(size_t)j * c + k];
                    start[i * step + k] = sum / (float)(to - from);
                }
            }
        }
    }
}

static int opsr_tent(float *a, int w, int h, int c, int radius) {
    float *line = (float *)malloc((size_t)(w > h ? w : h) * c * sizeof(float));
    if (!line) return -1;
    opsr_box(a, w, h, c, radius, line);
    opsr_box(a, w, h, c, radius, line);
    free(line);
    return 0;
}

/* ---- batches ---- */

/* Unbiased for the squared mean of independent numbers of one mean. */
static float opsr_squared(const float d[OPSR_BATCHES]) {
    float sum = 0.0f, squares = 0.0f;
    for (int b = 0; b < OPSR_BATCHES; b++) { sum += d[b]; squares += d[b] * d[b]; }
    return (sum * sum - squares) / (OPSR_BATCHES * (OPSR_BATCHES - 1));
}

static float opsr_variance(const float x[OPSR_BATCHES]) {
    float mean = (x[0] + x[1] + x[2] + x[3]) / OPSR_BATCHES, squares = 0.0f;
    for (int b = 0; b < OPSR_BATCHES; b++) squares += (x[b] - mean) * (x[b] - mean);
    return squares / (OPSR_BATCHES * (OPSR_BATCHES - 1));
}

static float opsr_median(const float x[OPSR_BATCHES]) {
    float low = fmaxf(fminf(x[0], x[1]), fminf(x[2], x[3])), high = fminf(fmaxf(x[0], x[1]), fmaxf(x[2], x[3]));
    return 0.5f * (low + high); /* the middle two */
}

static void opsr_channel(const opsr_light *l, int c, float x[OPSR_BATCHES]) {
    for (int b = 0; b < OPSR_BATCHES; b++) x[b] = l->v[b][c];
}

static float opsr_mean(const opsr_film *f, const opsr_light *l, int c) {
    float sum = 0.0f;
    for (int b = 0; b < OPSR_BATCHES; b++) sum += l->v[b][c] * f->shares[b];
    return sum;
}

/* Light of a level less the shared light, or the shared light. */
static opsr_light opsr_at(const opsr_film *f, int level, size_t pixel) {
    size_t n = (size_t)f->width * f->height;
    opsr_light out;
    for (int b = 0; b < OPSR_BATCHES; b++)
        for (int c = 0; c < 3; c++) {
            float shared = f->light[(((size_t)f->levels * 4 + b) * n + pixel) * 3 + c];
            out.v[b][c] = level == f->levels ? shared : f->light[(((size_t)level * 4 + b) * n + pixel) * 3 + c] - shared;
        }
    return out;
}

/* ---- cells of 4 x 4 pixels ---- */

#define OPSR_CELL 4

typedef struct {
    int w, h, columns, rows;
} opsr_grid;

static opsr_grid opsr_cells(const opsr_film *f) {
    opsr_grid g = {f->width, f->height, (f->width + 3) / OPSR_CELL, (f->height + 3) / OPSR_CELL};
    return g;
}

/* First and last pixels of a cell. */
static void opsr_inside(opsr_grid g, int cell, int r[4]) {
    int x = cell % g.columns * OPSR_CELL, y = cell / g.columns * OPSR_CELL;
    r[0] = x; r[1] = x + OPSR_CELL < g.w ? x + OPSR_CELL : g.w;
    r[2] = y; r[3] = y + OPSR_CELL < g.h ? y + OPSR_CELL : g.h;
}

/* A plane of c numbers a cell at a pixel, bilinearly. */
static float opsr_corners(opsr_grid g, const float *plane, int c, int k, int pixel) {
    float x = fminf(fmaxf((pixel % g.w + 0.5f) / OPSR_CELL - 0.5f, 0.0f), (float)(g.columns - 1));
    float y = fminf(fmaxf((pixel / g.w + 0.5f) / OPSR_CELL - 0.5f, 0.0f), (float)(g.rows - 1));
    int x0 = (int)x, y0 = (int)y, x1 = x0 + 1 < g.columns ? x0 + 1 : x0, y1 = y0 + 1 < g.rows ? y0 + 1 : y0;
    float u = x - x0, v = y - y0;
    return plane[((size_t)y0 * g.columns + x0) * c + k] * (1 - u) * (1 - v) + plane[((size_t)y0 * g.columns + x1) * c + k] * u * (1 - v)
         + plane[((size_t)y1 * g.columns + x0) * c + k] * (1 - u) * v + plane[((size_t)y1 * g.columns + x1) * c + k] * u * v;
}

static float opsr_expected(float pixels, float grey, float size) {
    return pixels * OPSR_BATCHES * grey / fmaxf(size, FLT_MIN);
}

/* A layer in cells: means[level][cell][batch][channel], and the size of its hits[level][cell]. */
typedef struct {
    int levels;
    float *means, *hits;
} opsr_coarse;

static int opsr_coarse_of(const opsr_film *f, int shared, opsr_coarse *out) {
    opsr_grid g = opsr_cells(f);
    size_t cells = (size_t)g.columns * g.rows;
    out->levels = shared ? 1 : f->levels;
    out->means = (float *)calloc(cells * out->levels * 12, sizeof(float));
    out->hits = (float *)calloc(cells * out->levels, sizeof(float));
    float *moments = (float *)malloc(cells * 2 * sizeof(float));
    if (!out->means || !out->hits || !moments) { free(moments); return -1; }
    for (int k = 0; k < out->levels; k++) {
        for (int turn = 0; turn < 2; turn++) {
            memset(moments, 0, cells * 2 * sizeof(float));
            for (size_t cell = 0; cell < cells; cell++) {
                int r[4];
                opsr_inside(g, (int)cell, r);
                float part = 1.0f / ((r[1] - r[0]) * (r[3] - r[2]));
                for (int y = r[2]; y < r[3]; y++)
                    for (int x = r[0]; x < r[1]; x++) {
                        opsr_light l = opsr_at(f, shared ? f->levels : k, (size_t)y * g.w + x);
                        for (int b = 0; b < OPSR_BATCHES; b++) {
                            float grey = 0.0f;
                            for (int c = 0; c < 3; c++) {
                                float v = shared ? l.v[b][c] : fmaxf(l.v[b][c], 0.0f);
                                if (!turn) out->means[((k * cells + cell) * 4 + b) * 3 + c] += part * v;
                                grey += v / 3.0f;
                            }
                            moments[cell * 2] += part * grey;
                            moments[cell * 2 + 1] += part * grey * grey;
                        }
                    }
            }
            if (opsr_tent(moments, g.columns, g.rows, 2, turn ? 3 : 1)) { free(moments); return -1; }
            for (size_t cell = 0; cell < cells; cell++) {
                float size = moments[cell * 2 + 1] / fmaxf(moments[cell * 2], FLT_MIN), *hits = out->hits + k * cells + cell;
                *hits = fmaxf(*hits, size);
            }
        }
    }
    /* A level that has met nothing: the same light comes in hits no smaller than a rougher level's. */
    for (int k = out->levels - 1; k > 0; k--)
        for (size_t cell = 0; cell < cells; cell++)
            out->hits[(k - 1) * cells + cell] = fmaxf(out->hits[(k - 1) * cells + cell], out->hits[k * cells + cell]);
    free(moments);
    return 0;
}

/* Factors on a layer of the picture, 3 a cell. */
static int opsr_energy(const opsr_film *f, const opsr_coarse *of, const float *layer, float *factors) {
    opsr_grid g = opsr_cells(f);
    size_t cells = (size_t)g.columns * g.rows;
    float *smooth = (float *)malloc(cells * of->levels * 12 * sizeof(float)), *have = (float *)calloc(cells * 3, sizeof(float));
    int failed = !smooth || !have;
    if (!failed) {
        memcpy(smooth, of->means, cells * of->levels * 12 * sizeof(float));
        for (int k = 0; k < of->levels; k++) failed |= opsr_tent(smooth + k * cells * 12, g.columns, g.rows, 12, 3);
        for (size_t cell = 0; cell < cells; cell++) {
            int r[4];
            opsr_inside(g, (int)cell, r);
            for (int y = r[2]; y < r[3]; y++)
                for (int x = r[0]; x < r[1]; x++)
                    for (int c = 0; c < 3; c++)
                        have[cell * 3 + c] += layer[((size_t)y * g.w + x) * 3 + c] / ((r[1] - r[0]) * (r[3] - r[2]));
        }
        failed |= opsr_tent(have, g.columns, g.rows, 3, 3);
    }
    for (size_t cell = 0; !failed && cell < cells; cell++) {
        float mean[OPSR_MAX_LEVELS][3], greys[OPSR_MAX_LEVELS], noise[OPSR_MAX_LEVELS], least = FLT_MAX;
        int rough = of->levels - 1, best = 0;
        for (int k = 0; k < of->levels; k++)
            for (int c = 0; c < 3; c++) {
                mean[k][c] = 0.0f;
                for (int b = 0; b < OPSR_BATCHES; b++) mean[k][c] += smooth[((k * cells + cell) * 4 + b) * 3 + c] / OPSR_BATCHES;
            }
        for (int k = 0; k < of->levels; k++) greys[k] = (mean[k][0] + mean[k][1] + mean[k][2]) / 3.0f;
        for (int k = 0; k < of->levels; k++) {
            float size = of->hits[k * cells + cell], away = expf(-opsr_expected(1762.0f, greys[rough], size));
            noise[k] = 0.0f;
            for (int c = 0; c < 3; c++) {
                float x[OPSR_BATCHES];
                for (int b = 0; b < OPSR_BATCHES; b++) x[b] = smooth[((k * cells + cell) * 4 + b) * 3 + c];
                noise[k] += (opsr_variance(x) + fmaxf(mean[rough][c] - mean[k][c], 0.0f) * size / (OPSR_BATCHES * 1762.0f) * away) / 3.0f;
            }
            /* Light that this level has not met comes in at the next one; a bias grows to the last. */
            float lacks = greys[rough] - greys[k];
            if (k + 1 < rough && lacks > 0.0f && greys[k + 1] - greys[k] > 0.8f * lacks) noise[k] = fmaxf(noise[k], lacks * lacks);
            float bias = 0.0f;
            for (int j = 0; j < k; j++) {
                float u = 0.0f;
                for (int c = 0; c < 3; c++) {
                    float d[OPSR_BATCHES];
                    for (int b = 0; b < OPSR_BATCHES; b++)
                        d[b] = smooth[((k * cells + cell) * 4 + b) * 3 + c] - smooth[((j * cells + cell) * 4 + b) * 3 + c];
                    u += opsr_squared(d) / 3.0f;
                }
                bias = fmaxf(bias, u - noise[j]);
            }
            if (bias + noise[k] < least) { least = bias + noise[k]; best = k; }
        }
        for (int c = 0; c < 3; c++) {
            float x[OPSR_BATCHES], h = have[cell * 3 + c], m = mean[best][c] - h, floor = h * 1e-4f;
            for (int b = 0; b < OPSR_BATCHES; b++) x[b] = smooth[((best * cells + cell) * 4 + b) * 3 + c];
            float kept = fmaxf(1.0f - 2.0f * (opsr_variance(x) + floor * floor) / fmaxf(m * m, FLT_MIN), 0.0f);
            factors[cell * 3 + c] = fminf(fmaxf(1.0f + m * kept / fmaxf(h, FLT_MIN), 0.5f), 16.0f);
        }
    }
    if (!failed) failed = opsr_tent(factors, g.columns, g.rows, 3, 1);
    free(smooth);
    free(have);
    return failed ? -1 : 0;
}

/* Most light of a batch of P that is blurred, 3 a cell: what is above is a firefly. */
static int opsr_caps(const opsr_film *f, float *most) {
    opsr_grid g = opsr_cells(f);
    size_t cells = (size_t)g.columns * g.rows;
    float *hits = (float *)calloc(cells * 4, sizeof(float));
    if (!hits) return -1;
    memset(most, 0, cells * 3 * sizeof(float));
    for (size_t cell = 0; cell < cells; cell++) {
        int r[4];
        opsr_inside(g, (int)cell, r);
        float part = 1.0f / ((r[1] - r[0]) * (r[3] - r[2]));
        for (int y = r[2]; y < r[3]; y++)
            for (int x = r[0]; x < r[1]; x++) {
                opsr_light l = opsr_at(f, f->levels, (size_t)y * g.w + x);
                for (int c = 0; c < 3; c++) {
                    float v[OPSR_BATCHES];
                    opsr_channel(&l, c, v);
                    most[cell * 3 + c] += part * opsr_median(v);
                    hits[cell * 4 + c] += part * (v[0] + v[1] + v[2] + v[3]);
                }
                for (int b = 0; b < OPSR_BATCHES; b++)
                    hits[cell * 4 + 3] += part * (l.v[b][0] != 0.0f || l.v[b][1] != 0.0f || l.v[b][2] != 0.0f);
            }
    }
    int failed = opsr_tent(most, g.columns, g.rows, 3, 1) | opsr_tent(hits, g.columns, g.rows, 4, 2);
    for (size_t cell = 0; cell < cells; cell++)
        for (int c = 0; c < 3; c++)
            most[cell * 3 + c] = 10.0f * most[cell * 3 + c] + (hits[cell * 4 + 3] > 0.0f ? hits[cell * 4 + c] * (4.0f / hits[cell * 4 + 3]) : 0.0f);
    free(hits);
    return failed;
}

/* ---- blurs that stop at edges ---- */

/* Squared length of the mean normal in a pixel: 1 less the variance of its normals. */
static float opsr_length2(const opsr_film *f, int at, int x, int y) {
    const float *n = f->features + ((size_t)y * f->width + x) * OPSR_FEATURES + at;
    return n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
}

/* Variance of the normals in a pixel on an edge between surfaces. What two pixels on opposite sides have, too, is no edge. */
static float opsr_spread(const opsr_film *f, int at, int x, int y) {
    static const int sides[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    float most = 0.0f;
    if (x == 0 || y == 0 || x + 1 == f->width || y + 1 == f->height) return 0.0f;
    for (int i = 0; i < 4; i++) {
        int dx = sides[i][0], dy = sides[i][1];
        most = fmaxf(most, fminf(opsr_length2(f, at, x - dx, y - dy), opsr_length2(f, at, x + dx, y + dy)));
    }
    return fmaxf(most - opsr_length2(f, at, x, y), 0.0f);
}

/* Guides of a pixel: of its first surface or its first rough one. */
typedef struct {
    int at, x, y;
    float length, here, slope, spread;
} opsr_guide;

#define OPSR_F(x, y, i) f->features[((size_t)(y) * f->width + (x)) * OPSR_FEATURES + (i)]
static opsr_guide opsr_guide_of(const opsr_film *f, int first, int x, int y) {
    int w = f->width, h = f->height, at = first ? 4 : 0;
    float length = OPSR_F(x, y, at + 3);
    float across = fabsf(OPSR_F(x + 1 < w ? x + 1 : x, y, at + 3) - OPSR_F(x > 0 ? x - 1 : 0, y, at + 3));
    float along = fabsf(OPSR_F(x, y + 1 < h ? y + 1 : y, at + 3) - OPSR_F(x, y > 0 ? y - 1 : 0, at + 3));
    opsr_guide guide = {at, x, y, length, 0.02f * length + sqrtf(FLT_MIN), 0.25f * fmaxf(across, along), opsr_spread(f, at, x, y)};
    return guide;
}

/* Weight, at most 1, of another pixel for one with these guides; `scale` is 1 / (2 sigma^2). */
static float opsr_alike(const opsr_film *f, opsr_guide g, int x, int y, float scale) {
    float d2 = (float)((x - g.x) * (x - g.x) + (y - g.y) * (y - g.y)), e = d2 * scale, normals = 0.0f;
    float step = (OPSR_F(x, y, g.at + 3) - g.length) / (g.here + g.slope * sqrtf(d2));
    e += 0.5f * step * step;
    for (int i = 0; i < 3; i++) {
        float d = OPSR_F(x, y, g.at + i) - OPSR_F(g.x, g.y, g.at + i);
        normals += d * d;
        d = (OPSR_F(x, y, 8 + i) - OPSR_F(g.x, g.y, 8 + i)) / 0.1f;
        e += 0.5f * d * d;
    }
    e += 10.0f * fmaxf(normals - g.spread, 0.0f); /* a pixel that shows several surfaces takes light of each */
    return expf(-fminf(e, 41.5888f)); /* at least 2^-60 */
}
#undef OPSR_F

/* `first`: along the first surface; otherwise along the first rough one. From every `step`th pixel in both
 * directions: more than one is for light that is blurred already. */
static void opsr_blur(const opsr_film *f, int first, float sigma, int step, const opsr_light *in, opsr_light *out) {
    int w = f->width, h = f->height, radius = (int)ceilf(2.0f * sigma) / step * step;
    float most = 2.2f * sigma * 2.2f * sigma;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            opsr_guide guide = opsr_guide_of(f, first, x, y);
            float all = 0.0f;
            opsr_light sum;
            memset(&sum, 0, sizeof sum);
            for (int dy = -radius; dy <= radius; dy += step) {
                float left = most - (float)(dy * dy);
                if (left < 0.0f || y + dy < 0 || y + dy >= h) continue;
                int half = ((int)sqrtf(left) < radius ? (int)sqrtf(left) : radius) / step * step;
                for (int dx = -half; dx <= half; dx += step) {
                    if (x + dx < 0 || x + dx >= w) continue;
                    float weight = opsr_alike(f, guide, x + dx, y + dy, 0.5f / (sigma * sigma));
                    const opsr_light *l = in + (size_t)(y + dy) * w + x + dx;
                    all += weight;
                    for (int b = 0; b < OPSR_BATCHES; b++)
                        for (int c = 0; c < 3; c++) sum.v[b][c] += weight * l->v[b][c];
                }
            }
            for (int b = 0; b < OPSR_BATCHES; b++)
                for (int c = 0; c < 3; c++) out[(size_t)y * w + x].v[b][c] = sum.v[b][c] / all;
        }
}

/* ---- the rule ---- */

/* Squared difference that is confirmed without the batch that has most of it. */
static float opsr_without_largest(const float d[OPSR_BATCHES]) {
    float sign = d[0] + d[1] + d[2] + d[3] > 0.0f ? 1.0f : -1.0f, sum = 0.0f, squares = 0.0f;
    int largest = 0;
    for (int b = 1; b < OPSR_BATCHES; b++)
        if (d[b] * sign > d[largest] * sign) largest = b;
    for (int b = 0; b < OPSR_BATCHES; b++)
        if (b != largest) { sum += d[b]; squares += d[b] * d[b]; }
    return (sum * sum - squares) / ((OPSR_BATCHES - 1) * (OPSR_BATCHES - 2));
}

/* Squared differences as far as a pixel beside shows as much, or those of `least`: hits that meet in one pixel by chance are
 * no bias. `old` has room for the plane. */
static void opsr_seen_again(int w, int h, float *square, const float *least, float *old) {
    memcpy(old, square, (size_t)w * h * 3 * sizeof(float));
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            for (int c = 0; c < 3; c++) {
                size_t i = ((size_t)y * w + x) * 3 + c;
                float most = fmaxf(least[i], 0.0f);
                for (int v = y > 0 ? y - 1 : 0; v < h && v <= y + 1; v++)
                    for (int u = x > 0 ? x - 1 : 0; u < w && u <= x + 1; u++)
                        if (u != x || v != y) most = fmaxf(most, old[((size_t)v * w + u) * 3 + c]);
                square[i] = fminf(old[i], most);
            }
}

/* Choices less those that chance makes: a pixel takes the next wider blur where too few pixels around have taken one as narrow as its
   own, of all and of those on its surface. `share` has room for a float a pixel; `first` says which surface. */
static int opsr_common(const opsr_film *f, int first, const opsr_candidate *all, int count, unsigned char *chosen, float *share) {
    int w = f->width, h = f->height, widest = 0;
    size_t n = (size_t)w * h;
    for (int k = 0; k < count; k++) widest = all[k].blur > widest ? all[k].blur : widest;
    unsigned char *old = (unsigned char *)malloc(n);
    float *line = (float *)malloc((size_t)(w > h ? w : h) * sizeof(float));
    int failed = !old || !line;
    if (!failed) memcpy(old, chosen, n);
    for (int blur = 0; !failed && blur < widest; blur++) {
        int radius = blur < 2 ? 3 : 4;
        float least = blur < 2 ? 0.37f : 0.49f;
        for (size_t i = 0; i < n; i++) share[i] = all[old[i]].blur <= blur;
        opsr_box(share, w, h, 1, radius, line);
        for (int i = 0; i < (int)n; i++) {
            if (all[chosen[i]].blur != blur || share[i] >= least || all[chosen[i]].wider < 0) continue;
            opsr_guide guide = opsr_guide_of(f, first, i % w, i / w);
            float narrow = 0.0f, near = 0.0f;
            for (int y = guide.y > radius ? guide.y - radius : 0; y < h && y <= guide.y + radius; y++)
                for (int x = guide.x > radius ? guide.x - radius : 0; x < w && x <= guide.x + radius; x++) {
                    float weight = opsr_alike(f, guide, x, y, 0.0f);
                    near += weight;
                    if (all[old[(size_t)y * w + x]].blur <= blur) narrow += weight;
                }
            if (narrow / near < least) chosen[i] = (unsigned char)all[chosen[i]].wider;
        }
    }
    free(old);
    free(line);
    return failed ? -1 : 0;
}

/* The most bias that a weighted squared difference shows where it may be a chance of few batches: that of the wider of two radii.
 * Infinite where it is above 4 standard deviations of what it is without bias, at one of them, of which 19/81 and 231/2401 are the
 * filters' share. `square` and `variance` are 3 a pixel. */
static int opsr_doubtful(int w, int h, const float *square, const float *variance, const float *weights, float *plane, float *most) {
    size_t n = (size_t)w * h;
    int failed = 0;
    memset(most, 0, n * sizeof(float));
    for (int scale = 0; !failed && scale < 2; scale++) {
        float z = 4.0f * sqrtf(2.0f * OPSR_BATCHES / (OPSR_BATCHES - 1.0f)) * (scale ? 231.0f / 2401.0f : 19.0f / 81.0f);
        for (size_t i = 0; i < n; i++) {
            const float *s = square + i * 3, *v = variance + i * 3, *a = weights + i * 3;
            plane[i * 2] = (s[0] * a[0] + s[1] * a[1] + s[2] * a[2]) / 3.0f;
            plane[i * 2 + 1] = (v[0] * a[0] + v[1] * a[1] + v[2] * a[2]) / 3.0f;
        }
        failed = opsr_tent(plane, w, h, 2, scale ? 3 : 1);
        for (size_t i = 0; i < n; i++) {
            if (plane[i * 2] > z * plane[i * 2 + 1]) most[i] = INFINITY;
            else if (scale) most[i] = fmaxf(most[i], plane[i * 2]);
        }
    }
    return failed;
}

/* Chooses among candidates, each judged against the `sharper` first of them; blends their means into `layer` and adds to
 * bias2, variance and the batches of the choice. `weights`: own and dark, 3 a pixel each. */
static int opsr_choose(const opsr_film *f, const opsr_candidate *all, int count, const float *own, const float *dark,
                       float *layer, unsigned char *level, float *bias2, float *variance, opsr_light *batches) {
    size_t n = (size_t)f->width * f->height;
    float *noise = (float *)malloc(n * 3 * sizeof(float)), *square = (float *)malloc(n * 3 * sizeof(float));
    float *least_square = (float *)malloc(n * 3 * sizeof(float)), *old = (float *)malloc(n * 3 * sizeof(float));
    float *anchors = (float *)malloc(n * count * sizeof(float)), *bias = (float *)malloc(n * sizeof(float));
    float *least = (float *)malloc(n * sizeof(float)), *biases = (float *)malloc(n * count * sizeof(float));
    float *spread = (float *)malloc(n * 3 * sizeof(float));
    unsigned char *chosen = (unsigned char *)calloc(n, 1);
    float *most = (float *)malloc(n * sizeof(float));
    int failed = !noise || !square || !least_square || !old || !anchors || !bias || !least || !biases || !chosen || !spread || !most;
    for (size_t i = 0; !failed && i < n; i++) least[i] = INFINITY;
    for (int k = 0; !failed && k < count; k++) {
        for (size_t i = 0; i < n; i++)
            for (int c = 0; c < 3; c++) {
                float x[OPSR_BATCHES];
                opsr_channel(all[k].light + i, c, x);
                noise[i * 3 + c] = opsr_variance(x);
            }
        failed = opsr_tent(noise, f->width, f->height, 3, 1);
        memset(bias, 0, n * sizeof(float));
        for (int j = 0; !failed && j < all[k].sharper; j++) {
            for (size_t i = 0; i < n; i++)
                for (int c = 0; c < 3; c++) {
                    float d[OPSR_BATCHES];
                    for (int b = 0; b < OPSR_BATCHES; b++) d[b] = all[k].light[i].v[b][c] - all[j].light[i].v[b][c];
                    square[i * 3 + c] = opsr_squared(d);
                    least_square[i * 3 + c] = opsr_without_largest(d);
                    spread[i * 3 + c] = opsr_variance(d);
                }
            if (all[k].missing) opsr_seen_again(f->width, f->height, square, least_square, old);
            const float *weights = all[k].dark_side ? dark : own;
            /* Roughening is a bias for sure. */
            for (size_t i = 0; i < n; i++) most[i] = INFINITY;
            if (all[k].blur && !all[k].missing)
                failed = opsr_doubtful(f->width, f->height, square, spread, weights, old, most);
            failed |= opsr_tent(square, f->width, f->height, 3, 1);
            for (size_t i = 0; i < n; i++) {
                float u = 0.0f;
                for (int c = 0; c < 3; c++) u += square[i * 3 + c] * weights[i * 3 + c] / 3.0f;
                if (most[i] < INFINITY) u = fminf(0.4f * u, most[i]);
                bias[i] = fmaxf(bias[i], u - 0.25f * anchors[j * n + i]);
            }
        }
        for (size_t i = 0; !failed && i < n; i++) {
            float v = 0.0f, edge = 0.0f;
            for (int c = 0; c < 3; c++) {
                float x = noise[i * 3 + c] + (all[k].missing ? all[k].missing[i * 3 + c] : 0.0f);
                v += x * own[i * 3 + c] / 3.0f;
                edge += x * fmaxf(own[i * 3 + c], 0.5f * dark[i * 3 + c]) / 3.0f;
            }
            anchors[k * n + i] = v;
            biases[k * n + i] = bias[i];
            float error = all[k].blur ? 1.5f * (bias[i] + edge) : bias[i] + v;
            if (error < least[i]) {
                least[i] = error;
                chosen[i] = (unsigned char)k;
            }
        }
    }
    if (!failed) failed = opsr_common(f, !all[0].missing, all, count, chosen, bias);
    if (!failed) memset(layer, 0, n * 3 * sizeof(float));
    for (int k = 0; !failed && k < count; k++) {
        for (size_t i = 0; i < n; i++) bias[i] = chosen[i] == k;
        failed = opsr_tent(bias, f->width, f->height, 1, 1);
        for (size_t i = 0; i < n; i++)
            for (int c = 0; bias[i] > 0.0f && c < 3; c++) {
                layer[i * 3 + c] += bias[i] * opsr_mean(f, all[k].light + i, c);
                for (int b = 0; b < OPSR_BATCHES; b++) batches[i].v[b][c] += bias[i] * all[k].light[i].v[b][c];
            }
    }
    for (size_t i = 0; !failed && i < n; i++) {
        if (level) level[i] = (unsigned char)all[chosen[i]].level;
        bias2[i] += biases[chosen[i] * n + i];
        variance[i] += anchors[chosen[i] * n + i];
    }
    free(noise); free(square); free(least_square); free(old); free(anchors); free(bias); free(least); free(biases); free(chosen);
    free(spread); free(most);
    return failed ? -1 : 0;
}

/* Adds a candidate with room for its light. */
static opsr_candidate *opsr_add(opsr_candidate *all, int *count, size_t n, int level, int sharper, int blur, int wider, int missing) {
    opsr_candidate *new_one = all + (*count)++;
    opsr_candidate value = {level, sharper, 0, blur, wider, NULL, NULL};
    *new_one = value;
    new_one->light = (opsr_light *)malloc(n * sizeof(opsr_light));
    if (missing) new_one->missing = (float *)malloc(n * 3 * sizeof(float));
    return new_one->light && (!missing || new_one->missing) ? new_one : NULL;
}

/* Standard deviations of blurs in pixels. That of 6 is for P alone, made of that of 1.5 by every third pixel. */
static const float opsr_blurs[4] = {0.7f, 1.5f, 3.0f, 6.0f};

/* P as it is, and blurred without its fireflies. */
static int opsr_of_shared(const opsr_film *f, opsr_candidate *all, int *count) {
    size_t n = (size_t)f->width * f->height;
    opsr_grid g = opsr_cells(f);
    opsr_candidate *one = opsr_add(all, count, n, 0, 0, 0, f->smoothing == OPSR_SHARP ? -1 : 1, 0);
    if (!one) return -1;
    for (size_t i = 0; i < n; i++) one->light[i] = opsr_at(f, f->levels, i);
    if (f->smoothing == OPSR_SHARP) return 0;
    float *caps = (float *)malloc((size_t)g.columns * g.rows * 3 * sizeof(float));
    opsr_light *capped = (opsr_light *)malloc(n * sizeof(opsr_light));
    int failed = !caps || !capped || opsr_caps(f, caps);
    for (size_t i = 0; !failed && i < n; i++)
        for (int c = 0; c < 3; c++) {
            float cap = opsr_corners(g, caps, 3, c, (int)i);
            for (int b = 0; b < OPSR_BATCHES; b++) capped[i].v[b][c] = fminf(all[0].light[i].v[b][c], cap);
        }
    for (int s = 0; !failed && s < 4; s++) {
        one = opsr_add(all, count, n, 0, s + 1, s + 1, s < 3 ? s + 2 : -1, 0);
        failed = !one;
        if (!one) break;
        float square = opsr_blurs[s] * opsr_blurs[s], base = opsr_blurs[1] * opsr_blurs[1];
        one->dark_side = 1;
        if (s < 3)
            opsr_blur(f, 1, opsr_blurs[s], 1, capped, one->light);
        else
            opsr_blur(f, 1, sqrtf(square - base), 3, all[2].light, one->light);
    }
    free(caps);
    free(capped);
    return failed ? -1 : 0;
}

/* What a level has not met at every pixel: its variance, 3 a pixel, and the hits that are expected. */
static int opsr_missing(const opsr_film *f, const opsr_coarse *coarse, int level, float *variance, float *expected) {
    size_t n = (size_t)f->width * f->height, cells;
    opsr_grid g = opsr_cells(f);
    cells = (size_t)g.columns * g.rows;
    float *planes = (float *)malloc(n * 12 * sizeof(float)); /* roughest, own; wide, narrow */
    int failed = !planes;
    for (int p = 0; !failed && p < 4; p++) {
        float *plane = planes + p * n * 3;
        for (size_t i = 0; i < n; i++) {
            opsr_light l = opsr_at(f, p < 2 ? f->levels - 1 : level, i);
            for (int c = 0; c < 3; c++) plane[i * 3 + c] = fmaxf(opsr_mean(f, &l, c), 0.0f);
        }
        failed = opsr_tent(plane, f->width, f->height, 3, p % 2 ? 1 : 2);
    }
    for (size_t i = 0; !failed && i < n; i++) {
        float size = opsr_corners(g, coarse->hits + level * cells, 1, 0, (int)i), grey = 0.0f;
        for (int c = 0; c < 3; c++) {
            float wide = planes[i * 3 + c] - planes[(2 * n + i) * 3 + c], narrow = planes[(n + i) * 3 + c] - planes[(3 * n + i) * 3 + c];
            variance[i * 3 + c] = fmaxf(fmaxf(wide, narrow), 0.0f) * size / OPSR_BATCHES;
            grey += planes[i * 3 + c] / 3.0f;
        }
        expected[i] = opsr_expected(12.0f, grey, size);
    }
    free(planes);
    return failed ? -1 : 0;
}

/* R at every level, and all but level 0 blurred. */
static int opsr_of_roughened(const opsr_film *f, const opsr_coarse *coarse, opsr_candidate *all, int *count) {
    size_t n = (size_t)f->width * f->height;
    float *variance = (float *)malloc(n * 3 * f->levels * sizeof(float)), *expected = (float *)malloc(n * f->levels * sizeof(float));
    int failed = !variance || !expected, blurs = f->smoothing == OPSR_SHARP ? 0 : 3;
    for (int k = 0; !failed && k < f->levels; k++)
        failed = opsr_missing(f, coarse, k, variance + k * n * 3, expected + k * n);
    for (int s = -1; !failed && s < blurs; s++)
        for (int k = s < 0 ? 0 : 1; !failed && k < f->levels; k++) {
            /* Level 0 is too noisy for a blur: its pixels take that of level 1. */
            int next = f->levels + (s + 1) * (f->levels - 1) + (k > 0 ? k - 1 : 0), wider = s + 1 < blurs && f->levels > 1 ? next : -1;
            opsr_candidate *one = opsr_add(all, count, n, k, s < 0 ? k : k + 1, s + 1, wider, 1);
            failed = !one;
            if (!one) break;
            float times = s < 0 ? 1.0f : 1.0f + opsr_blurs[s] * opsr_blurs[s];
            if (s < 0)
                for (size_t i = 0; i < n; i++) one->light[i] = opsr_at(f, k, i);
            else
                opsr_blur(f, 0, opsr_blurs[s], 1, all[k].light, one->light);
            for (size_t i = 0; i < n; i++)
                for (int c = 0; c < 3; c++)
                    one->missing[i * 3 + c] = variance[(k * n + i) * 3 + c] * expf(-expected[k * n + i] * times);
        }
    free(variance);
    free(expected);
    return failed ? -1 : 0;
}

/* Weights, own and for the darkest pixel around, 3 a pixel each, and what makes errors relative whatever the exposure. */
static int opsr_weights(const opsr_film *f, float *own, float *dark, float *stated) {
    int w = f->width, h = f->height;
    size_t n = (size_t)w * h;
    float *light = (float *)malloc(n * 3 * sizeof(float));
    if (!light) return -1;
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) {
        opsr_light p = opsr_at(f, f->levels, i), r = opsr_at(f, f->levels - 1, i);
        for (int c = 0; c < 3; c++) sum += light[i * 3 + c] = opsr_mean(f, &p, c) + opsr_mean(f, &r, c);
    }
    float gain = sum > 0.0 ? (float)(0.3 * 3.0 * (double)n / sum) : 1.0f;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            for (int c = 0; c < 3; c++) {
                float least = FLT_MAX;
                for (int v = y > 0 ? y - 1 : 0; v < h && v <= y + 1; v++)
                    for (int u = x > 0 ? x - 1 : 0; u < w && u <= x + 1; u++) least = fminf(least, light[((size_t)v * w + u) * 3 + c]);
                dark[((size_t)y * w + x) * 3 + c] = gain * gain / (least * gain * least * gain + 0.01f);
            }
    int failed = opsr_tent(light, w, h, 3, 1);
    for (size_t i = 0; i < n; i++) {
        float grey = 0.0f, raw = 0.0f;
        for (int c = 0; c < 3; c++) {
            float l = light[i * 3 + c];
            own[i * 3 + c] = gain * gain / (l * gain * l * gain + 0.01f);
            grey += own[i * 3 + c];
            raw += 1.0f / (l * l + 0.01f);
        }
        stated[i] = raw / grey;
    }
    free(light);
    return failed;
}

/* Mean absolute noise of a pixel, the channels added up: the mean of the three ways to halve its batches. */
static float opsr_noise(const opsr_film *f, const opsr_light *light) {
    float noise = 0.0f;
    for (int with = 1; with < OPSR_BATCHES; with++) {
        float sums[2][3] = {{0}}, shares[2] = {0}, apart = 0.0f;
        for (int b = 0; b < OPSR_BATCHES; b++) {
            int half = b != 0 && b != with;
            shares[half] += f->shares[b];
            for (int c = 0; c < 3; c++) sums[half][c] += f->shares[b] * light->v[b][c];
        }
        for (int c = 0; c < 3; c++) apart += fabsf(sums[0][c] / shares[0] - sums[1][c] / shares[1]);
        noise += apart / sqrtf(1.0f / shares[0] + 1.0f / shares[1]) / (OPSR_BATCHES - 1);
    }
    return noise;
}

/* The error map, from the batches of the choice and its light before it was brought to its energy. */
static int opsr_errors(const opsr_film *f, const opsr_light *batches, const float *before, const opsr_resolved *out) {
    size_t n = (size_t)f->width * f->height;
    double sum = 0.0;
    int black = 1;
    for (size_t i = 0; i < n; i++) {
        const float *p = out->picture + i * 3;
        sum += fmaxf(p[0] + p[1] + p[2], 0.0f);
        black &= p[0] == 0.0f && p[1] == 0.0f && p[2] == 0.0f;
    }
    for (size_t i = 0; i < n; i++) {
        const float *p = out->picture + i * 3;
        float light = p[0] + p[1] + p[2], noise = opsr_noise(f, batches + i);
        if (before[i] > 0.0f) noise *= light / before[i];
        out->error[i] = black ? 1.0f : noise == 0.0f ? 0.0f : fminf(1.65f * noise / (fmaxf(light, 0.0f) + (float)(sum / (30.0 * (double)n))), 1.0f);
    }
    return opsr_tent(out->error, f->width, f->height, 1, 1);
}

/* Chooses. 0, or -1 where there is not enough memory. */
static int opsr_resolve(const opsr_film *f, const opsr_resolved *out) {
    size_t n = (size_t)f->width * f->height;
    opsr_grid g = opsr_cells(f);
    size_t cells = (size_t)g.columns * g.rows;
    opsr_candidate all[3 + 4 * OPSR_MAX_LEVELS];
    opsr_coarse coarse[2] = {{0, NULL, NULL}, {0, NULL, NULL}};
    float *own = (float *)malloc(n * 3 * sizeof(float)), *dark = (float *)malloc(n * 3 * sizeof(float));
    float *stated = (float *)malloc(n * sizeof(float)), *layer = (float *)malloc(n * 3 * sizeof(float));
    float *factors = (float *)malloc(cells * 3 * sizeof(float)), *before = (float *)calloc(n, sizeof(float));
    opsr_light *batches = (opsr_light *)calloc(n, sizeof(opsr_light));
    int failed = !own || !dark || !stated || !layer || !factors || !before || !batches || opsr_weights(f, own, dark, stated);
    memset(out->picture, 0, n * 3 * sizeof(float));
    memset(out->bias2, 0, n * sizeof(float));
    memset(out->variance, 0, n * sizeof(float));
    for (int rough = 0; !failed && rough < 2; rough++) {
        int count = 0;
        failed = opsr_coarse_of(f, !rough, coarse + rough);
        if (!failed) failed = rough ? opsr_of_roughened(f, coarse + 1, all, &count) : opsr_of_shared(f, all, &count);
        if (!failed) failed = opsr_choose(f, all, count, own, dark, layer, rough ? out->level : NULL, out->bias2, out->variance, batches);
        if (!failed) failed = opsr_energy(f, coarse + rough, layer, factors);
        for (size_t i = 0; !failed && i < n; i++)
            for (int c = 0; c < 3; c++) {
                before[i] += layer[i * 3 + c];
                out->picture[i * 3 + c] += layer[i * 3 + c] * opsr_corners(g, factors, 3, c, (int)i);
            }
        for (int k = 0; k < count; k++) {
            free(all[k].light);
            free(all[k].missing);
        }
        free(coarse[rough].means);
        free(coarse[rough].hits);
    }
    for (size_t i = 0; !failed && i < n; i++) {
        out->bias2[i] *= stated[i];
        out->variance[i] *= stated[i];
    }
    if (!failed) failed = opsr_errors(f, batches, before, out);
    free(own); free(dark); free(stated); free(layer); free(factors); free(before); free(batches);
    return failed ? -1 : 0;
}

#ifdef OPSR_RESOLVE_TEST
/* ---- a test picture, for ports: a floor and a wall, light in rare hits at level 0, even at the roughest ---- */

enum { OPSR_TEST_WIDTH = 24, OPSR_TEST_HEIGHT = 16, OPSR_TEST_LEVELS = 3, OPSR_TEST_PIXELS = 24 * 16 };

/* Xorshift in 32 bits, as a number in [0, 1). */
static float opsr_test_next(unsigned *state) {
    *state = (*state ^ *state << 13) & 0xffffffffu;
    *state ^= *state >> 17;
    *state = (*state ^ *state << 5) & 0xffffffffu;
    return (float)(*state >> 8) / 16777216.0f;
}

/* light[(OPSR_TEST_LEVELS + 1) * 4 * OPSR_TEST_PIXELS * 3], features[OPSR_TEST_PIXELS * 11]. */
static void opsr_test_film(float *light, float *features) {
    unsigned state = 2463534242u;
    for (int i = 0; i < OPSR_TEST_PIXELS; i++) {
        int wall = i % OPSR_TEST_WIDTH >= 15;
        float surface[OPSR_FEATURES] = {0, 0, 1, 5, 0, (float)wall, (float)!wall, 4, wall ? 0.8f : 0.5f, 0.5f, 0.5f};
        memcpy(features + (size_t)i * OPSR_FEATURES, surface, sizeof surface);
        for (int b = 0; b < OPSR_BATCHES; b++) {
            float shared = 0.2f + 0.1f * opsr_test_next(&state), lit = wall ? 0.25f : 1.0f, rough[OPSR_TEST_LEVELS];
            rough[0] = opsr_test_next(&state) < 0.03f ? 6.0f * lit : 0.0f;
            rough[1] = lit * (0.05f + 0.3f * opsr_test_next(&state));
            rough[2] = lit * (0.19f + 0.04f * opsr_test_next(&state));
            for (int k = 0; k <= OPSR_TEST_LEVELS; k++)
                for (int c = 0; c < 3; c++)
                    light[((size_t)(k * 4 + b) * OPSR_TEST_PIXELS + i) * 3 + c] =
                        shared + (k < OPSR_TEST_LEVELS ? rough[k] * (1.0f - 0.1f * c) : 0.0f);
        }
    }
}

/* Red, green, blue, relative squared error and error map of every 41st pixel of the choice with OPSR_DEFAULT. */
static const float opsr_test_expected[10][5] = {
    {0.4517989f, 0.4315316f, 0.4112643f, 3.5171340e-4f, 0.0220269f},
    {0.3005324f, 0.2954745f, 0.2904166f, 3.0886450e-4f, 0.0108356f},
    {0.4559888f, 0.4352736f, 0.4145584f, 1.3225400e-5f, 0.0018530f},
    {0.4481837f, 0.4283311f, 0.4084786f, 1.4719830e-5f, 0.0096576f},
    {0.3007522f, 0.2956753f, 0.2905985f, 2.0720110e-4f, 0.0100064f},
    {0.4554026f, 0.4348259f, 0.4142492f, 1.4811990e-5f, 0.0061113f},
    {0.4540434f, 0.4336149f, 0.4131864f, 1.1695280e-5f, 0.0066391f},
    {0.3012168f, 0.2960742f, 0.2909315f, 4.5536120e-5f, 0.0105491f},
    {0.2992826f, 0.2943643f, 0.2894460f, 3.0966400e-5f, 0.0192065f},
    {0.4749274f, 0.4524618f, 0.4299963f, 8.7823410e-4f, 0.0187896f},
};

/* 0 if the choice on this machine is the expected one. */
static int opsr_resolve_test(void) {
    static float light[(OPSR_TEST_LEVELS + 1) * 4 * OPSR_TEST_PIXELS * 3], features[OPSR_TEST_PIXELS * OPSR_FEATURES];
    static float picture[OPSR_TEST_PIXELS * 3], bias2[OPSR_TEST_PIXELS], variance[OPSR_TEST_PIXELS], error[OPSR_TEST_PIXELS];
    static unsigned char level[OPSR_TEST_PIXELS];
    opsr_film film = {OPSR_TEST_WIDTH, OPSR_TEST_HEIGHT, OPSR_TEST_LEVELS, light, features, {0.25f, 0.25f, 0.25f, 0.25f}, OPSR_DEFAULT};
    opsr_resolved out = {picture, level, bias2, variance, error};
    opsr_test_film(light, features);
    if (opsr_resolve(&film, &out)) return -1;
    for (int i = 0; i < 10; i++)
        for (int c = 0; c < 5; c++) {
            float square = bias2[i * 41] + variance[i * 41], expected = opsr_test_expected[i][c];
            float found = c < 3 ? picture[i * 41 * 3 + c] : c < 4 ? square : error[i * 41];
            if (!(fabsf(found - expected) <= 2e-3f * fabsf(expected) + 1e-7f)) return 1 + i;
        }
    return 0;
}
#endif

#endif
