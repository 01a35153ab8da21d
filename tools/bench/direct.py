"""Direct integration against the photons on the case study: time, memory, how many pixels agree
within 4 standard errors in annual irradiance, and why durations differ.

    cargo build --release
    python tools/bench/direct.py                                          small, minutes
    python tools/bench/direct.py --stored 250000000 --bandwidth 400 --plan 1000 --panorama 2000 \
        --figure durations.png                                            the paper's
    python tools/bench/direct.py --only direct --plan 1000 --panorama 2000        the paper's, direct alone
    python tools/bench/direct.py --only direct --days 0:364:1 --plan 250  a full year, fused
    python tools/bench/direct.py --store FOLDER --stored 250000000 --bandwidth 400 --materials standard \
        --around=-48,6,12 --plan 300 --figure close.png     twelve metres of the plan, so close that
                                                            discs are larger than pixels

Both run from the same project, one material at a time and in turn, into folders of their own;
`--keep FOLDER` leaves them there, and goes on with what is there. `--store FOLDER` takes photons from a project's folder that was
traced before (its materials that were, the rest is traced here): they are linked, not changed, and
traced anew if they were made from other settings, which is said.

Compared are pixels that hold photons and whose search disc crosses no edge or shadow border, read
off the noise-free map: within the disc it is nowhere 0 and varies by less than 1.3. Standard errors
are those of `annual.exr`, as shares of the noise-free value. Durations are hours above the
project's lower threshold, unfiltered; durations.py says how their differences are explained. Memory
is the largest of anonymous pages, from /proc (Linux). Needs numpy, scipy, OpenEXR, zarr
(tools/requirements.txt), and matplotlib for the figure.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import durations

ROOT = Path(__file__).resolve().parents[2]
MATERIALS = ["standard", "satinated", "tile", "smooth"]
VIEWS = ["plan", "panorama"]
THRESHOLD_W_M2 = 10.0
PAPER_H = 4.0


def project_of(folder, material, views):
    """The case study with one material and these views."""
    shutil.copytree(ROOT / "fixtures/projects/case-study", folder, ignore=shutil.ignore_patterns("run"),
                    dirs_exist_ok=True)
    path = folder / "project.toml"
    parts = re.split(r"(?m)^(?=\[)", path.read_text())

    def stays(part):
        name = re.match(r'\[\[material\]\].*\nname = "(.*?)"', part)
        # Maps alone are compared; regions and observers would take time of their own.
        left_out = ("[reference]", "[[region]]", "[[observer]]")
        view = re.match(r'\[\[view\]\]\nname = "(.*?)"', part)
        return ((not name or name.group(1) == material) and (not view or view.group(1) in views)
                and not part.startswith(left_out))

    path.write_text("".join(part for part in parts if stays(part)))
    return folder


def link_store(project, store, material):
    """Links what another run of the same project traced."""
    there, here = store.resolve() / "run", project / "run"
    units = json.loads((there / "manifest.json").read_text())
    kept = {n: u for n, u in units["units"].items() if n in (f"trace {material}", f"pages {material}")}
    if len(kept) < 2 or (here / "manifest.json").exists():
        return
    for name in (name for unit in kept.values() for name in unit["outputs"]):
        (here / name).parent.mkdir(parents=True, exist_ok=True)
        (here / name).symlink_to(there / name)
    (here / "manifest.json").write_text(json.dumps({**units, "units": kept}))


def anonymous_mib(pid, most):
    """Keeps the largest of a process's anonymous pages in `most[0]` until it ends."""
    try:
        while True:
            for line in Path(f"/proc/{pid}/status").read_text().splitlines():
                if line.startswith("RssAnon:"):
                    most[0] = max(most[0], int(line.split()[1]) / 1024)
            time.sleep(0.05)
    except (FileNotFoundError, ProcessLookupError):
        return


def run(program, project, settings, threads, until="render"):
    """CPU and wall seconds and MiB; the photons' share of the seconds if it traced."""
    command = [program, "run", project, "--until", until, "--quiet"]
    command += ["--threads", str(threads)] if threads else []
    for setting in settings:
        command += ["--set", setting]
    began = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    most = [0.0]
    watch = threading.Thread(target=anonymous_mib, args=(process.pid, most), daemon=True)
    watch.start()
    _, status, used = os.wait4(process.pid, 0)
    took = time.monotonic() - began
    watch.join(1)
    if status:
        sys.exit(f"{command}: {status}")
    return used.ru_utime + used.ru_stime, took, most[0]


def traced_s(project):
    """Seconds of tracing and sorting photons in the last run."""
    lines = (project / "run/log/run.jsonl").read_text().splitlines()
    sums = 0.0
    for line in lines:
        note = json.loads(line)
        if str(note.get("unit", "")).startswith(("trace ", "pages ")):
            sums += note.get("facts", {}).get("took_s", 0.0)
    return sums


def channels(path):
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        return {name: np.array(c.pixels) for name, c in file.channels().items()}


def window(values, radius, pick):
    """Smallest or largest value of the square of `radius` pixels around each pixel."""
    from scipy import ndimage

    return pick(ndimage)(values, size=2 * radius + 1, mode="nearest")


