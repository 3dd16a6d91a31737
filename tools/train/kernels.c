// SPDX-License-Identifier: Apache-2.0
// average() of network.py, forwards and backwards, many times faster than by whole tensors. Compiled by kernels.py.
//
// Arrays are contiguous, [image][channel][row][column]. No gradient flows through brightness and noise: the tests are
// there to overrule what is learned.
#include <math.h>
#include <stddef.h>

#define RADIUS 2
#define TINY 1e-12f
#define MOST 1e4f

typedef struct {
  int width, height, features;
  const float *image, *weight, *feature, *bright, *noise;  // 3, 1, features, 1 and 1 channels
  float steepness, tolerance;
} Input;

// Distance, and by how much the test fails, of the pixels [x0, x1) of a row and their neighbours; index p, q at x = 0.
static void distances(const Input *in, ptrdiff_t p, ptrdiff_t q, int x0, int x1, float *restrict exponent,
                      float *restrict excess) {
  const ptrdiff_t plane = (ptrdiff_t)in->width * in->height;
  for (int x = x0; x < x1; ++x) exponent[x] = 0;
  for (int k = 0; k < in->features; ++k) {
    const float *restrict a = in->feature + k * plane + p, *restrict b = in->feature + k * plane + q;
    for (int x = x0; x < x1; ++x) {
      const float d = a[x] - b[x];
      exponent[x] += d * d;
    }
  }
  const float *restrict bp = in->bright + p, *restrict bq = in->bright + q;
  const float *restrict np = in->noise + p, *restrict nq = in->noise + q;
  for (int x = x0; x < x1; ++x) {
    const float d = bp[x] - bq[x], z = d * d / (np[x] + nq[x] + TINY) - in->tolerance;
    excess[x] = z < 0 ? 0 : z > MOST ? MOST : z;
  }
}

static void weights(const Input *in, ptrdiff_t q, int x0, int x1, const float *restrict exponent,
                    const float *restrict excess, float *restrict w) {
  for (int x = x0; x < x1; ++x) w[x] = expf(-fminf(exponent[x] + in->steepness * excess[x], 80));
  for (int x = x0; x < x1; ++x) w[x] *= in->weight[q + x];
}

// out: 3 channels, then the total weight.
void average_forward(const Input *in, float *out) {
  const int w = in->width, h = in->height;
  const ptrdiff_t plane = (ptrdiff_t)w * h;
  float exponent[w], excess[w], weight[w], sum[4][w];
  for (int y = 0; y < h; ++y) {
    for (int k = 0; k < 4; ++k)
      for (int x = 0; x < w; ++x) sum[k][x] = 0;
    for (int dy = -RADIUS; dy <= RADIUS; ++dy)
      for (int dx = -RADIUS; dx <= RADIUS; ++dx) {
        const int x0 = dx < 0 ? -dx : 0, x1 = dx > 0 ? w - dx : w;
        if (y + dy < 0 || y + dy >= h || x0 >= x1) continue;
        const ptrdiff_t p = (ptrdiff_t)y * w, q = (ptrdiff_t)(y + dy) * w + dx;
        distances(in, p, q, x0, x1, exponent, excess);
        weights(in, q, x0, x1, exponent, excess, weight);
        for (int x = x0; x < x1; ++x) sum[3][x] += weight[x];
        for (int c = 0; c < 3; ++c) {
          const float *restrict u = in->image + c * plane + q;
          for (int x = x0; x < x1; ++x) sum[c][x] += weight[x] * u[x];
        }
      }
    for (int x = 0; x < w; ++x) out[3 * plane + (ptrdiff_t)y * w + x] = sum[3][x];
    for (int c = 0; c < 3; ++c)
      for (int x = 0; x < w; ++x) out[c * plane + (ptrdiff_t)y * w + x] = sum[c][x] / sum[3][x];
  }
}

// Adds to the gradients of image, weight and features, and of steepness and tolerance (constants[0] and [1]).
void average_backward(const Input *in, const float *out, const float *slope, float *image, float *weight, float *feature,
                      double *constants) {
  const int w = in->width, h = in->height;
  const ptrdiff_t plane = (ptrdiff_t)w * h;
  float exponent[w], excess[w], share[w], of_weight[w], t[w];
  for (int y = 0; y < h; ++y)
    for (int dy = -RADIUS; dy <= RADIUS; ++dy)
      for (int dx = -RADIUS; dx <= RADIUS; ++dx) {
        const int x0 = dx < 0 ? -dx : 0, x1 = dx > 0 ? w - dx : w;
        if (y + dy < 0 || y + dy >= h || x0 >= x1) continue;
        const ptrdiff_t p = (ptrdiff_t)y * w, q = (ptrdiff_t)(y + dy) * w + dx;
        distances(in, p, q, x0, x1, exponent, excess);
        weights(in, q, x0, x1, exponent, excess, share);
        for (int x = x0; x < x1; ++x) share[x] /= out[3 * plane + p + x];
        for (int x = x0; x < x1; ++x) of_weight[x] = 0;
        for (int c = 0; c < 3; ++c) {
          const float *restrict u = in->image + c * plane + q, *restrict o = out + c * plane + p;
          const float *restrict g = slope + c * plane + p;
          float *restrict to = image + c * plane + q;
          for (int x = x0; x < x1; ++x) {
            to[x] += share[x] * g[x];
            of_weight[x] += g[x] * (u[x] - o[x]);
          }
        }
        for (int x = x0; x < x1; ++x) t[x] = share[x] * of_weight[x];  // of the logarithm of the weight
        for (int x = x0; x < x1; ++x) weight[q + x] += t[x] / in->weight[q + x];
        double steep = 0, tolerant = 0;
        for (int x = x0; x < x1; ++x) {
          steep -= t[x] * excess[x];
          tolerant += excess[x] > 0 && excess[x] < MOST ? t[x] * in->steepness : 0;
        }
        constants[0] += steep;
        constants[1] += tolerant;
        for (int k = 0; k < in->features; ++k) {
          const float *a = in->feature + k * plane + p, *b = in->feature + k * plane + q;
          float *ga = feature + k * plane + p, *gb = feature + k * plane + q;
          for (int x = x0; x < x1; ++x) exponent[x] = 2 * t[x] * (a[x] - b[x]);
          for (int x = x0; x < x1; ++x) ga[x] -= exponent[x];
          for (int x = x0; x < x1; ++x) gb[x] += exponent[x];
        }
      }
}
