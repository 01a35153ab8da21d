"""The same five observers of the case study three ways: the mirror rule, photons, direct integration.

    cargo build --release
    python tools/bench/three_ways.py --glintmap target/release/glintmap [--stored 16000000]

Every 7th day of 2025 in steps of 15 minutes (NREL's suns, a clear sky, broadband) for photons and
direct, every minute of every day for the mirror rule. Prints a table in Markdown: hours a year and
most minutes a day; for photons and direct above a threshold at the wall, with each material. Needs
nothing but Python.
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
    out += """
[time]
year = 2025
days = { from = 0, to = 364, step = 7 }
hours = { from = 0.0, to = 23.75, step = 0.25 }
sun = "spa"
irradiance = "clear-sky"

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
    began = time.process_time(), time.time()
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command}: {done.stderr}")
    print(f"{' '.join(map(str, command[1:3]))}: {time.time() - began[1]:.1f} s", file=sys.stderr)
    return done.stdout


def sensors(folder, material, view):
    path = folder / "run" / material / view / "sensors.csv"
    return list(csv.DictReader(path.open()))


def cell(row, threshold):
    hours = float(row[f"hours_above_{threshold}"] or 0)
    minutes = float(row[f"longest_day_min_above_{threshold}"] or 0)
    return f"{hours:.0f} h, {minutes:.0f} min" if hours else "never"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--glintmap", required=True)
    parser.add_argument("--stored", type=int, default=1_000_000)
    parser.add_argument("--materials", nargs="*", default=["standard", "satinated", "smooth"])
    parser.add_argument("--keep", help="folder for the project and its run")
    asked = parser.parse_args()
    folder = Path(asked.keep or tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    project(folder, asked.stored)
    mirrored = json.loads(call(asked.glintmap, "mirror", folder, "--json", "--quiet"))
    call(asked.glintmap, "run", folder, "--until", "glare", "--quiet")
    swept = json.loads(call(asked.glintmap, "eyes", folder, "--json", "--quiet"))
    print("| observer | mirror rule |", end="")
    columns = [(m, t) for m in asked.materials for t in (10, 30)]
    for material, threshold in columns:
        print(f" {material} > {threshold} W/m²: photons | direct | to the minute |", end="")
    print("\n|---" * (2 + 3 * len(columns)) + "|")
    for number, (name, _) in enumerate(OBSERVERS.items()):
        year = next(r for r in mirrored["receivers"] if r["name"] == name)
        never = year["days"] == 0
        first = "never" if never else f"{year['hours']:.0f} h, {year['most_minutes']:.0f} min"
        print(f"| {name} | {first} |", end="")
        for material, threshold in columns:
            for view in ("counted", "direct"):
                print(f" {cell(sensors(folder, material, view)[number], threshold)} |", end="")
            eye = next(e for e in swept["eyes"] if (e["observer"], e["material"]) == (name, material))
            found = eye["exceeded"][f"irradiance > {threshold} W/m2"]
            text = f"{found['hours']:.0f} h, {60 * found['longest_day_h']:.0f} min"
            print(f" {text if found['hours'] else 'never'} |", end="")
        print()


if __name__ == "__main__":
    main()
