"""Direct integration against the photons on the case study: time, memory, how many pixels agree
within 4 standard errors in annual irradiance, and how durations differ.

    cargo build --release
    python tools/bench/direct.py                                          small, minutes
    python tools/bench/direct.py --stored 250000000 --plan 1000 --panorama 2000   the paper's
    python tools/bench/direct.py --only direct --plan 1000 --panorama 2000        the paper's, direct alone
    python tools/bench/direct.py --only direct --days 0:364:1 --plan 250  a full year
    python tools/bench/direct.py --figure durations.png                   where durations differ

Both run from the same project, one material at a time and in turn, into folders of their own;
`--keep FOLDER` leaves them there. Compared are pixels that hold photons and whose search disc
crosses no edge or shadow border, read off the noise-free map: within the disc it is nowhere 0 and
varies by less than 1.3. Standard errors are those of `annual.exr`, as shares of the noise-free
value. Durations are hours above the project's lower threshold, unfiltered. Needs numpy, scipy,
OpenEXR, zarr (tools/requirements.txt), and matplotlib for the figure.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MATERIALS = ["standard", "satinated", "tile", "smooth"]
VIEWS = ["plan", "panorama"]
THRESHOLD_W_M2 = 10.0


def project_of(folder, material):
    """The case study with one material."""
    shutil.copytree(ROOT / "fixtures/projects/case-study", folder, ignore=shutil.ignore_patterns("run"))
    path = folder / "project.toml"
    parts = re.split(r"(?m)^(?=\[)", path.read_text())

    def stays(part):
        name = re.match(r'\[\[material\]\].*\nname = "(.*?)"', part)
        return (not name or name.group(1) == material) and not part.startswith("[reference]")

    path.write_text("".join(part for part in parts if stays(part)))
    return folder


def run(program, project, settings, threads):
    command = [program, "run", project, "--until", "render", "--quiet"]
    command += ["--threads", str(threads)] if threads else []
    for setting in settings:
        command += ["--set", setting]
    began = time.monotonic()
    process = subprocess.Popen(command)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command}: {status}")
    return used.ru_utime + used.ru_stime, time.monotonic() - began, used.ru_maxrss / 1024


def channels(path):
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        return {name: np.array(c.pixels) for name, c in file.channels().items()}


def hours(path):
    """Hours a year above the threshold."""
    import zarr

    store = zarr.open_group(str(path), mode="r")
    weight_h = store["weight_h"][:]
    values = next(a for _, a in store.arrays() if a.ndim == 3)
    out = np.zeros(values.shape[1:])
    for start in range(0, values.shape[0], 64):
        part = values[start : start + 64] >= THRESHOLD_W_M2
        out += np.tensordot(weight_h[start : start + 64], part, axes=1)
    return out


def window(values, radius, pick):
    """Smallest or largest value of the square of `radius` pixels around each pixel."""
    from scipy import ndimage

    return pick(ndimage)(values, size=2 * radius + 1, mode="nearest")


def plain_pixels(found, expected, radius_m, metres):
    """Pixels that hold photons and whose search disc crosses no edge or shadow border."""
    # In the panorama pixels differ in size: three to each side.
    pixels = 3 if metres is None else int(np.ceil(np.percentile(radius_m[found > 0], 90) / metres))
    least = window(expected, pixels, lambda n: n.minimum_filter)
    most = window(expected, pixels, lambda n: n.maximum_filter)
    return (found > 0) & (least > 0) & (most < 1.3 * least)


def compare(material, view, folders, metres):
    photons, direct = (channels(folders[name] / material / view / "annual.exr") for name in ["photons", "direct"])
    found, expected = photons["annual.wh_m2"], direct["annual.wh_m2"]
    if not (found > 0).any():
        return None
    plain = plain_pixels(found, expected, photons["radius.m"], metres)
    error = expected * photons["standard_error.wh_m2"] / np.maximum(found, 1e-30)
    off = (found - expected)[plain] / error[plain]
    ratio = found[plain].sum() / max(expected[plain].sum(), 1e-30)
    bound = direct["error.wh_m2"][expected > 0].sum() / expected.sum()
    print(f"  {view}: {plain.sum()} of {(expected > 0).sum()} lit pixels compared, "
          f"{100 * (np.abs(off) <= 4).mean():.2f} % within 4 standard errors, mean {off.mean():+.3f} and "
          f"deviation {off.std():.2f} of them, sum ratio {ratio:.4f}; bound of the direct sum {100 * bound:.2f} %")
    series = [hours(folders[name] / material / view / "series.zarr") for name in ["photons", "direct"]]
    differs = series[0] - series[1]
    lit = np.maximum(*series) > 0
    both = lit & plain
    print(f"    hours above {THRESHOLD_W_M2:g} W/m2: direct {series[1].sum() / max(lit.sum(), 1):.2f}, photons "
          f"{series[0].sum() / max(lit.sum(), 1):.2f} on average of {lit.sum()} pixels; median difference "
          f"{np.median(np.abs(differs[lit])) if lit.any() else 0:.2f} h, on compared ones "
          f"{np.median(np.abs(differs[both])) if both.any() else 0:.2f} h")
    return series, plain


def figure(path, all_series):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = len(all_series)
    shape, axes = plt.subplots(rows, 3, figsize=(12, 3.2 * rows), squeeze=False)
    for row, ((material, view), (series, _)) in zip(axes, all_series.items()):
        most = max(np.percentile(s[s > 0], 99) if (s > 0).any() else 1 for s in series)
        for axis, values, title in zip(row, [*series, series[0] - series[1]], ["photons", "direct", "photons - direct"]):
            plain = "-" not in title
            drawn = axis.imshow(values, cmap="viridis" if plain else "RdBu_r", vmin=0 if plain else -most / 2,
                                vmax=most if plain else most / 2)
            axis.set_title(f"{material}, {view}: {title}", fontsize=9)
            axis.axis("off")
            shape.colorbar(drawn, ax=axis, shrink=0.7, label="h")
    shape.tight_layout()
    shape.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap")
    parser.add_argument("--stored", type=int, default=2_000_000)
    parser.add_argument("--plan", type=int, default=250, help="edge of the plan, pixels")
    parser.add_argument("--panorama", type=int, default=400, help="width of the panorama, pixels")
    parser.add_argument("--bandwidth", type=int, default=400)
    parser.add_argument("--days", help="A:B:STEP instead of the paper's; a full year, not doubled")
    parser.add_argument("--only", choices=["photons", "direct"])
    parser.add_argument("--materials", nargs="+", default=MATERIALS, choices=MATERIALS)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--figure", type=Path, help="PNG of the durations")
    parser.add_argument("--keep", type=Path, help="folder that the runs stay in")
    arguments = parser.parse_args()
    common = [
        f"photons.stored={arguments.stored}",
        f"view.plan.size=[{arguments.plan}, {arguments.plan}]",
        f"view.panorama.size=[{arguments.panorama}, {arguments.panorama // 4}]",
        f"view.plan.bandwidth={arguments.bandwidth}",
        f"view.panorama.bandwidth={arguments.bandwidth}",
    ]
    if arguments.days:
        first, last, step = arguments.days.split(":")
        common += [f"time.days={{ from = {first}, to = {last}, step = {step} }}", "time.half_year=false"]
    total = {"photons": 0.0, "direct": 0.0}
    all_series = {}
    with tempfile.TemporaryDirectory() as folder:
        for material in arguments.materials:
            print(material, flush=True)
            folders = {}
            for name in ["photons", "direct"]:
                if arguments.only in (None, name):
                    project = project_of(Path(arguments.keep or folder) / f"{material}-{name}", material)
                    both = [f'view.{v}.estimator="{name}"' for v in VIEWS]
                    cpu, wall, memory = run(arguments.glintmap, project, common + both, arguments.threads)
                    total[name] += wall
                    print(f"  {name}: {wall:.1f} s, {cpu:.1f} CPU s, {memory:.0f} MiB resident at most", flush=True)
                    folders[name] = project / "run"
            if len(folders) == 2:
                for view, metres in [("plan", 200 / arguments.plan), ("panorama", None)]:
                    result = compare(material, view, folders, metres)
                    if result:
                        all_series[material, view] = result
    print(f"all: photons {total['photons']:.0f} s, direct {total['direct']:.0f} s")
    if arguments.figure and all_series:
        figure(arguments.figure, all_series)


if __name__ == "__main__":
    main()
