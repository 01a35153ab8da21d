"""glintmap's annual map and ten of its timesteps against Radiance's rtrace and rcontrib: the same
scene, the same BSDF file, the same suns; a z-test for each block of pixels.

    cargo build --release
    python tools/bench/compare_maps.py --glintmap target/release/glintmap [--photons 400000]
        [--suns 60]

Needs pyradiance (tools/requirements.txt). Both trace their own photons: nothing but the scene is
shared. The PV is `pv_west_lower`, a rectangle, because mkpmap emits too little from other ports
(handbook/radiance.md); the view is the ground west of the church. glintmap runs with
`estimator = "radiance"` (the paper's), `receivers = "diffuse"`; both ask whether the sun is in sight.
mkpmap gets `-dp 1e6`: by default it takes each sun's flux from one sample of the disc (scattering.py).

Both have as many photons and search within the same largest radius: what the k nearest blur is then
the same, and what remains is noise and the programs themselves.

The whole scene stands in the light: terrain, church, houses and trees. On crowns and beside walls both
count what lands on steep neighbours (normals within 89 degrees); before glintmap's `radiance` did so
(it took 60 degrees), it was 10 to 25 % below.

For each block the difference is divided by the standard error of both: photons in the block's disc
number E A / Phi, with each program's own flux per photon; a block counts where both have 30 photons.
What remains is said as a mean ratio (bias) and the share of blocks within 2 and 3 standard errors.
Exits with 1 where the bias is beyond --most or fewer than 80 % of the blocks lie within 3.
"""

import argparse
import csv
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mkpmap import SCENE, cpu_s, radiance, tensor_tree

ROOT = Path(__file__).resolve().parents[2]
METRES, SIZE, BLOCK = 60.0, 60, 6
VIEW = f"-vtl -vp -45 0 200 -vd 0 0 -1 -vu 0 1 0 -vh {METRES} -vv {METRES}"
OMEGA = 5.981e-5
ALL = ["terrain.rad", "church.rad", "houses.rad", "trees.rad"]


def project(work, options):
    text = (SCENE / "project.toml").read_text()
    head, rest = text.split("[[material]]", 1)
    head = head.split("[[pv]]")[0]
    head = head.replace('"pv.rad"', '"pv_one.rad"')
    head += '[[pv]]\nname = "roof"\nselect = { modifier = "pv_west_lower" }\n\n'
    material = '[[material]]\nname = "m"\nbsdf = "pv.xml"\n\n'
    step = max(1, 1280 // options.suns // 26 + 1)
    time = (
        "[time]\nyear = 2018\ndays = { from = 0, to = 181, step = 28 }\n"
        f"hours = {{ from = 4.5, to = 20.5, step = {0.25 * step} }}\n"
        'sun = "gensky-2018"\nirradiance = "gensky"\nhalf_year = true\n\n'
    )
    photons = (
        f"[photons]\nstored = {options.photons}\nmax_path_m = 100.0\nbounces = 1\nseed = 1\n"
        'receivers = "diffuse"\n\n'
    )
    view = (
        f'[[view]]\nname = "v"\nview = "{VIEW}"\nsize = [{SIZE}, {SIZE}]\nestimator = "radiance"\n'
        f"bandwidth = 400\nseries_bandwidth = 4000\nmax_radius_m = {options.radius}\n"
    )
    folder = work / "project"
    folder.mkdir()
    for file in SCENE.glob("*.rad"):
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / "pv.xml").write_bytes((work / "pv.xml").read_bytes())
    one = [b for b in re.split(r"\n(?=\w+ polygon)", (SCENE / "pv.rad").read_text())
           if b.startswith("pv_west_lower polygon")]
    (folder / "pv_one.rad").write_text("\n".join(one) + "\n")
    (folder / "project.toml").write_text(head + material + time + photons + view)
    return folder


