"""Where glintmap's photons land against where Radiance's mkpmap sends them: the case study, the same
tensor-tree BSDF and the same suns; flux for each cell of the scene, before any density is estimated.

    cargo build --release
    python tools/bench/photon_density.py --glintmap target/release/glintmap [--photons 2000000]
        [--mkpmap-photons 1000000] [--suns 60] [--cell 5]

Needs pyradiance (tools/requirements.txt); pmapdump prints the photons of mkpmap. PV, receivers and
sun visibility are those of compare_maps.py. The cells are cubes of --cell metres, so that ground,
roofs and walls mostly fall into different ones. A cell counts where mkpmap's photons in it are
worth 50 equal ones. The difference of the shares of the whole flux is divided by the standard
error of both; chi-squared over all cells is held against its own spread: what differs beyond
chance beyond a 1 % bias of every cell fails (exit 1). `--scale 1.05` enlarges our positions by
5 % about the origin, to see it fail.
"""

import argparse
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from compare_maps import octrees, project
from mkpmap import ROOT, cpu_s, radiance, tensor_tree

RECORD = np.dtype([("at", "<f4", 3), ("normal", "<f4", 3), ("flux_w", "<f4"), ("timestep", "<u4"),
                   ("surface", "<u2")])


def ours(glintmap, folder, work):
    out = work / "photons.ply"
    subprocess.run([glintmap, "inspect", folder / "run/m/photons.gmp", "--ply", out, "--sample", "1000000000",
                    "--quiet"], check=True, stdout=subprocess.DEVNULL)
    data = out.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    found = np.frombuffer(data[end:], RECORD)
    return found["at"].astype(float), found["flux_w"].astype(float)


def theirs(work, env):
    text = subprocess.run("pmapdump -a -n 100000k -f map.pm".split(), cwd=work, env=env, check=True,
                          capture_output=True, text=True).stdout
    rows = np.array([line.split()[:6] for line in text.splitlines() if line[:1] not in "#"], float)
    # The channels differ by their rounding to 8 bits alone.
    return rows[:, :3], rows[:, 3:].mean(axis=1)


def cells(at, flux, edge_m, keys):
    """Sum and sum of squares of the flux for each cell."""
    place = np.floor(at / edge_m).astype(np.int64) + (1 << 20)
    code = (place[:, 0] << 42) | (place[:, 1] << 21) | place[:, 2]
    found, index = np.unique(code, return_inverse=True)
    sums = np.bincount(index, flux), np.bincount(index, flux**2)
    if keys is None:
        return found, *sums
    spot = np.searchsorted(found, keys).clip(max=len(found) - 1)
    hit = found[spot] == keys
    return keys, *(np.where(hit, s[spot], 0.0) for s in sums)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap", type=Path)
    parser.add_argument("--photons", type=int, default=2_000_000)
    parser.add_argument("--mkpmap-photons", type=int, default=1_000_000)
    parser.add_argument("--suns", type=int, default=60, help="about that many")
    parser.add_argument("--cell", type=float, default=5.0, help="edge of a cell, metres")
    parser.add_argument("--alpha", type=float, default=0.2, help="GGX roughness of the PV glass")
    parser.add_argument("--reflectance", type=float, default=0.04, help="of the cells below it")
    parser.add_argument("--scale", type=float, default=1.0, help="enlarges our scene, to see it fail")
    parser.set_defaults(radius=10.0)  # of a view that isn't rendered
    options = parser.parse_args()
    env, glintmap = radiance(), options.glintmap.resolve()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        tensor_tree(work, env, options.alpha, options.reflectance)
        folder = project(work, options)
        subprocess.run([glintmap, "run", folder, "--until", "pages", "--quiet"], check=True)
        rows = csv.DictReader(line for line in open(folder / "run/suns.csv") if not line.startswith("#"))
        suns = [tuple(float(row[k]) for k in ("x", "y", "z", "irradiance_w_m2")) for row in rows]
        octrees(work, env, folder, suns)
        command = (f"mkpmap -n 1 -fo+ -apC map.pm {options.mkpmap_photons} -apo- pv_west_lower "
                   "-lr 1 -ld 100 -t 0 -dp 1e6 sky.oct")
        took_s, _ = cpu_s(command.split(), cwd=work, env=env)
        at, flux = ours(glintmap, folder, work)
        their_at, their_flux = theirs(work, env)
        print(f"{len(suns)} suns; glintmap {len(at):,} photons, {flux.sum():.1f} W; mkpmap {len(their_at):,} photons "
              f"in {took_s:.0f} CPU s, {their_flux.sum():.1f} by its own scale")
        keys, b, b2 = cells(their_at, their_flux, options.cell, None)
        _, a, a2 = cells(at * options.scale, flux, options.cell, keys)
        use = b * b > 50 * b2
        whole = flux.sum(), their_flux.sum()
        share = a / whole[0], b / whole[1]
        variance = a2 / whole[0] ** 2 + b2 / whole[1] ** 2
        z = ((share[0] - share[1]) / np.sqrt(variance))[use]
        cells_used, chi = len(z), float((z**2).sum())
        lean = 0.01 * share[1][use]
        allowed = float(((lean**2) / variance[use]).sum())
        limit = cells_used + 3.1 * np.sqrt(2 * cells_used) + allowed
        covered = share[1][use].sum()
        print(f"cells of {options.cell} m: {cells_used} with {covered:.1%} of the flux; chi2 {chi:.0f}, limit {limit:.0f} "
              f"(of which {allowed:.0f} for a bias of 1 %); {np.mean(np.abs(z) < 2):.1%} within 2 standard errors, "
              f"{np.mean(np.abs(z) < 3):.1%} within 3, mean z {z.mean():+.2f}")
        sys.exit(int(not chi < limit))


if __name__ == "__main__":
    main()
