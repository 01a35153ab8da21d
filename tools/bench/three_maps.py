"""The picture of src/docs/estimators.md: one site three ways, side by side.

    cargo build --release
    python tools/bench/three_maps.py --glintmap target/release/glintmap --out fixtures/gallery/three-ways.png

Fifty metres around the chalet and the open house of the case study, standard modules, every 7th day
of 2025 in steps of 15 minutes: hours above 10 W/m2 by photons and by direct integration, and the
year of the two houses by the mirror rule. `--keep FOLDER` keeps project and run; what is current
there isn't made again. Needs numpy, OpenEXR, zarr, and matplotlib.
"""

import argparse
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from three_ways import TIME

ROOT = Path(__file__).resolve().parents[2]
VIEW = "-vtl -vp -50 2 200 -vd 0 0 -1 -vu 0 1 0 -vh 50 -vv 50"
THRESHOLD_W_M2 = 10.0
REGIONS = ["Chalet", "Open house"]


def project(folder, stored, edge):
    for file in (ROOT / "fixtures/projects/case-study").glob("*.rad"):
        shutil.copy(file, folder)
    parts = re.split(r"(?m)^(?=\[)", (ROOT / "fixtures/projects/case-study/project.toml").read_text())

    def stays(part):
        if part.startswith("[[material]]"):
            return 'name = "standard"' in part
        if part.startswith("[[region]]"):
            return any(f'name = "{region}"' in part for region in REGIONS)
        return not part.startswith(("[reference]", "[[observer]]", "[[view]]", "[time]"))

    text = "".join(part for part in parts if stays(part)).replace("250_000_000", str(stored))
    text += TIME
    for name, estimator in (("counted", "photons"), ("direct", "direct")):
        text += f"""
[[view]]
name = "{name}"
view = "{VIEW}"
size = [{edge}, {edge}]
estimator = "{estimator}"
bandwidth = 100
"""
    (folder / "project.toml").write_text(text)


def hours(store):
    import zarr

    group = zarr.open_group(str(store), mode="r")
    values = next(a for _, a in group.arrays() if a.ndim == 3)
    weights = group["weight_h"][:]
    return sum(
        np.tensordot(weights[t : t + 64], values[t : t + 64] > THRESHOLD_W_M2, axes=1)
        for t in range(0, values.shape[0], 64)
    )


def background(path):
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        found = {n: np.array(c.pixels) for n, c in file.channels().items()}
    rgb = found["RGB"] if "RGB" in found else np.stack([found[c] for c in "RGB"], axis=-1)
    grey = rgb.mean(axis=-1)
    return np.clip(grey / max(np.percentile(grey, 98), 1e-9), 0, 1) ** 0.45


def draw(folder, mirrored, out):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    run = folder / "run"
    grey = background(next((run / "counted").glob("*.exr")))
    maps = [hours(run / "standard" / view / "series.zarr") for view in ("counted", "direct")]
    most = max(np.percentile(m[m > 0], 99) for m in maps)
    shape, axes = plt.subplots(1, 3, figsize=(13, 4.4), width_ratios=[1, 1, 1.15], layout="constrained")
    for axis, values, title in zip(axes, maps, ["photons", "direct"]):
        axis.imshow(0.35 + 0.6 * grey, cmap="gray", vmin=0, vmax=1, extent=(-75, -25, -23, 27))
        shown = np.ma.masked_where(values <= 0, values)
        drawn = axis.imshow(shown, cmap="inferno", vmin=0, vmax=most, extent=(-75, -25, -23, 27))
        axis.set_title(f"{title}: hours a year above 10 W/m²", fontsize=10)
        axis.set_xlabel("east (m)", fontsize=8)
        axis.tick_params(labelsize=7)
    axes[0].set_ylabel("north (m)", fontsize=8)
    shape.colorbar(drawn, ax=axes[:2], shrink=0.8, label="h/a", location="left")
    chart = axes[2]
    for region, colour in zip(mirrored["regions"], ["#1f6fa8", "#d9731c"]):
        runs = region["anywhere"]["chart"]
        chart.vlines([r["day"] for r in runs], [r["first_h"] for r in runs],
                     [r["last_h"] + 1 / 60 for r in runs], color=colour, lw=1.0,
                     label=f"{region['name']}: {region['anywhere']['hours']:.0f} h anywhere on it,\nat most "
                           f"{region['worst']['hours']:.0f} h at a point")
    chart.set(xlim=(0, 365), ylim=(4, 12), title="")
    chart.set_title("mirror rule: when the sun stands in the mirror", fontsize=10)
    chart.set_xticks([0, 90, 181, 273], ["Jan", "Apr", "Jul", "Oct"], fontsize=8)
    chart.set_ylabel("local standard time (h)", fontsize=8)
    chart.tick_params(labelsize=8)
    chart.grid(lw=0.3)
    chart.legend(fontsize=8, loc="upper right")
    shape.savefig(out, dpi=85)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--glintmap", required=True)
    parser.add_argument("--stored", type=int, default=1_000_000)
    parser.add_argument("--edge", type=int, default=250, help="of the maps, pixels")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--keep", type=Path, help="folder for the project and its run")
    asked = parser.parse_args()
    folder = asked.keep or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    project(folder, asked.stored, asked.edge)
    subprocess.run([asked.glintmap, "run", folder, "--until", "render", "--quiet"], check=True, stdout=subprocess.DEVNULL)
    regions = [part for region in REGIONS for part in ("--region", region)]
    said = subprocess.run([asked.glintmap, "mirror", folder, "--json", "--quiet", *regions], check=True, capture_output=True, text=True)
    draw(folder, json.loads(said.stdout), asked.out)


if __name__ == "__main__":
    main()