def octrees(work, env, folder, suns):
    (work / "suns.rad").write_text("".join(
        f"void light sun{i} 0 0 3 {e / OMEGA} {e / OMEGA} {e / OMEGA}\n"
        f"sun{i} source s{i} 0 0 4 {x} {y} {z} .5\n" for i, (x, y, z, e) in enumerate(suns)))
    (work / "glow.rad").write_text("".join(
        f"void glow sun{i} 0 0 4 {e / OMEGA} {e / OMEGA} {e / OMEGA} 0\n"
        f"sun{i} source s{i} 0 0 4 {x} {y} {z} .5\n" for i, (x, y, z, e) in enumerate(suns)))
    (work / "suns.mod").write_text("".join(f"sun{i}\n" for i in range(len(suns))))
    text = "".join((SCENE / f).read_text() for f in ALL)
    defined = set(re.findall(r"^\s*void\s+\S+\s+(\S+)", text, re.M))
    used = set(re.findall(r"^\s*(\w+)\s+polygon\s", text, re.M))
    grey = "".join(f"void plastic {m} 0 0 5 .25 .25 .25 0 0\n" for m in sorted(used - defined))
    (work / "scene.rad").write_text(grey + text)
    (work / "pv.rad").write_text("void BSDF pv_west_lower 6 0 pv.xml 0 0 1 . 0 0\n"
                                 + (folder / "pv_one.rad").read_text())
    for name, files in [("sky", ["suns.rad"]), ("nosky", []), ("glow", ["glow.rad"])]:
        out = subprocess.run(["oconv", *files, "scene.rad", "pv.rad"], cwd=work, env=env, capture_output=True)
        if out.returncode != 0:
            sys.exit(out.stderr.decode())
        (work / f"{name}.oct").write_bytes(out.stdout)


def trace(work, env, command):
    rays = subprocess.run(["vwrays", "-ff", "-pa", "0", "-x", str(SIZE), "-y", str(SIZE), *VIEW.split()],
                          env=env, cwd=work, capture_output=True, check=True).stdout
    out = subprocess.run(command.split(), input=rays, env=env, cwd=work, capture_output=True)
    if out.returncode != 0:
        sys.exit(out.stderr.decode())
    return np.frombuffer(out.stdout, "<f4").reshape(SIZE * SIZE, -1, 3)[:, :, 1].astype(float)


def blocks(values):
    n = SIZE // BLOCK
    return values.reshape(n, BLOCK, n, BLOCK).mean(axis=(1, 3)).ravel()