def plain_pixels(found, expected, radius_m, metres):
    """Pixels that hold photons and whose search disc crosses no edge or shadow border."""
    # In the panorama pixels differ in size: three to each side.
    pixels = np.full(found.shape, 3) if metres is None else np.ceil(radius_m / metres).astype(int)
    out = np.zeros(found.shape, bool)
    for reach in np.unique(pixels[found > 0]):
        if reach <= 40:
            least = window(expected, int(reach), lambda n: n.minimum_filter)
            most = window(expected, int(reach), lambda n: n.maximum_filter)
            out |= (pixels == reach) & (found > 0) & (least > 0) & (most < 1.3 * least)
    return out


def compare(material, view, folders, metres, plan_m):
    photons, direct = (channels(folders[name] / material / view / "annual.exr") for name in ["photons", "direct"])
    found, expected = photons["annual.wh_m2"], direct["annual.wh_m2"]
    if not (found > 0).any():
        return None
    plain = plain_pixels(found, expected, photons["radius.m"], metres)
    error = expected * photons["standard_error.wh_m2"] / np.maximum(found, 1e-30)
    if not plain.any():
        print(f"  {view}: no pixel's disc is free of borders: more photons, or a smaller bandwidth")
        return None
    off = (found - expected)[plain] / error[plain]
    ratio = found[plain].sum() / max(expected[plain].sum(), 1e-30)
    bound = direct["error.wh_m2"][expected > 0].sum() / expected.sum()
    print(f"  {view}: {plain.sum()} of {(expected > 0).sum()} lit pixels compared, "
          f"{100 * (np.abs(off) <= 4).mean():.2f} % within 4 standard errors, mean {off.mean():+.3f} and "
          f"deviation {off.std():.2f} of them, sum ratio {ratio:.4f}; bound of the direct sum {100 * bound:.2f} %")
    found = durations.explain(folders["photons"], folders["direct"], material, view, THRESHOLD_W_M2,
                              plan_m=plan_m)
    found.tell(plain)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap")
    parser.add_argument("--stored", type=int, default=2_000_000)
    parser.add_argument("--plan", type=int, default=250, help="edge of the plan, pixels")
    parser.add_argument("--panorama", type=int, default=400, help="width of the panorama, pixels")
    parser.add_argument("--bandwidth", type=int, default=100)
    parser.add_argument("--days", help="A:B:STEP instead of the paper's; a full year, not doubled")
    parser.add_argument("--only", choices=["photons", "direct"])
    parser.add_argument("--materials", nargs="+", default=MATERIALS, choices=MATERIALS)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--figure", type=Path, help="PNG of the durations")
    parser.add_argument("--store", type=Path, help="a project's folder with photons of the same settings")
    parser.add_argument("--around", help="X,Y,EDGE in metres: of the plan this square alone, no panorama")
    parser.add_argument("--keep", type=Path, help="folder that the runs stay in")
    arguments = parser.parse_args()
    views, plan_m = VIEWS, durations.PLAN_M
    common = [
        f"photons.stored={arguments.stored}",
        f"view.plan.size=[{arguments.plan}, {arguments.plan}]",
        f"view.plan.bandwidth={arguments.bandwidth}",
    ]
    if arguments.around:
        x, y, plan_m = (float(n) for n in arguments.around.split(","))
        views = ["plan"]
        common += [f'view.plan.view="-vtl -vp {x} {y} 200 -vd 0 0 -1 -vu 0 1 0 -vh {plan_m} -vv {plan_m}"']
    else:
        common += [f"view.panorama.size=[{arguments.panorama}, {arguments.panorama // 4}]",
                   f"view.panorama.bandwidth={arguments.bandwidth}"]
    if arguments.days:
        first, last, step = arguments.days.split(":")
        common += [f"time.days={{ from = {first}, to = {last}, step = {step} }}", "time.half_year=false"]
    total = {"photons": 0.0, "direct": 0.0}
    all_series = {}
    with tempfile.TemporaryDirectory() as folder:
        for material in arguments.materials:
            print(material, flush=True)
            folders = {}
            fused = [f"view.{v}.fuse=true" for v in views] if arguments.days else []
            for name in ["photons", "direct"]:
                if arguments.only in (None, name):
                    project = project_of(Path(arguments.keep or folder) / f"{material}-{name}", material, views)
                    both = [f'view.{v}.estimator="{name}"' for v in views]
                    if name == "photons" and arguments.store:
                        link_store(project, arguments.store, material)
                    cpu, wall, memory = run(arguments.glintmap, project, common + both + fused, arguments.threads)
                    total[name] += wall
                    spent = traced_s(project) if name == "photons" else 0.0
                    traced = f", of which {spent:.1f} s tracing" if spent else ""
                    traced = traced or (", photons were there" if name == "photons" else "")
                    print(f"  {name}: {wall:.1f} s{traced}, {cpu:.1f} CPU s, {memory:.0f} MiB anonymous at most", flush=True)
                    folders[name] = project / "run"
            if len(folders) == 2 and not fused:
                for view in views:
                    metres = plan_m / arguments.plan if view == "plan" else None
                    result = compare(material, view, folders, metres, plan_m)
                    if result:
                        all_series[material, view] = result
    cores = arguments.threads or len(os.sched_getaffinity(0))
    print(f"all {len(arguments.materials)} materials, {' and '.join(views)}, {cores} threads: photons {total['photons']:.0f} s, "
          f"direct {total['direct']:.0f} s; the paper: {PAPER_H:g} h on 8 cores for one")
    if arguments.figure and all_series:
        durations.figure(arguments.figure, all_series)


if __name__ == "__main__":
    main()
