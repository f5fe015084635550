"""Intervals by other means, for tests/rows/intervals.rs.

Python's standard library only: `python3 intervals.py > intervals.json`.
Written from docs/background/intervals.md; sums over fine grids, where the crate has a few nodes.
"""

import json
import math
from statistics import NormalDist

Z = NormalDist().inv_cdf(0.975)


def logit(p):
    return math.log(p / (1 - p))


def expit(x):
    return 1 / (1 + math.exp(-x))


def mean(values):
    values = list(values)
    return sum(values) / len(values)


def wilson(p, n):
    """Both roots of (p − q)² = z² q (1 − q)/n, by bisection."""

    def root(inside, outside):
        for _ in range(200):
            q = (inside + outside) / 2
            if (p - q) ** 2 <= Z * Z * q * (1 - q) / n:
                inside = q
            else:
                outside = q
        return (inside + outside) / 2

    # The point of least distance is inside.
    return [root(p, 0.0) if p else 0.0, root(p, 1.0) if p < 1 else 1.0]


def at_most(n):
    """The rate with which n trials show nothing with probability 0.05."""
    lo, hi = 0.0, 1.0
    for _ in range(200):
        p = (lo + hi) / 2
        lo, hi = (p, hi) if 0.05 < math.exp(n * math.log1p(-p)) else (lo, p)
    return (lo + hi) / 2


def posterior(rates, n):
    """Central 95 % of μ: rates are Beta with mean μ and correlation φ, successes
    binomial; μ ~ Beta(½, ½), φ ~ Beta(0.45, 3). A plain sum over logit μ and φ^0.45."""
    xs = [-16 + 32 * (i + 0.5) / 1600 for i in range(1600)]
    logs = []
    for i in range(160):
        phi = ((i + 0.5) / 160) ** (1 / 0.45)
        size = 1 / phi - 1
        whole = len(rates) * (math.lgamma(size) - math.lgamma(size + n))
        for j, x in enumerate(xs):
            p, q = expit(x), expit(-x)
            log = whole + 2 * math.log1p(-phi) + 0.5 * (math.log(p) + math.log(q))
            for rate in rates:
                log += math.lgamma(p * size + rate * n) - math.lgamma(p * size)
                log += math.lgamma(q * size + (1 - rate) * n) - math.lgamma(q * size)
            logs.append((j, log))
    top = max(log for _, log in logs)
    density = [0.0] * len(xs)
    for j, log in logs:
        density[j] += math.exp(log - top)
    whole, ends = sum(density), []
    for share in (0.025, 0.975):
        left = share * whole
        for j, mass in enumerate(density):
            if left <= mass:
                ends.append(expit(xs[j] + (left / mass - 0.5) * 32 / 1600))
                break
            left -= mass
    return ends


def layout(scores):
    """Rows are trainings: means, the residual's part in the variance of the mean,
    and the starts that a training was as good as tested on."""
    rows, n = len(scores), len(scores[0])
    means = [mean(row) for row in scores]
    rate = mean(means)
    on = [mean(row[j] for row in scores) for j in range(n)]
    squares = sum(
        (scores[i][j] - means[i] - on[j] + rate) ** 2 for i in range(rows) for j in range(n)
    )
    freedom = (rows - 1) * (n - 1)
    inside = (rate * n + 0.5) / (n + 1)
    coin = inside * (1 - inside)
    # As if one more episode had come out otherwise.
    noise = (squares + 1) / (freedom + 1 / coin)
    effective = n * min(max(coin / noise, 1), 100)
    return means, squares / freedom / (rows * n), effective


def start_variance(per_start, estimate):
    n = len(per_start)
    return sum((s - estimate) ** 2 for s in per_start) / (n - 1) / n


def seeds_interval(trainings):
    scores = [[float(mark) for mark in marks] for marks in trainings]
    means, rest, effective = layout(scores)
    n = len(scores[0])
    rate = mean(means)
    lo, hi = posterior(means, effective)
    inside = (rate * n + 0.5) / (n + 1)
    per_start = [mean(row[j] for row in scores) for j in range(n)]
    starts = max(start_variance(per_start, rate) - rest, 0)
    half = Z * math.sqrt(starts) / (inside * (1 - inside))
    below = math.hypot(half, max(logit(inside) - logit(lo), 0))
    above = math.hypot(half, max(logit(hi) - logit(inside), 0))
    return [
        min(rate, expit(logit(inside) - below)),
        max(rate, expit(logit(inside) + above)),
    ]


