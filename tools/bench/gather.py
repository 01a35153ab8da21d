"""How fast glintmap looks photons up against Radiance's rtrace and rcontrib: the same scene, suns,
scattering, view, machine and run; prints pixels per CPU second of each and the ratios.

    cargo build --release
    python tools/bench/gather.py --glintmap target/release/glintmap [--photons 1000000]
        [--size 250] [--metres 50] [--rounds 2]

Needs pyradiance (tools/requirements.txt). Both programs fill a store of their own with the same
number of photons (mkpmap -n 1 -apC, as in mkpmap.py), because neither
reads the other's. The view is a square of `--metres` on the ground west of the church, from above:
250 pixels on 50 m are the 0.2 m of the case study's plan of 1,000 x 1,000.

- rtrace: irradiance with the photon map at bandwidth 400 (`-i -ab -1 -ap map 400`); glintmap: the
  annual map, k = 400, with standard error and radius.
- rcontrib: one value per sun at bandwidth 4,000 into one stream; glintmap: the time series of all
  suns, k = 4,000, written to the volume (compression included).

CPU seconds of rtrace and rcontrib are those of the whole process less those of one with a single
pixel (reading map and octree); glintmap's are from run/log (`annual.cpu_s`, `series_took.cpu_s`).
rcontrib has every pixel search for itself and is slow: it gets fewer pixels of the same square
(`--rcontrib-size`). Both search within the same largest radius (`-am`, `max_radius_m`).
A pixel counts where the result isn't 0, for each program its own: rays and dark pixels are paid for
by the lit ones on both sides. `--exact` switches glintmap's edges and tolerances off
(`estimator = "radiance"`), which is what Radiance computes.
"""

import argparse
import itertools
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mkpmap import MATERIALS, cpu_s, octree, project, radiance, suns_of, tensor_tree

ROOT = Path(__file__).resolve().parents[2]


def view_of(options):
    m = options.metres
    return f"-vtl -vp {options.at} 0 200 -vd 0 0 -1 -vu 0 1 0 -vh {m} -vv {m}"


def configured(folder, options, estimator):
    text = (folder / "project.toml").read_text()
    head, rest = text.split("[[view]]", 1)
    tail = rest[rest.index("[[observer]]"):]
    view = (
        f'[[view]]\nname = "square"\nview = "{view_of(options)}"\nsize = [{options.size}, {options.size}]\n'
        f'estimator = "{estimator}"\nbandwidth = 400\nseries_bandwidth = 4000\n'
        f"max_radius_m = {options.radius}\n\n"
    )
    (folder / "project.toml").write_text(head + view + tail)


def ours(glintmap, folder):
    subprocess.run(
        [glintmap, "--threads", "1", "run", folder, "--until", "render", "--force", "render", "--quiet"],
        check=True, stdout=subprocess.DEVNULL,
    )
    lines = (folder / "run/log/run.jsonl").read_text().splitlines()
    facts = {e["unit"]: e["facts"] for e in map(json.loads, lines) if "unit" in e}
    annual, series = facts["annual bench square"], facts["render bench square"]
    caches = [annual["cache"], series["cache"]]
    hits, misses = (sum(c[key] for c in caches) for key in ("hits", "misses"))
    took = (annual["annual"]["cpu_s"], series["series_took"]["cpu_s"])
    return series["gathered"]["lit_pixels"], *took, hits / max(1, hits + misses)


def rays(work, env, options, size):
    out = subprocess.run(
        ["vwrays", "-ff", "-pa", "0", "-x", str(size), "-y", str(size)] + view_of(options).split(),
        env=env, cwd=work, capture_output=True, check=True,
    )
    return out.stdout


def theirs(work, env, command, name, options, size):
    took = []
    for size in (1, size):
        (work / "rays").write_bytes(rays(work, env, options, size))
        with open(work / "rays", "rb") as source, open(work / name, "wb") as out:
            used = measured(command, work, env, source, out)
        took.append(used)
    return took[1] - took[0]


