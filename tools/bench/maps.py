"""How long glintmap's maps and time series take, on the case study; one command, one table.

    cargo build --release
    python tools/bench/maps.py table                 # k = 400 and 4,000 at 1, 16 and 250 M photons
    python tools/bench/maps.py plan                  # 1,000 x 1,000, 1,280 suns, 16 M photons
    python tools/bench/maps.py year                  # every 15 minutes of a whole year
    python tools/bench/maps.py all --scale 0.1       # any of them at a tenth of the photons and pixels

- table: the plan, 500 x 500 pixels of 0.4 m: for the annual map (k = 400) and the written series
  (k = 4,000) seconds of wall and CPU, lit pixels per second of wall (a look-up is the search and
  the sum for one pixel that sees photons), the share of page reads that the cache served, and the
  anonymous memory of the whole stage at its peak.
- plan: 1,000 x 1,000 written to the volume; under two minutes on two cores is the aim.
- year: half_year = false, every day, 4.5 h to 20.5 h every 15 minutes: the panorama of
  2,000 x 500 fused (analysed without being written), and of 1,000 x 250 written.

Photons are traced once for each number and kept in --work; tracing isn't timed. The material is
`satinated`, whose wide lobe lights most of the view. Memory is RssAnon, asked every 20 ms.
"""

import argparse
import json
import math
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "fixtures/projects/case-study"
PLAN = "-vtl -vp 0 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 200 -vv 200"
PANORAMA = "-vtc -vp 1 5 25 -vd 0 -1 0 -vu 0 0 1 -vh 360 -vv 76.3 -vo 32"
YEAR = "days = { from = 0, to = 364, step = 1 }"


def project(folder, photons, view, year):
    """Writes or rewrites the project; what is traced stays where its settings are the same."""
    text = (SCENE / "project.toml").read_text()
    head, rest = text.split("[[material]]", 1)
    tail = rest[rest.index("[time]"):]
    material = ('[[material]]\nname = "m"\nmodel = { kind = "pv-glass", index = 1.52, '
                "ggx_alpha = 0.28, cell_reflectance = 0.06 }\n\n")
    tail = re.sub(r"stored = [\d_]+", f"stored = {photons}", tail.split("[[view]]")[0])
    if year:
        tail = re.sub(r"days = .*", YEAR, tail).replace("half_year = true", "half_year = false")
    folder.mkdir(parents=True, exist_ok=True)
    for file in SCENE.glob("*.rad"):
        shutil.copy(file, folder)
    glare = "[glare]\nthresholds_w_m2 = [10.0]\nrules = []\n"
    (folder / "project.toml").write_text(f"{head}{material}{tail}{view}\n{glare}")


def view(name, options, size, more=""):
    return (f'[[view]]\nname = "{name}"\nview = "{options}"\nsize = [{size[0]}, {size[1]}]\n'
            f"bandwidth = 400\nseries_bandwidth = 4000\n{more}\n")


def run(options, folder, until, force=False):
    """Wall seconds and peak of anonymous memory, MB."""
    command = [options.glintmap, "run", folder, "--until", until, "--quiet"]
    command += ["--threads", str(options.threads)] if options.threads else []
    command += ["--force", until] if force else []
    began, peak = time.monotonic(), 0
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while child.poll() is None:
        try:
            status = Path(f"/proc/{child.pid}/status").read_text()
            found = re.search(r"RssAnon:\s*(\d+)", status)
            peak = max(peak, int(found.group(1)) if found else 0)
        except OSError:
            pass
        time.sleep(0.02)
    if child.returncode != 0:
        sys.exit(f"{command}: {child.returncode}")
    return time.monotonic() - began, peak / 1e3


def facts(folder, unit):
    for line in reversed((folder / "run/log/run.jsonl").read_text().splitlines()):
        entry = json.loads(line)
        if entry.get("unit", "") == unit:
            return entry["facts"]
    sys.exit(f"no {unit} in the log")


