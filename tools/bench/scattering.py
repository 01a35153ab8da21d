"""What a BSDF file holds for light at one incidence, what rtrace makes of it, and what mkpmap scatters
off one small rectangle in a closed box.

    python tools/bench/scattering.py                     # the case study's glass (bsdf2ttree, rank 3)
    python tools/bench/scattering.py --file bsdf.xml --photons 1000000 --seeds 0 333

Needs pyradiance (tools/requirements.txt). Rank 3 only; tests/oracle/scattering.rs holds glintmap and
mkpmap against files of rank 3 and 4, cell by cell. Shares of the light on the rectangle:
  file      sum of the file's numbers times their cells' projected solid angles, over the sun's disc
  rtrace    under an even sky, from the view at that angle (`-ab 1 -ss 4096`), over the file's
  -dp 1e6   mkpmap with some 60 samples of the sun's disc, over the file's
  default   mkpmap with `-dp 1000`, over the file's, and how far off it must be
mkpmap draws from a file what it holds. But by default it samples the disc once for each sun and
partition of a port, before it sends photons and whatever the seed, and takes the sun's flux from there:
cos(sample) for cos(centre), up to tan(incidence) x 0.27 degrees off. `foreseen` follows its generator.
Exits with 1 where -dp 1e6 or rtrace differs from the file beyond 4 standard errors and 0.2 % (the flux of
a photon is stored with 8 bits), or the default does from what is foreseen.
"""

import argparse
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mkpmap import radiance, tensor_tree

PV, BOX, WINDOW, DISC_DEG, AZIMUTH, IRRADIANCE = 0.02, 10.0, 0.2, 0.533, 0.3, 800.0
ANGLES = [10.0, 30.0, 60.0, 70.0, 75.0, 80.0, 85.0]


def reflectance(path):
    """Share scattered, by the sine of the incidence: a function of an array."""
    text = path.read_text()
    if "TensorTree3" not in text:
        sys.exit(f"{path}: no tensor tree of rank 3")
    block = text.split("Reflection Back")[1].split("<ScatteringData>")[1].split("</ScatteringData>")[0]
    words = iter(re.findall(r"[{}]|[^\s,{}]+", block))
    steps = 4096
    total = np.zeros(steps)

    def node(low, edge):
        values = []
        for word in words:
            if word == "}":
                break
            if word == "{":
                node(low + 0.5 * edge * (len(values) & 1), 0.5 * edge)
                values.append(0.0)
            else:
                values.append(float(word))
        else:
            return
        side = round(len(values) ** (1 / 3))
        small = edge / side
        # The first coordinate (incidence) varies slowest in a grid; branches have added theirs.
        for i, sheet in enumerate(np.reshape(values, (side, -1)).sum(axis=1)):
            first = low + i * small
            total[round(first * steps):round((first + small) * steps)] += math.pi * small**2 * sheet

    if next(words) != "{":
        sys.exit(f"{path}: no tree")
    node(0.0, 1.0)
    return lambda sine: total[((0.5 - 1e-6 - 0.5 * sine) * steps).astype(int)]


def over_disc(share, angle):
    """Mean over the sun's disc, weighed with the cosine and relative to the centre's."""
    off, turn = np.meshgrid((np.arange(200) + 0.5) / 200, 2 * math.pi * (np.arange(200) + 0.5) / 200)
    off = math.radians(DISC_DEG / 2) * np.sqrt(off)
    cos = np.cos(off) * math.cos(angle) - np.sin(off) * np.cos(turn) * math.sin(angle)
    return (share(np.sqrt(1 - cos**2)) * cos).mean() / math.cos(angle)


def foreseen(sun):
    """mkpmap's flux of the first sun over the true one: the first numbers of erand48, its sample."""
    state = 33997 | 59693 << 16 | 11003 << 32

    def draw():
        nonlocal state
        state = (state * 0x5DEECE66D + 0xB) % 2**48
        return state / 2**48

    u = np.cross([1.0, 0.0, 0.0], sun)
    u /= np.linalg.norm(u)
    v = np.cross(sun, u)
    cos = 1 - draw() * (1 - math.cos(math.radians(DISC_DEG / 2)))
    turn = 2 * math.pi * draw()
    sample = math.sqrt(1 - cos**2) * (math.cos(turn) * u + math.sin(turn) * v) + cos * sun
    return sample[2] / sun[2]


def polygon(modifier, name, corners):
    return f"{modifier} polygon {name} 0 0 12 " + " ".join(f"{x:.9g}" for c in corners for x in c) + "\n"


def rectangle(axis, at, across, up):
    def corner(x, y):
        out = [0.0, 0.0, 0.0]
        out[axis], out[(axis + 1) % 3], out[(axis + 2) % 3] = at, x, y
        return out

    (a, b), (c, d) = across, up
    return [corner(a, c), corner(b, c), corner(b, d), corner(a, d)]