def measured(command, work, env, source, out):
    import resource

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=work, env=env, stdin=source, stdout=out, stderr=subprocess.PIPE)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{command}: {done.stderr.decode()}")
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap", type=Path)
    parser.add_argument("--photons", type=int, default=1_000_000)
    parser.add_argument("--size", type=int, default=250, help="pixels along an edge")
    parser.add_argument("--metres", type=float, default=50.0, help="metres along an edge")
    parser.add_argument("--at", type=float, default=-40.0, help="x of the square's centre")
    parser.add_argument("--radius", type=float, default=5.0, help="of both searches at most, m")
    parser.add_argument("--rcontrib-size", type=int, default=80, help="pixels along an edge for rcontrib")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--peer", type=Path, help="another glintmap, measured in turn")
    parser.add_argument("--exact", action="store_true", help="only estimator = radiance")
    options = parser.parse_args()
    env, glintmap = radiance(), options.glintmap.resolve()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        tensor_tree(work, env, *MATERIALS["tree"])
        folder = project(work, "tree", options.photons)
        suns = suns_of(glintmap, folder)
        ports = octree(work, env, suns, False)
        # rtrace must see no suns; rcontrib wants them as glow. Before the map, which is stale else.
        text = (work / "suns.rad").read_text()
        text = re.sub(r"void light (sun\d+) 0 0 3 (\S+ \S+ \S+)", r"void glow \1 0 0 4 \2 0", text)
        (work / "glow.rad").write_text(text)
        (work / "suns.mod").write_text("".join(f"sun{i}\n" for i in range(len(suns))))
        for octree_name, sources in [("nosky.oct", []), ("glow.oct", ["glow.rad"])]:
            made = subprocess.run(["oconv", *sources, "scene.rad", "pv.rad"], cwd=work, env=env,
                                  capture_output=True, check=True)
            (work / octree_name).write_bytes(made.stdout)
        command = ["mkpmap", "-n", "1", "-fo+", "-apC", "map.pm", str(options.photons)]
        for port in ports:
            command += ["-apo-", port]
        took, _ = cpu_s(command + ["-lr", "1", "-ld", "100", "-t", "0", "sky.oct"], cwd=work, env=env)
        head = subprocess.run(["getinfo", "map.pm"], cwd=work, env=env, capture_output=True, check=True)
        stored = int(re.search(r"NumPhotons\s*=\s*(\d+)", head.stdout.decode(errors="replace")).group(1))
        # mkpmap misses its target by far: as many as it has.
        folder = project(work, "tree", stored)
        subprocess.run([glintmap, "run", folder, "--until", "pages", "--quiet"], check=True,
                       stdout=subprocess.DEVNULL)
        print(f"mkpmap: {stored} photons in {took:.0f} CPU s, glintmap as many; {len(suns)} suns; "
              f"{options.size}^2 pixels on {options.metres} m", flush=True)
        pixels = options.size**2
        for _ in range(options.rounds):
            took = theirs(work, env, f"rtrace -h -w -ff -i -ab -1 -am {options.radius} -ap map.pm 400 nosky.oct".split(), "annual", options, options.size)
            lit = np.count_nonzero(np.fromfile(work / "annual", "<f4").reshape(pixels, 3).max(axis=1) > 0)
            rtrace = lit / took
            print(f"rtrace 400: {took:.2f} CPU s, {lit} lit of {pixels}: {rtrace:,.0f} lit pixels/s ({pixels / took:,.0f} all)", flush=True)
            took = theirs(work, env, f"rcontrib -h -w -fff -i -V+ -ab -1 -am {options.radius} -ap map.pm 4000 -M suns.mod glow.oct".split(), "series", options, options.rcontrib_size)
            few = options.rcontrib_size**2
            values = np.fromfile(work / "series", "<f4").reshape(few, -1)
            lit = np.count_nonzero(values.max(axis=1) > 0)
            rcontrib = lit / took
            print(f"rcontrib 4000: {took:.2f} CPU s, {lit} lit of {few}: {rcontrib:,.0f} lit pixels/s ({few / took:,.0f} all)")
            programs = [glintmap] + ([options.peer.resolve()] if options.peer else [])
            for program, estimator in itertools.product(programs, ["radiance"] if options.exact else ["radiance", "photons"]):
                configured(folder, options, estimator)
                lit, annual, series, share = ours(program, folder)
                print(
                    f"{program.name} {estimator}: {lit} lit; annual {annual:.2f} CPU s: {lit / annual:,.0f}/s, "
                    f"{lit / annual / rtrace:.1f} x rtrace; series {series:.2f} CPU s: {lit / series:,.0f}/s, "
                    f"{lit / series / rcontrib:.1f} x rcontrib; page cache {share:.4f}", flush=True
                )


if __name__ == "__main__":
    main()