def share(cache, before=None):
    hits, misses = (cache[k] - (before[k] if before else 0) for k in ("hits", "misses"))
    return hits / max(1, hits + misses)


def bytes_of(path):
    return sum(f.stat().st_size for f in path.rglob("*") if f.is_file())


def table(options, work):
    edge = max(32, int(500 * math.sqrt(options.scale)))
    print(f"plan of {edge} x {edge} pixels, 1,280 suns")
    print(f"{'photons':>12} {'k':>6} {'wall s':>8} {'CPU s':>8} {'lit':>8} {'look-ups/s':>11} "
          f"{'cache':>7} {'memory':>8}")
    for millions in options.millions:
        photons = int(millions * 1e6 * options.scale)
        folder = work / f"half-{photons}"
        project(folder, photons, view("v", PLAN, (edge, edge)), False)
        run(options, folder, "pages")
        _, memory = run(options, folder, "render", force=True)
        annual, found = facts(folder, "annual m v"), facts(folder, "render m v")
        lit = found["gathered"]["lit_pixels"]
        rows = [(400, annual["annual"], share(annual["cache"])),
                (4000, found["series_took"], share(found["cache"]))]
        for k, took, cache in rows:
            print(f"{photons:12,} {k:6,} {took['wall_s']:8.2f} {took['cpu_s']:8.2f} {lit:8,} "
                  f"{lit / took['wall_s']:11,.0f} {cache:7.4f} {memory:5.0f} MB", flush=True)


def plan(options, work):
    edge, photons = max(32, int(1000 * math.sqrt(options.scale))), int(16e6 * options.scale)
    folder = work / f"half-{photons}"
    project(folder, photons, view("plan", PLAN, (edge, edge)), False)
    run(options, folder, "pages")
    wall, memory = run(options, folder, "render", force=True)
    annual, found = facts(folder, "annual m plan"), facts(folder, "render m plan")
    series = bytes_of(folder / "run/m/plan/series.zarr") / 1e6
    print(f"plan {edge} x {edge}, {photons:,} photons, 1,280 suns, hits and background included: "
          f"{wall:.1f} s (annual map {annual['annual']['wall_s']:.1f} s, series "
          f"{found['series_took']['wall_s']:.1f} s, {series:.0f} MB), {memory:.0f} MB of memory")


def year(options, work):
    part, photons = math.sqrt(options.scale), int(16e6 * options.scale)
    folder = work / f"year-{photons}"
    for name, size, more in [("written", (1000, 250), ""), ("fused", (2000, 500), "fuse = true\n")]:
        size = tuple(max(32, int(s * part)) for s in size)
        project(folder, photons, view(name, PANORAMA, size, "# bandwidth of all suns\n" + more)
                .replace("series_bandwidth = 4000\n", ""), True)
        run(options, folder, "pages")
        wall, memory = run(options, folder, "glare", force=False)
        found = facts(folder, f"render m {name}")
        written = folder / f"run/m/{name}/series.zarr"
        volume = f"{bytes_of(written) / 1e6:,.0f} MB" if written.exists() else \
            f"{found['series']['batches']} batches"
        steps = sum(1 for _ in open(folder / "run/suns.csv")) - 1
        print(f"year {name} {size[0]} x {size[1]}, {photons:,} photons, some {steps:,} suns, to the "
              f"analysis at 10 W/m2: {wall:.1f} s (series {found['series_took']['wall_s']:.1f} s, "
              f"{volume}), {memory:.0f} MB of memory", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["table", "plan", "year", "all"])
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap", type=Path)
    parser.add_argument("--scale", type=float, default=1.0, help="share of photons and pixels")
    parser.add_argument("--millions", type=float, nargs="+", default=[1, 16, 250], help="of the table")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--work", type=Path, help="folder for projects (250 M photons: 15 GB)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        work = options.work or Path(name)
        for what, how in [("table", table), ("plan", plan), ("year", year)]:
            if options.what in (what, "all"):
                how(options, work)


if __name__ == "__main__":
    main()
