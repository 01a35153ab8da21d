"""Direct integration against Radiance: reads cases as JSON from stdin, prints the irradiance of each
and its standard error as JSON.

    python tools/oracles/direct_rtrace.py < cases.json

A case has `triangles` (the scene, [[[x, y, z] * 3], ...], black), `pv` (the same for the PV), a
`spot` and its `normal`, a `sun` (towards it), its `strength` (W/m2) and `diameter_deg`, and the
PV's `index`, `alpha`, `diffuse`. The PV is Radiance's `plasfunc` with the BRDF of
bsdf::PvGlass as a function; rtrace sends a ray from the spot to each of many points spread
over the PV and samples the sun's disc there (-dj 1): Radiance finds what hides the PV, what shades
it, and its radiance. Needs pyradiance (tools/requirements.txt).
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

BATCHES = 8
CAL = """
sq(x) : x*x;
lower(a,b) : if(a-b, b, a);
cosin(c) : sqrt(1 - (1-sq(c))/sq(n));
fresnel2(c,k) : .5*(sq((c-n*k)/(c+n*k)) + sq((n*c-k)/(n*c+k)));
fresnel(c) : fresnel2(lower(c,1), cosin(lower(c,1)));
lambda(z) : .5*(sqrt(1 + sq(a)*(1-sq(z))/sq(z)) - 1);
ggx(z) : sq(a)/(PI*sq((1-sq(z)) + sq(a)*sq(z)));
lobe(hz,ih,iz,oz) : ggx(hz) / (1 + lambda(iz) + lambda(oz)) * fresnel(ih) / (4*iz*oz);
len(c) : sqrt(2 + 2*c);
both(iz,oz,io) : diffuse*(1-fresnel(iz))*(1-fresnel(oz))/PI
  + lobe((iz+oz)/len(io), len(io)/2, iz, oz);
refl(x,y,z,w) : if(Nx*x+Ny*y+Nz*z-1e-4,
  both(Nx*x+Ny*y+Nz*z, Rdot, -(Dx*x+Dy*y+Dz*z)), 0);
"""


def environment():
    import pyradiance

    package = Path(pyradiance.__file__).parent
    return dict(os.environ, RAYPATH=f".:{package / 'lib'}", PATH=f"{package / 'bin'}:{os.environ['PATH']}")


def polygons(name, modifier, triangles):
    out = []
    for i, t in enumerate(triangles):
        numbers = "\n".join("%.9g %.9g %.9g" % tuple(p) for p in t)
        out.append(f"{modifier} polygon {name}{i}\n0\n0\n9\n{numbers}\n")
    return "\n".join(out)


def irradiance(case, work, env, points):
    cal = f"n : {case['index']}; a : {case['alpha']}; diffuse : {case['diffuse']};\n" + CAL
    (work / "pv.cal").write_text(cal)
    radius = math.radians(case["diameter_deg"]) / 2
    # Radiance's sources have the solid angle of a flat disc.
    radiance = case["strength"] / (2 * math.pi * (1 - math.cos(radius)))
    x, y, z = case["sun"]
    (work / "scene.rad").write_text(
        f"void light sun\n0\n0\n3 {radiance} {radiance} {radiance}\n"
        f"sun source s\n0\n0\n4 {x} {y} {z} {case['diameter_deg']}\n"
        "void plastic black\n0\n0\n5 0 0 0 0 0\n"
        "void plasfunc pv\n2 refl pv.cal\n0\n4 0 0 0 1\n"
        + polygons("s", "black", case["triangles"]) + polygons("p", "pv", case["pv"]))
    octree = subprocess.run(["oconv", "scene.rad"], cwd=work, env=env, capture_output=True, check=True)
    (work / "scene.oct").write_bytes(octree.stdout)
    random = np.random.default_rng(1)
    spot, normal = np.array(case["spot"]), np.array(case["normal"])
    start = spot + 1e-3 * normal
    parts, rays = [], []
    for triangle in case["pv"]:
        a, b, c = map(np.array, triangle)
        across = np.cross(b - a, c - a)
        area = np.linalg.norm(across) / 2
        across = across / (2 * area)
        # R2 sequence (Roberts 2018) with a random start, in batches for the error.
        for _ in range(BATCHES):
            i = np.arange(points // BATCHES)[:, None]
            uv = (random.random(2) + i * np.array([0.7548776662466927, 0.5698402909980532])) % 1
            uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
            at = a + uv[:, :1] * (b - a) + uv[:, 1:] * (c - a)
            way = at - spot
            away = np.linalg.norm(way, axis=1)
            ray = (at - start) / np.linalg.norm(at - start, axis=1)[:, None]
            rays.append(np.hstack([np.broadcast_to(start, ray.shape), ray]).astype(np.float32))
            parts.append((way @ normal).clip(0) * (-(way @ across)).clip(0) / away**4 * area)
    run = subprocess.run(
        "rtrace -h -w -fff -ab 0 -dt 0 -dj 1 -ds 0 -dc 1 -lr 1 -st 1 -u+ scene.oct".split(),
        input=np.concatenate(rays).tobytes(), cwd=work, env=env, capture_output=True, check=True)
    seen = np.frombuffer(run.stdout, np.float32).reshape(len(parts), -1, 3)[:, :, 1].astype(float)
    values = (seen * np.array(parts)).mean(axis=1).reshape(-1, BATCHES)
    return values.mean(axis=1).sum(), math.sqrt((values.var(axis=1, ddof=1) / BATCHES).sum())


def main():
    env = environment()
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for case in json.load(sys.stdin)["cases"]:
            value, error = irradiance(case, Path(folder), env, case.get("points", 4096))
            out.append({"w_m2": value, "error_w_m2": error})
    json.dump(out, sys.stdout)


if __name__ == "__main__":
    main()
