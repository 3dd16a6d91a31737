"""Whether the means of two renders differ by more than their noise."""

import math

BIAS, TILE_BIAS = 0.05, 0.15    # of biased integrators: image, tiles


def mean_and_error(values):
    """Mean and squared standard error."""
    n = len(values)
    mean = math.fsum(values) / n
    return mean, math.fsum((v - mean) ** 2 for v in values) / (n * (n - 1))


def student_tail(t, freedom):
    """Two-sided probability of |T| >= t, by Simpson's rule in the angle of
    t = sqrt(freedom) tan(angle)."""
    start = math.atan(t / math.sqrt(freedom))
    steps = 200
    width = (math.pi / 2 - start) / steps
    total = sum((1, 4, 2)[0 if i in (0, steps) else 1 if i % 2 else 2]
                * math.cos(start + i * width) ** (freedom - 1)
                for i in range(steps)) * width / 3
    return 2 * total * math.exp(math.lgamma((freedom + 1) / 2)
                                - math.lgamma(freedom / 2)) / math.sqrt(
                                    math.pi)


def probability(a, b, allowance):
    """That means as different as these come from equal ones that may differ
    by `allowance`. A single b is exact."""
    mean_a, error_a = mean_and_error(a)
    mean_b, error_b = mean_and_error(b) if len(b) > 1 else (b[0], 0.0)
    least = 1e-5 * max(abs(mean_a), abs(mean_b))    # float summation
    gap = abs(mean_a - mean_b) - allowance - least
    if gap <= 0:
        return 1.0
    if error_a + error_b <= 0:
        return 0.0
    freedom = (error_a + error_b) ** 2 / (
        error_a ** 2 / (len(a) - 1) + error_b ** 2 / max(1, len(b) - 1))
    return student_tail(gap / math.sqrt(error_a + error_b), freedom)


def difference(values, wanted, biased):
    """Values and wanted: a list of [mean, tiles...] each. The least
    probability of all tiles, times their number, and the tile's index."""
    columns, others = list(zip(*values)), list(zip(*wanted))
    mean = abs(math.fsum(others[0]) / len(others[0]))
    found = []
    for i, (column, other) in enumerate(zip(columns, others)):
        allowance = 0.0
        if biased:
            level = abs(math.fsum(other) / len(other))
            allowance = (TILE_BIAS if i else BIAS) * max(level, mean)
        found.append((len(columns) * probability(column, other, allowance),
                      i))
    return min(found)
