#!/usr/bin/env python3
"""The glare analysis against SciPy and cc3d, in one run, on one core each.

    bench_glare.py GLINTMAP [--shape 192 1000 1000] [--repeat 3] [--full] [--sparse] [--memory] [--mask SERIES] [--no-dense]

GLINTMAP is a release build of the program. Times are the CPU's (user and system), so that other
programs on the machine matter less; the best of several repeats counts, glintmap and its peers in
turn. The volume is read from the page cache by glintmap, and lies in memory for SciPy and cc3d,
which is to their favour; "without reading" leaves out what the same command takes with a threshold
that nothing reaches and without a filter. The analysis is what glintmap says it took ("took" in its
JSON); the whole program also starts, writes six maps and the table of events.

1. Gaussian: glintmap with a threshold that nothing reaches, against
   scipy.ndimage.gaussian_filter, sigma 1.
2. Threshold, events and all durations: glintmap without a filter, against the threshold and
   scipy.ndimage.label alone (no durations), and against cc3d. Two masks: blobs like glare of which
   some per cent lie above the threshold, and 30 % of independent noise.
3. --sparse: a volume in Zarr of 1,280 x 1,000 x 4,000 (20 GB dense), where 1 % of the chunks hold
   blobs: wall clock, with both cores. It is written as a Zarr file of another program.
4. --full: the same size, no voxel 0: once 5 % of them in blobs above the threshold, once noise, a fifth
   of it above, which is worse than any real year (4 GB on disk each): wall clock, with both cores.
   --size 640 500 2000 takes an eighth of it.
5. --memory: the highest RssAnon with 4 million pixels, for 200 timesteps of which every chunk holds
   blobs (5 % of all voxels above the threshold), for 2,000 and 20,000 timesteps with blobs in 1 % of
   the chunks (30 % of their voxels above), and what is worse than any real year: 200 timesteps of
   which 30 % of all voxels lie above, and 200 of noise, a fifth of which does.
6. --mask SERIES: a real series (of the case study, say), filtered by glintmap beforehand. Threshold,
   events and all durations of that: glintmap, reading it from Zarr and from .npy, against the
   threshold and scipy.ndimage.label alone in memory, each in turn.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

import numpy as np
import scipy.ndimage as ndi


def cpu_of(call, repeat):
    best = float("inf")
    for _ in range(repeat):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return best


def run(program, volume, out, arguments, threads=1):
    """CPU seconds, wall seconds and highest anonymous memory in MiB of one analysis, and the CPU
    seconds of the analysis alone."""
    before = os.times()
    start = time.perf_counter()
    child = subprocess.Popen(
        [program, "glare", "analyse", str(volume), "--out", str(out), "--quiet", "--json",
         "--threads", str(threads), *map(str, arguments)], stdout=subprocess.PIPE)
    peak = 0
    while child.poll() is None:
        try:
            for line in open(f"/proc/{child.pid}/status"):
                if line.startswith("RssAnon"):
                    peak = max(peak, int(line.split()[1]))
        except OSError:
            pass
        time.sleep(0.003)
    wall = time.perf_counter() - start
    took = json.loads(child.stdout.read() or b"{}").get("took", {}).get("cpu_s", float("nan"))
    after = os.times()
    if child.returncode:
        raise SystemExit(f"glintmap failed with {child.returncode}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return cpu, wall, peak / 1024, took


def blobs(shape, share, seed):
    """Smooth blobs of which about `share` lie above 10."""
    random = np.random.default_rng(seed)
    noise = random.standard_normal(shape, dtype=np.float32)
    noise = ndi.gaussian_filter(noise, (1, 3, 3))
    level = np.quantile(noise[::4, ::4, ::4], 1 - share)
    return np.maximum(noise - level, 0) / noise.std() * 20 + np.where(noise > level, 10, 0).astype("f4")


def dense(options, folder):
    shape, program = tuple(options.shape), options.glintmap
    voxels = np.prod(shape) / 1e6
    path = folder / "volume.npy"

    def compare(volume, what, peers, *more):
        np.save(path, volume)
        best = dict.fromkeys(["whole", "analysis", "reading", *peers], float("inf"))
        for _ in range(options.repeat):
            cpu, _, _, took = run(program, path, folder / "out", more)
            best["whole"], best["analysis"] = min(best["whole"], cpu), min(best["analysis"], took)
            took = run(program, path, folder / "out", ["--threshold", "1e30", "--sigma", 0, 0, 0])[3]
            best["reading"] = min(best["reading"], took)
            for name, call in peers.items():
                best[name] = min(best[name], cpu_of(call, 1))
        alone = best["analysis"] - best["reading"]
        print(f"{what}: glintmap {voxels / best['analysis']:.0f} Mvoxel/s, {voxels / alone:.0f} without reading")
        for name in peers:
            print(f"  {name} {voxels / best[name]:.0f} Mvoxel/s: {best[name] / best['analysis']:.2f}x, without reading "
                  f"{best[name] / alone:.2f}x, whole program {best[name] / best['whole']:.2f}x", flush=True)

    volume = np.random.default_rng(1).random(shape, np.float32) * 20
    compare(volume, "Gaussian", {"SciPy": lambda: ndi.gaussian_filter(volume, 1.0)}, "--threshold", "1e30")
    structure = ndi.generate_binary_structure(3, 1)
    for name, volume in [("blobs", blobs(shape, 0.05, 2)), ("30 % noise", np.where(volume > 14, volume, 0))]:
        volume = np.ascontiguousarray(volume, np.float32)
        share = (volume > 10).mean()
        peers = {"SciPy's label": lambda: ndi.label(volume > np.float32(10), structure)}
        try:
            import cc3d
            peers["cc3d"] = lambda: cc3d.connected_components(volume > np.float32(10), connectivity=6)
        except ImportError:
            print("cc3d isn't installed (pip install connected-components-3d)")
        compare(volume, f"threshold, events, durations, {name}, {share:.1%} above", peers,
                "--threshold", "10", "--sigma", 0, 0, 0)


def write_tiles(path, shape, tiles, lit):
    """A volume in the layout of glintmap (shards of a tile with all timesteps, chunks 16 x 32 x 32,
    zstd). `tiles` are written with zarr, into the first places; the files of all others of which
    `lit` says so are copies of theirs, in turn."""
    import zarr
    timesteps, rows, columns = shape
    group = zarr.create_group(store=str(path), zarr_format=3)
    array = group.create_array(
        "irradiance", shape=shape, dtype="float32", chunks=(16, 32, 32), shards=(-(-timesteps // 16) * 16, 32, 32),
        fill_value=0.0, dimension_names=("timestep", "row", "column"),
        compressors=zarr.codecs.ZstdCodec(level=1))
    shards, kept = path / "irradiance" / "c" / "0", []
    for number, tile in enumerate(tiles):
        array[:, :32, number * 32:number * 32 + 32] = tile
        kept.append(path / f"tile-{number}")
        (shards / "0" / str(number)).rename(kept[-1])
    across = -(-columns // 32)
    for number in range(-(-rows // 32) * across):
        if lit(number):
            (shards / str(number // across)).mkdir(exist_ok=True)
            shutil.copyfile(kept[number % len(kept)], shards / str(number // across) / str(number % across))
    for file in kept:
        file.unlink()


def write_blobs(path, shape, share, seed, above=0.3):
    """A volume of which about `share` of the chunks hold blobs, all of them in the same few tiles.
    `above`: how much of such a chunk isn't 0."""
    timesteps, rows, columns = shape
    random = np.random.default_rng(seed)
    pattern = blobs((16, 32, 32), above, seed)
    count = -(-rows // 32) * -(-columns // 32)
    lit_tiles = max(1, int(count * min(1, share * 5)))

    def tile():
        out = np.zeros((timesteps, 32, 32), np.float32)
        for chunk in np.flatnonzero(random.random(-(-timesteps // 16)) < share * count / lit_tiles):
            there = out[chunk * 16:chunk * 16 + 16]
            there[:] = np.roll(pattern, random.integers(32, size=2), (1, 2))[:len(there)]
        return out

    write_tiles(path, shape, (tile() for _ in range(7)), set(random.choice(count, lit_tiles, replace=False)).__contains__)


def write_full(path, shape):
    """A volume all of which is noise of whole numbers."""
    random = np.random.default_rng(6)
    tiles = (random.integers(21, size=(shape[0], 32, 32)).astype("f4") for _ in range(8))
    write_tiles(path, shape, tiles, lambda _: True)


def write_dense(path, shape):
    """A volume whose voxels are all lit, 5 % of them in blobs above the rest."""
    random = np.random.default_rng(8)
    pattern = 20 * (blobs((16, 32, 32), 0.05, 8) > 0).astype("f4")

    def tile():
        chunks = [np.roll(pattern, random.integers(32, size=2), (1, 2)) for _ in range(-(-shape[0] // 16))]
        return np.concatenate(chunks)[:shape[0]] + 1 + random.integers(6, size=(shape[0], 32, 32)).astype("f4")

    write_tiles(path, shape, (tile() for _ in range(8)), lambda _: True)


def full(options, folder):
    shape = tuple(options.size)
    path = folder / "full.zarr"
    for what, write in (("5 % above, in blobs", write_dense), ("noise, a fifth of it above", write_full)):
        write(path, shape)
        cpu, wall, peak, _ = run(options.glintmap, path, folder / "out", ["--threshold", "10.8"], threads=2)
        print(f"{shape}, all of it lit ({np.prod(shape) * 4 / 1e9:.1f} GB), {what}: {wall:.1f} s ({cpu:.1f} s of CPU), "
              f"{peak:.0f} MiB", flush=True)
        shutil.rmtree(path)


def sparse(options, folder):
    path = folder / "sparse.zarr"
    write_blobs(path, tuple(options.size), 0.01, 3)
    cpu, wall, peak, _ = run(options.glintmap, path, folder / "out", ["--threshold", "10"], threads=2)
    print(f"{tuple(options.size)}, 1 % of the chunks lit: {wall:.1f} s ({cpu:.1f} s of CPU), {peak:.0f} MiB")


def mask(options, folder):
    level, quiet = "10", {"check": True, "stdout": subprocess.DEVNULL}
    run(options.glintmap, options.mask, folder / "filtered", ["--threshold", level, "--keep-filtered"])
    path, volume_path = folder / "filtered" / "filtered.npy", folder / "filtered.zarr"
    subprocess.run([options.glintmap, "volume", "import", str(path), "--out", str(volume_path), "--quiet"], **quiet)
    volume = np.load(path)
    structure = ndi.generate_binary_structure(3, 1)
    arguments = ["--threshold", level, "--sigma", 0, 0, 0, "--segments", "none"]
    best = dict.fromkeys(("zarr", "npy", "whole zarr", "whole npy", "scipy"), float("inf"))
    for _ in range(options.repeat):
        for name, at in (("zarr", volume_path), ("npy", path)):
            cpu, _, _, took = run(options.glintmap, at, folder / "out", arguments)
            best[name], best[f"whole {name}"] = min(best[name], took), min(best[f"whole {name}"], cpu)
        best["scipy"] = min(best["scipy"], cpu_of(lambda: ndi.label(volume > np.float32(level), structure), 1))
    voxels = volume.size / 1e6
    lit, above = (volume != 0).mean(), (volume > np.float32(level)).mean()
    print(f"{options.mask}, filtered, {volume.shape}: {above:.3%} above, {lit:.2%} not 0; SciPy's label {best['scipy']:.2f} s, "
          f"{voxels / best['scipy']:.0f} Mvoxel/s")
    for name in ("zarr", "npy"):
        print(f"  from {name}: {best[name]:.2f} s, {voxels / best[name]:.0f} Mvoxel/s, {best['scipy'] / best[name]:.2f}x; "
              f"whole program {best['whole ' + name]:.2f} s, {best['scipy'] / best['whole ' + name]:.2f}x")


def memory(options, folder):
    cases = [(200, "every chunk lit, 5 % above", (1.0, 0.05))]
    cases += [(n, "1 % of the chunks lit", (0.01, 0.3)) for n in options.lengths]
    cases += [(200, "every chunk lit, 30 % above", (1.0, 0.3)), (200, "all of it noise, a fifth above", None)]
    for timesteps, what, filled in cases:
        path, shape = folder / "memory.zarr", (timesteps, 2000, 2000)
        if filled:
            write_blobs(path, shape, filled[0], 4, filled[1])
        else:
            write_full(path, shape)
        cpu, wall, peak, _ = run(options.glintmap, path, folder / "out", ["--threshold", "10.8"], threads=2)
        print(f"{timesteps} timesteps of 4 million pixels, {what}: {peak:.0f} MiB anonymous, {wall:.1f} s ({cpu:.1f} s of CPU)",
              flush=True)
        shutil.rmtree(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("glintmap")
    parser.add_argument("--shape", type=int, nargs=3, default=[192, 1000, 1000])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--sparse", action="store_true")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--size", type=int, nargs=3, default=[1280, 1000, 4000], help="for --full and --sparse")
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--lengths", type=int, nargs="+", default=[2000, 20000], help="for --memory: those of which 1 % is lit")
    parser.add_argument("--mask", metavar="SERIES", help="a volume: Zarr or .npy")
    parser.add_argument("--no-dense", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        if not options.no_dense:
            dense(options, folder)
        if options.full:
            full(options, folder)
        if options.sparse:
            sparse(options, folder)
        if options.mask:
            mask(options, folder)
        if options.memory:
            memory(options, folder)


if __name__ == "__main__":
    main()
