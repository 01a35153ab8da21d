"""How fast glintmap traces photons against Radiance's mkpmap: the same scene, suns and scattering,
both on one core, in turn; prints stored photons per CPU second of each and the ratio.

    cargo build --release
    python tools/bench/mkpmap.py --glintmap target/release/glintmap
    python tools/bench/mkpmap.py --materials standard satinated tile tree --rounds 2
    python tools/bench/mkpmap.py --photons 60000000 --until pages      # the larger, the steadier

Needs pyradiance (tools/requirements.txt). Materials of the case study's three roofs:
  standard   pv-glass, GGX alpha 0.05, cells of 0.04
  satinated  pv-glass, GGX alpha 0.28, cells of 0.06
  tile       lambertian, 0.25
  tree       `standard`, but glintmap reads the tensor tree that Radiance gets
For pv-glass Radiance gets the same function as an isotropic tensor tree of 128 x 128 directions
(bsdf2ttree -t3 -g 7 -t 80); the tile is a plastic. The suns are those of `glintmap suns` as sources of equal irradiance (mkpmap shares photons out per
sun), and `-n 1 -apC … -apo- pv -lr 1 -ld 100`. CPU time is that of the whole program: reading the
scene, its set-up and pilot or pre-pass, tracing, and writing what is stored (for glintmap the
spill; `--until pages` adds sort and store, which mkpmap's kd-tree includes).
"""

import argparse
import csv
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "fixtures/projects/case-study"
INDEX = 1.52
# GGX roughness and cell reflectance; None: lambertian.
MATERIALS = {
    "standard": (0.05, 0.04),
    "satinated": (0.28, 0.06),
    "tile": None,
    "tree": (0.05, 0.04),
}

# bsdf::PvGlass, with f = 0 below the surface. Vectors point away from the surface.
CAL = """
sq(x) : x*x;
lower(a,b) : if(a-b, b, a);
cosin(c) : sqrt(1 - (1-sq(c))/sq(n));
fresnel2(c,k) : .5*(sq((c-n*k)/(c+n*k)) + sq((n*c-k)/(n*c+k)));
fresnel(c) : fresnel2(lower(c,1), cosin(lower(c,1)));
lambda(x,y,z) : .5*(sqrt(1 + sq(a)*(x*x+y*y)/sq(z)) - 1);
ggx(hx,hy,hz) : sq(a)/(PI*sq(hx*hx + hy*hy + sq(a)*hz*hz));
lobe(hx,hy,hz,len,ix,iy,iz,ox,oy,oz) : ggx(hx/len,hy/len,hz/len)
  / (1 + lambda(ix,iy,iz) + lambda(ox,oy,oz))
  * fresnel((ix*hx+iy*hy+iz*hz)/len) / (4*iz*oz);
norm(x,y,z) : sqrt(x*x+y*y+z*z);
both(ix,iy,iz,ox,oy,oz) : diffuse*(1-fresnel(iz))*(1-fresnel(oz))/PI
  + lobe(ix+ox,iy+oy,iz+oz,norm(ix+ox,iy+oy,iz+oz),ix,iy,iz,ox,oy,oz);
brdf(ix,iy,iz,ox,oy,oz) : if(iz-1e-4, if(oz-1e-4, both(ix,iy,iz,ox,oy,oz), 0), 0);
"""


def fresnel(cos):
    inside = math.sqrt(1 - (1 - cos * cos) / INDEX**2)
    return 0.5 * (
        ((cos - INDEX * inside) / (cos + INDEX * inside)) ** 2
        + ((INDEX * cos - inside) / (INDEX * cos + inside)) ** 2
    )


def radiance():
    import pyradiance

    package = Path(pyradiance.__file__).parent
    env = dict(os.environ, RAYPATH=f".:{package / 'lib'}")
    env["PATH"] = f"{package / 'bin'}:{env['PATH']}"
    return env