def z_test(name, ours, theirs, flux_ours, flux_theirs):
    """Means of blocks in W/m2; flux of a photon in W."""
    # A block's photons come from its own area and a rim of a search radius: its area alone is safe.
    area = (METRES / SIZE * BLOCK) ** 2
    a, b = blocks(ours), blocks(theirs)
    use = (a * area / flux_ours > 30) & (b * area / flux_theirs > 30)
    if use.sum() < 3:
        print(f"{name}: only {use.sum()} blocks have light enough")
        return None
    a, b = a[use], b[use]
    z = (a - b) / np.sqrt(a * flux_ours / area + b * flux_theirs / area)
    ratio = a.sum() / b.sum()
    within = [float(np.mean(np.abs(z) < s)) for s in (2, 3)]
    print(f"{name}: {use.sum()} blocks, glintmap / Radiance = {ratio:.3f}, "
          f"{within[0]:.0%} within 2, {within[1]:.0%} within 3 standard errors, mean z {z.mean():+.2f}")
    return ratio, within[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap", type=Path)
    parser.add_argument("--photons", type=int, default=400_000)
    parser.add_argument("--radius", type=float, default=10.0, help="of both searches at most, m")
    parser.add_argument("--suns", type=int, default=60, help="about that many")
    parser.add_argument("--alpha", type=float, default=0.2, help="GGX roughness of the PV glass")
    parser.add_argument("--cell", type=float, default=0.04, help="reflectance of the cells below it")
    parser.add_argument("--most", type=float, default=0.1, help="bias that is accepted")
    options = parser.parse_args()
    env, glintmap = radiance(), options.glintmap.resolve()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        tensor_tree(work, env, options.alpha, options.cell)
        folder = project(work, options)
        quiet = dict(check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        subprocess.run([glintmap, "run", folder, "--until", "suns", "--quiet"], **quiet)
        rows = list(csv.DictReader(l for l in open(folder / "run/suns.csv") if not l.startswith("#")))
        suns = [tuple(float(r[k]) for k in ("x", "y", "z", "irradiance_w_m2")) for r in rows]
        weights = np.array([float(r["weight_h"]) for r in rows])
        octrees(work, env, folder, suns)
        command = f"mkpmap -n 1 -fo+ -apC map.pm {options.photons} -apo- pv_west_lower -lr 1 -ld 100 -t 0 -dp 1e6 sky.oct"
        took, _ = cpu_s(command.split(), cwd=work, env=env)
        dump = subprocess.run(["getinfo", "map.pm"], cwd=work, env=env, capture_output=True).stdout.decode(errors="replace")
        theirs_stored = int(re.search(r"NumPhotons\s*=\s*(\d+)", dump).group(1))
        # As many photons as mkpmap has: the same k then means the same blur.
        subprocess.run([glintmap, "run", folder, "--until", "render", "--quiet",
                        "--set", f"photons.stored={theirs_stored}"], **quiet)
        print(f"{len(suns)} suns; {theirs_stored} photons each, Radiance's in {took:.0f} CPU s")
        listed = subprocess.run("pmapdump -a -n 1000k -f map.pm".split(), cwd=work, env=env,
                                capture_output=True, check=True).stdout.decode()
        # The channels differ by their rounding to 8 bits alone.
        theirs_w = sum(sum(map(float, line.split()[3:6])) / 3 for line in listed.splitlines())
        annual = np.load(folder / "run/m/v/annual.npy").astype(float).ravel() / weights[0]
        assert np.allclose(weights, weights[0])
        rtrace = trace(work, env, f"rtrace -h -w -ff -i -ab -1 -am {options.radius} -ap map.pm 400 nosky.oct")[:, 0]
        ground = METRES**2 / SIZE**2
        store = subprocess.run([glintmap, "inspect", folder / "run/m/photons.gmp", "--json"], check=True,
                               capture_output=True, text=True).stdout
        total = float(re.search(r'"flux_w":\s*([0-9.e+-]+)', store).group(1))
        flux = total / theirs_stored, total / theirs_stored
        print(f"flux of all photons: glintmap {total:.0f} W, Radiance {theirs_w:.0f} W")
        print(f"flux on the square: glintmap {annual.sum() * ground:.0f} W, Radiance {rtrace.sum() * ground:.0f} W")
        failed = False
        result = z_test("annual", annual, rtrace, *flux)
        failed |= result is None or abs(result[0] - 1) > options.most or result[1] < 0.8
        series = trace(work, env, f"rcontrib -h -w -fff -i -V+ -ab -1 -am {options.radius} -ap map.pm 4000 -M suns.mod glow.oct")
        out = work / "series.npy"
        subprocess.run([glintmap, "volume", "export", folder / "run/m/v/series.zarr", "--out", out, "--quiet"], **quiet)
        ours = np.load(out).reshape(len(suns), -1).astype(float)
        ratios = []
        # The brightest by both: chosen by one alone, its noise would choose what is too bright in it.
        for t in np.sort(np.argsort(-ours.sum(axis=1) - series.sum(axis=0))[:10]):
            result = z_test(f"timestep {t}", ours[t], series[:, t], *flux)
            if result:
                ratios.append(result)
        mean = np.mean([r[0] for r in ratios])
        print(f"ten timesteps: mean ratio {mean:.3f}, {np.mean([r[1] for r in ratios]):.0%} of blocks within 3")
        failed |= abs(mean - 1) > options.most
        sys.exit(int(failed))


if __name__ == "__main__":
    main()
