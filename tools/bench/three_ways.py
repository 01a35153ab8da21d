"""The same five observers of the case study three ways: the mirror rule, photons, direct integration.

    cargo build --release
    python tools/bench/three_ways.py --glintmap target/release/glintmap [--stored 16000000]
    python tools/bench/three_ways.py --glintmap target/release/glintmap --step 5min      a draft

Every 7th day of 2025 in steps of 15 minutes (NREL's suns, a clear sky, broadband) for photons and
direct, every minute of every day for the mirror rule and for `glintmap eyes`, which integrates as
direct does, but for the plane across the observer's line of sight, and looks only when it must. Prints
a table in Markdown: hours a year and most minutes a day above 10 W/m2, in brackets hours above 30.
What is current in `--keep FOLDER` is not made again. Needs nothing but Python.
"""

import argparse
import csv
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Every 7th day of a year, with the whole spectrum.
TIME = """
[time]
year = 2025
days = { from = 0, to = 364, step = 7 }
hours = { from = 0.0, to = 23.75, step = 0.25 }
sun = "spa"
irradiance = "clear-sky"
"""

# On surfaces of the scene, with their normals.
OBSERVERS = {
    "Crown before the chalet": ((-38.2897, 12.3507, 7.4777), (0.9928, -0.1051, 0.0580)),
    "Chalet, gable": ((-58.0440, 12.5000, 13.5000), (1.0, 0.0, 0.0)),
    "Chalet, upstairs": ((-54.5000, 10.5000, 9.2000), (1.0, 0.0, 0.0)),
    "Open house, upstairs": ((-51.9734, -9.1172, 6.5000), (0.9945, -0.1045, 0.0)),
    "Open house, ground floor": ((-51.7643, -7.1282, 4.5000), (0.9945, -0.1045, 0.0)),
}


def project(folder, stored):
    for file in (ROOT / "fixtures/projects/case-study").glob("*.rad"):
        shutil.copy(file, folder)
    text = (ROOT / "fixtures/projects/case-study/project.toml").read_text()
    tables, keep = [], ("[site]", "[scene]", "[[pv]]", "[[material]]", "[reference]", "[photons]")
    for line in text.splitlines(keepends=True):
        if line.startswith("["):
            tables.append("")
        if tables:
            tables[-1] += line
    out = "".join(t for t in tables if t.startswith(keep))
    out = out.replace("stored = 250_000_000", f"stored = {stored}")
    out += TIME + """
[[view]]
name = "direct"
sensors = "five.txt"
estimator = "direct"

[[view]]
name = "counted"
sensors = "five.txt"

[glare]
thresholds_w_m2 = [10.0, 30.0]
"""
    lines = []
    for name, (point, normal) in OBSERVERS.items():
        out += f'\n[[observer]]\nname = "{name}"\npoint = {list(point)}\ndirection = {list(normal)}\n'
        lines.append(" ".join(map(str, point + normal)))
    (folder / "project.toml").write_text(out)
    (folder / "five.txt").write_text("\n".join(lines) + "\n")


def call(*command):
    began = time.time()
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command}: {done.stderr}")
    print(f"{' '.join(map(str, command[1:3]))}: {time.time() - began:.1f} s", file=sys.stderr)
    return done.stdout


def sensors(folder, material, view):
    path = folder / "run" / material / view / "sensors.csv"
    return list(csv.DictReader(path.open()))


def cell(hours, minutes, hours_more):
    if not hours:
        return "never"
    shown = lambda h: f"{h:.1f}" if h < 10 else f"{h:.0f}"
    return f"{shown(hours)} h, {minutes:.0f} min ({f'{shown(hours_more)} h' if hours_more else 'never'})"


def counted(row):
    number = lambda name: float(row[name] or 0)
    return cell(number("hours_above_10"), number("longest_day_min_above_10"), number("hours_above_30"))


def swept(eye):
    low, high = (eye["exceeded"][f"irradiance > {t} W/m2"] for t in (10, 30))
    return cell(low["hours"], 60 * low["longest_day_h"], high["hours"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", required=True)
    parser.add_argument("--stored", type=int, default=1_000_000)
    parser.add_argument("--materials", nargs="*", default=["standard", "satinated", "smooth"])
    parser.add_argument("--step", default="1min", help="of `eyes`, 10s to 60min")
    parser.add_argument("--keep", help="folder for the project and its run")
    asked = parser.parse_args()
    folder = Path(asked.keep or tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    project(folder, asked.stored)
    mirrored = json.loads(call(asked.glintmap, "mirror", folder, "--json", "--quiet"))
    call(asked.glintmap, "run", folder, "--until", "glare", "--quiet")
    materials = [part for m in asked.materials for part in ("--material", m)]
    found = json.loads(call(asked.glintmap, "eyes", folder, "--json", "--quiet", "--step", asked.step, *materials))
    print("| observer | mirror rule |", end="")
    for material in asked.materials:
        print(f" {material}: photons | direct | every {asked.step} |", end="")
    print("\n|---" + "|---" * (1 + 3 * len(asked.materials)) + "|")
    for number, name in enumerate(OBSERVERS):
        year = next(r for r in mirrored["receivers"] if r["name"] == name)
        first = f"{year['hours']:.0f} h, {year['most_minutes']:.0f} min" if year["days"] else "never"
        print(f"| {name} | {first} |", end="")
        for material in asked.materials:
            for view in ("counted", "direct"):
                print(f" {counted(sensors(folder, material, view)[number])} |", end="")
            eye = next(e for e in found["eyes"] if (e["observer"], e["material"]) == (name, material))
            print(f" {swept(eye)} |", end="")
        print()
    print(f"\n{asked.stored} stored photons a material; looked at:", end="")
    for material in asked.materials:
        shares = [e["looked"] / found["instants"] for e in found["eyes"] if e["material"] == material]
        print(f" {material} {100 * sum(shares) / len(shares):.0f} %", end="")
    print(f" of {found['instants']} instants")


if __name__ == "__main__":
    main()
