"""How fast glintmap traces photons against Radiance's mkpmap: the same scene, suns and scattering,
both on one core, in turn; prints stored photons per CPU second of each and the ratio.

    cargo build --release
    python tools/bench/mkpmap.py --glintmap target/release/glintmap [--alpha 0.05] [--rounds 3]

Needs pyradiance (tools/requirements.txt). The case study's three roofs carry `pv-glass`; Radiance
gets the same function as an isotropic tensor tree of 128 x 128 directions (bsdf2ttree -t3 -g 7
-t 80), the suns of `glintmap suns` as sources of equal irradiance (mkpmap shares photons out per
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
INDEX, CELL = 1.52, 0.04

# site::bsdf::PvGlass, with f = 0 below the surface. Vectors point away from the surface.
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


def tensor_tree(work, env, alpha):
    steps = 20_000
    mean = sum(2 * fresnel(c) * c / steps for c in ((i + 0.5) / steps for i in range(steps)))
    constants = f"n : {INDEX}; a : {alpha}; diffuse : {CELL / (1 - mean)};\n"
    (work / "brdf.cal").write_text(constants + CAL)
    tree = subprocess.run(
        "bsdf2ttree -t3 -g 7 -t 80 +for +b -f brdf.cal brdf".split(),
        cwd=work, env=env, capture_output=True, check=True,
    )
    (work / "pv.xml").write_bytes(tree.stdout)
    if shutil.which("checkBSDF", path=env["PATH"]):
        check = subprocess.run(["checkBSDF", "pv.xml"], cwd=work, env=env, capture_output=True, text=True)
        print(check.stdout.strip())


def octree(work, env, suns):
    lines = []
    for i, (x, y, z) in enumerate(suns):
        lines.append(f"void light sun{i} 0 0 3 5e6 5e6 5e6\nsun{i} source s{i} 0 0 4 {x} {y} {z} .533\n")
    (work / "suns.rad").write_text("".join(lines))
    names = ["pv_west_lower", "pv_west_upper", "pv_south"]
    bsdf = "".join(f"void BSDF {m} 6 0 pv.xml 0 0 1 . 0 0\n" for m in names)
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


def project(work, alpha, stored):
    text = (SCENE / "project.toml").read_text()
    head, rest = text.split("[[material]]", 1)
    tail = rest[rest.index("[time]"):]
    material = (
        '[[material]]\nname = "glossy"\n'
        f'model = {{ kind = "pv-glass", index = {INDEX}, ggx_alpha = {alpha}, cell_reflectance = {CELL} }}\n\n'
    )
    tail = re.sub(r"stored = [\d_]+", f"stored = {stored}", tail)
    folder = work / "project"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for file in SCENE.glob("*.rad"):
        shutil.copy(file, folder)
    (folder / "project.toml").write_text(head + material + tail)
    return folder


def suns_of(glintmap, folder):
    subprocess.run([glintmap, "run", folder, "--until", "suns", "--quiet"], check=True)
    with open(folder / "run/suns.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    keys = {k.strip().lower(): k for k in rows[0]}
    names = next(
        [keys[k] for k in trio]
        for trio in (("sun_x", "sun_y", "sun_z"), ("x", "y", "z"), ("dx", "dy", "dz"))
        if all(k in keys for k in trio)
    )
    return [tuple(float(row[k]) for k in names) for row in rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap", type=Path)
    parser.add_argument("--alpha", type=float, default=0.05, help="GGX roughness of the PV glass")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--mkpmap-photons", type=int, default=100_000)
    parser.add_argument("--photons", type=int, default=5_000_000)
    parser.add_argument("--until", default="trace", choices=["trace", "pages"])
    options = parser.parse_args()
    env, glintmap = radiance(), options.glintmap.resolve()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        tensor_tree(work, env, options.alpha)
        suns = suns_of(glintmap, project(work, options.alpha, options.photons))
        ports = octree(work, env, suns)
        print(f"{len(suns)} suns, alpha {options.alpha}, until {options.until}")
        for _ in range(options.rounds):
            command = ["mkpmap", "-n", "1", "-fo+", "-apC", "map.pm", str(options.mkpmap_photons)]
            for port in ports:
                command += ["-apo-", port]
            command += ["-lr", "1", "-ld", "100", "-t", "0", "sky.oct"]
            took_s, _ = cpu_s(command, cwd=work, env=env)
            header = subprocess.run(["getinfo", "map.pm"], cwd=work, env=env, capture_output=True)
            head = header.stdout.decode(errors="replace")
            found = re.search(r"NumPhotons\s*=\s*(\d+)", head)
            if not found:
                sys.exit(f"no number of photons in the map's header:\n{head}")
            theirs = int(found.group(1)) / took_s
            print(f"mkpmap: {found.group(1)} photons, {took_s:.2f} CPU s: {theirs:,.0f} stored/s")
            folder = project(work, options.alpha, options.photons)
            took_s, _ = cpu_s([glintmap, "--threads", "1", "run", folder, "--until", options.until, "--quiet"])
            tally = (folder / "run/glossy/tally.json").read_text()
            stored = int(re.search(r'"stored":\s*{\s*"photons":\s*(\d+)', tally.split('"tally"', 1)[1]).group(1))
            ours = stored / took_s
            print(f"glintmap: {stored} photons, {took_s:.2f} CPU s: {ours:,.0f} stored/s; ratio {ours / theirs:.1f}")


if __name__ == "__main__":
    main()