def octree(work, env, name, text):
    (work / f"{name}.rad").write_text("void BSDF pv 6 0 pv.xml 0 1 0 . 0 0\n" + text)
    out = subprocess.run(["oconv", f"{name}.rad"], cwd=work, env=env, capture_output=True, check=True)
    (work / f"{name}.oct").write_bytes(out.stdout)


def box(sun):
    """The walls, one with a window through which the sun reaches the rectangle."""
    facing, whole, out = int(np.argmax(np.abs(sun))), (-BOX, BOX), []
    for axis in range(3):
        for at in (-BOX, BOX):
            if axis != facing or at * sun[axis] < 0:
                out.append(rectangle(axis, at, whole, whole))
                continue
            x, y = (sun[(axis + k) % 3] / abs(sun[axis]) * BOX for k in (1, 2))
            out.append(rectangle(axis, at, (-BOX, x - WINDOW), whole))
            out.append(rectangle(axis, at, (x + WINDOW, BOX), whole))
            out.append(rectangle(axis, at, (x - WINDOW, x + WINDOW), (-BOX, y - WINDOW)))
            out.append(rectangle(axis, at, (x - WINDOW, x + WINDOW), (y + WINDOW, BOX)))
    return "".join(polygon("grey", f"w{i}", wall) for i, wall in enumerate(out))


def mkpmap(work, env, photons, seed, more):
    """Watts that land, and how many photons carry them."""
    command = f"mkpmap -n 1 -fo+ -apC map.pm {photons} -apr {seed} -apo- pv -lr 1 -t 0 {more} box.oct"
    subprocess.run(command.split(), cwd=work, env=env, check=True, capture_output=True)
    text = subprocess.run("pmapdump -a -n 100000k -f map.pm".split(), cwd=work, env=env, check=True,
                          capture_output=True, text=True).stdout
    rows = np.array([line.split()[3:6] for line in text.splitlines() if line[:1] not in "#"], float)
    return rows.mean(axis=1).sum(), len(rows)


def rtrace(work, env, angle):
    x, z = math.sin(angle), math.cos(angle)
    out = subprocess.run("rtrace -h -ab 1 -ad 4096 -as 0 -aa 0 -lw 1e-9 -st 0 -ss 4096 sky.oct".split(),
                         input=f"{x} 0 {z} {-x} 0 {-z}\n", cwd=work, env=env, check=True,
                         capture_output=True, text=True).stdout
    return float(out.split()[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--file", type=Path, help="a tensor tree of rank 3")
    parser.add_argument("--photons", type=int, default=400_000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    options = parser.parse_args()
    env, failed = radiance(), False
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        if options.file:
            (work / "pv.xml").write_bytes(options.file.read_bytes())
        else:
            tensor_tree(work, env, 0.05, 0.04)
        share = reflectance(work / "pv.xml")
        pv = polygon("pv", "p", rectangle(2, 0.0, (-PV / 2, PV / 2), (-PV / 2, PV / 2)))
        octree(work, env, "sky", "void glow g 0 0 4 1 1 1 0\ng source s 0 0 4 0 0 1 180\n" + pv)
        print("incidence     file  rtrace  -dp 1e6  default (foreseen)  standard error")
        for degrees in ANGLES:
            angle = math.radians(degrees)
            x, y = math.cos(AZIMUTH), math.sin(AZIMUTH)
            sun = np.array([math.sin(angle) * x, math.sin(angle) * y, math.cos(angle)])
            shine = IRRADIANCE / (2 * math.pi * (1 - math.cos(math.radians(DISC_DEG / 2))))
            light = f"void light l 0 0 3 {shine} {shine} {shine}\nl source s 0 0 4 {sun[0]} {sun[1]} {sun[2]} {DISC_DEG}\n"
            octree(work, env, "box", "void plastic grey 0 0 5 .5 .5 .5 0 0\n" + light + box(sun) + pv)
            whole = over_disc(share, angle)
            falls_w = IRRADIANCE * sun[2] * PV**2
            runs = {}
            for more in ("-dp 1e6", ""):
                found = [mkpmap(work, env, options.photons, seed, more) for seed in options.seeds]
                runs[more] = np.mean([watts for watts, _ in found]) / falls_w / whole
                error = 1 / math.sqrt(sum(count for _, count in found))
            seen = rtrace(work, env, angle) / float(share(np.array(math.sin(angle))))
            by, most = foreseen(sun), 4 * error + 0.002
            print(f"{degrees:8.0f}° {whole:8.5f} {seen:7.4f} {runs['-dp 1e6']:8.4f} {runs['']:8.4f} ({by:.4f}) {error:14.4f}",
                  flush=True)
            failed |= abs(runs["-dp 1e6"] - 1) > most or abs(runs[""] / by - 1) > most or abs(seen - 1) > 0.002
    sys.exit(int(failed))


if __name__ == "__main__":
    main()
