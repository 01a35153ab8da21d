"""Direct integration against the photons on the case study: CPU time, memory, and how many pixels
agree within 4 standard errors in annual irradiance.

    cargo build --release
    python tools/bench/direct.py --glintmap target/release/glintmap                    small, minutes
    python tools/bench/direct.py --glintmap … --stored 250000000 --plan 1000 --panorama 2000   the paper's
    python tools/bench/direct.py --glintmap … --only direct --days 0:364:1 --plan 250   a full year

Both run from the same project, in turn, into folders of their own. Compared are pixels that hold
photons and whose search disc crosses no edge or shadow border, read off the noise-free map: within
the disc it is nowhere 0 and varies by less than 1.3. A standard error is 1/sqrt(bandwidth - 1) of
the value: the photons carry equal flux and equal weights.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


def run(program, project, settings, threads):
    command = [program, "run", project, "--until", "render", "--quiet"]
    command += ["--threads", str(threads)] if threads else []
    for setting in settings:
        command += ["--set", setting]
    process = subprocess.Popen(command)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command}: {status}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def channels(path):
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        return {name: np.array(c.pixels) for name, c in file.channels().items()}


def window(values, radius, pick):
    """Smallest or largest value of the square of `radius` pixels around each pixel."""
    from scipy import ndimage

    return pick(ndimage)(values, size=2 * radius + 1, mode="nearest")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--glintmap", default=ROOT / "target/release/glintmap")
    parser.add_argument("--stored", type=int, default=2_000_000)
    parser.add_argument("--plan", type=int, default=250, help="edge of the plan, pixels")
    parser.add_argument("--panorama", type=int, default=400, help="width of the panorama, pixels")
    parser.add_argument("--bandwidth", type=int, default=400)
    parser.add_argument("--days", help="A:B:STEP instead of the paper's; a full year, not doubled")
    parser.add_argument("--only", choices=["photons", "direct"])
    parser.add_argument("--threads", type=int)
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
    with tempfile.TemporaryDirectory() as folder:
        runs = {}
        for name in ["photons", "direct"]:
            if arguments.only in (None, name):
                project = Path(folder) / name
                shutil.copytree(ROOT / "fixtures/projects/case-study", project, ignore=shutil.ignore_patterns("run"))
                both = [f'view.{v}.estimator="{name}"' for v in ("plan", "panorama")]
                cpu, memory = run(arguments.glintmap, project, common + both, arguments.threads)
                print(f"{name}: {cpu:.1f} CPU s, {memory:.0f} MiB at most", flush=True)
                runs[name] = project / "run"
        if len(runs) < 2:
            return
        for view, metres in [("plan", 200 / arguments.plan), ("panorama", None)]:
            for material in ["standard", "satinated", "tile", "smooth"]:
                photons = channels(runs["photons"] / material / view / "annual.exr")
                direct = channels(runs["direct"] / material / view / "annual.exr")
                found, expected = photons["annual.wh_m2"], direct["annual.wh_m2"]
                radius = photons["radius.m"]
                # In the panorama pixels differ in size: three to each side.
                pixels = 3 if metres is None else int(np.ceil(np.percentile(radius[found > 0], 90) / metres))
                least = window(expected, pixels, lambda n: n.minimum_filter)
                most = window(expected, pixels, lambda n: n.maximum_filter)
                plain = (found > 0) & (least > 0) & (most < 1.3 * least)
                error = expected / np.sqrt(arguments.bandwidth - 1)
                inside = np.abs(found - expected)[plain] <= 4 * error[plain]
                ratio = found[plain].sum() / max(expected[plain].sum(), 1e-30)
                print(f"{view} {material}: {plain.sum()} pixels, {100 * inside.mean():.2f} % within 4 standard errors, "
                      f"sum ratio {ratio:.4f}, largest error bound {direct['error.wh_m2'].max():.3f} Wh/m2")


if __name__ == "__main__":
    main()