def cpu_s(command, **more):
    """Runs a command; its user and system time, s, and its output."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, **more)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}")
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return used, done.stdout + done.stderr


def tensor_tree(work, env, alpha, cell):
    steps = 20_000
    mean = sum(2 * fresnel(c) * c / steps for c in ((i + 0.5) / steps for i in range(steps)))
    constants = f"n : {INDEX}; a : {alpha}; diffuse : {cell / (1 - mean)};\n"
    (work / "brdf.cal").write_text(constants + CAL)
    tree = subprocess.run(
        "bsdf2ttree -t3 -g 7 -t 80 +for +b -f brdf.cal brdf".split(),
        cwd=work, env=env, capture_output=True, check=True,
    )
    (work / "pv.xml").write_bytes(tree.stdout)


def octree(work, env, suns, diffuse):
    lines = []
    for i, (x, y, z) in enumerate(suns):
        lines.append(f"void light sun{i} 0 0 3 5e6 5e6 5e6\nsun{i} source s{i} 0 0 4 {x} {y} {z} .533\n")
    (work / "suns.rad").write_text("".join(lines))
    names = ["pv_west_lower", "pv_west_upper", "pv_south"]
    how = "void plastic {} 0 0 5 .25 .25 .25 0 0\n" if diffuse else "void BSDF {} 6 0 pv.xml 0 0 1 . 0 0\n"
    bsdf = "".join(how.format(m) for m in names)
    grey = "void plastic {} 0 0 5 .25 .25 .25 0 0\n"
    files = [SCENE / f for f in ("terrain.rad", "church.rad", "houses.rad", "trees.rad")]
    text = "".join(f.read_text() for f in files)
    defined = set(re.findall(r"^\s*void\s+\S+\s+(\S+)", text, re.M))
    used = set(re.findall(r"^\s*(\w+)\s+polygon\s", text, re.M))
    scene = "".join(grey.format(m) for m in sorted(used - defined - {"void"})) + text
    (work / "scene.rad").write_text(scene)
    (work / "pv.rad").write_text(bsdf + (SCENE / "pv.rad").read_text())
    (work / "pv.mod").write_text("\n".join(names) + "\n")
    out = subprocess.run(["oconv", "suns.rad", "scene.rad", "pv.rad"], cwd=work, env=env,
                         capture_output=True)
    if out.returncode != 0:
        sys.exit(out.stderr.decode())
    (work / "sky.oct").write_bytes(out.stdout)
    return names


def project(work, material, stored):
    text = (SCENE / "project.toml").read_text()
    head, rest = text.split("[[material]]", 1)
    tail = rest[rest.index("[time]"):]
    if material == "tree":
        how = 'bsdf = "pv.xml"'
    elif MATERIALS[material] is None:
        how = 'model = { kind = "lambertian", reflectance = 0.25 }'
    else:
        alpha, cell = MATERIALS[material]
        how = (f'model = {{ kind = "pv-glass", index = {INDEX}, ggx_alpha = {alpha}, '
               f'cell_reflectance = {cell} }}')
    tail = re.sub(r"stored = [\d_]+", f"stored = {stored}", tail)
    folder = work / "project"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for file in SCENE.glob("*.rad"):
        shutil.copy(file, folder)
    if material == "tree":
        shutil.copy(work / "pv.xml", folder)
    (folder / "project.toml").write_text(f'{head}[[material]]\nname = "bench"\n{how}\n\n{tail}')
    return folder


def suns_of(glintmap, folder):
    cpu_s([glintmap, "run", folder, "--until", "suns", "--quiet"])
    with open(folder / "run/suns.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    keys = {k.strip().lower(): k for k in rows[0]}
    names = next(
        [keys[k] for k in trio]
        for trio in (("sun_x", "sun_y", "sun_z"), ("x", "y", "z"), ("dx", "dy", "dz"))
        if all(k in keys for k in trio)
    )
    return [tuple(float(row[k]) for k in names) for row in rows]


def mkpmap(work, env, ports, photons):
    """Stored photons and CPU time, s."""
    command = ["mkpmap", "-n", "1", "-fo+", "-apC", "map.pm", str(photons)]
    for port in ports:
        command += ["-apo-", port]
    command += ["-lr", "1", "-ld", "100", "-t", "0", "sky.oct"]
    took_s, _ = cpu_s(command, cwd=work, env=env)
    header = subprocess.run(["getinfo", "map.pm"], cwd=work, env=env, capture_output=True)
    head = header.stdout.decode(errors="replace")
    found = re.search(r"NumPhotons\s*=\s*(\d+)", head)
    if not found:
        sys.exit(f"no number of photons in the map's header:\n{head}")
    return int(found.group(1)), took_s


def ours(glintmap, folder, until):
    took_s, _ = cpu_s([glintmap, "--threads", "1", "run", folder, "--until", until, "--quiet"])
    tally = (folder / "run/bench/tally.json").read_text().split('"tally"', 1)[1]
    return int(re.search(r'"stored":\s*{\s*"photons":\s*(\d+)', tally).group(1)), took_s


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap", type=Path)
    parser.add_argument("--materials", nargs="+", default=["standard", "tree"], choices=MATERIALS)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--mkpmap-photons", type=int, default=200_000)
    parser.add_argument("--photons", type=int, default=20_000_000)
    parser.add_argument("--until", default="trace", choices=["trace", "pages"])
    options = parser.parse_args()
    env, glintmap = radiance(), options.glintmap.resolve()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for material in options.materials:
            optics = MATERIALS[material]
            if optics:
                tensor_tree(work, env, *optics)
            suns = suns_of(glintmap, project(work, material, options.photons))
            ports = octree(work, env, suns, optics is None)
            print(f"{material}: {len(suns)} suns, until {options.until}", flush=True)
            for _ in range(options.rounds):
                photons, took_s = mkpmap(work, env, ports, options.mkpmap_photons)
                theirs = photons / took_s
                print(f"  mkpmap:   {photons} photons, {took_s:.2f} CPU s: {theirs:,.0f} stored/s")
                folder = project(work, material, options.photons)
                photons, took_s = ours(glintmap, folder, options.until)
                rate = photons / took_s
                print(f"  glintmap: {photons} photons, {took_s:.2f} CPU s: {rate:,.0f} stored/s; "
                      f"ratio {rate / theirs:.1f}", flush=True)


if __name__ == "__main__":
    main()
