#!/usr/bin/env python3
"""SciPy's cKDTree on the photons and queries of bench-store, as a figure beside its own.

    python tools/bench/store_peer.py 4e6 --k 400 4000

Needs numpy and scipy. Builds the tree in memory (bench-store's photons: ground, a wall, a caustic)
and asks for the k nearest on one core, in Morton order, distances bounded as the store bounds them.
Prints build rate, queries a second on the processor, and the resident memory.
"""
import argparse
import resource
import time

import numpy as np
from scipy.spatial import cKDTree


def photons(count, random):
    points = random.random((count, 3), dtype=np.float32) * np.float32([200, 200, 30])
    kind = np.arange(count) % 20
    points[kind >= 4, 2] = 0
    points[(kind >= 1) & (kind < 4), 0] = 120
    spot = kind == 0
    points[spot] = [50, 60, 0]
    points[spot, :2] += random.random((int(spot.sum()), 2), dtype=np.float32) * np.float32(0.5)
    return points


def patch(count, pitch):
    index = np.arange(count)
    compact = lambda v: sum(((v >> (2 * bit)) & 1) << bit for bit in range(16))
    grid = np.stack([compact(index), compact(index >> 1), np.zeros(count, int)], axis=1)
    return np.float32([20, 150, 0]) + np.float32(pitch) * grid


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photons", type=float)
    parser.add_argument("--k", type=int, nargs="+", default=[400, 4000])
    parser.add_argument("--queries", type=int, default=16384)
    parser.add_argument("--pitch", type=float, default=0.1)
    given = parser.parse_args()
    points = photons(int(given.photons), np.random.default_rng(1))
    began = time.process_time()
    tree = cKDTree(points)
    took = time.process_time() - began
    print(f"cKDTree: {len(points) / took / 1e6:.2f} M/s built on one core")
    queries = patch(given.queries, given.pitch)
    for k in given.k:
        began = time.process_time()
        found = 0
        for block in np.array_split(queries, max(1, len(queries) * k // 4_000_000)):
            distances, _ = tree.query(block, k=k, distance_upper_bound=10.0, workers=1)
            found += int(np.isfinite(distances).sum())
        took = time.process_time() - began
        print(f"k = {k}: {len(queries) / took:.0f} queries/s, {found / len(queries):.0f} found")
    print(f"resident: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10} MiB at most")


if __name__ == "__main__":
    main()