def difference(a, b):
    """Mean of a − b, paired on starts; sides of one string are fixed policies."""
    sides = [[[float(m) for m in marks] for marks in side] for side in (a, b)]
    n = len(sides[0][0])
    rates = [mean(mean(row) for row in side) for side in sides]
    estimate = rates[0] - rates[1]
    below = above = rest = 0.0
    for side, rate, sign in zip(sides, rates, (1, -1)):
        if len(side) < 2:
            continue
        means, part, effective = layout(side)
        lo, hi = posterior(means, effective)
        down, up = max(rate - lo, 0), max(hi - rate, 0)
        if sign < 0:
            down, up = up, down
        below, above, rest = below + down**2, above + up**2, rest + part
    per_start = [
        mean(row[j] for row in sides[0]) - mean(row[j] for row in sides[1]) for j in range(n)
    ]
    # Two more starts, one that only a solves and one that only b does.
    more = n + 2
    towards_0 = estimate * 2 / more
    starts = max(start_variance(per_start, estimate) - rest, 0)
    half = Z * math.sqrt(starts + 2 / more**2)
    below += max(half + towards_0, 0) ** 2
    above += max(half - towards_0, 0) ** 2
    ends = [estimate - math.sqrt(below), estimate + math.sqrt(above)]
    return estimate, [min(max(end, -1), 1) for end in ends]


def runs_interval(runs):
    scores = [[float(mark) for mark in marks] for marks in runs]
    n = len(scores[0])
    rate = mean(mean(row) for row in scores)
    variance = start_variance([mean(row[j] for row in scores) for j in range(n)], rate)
    coins = rate * (1 - rate) / variance if variance else n
    return wilson(rate, min(max(coins, n), n * len(runs)))


def marks(rate, n, seed, shared=0.0):
    """n marks: a start is solved where a drawn number is below the rate; `shared`
    is the weight of what the start has for every training alike."""
    state = 12345

    def draw(key):
        x = (key * 2654435761 + state) % 2**32
        for _ in range(4):
            x ^= x >> 15
            x = x * 2246822519 % 2**32
            x ^= x >> 13
        return x / 2**32

    alike = [draw(7 * j) < shared for j in range(n)]
    return "".join(
        "01"[draw(1000 + j if alike[j] else 100000 * (seed + 1) + j) < rate] for j in range(n)
    )


def main():
    some = [
        [marks(rate, n, seed, shared) for seed, rate in enumerate(rates)]
        for rates, n, shared in [
            ([0.5, 0.5, 0.5], 60, 0.0),
            ([0.9, 0.8, 0.85], 100, 0.0),
            ([0.7, 0.7, 0.7], 100, 0.9),
            ([0.1, 0.3, 0.6, 0.2, 0.3], 40, 0.5),
            ([0.03, 0.0, 0.02], 100, 0.0),
            ([1.0, 1.0, 1.0], 200, 0.0),
            ([0.0, 0.0], 50, 0.0),
        ]
    ]
    some += [["1101", "0111", "1001"], ["110", "100"], ["1111", "1110"]]
    pairs = [
        (some[0], [marks(0.3, 60, 9)]),
        (some[1], some[2]),
        ([marks(0.6, 80, 1)], [marks(0.4, 80, 2)]),
        ([marks(0.6, 80, 3, 0.8)], [marks(0.5, 80, 4, 0.8)]),
        ([marks(0.2, 100, 5)], some[1]),
        (some[5], [marks(0.99, 200, 3)]),
    ]
    cases = [(0, 1), (1, 1), (0, 16), (14, 16), (9, 16), (1, 500), (499, 500), (37, 100)]
    several = [some[0], some[2], [some[2][0]] * 5, [marks(0.2, 50, s) for s in range(6)]]
    out = {
        "z": Z,
        "wilson": [[k, n, wilson(k / n, n)] for k, n in cases],
        "at_most": [[n, at_most(n)] for n in (1, 2, 10, 16, 100, 500)],
        "seeds": [[solved, seeds_interval(solved)] for solved in some],
        # Trainings that agree on every start: what is left are the starts.
        "agreeing": [[s, seeds_interval(s)] for s in (["111011"] * 6, ["1111111110"] * 8)],
        "pairs": [[a, b, *difference(a, b)] for a, b in pairs],
        "runs": [[solved, runs_interval(solved)] for solved in several],
    }
    print(json.dumps(out, indent=1))


main()
