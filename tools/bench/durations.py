"""Why photons' durations differ from the noise-free ones: for direct.py.

Of a pixel's hours above a threshold by photons, three things are computed from the noise-free
series alone:

- blur: photons are counted over a disc. The noise-free series, averaged over the pixels of the
  same side within the series' radius in space, has other hours.
- noise at the threshold: a value E has the standard error sqrt(E * photon.w_m2) (noise.exr), so an
  hour whose E lies near the threshold counts with some probability. Summed up these are the hours
  to be expected; their variance is the sum of p (1 - p) of the hours.
- what remains, in units of that standard deviation, must look like chance.
"""

from pathlib import Path

import numpy as np

SAMPLES = 1500
BLOCK = 64
# Pixels to each side of a disc, at most; larger discs are looked at through every n-th pixel.
REACH = 24
RECEIVES = (0, 4, 5)
# Width of the plan, m.
PLAN_M = 200.0


def hits(path):
    """Positions, normals and kinds of `hits.gmh`."""
    import json

    from numcodecs.zstd import decompress

    data = Path(path).read_bytes()
    length = int(data[: data.index(b"\n")].split()[3])
    facts = json.loads(data[data.index(b"\n") + 1 : length - 16].decode())
    facts = facts.get("facts", facts)
    rows, columns = facts["rows"], facts["columns"]
    position = np.zeros((rows, columns, 3), np.float32)
    normal, kind = np.zeros_like(position), np.zeros((rows, columns), np.uint8)
    at = length
    while at < len(data):
        first, count, size, _ = np.frombuffer(data, "<u4", 4, at)
        content = np.frombuffer(decompress(data[at + 16 : at + 16 + size]), np.uint8)
        n = int(count) * columns
        for i in range(6):
            plane = content[4 * i * n : 4 * (i + 1) * n].reshape(4, n).T.copy().view("<f4")
            (position if i < 3 else normal)[first : first + count, :, i % 3] = plane.reshape(count, columns)
        kind[first : first + count] = content[36 * n : 37 * n].reshape(count, columns)
        at += 16 + int(size)
    return position, normal, kind


def footprints(view, position, normal):
    """What a pixel covers, up to a factor, m2."""
    if view == "plan":
        return 1.0 / np.maximum(np.abs(normal[..., 2]), 0.05)
    way = position - np.array([1.0, 5.0, 25.0], np.float32)
    away = np.linalg.norm(way, axis=-1)
    return away**2 / np.maximum(np.abs((way * normal).sum(-1)) / np.maximum(away, 1e-3), 0.05)


def rms(values):
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


class Explained:
    def tell(self, plain):
        """Says how photons' hours differ and what explains it; `plain`: pixels whose disc crosses no border."""
        found, exact = self.hours
        lit = np.maximum(found, exact) > 0
        if not lit.any():
            print(f"    never above {self.threshold:g} W/m2")
            return
        median = lambda mask: np.median(np.abs(found - exact)[mask]) if mask.any() else 0.0
        print(f"    hours above {self.threshold:g} W/m2: direct {exact[lit].mean():.2f}, photons {found[lit].mean():.2f} on "
              f"average of {lit.sum()} pixels; median difference {median(lit):.2f} h, on compared ones {median(lit & plain):.2f} h")
        if len(self.expected) < 2:
            return
        self.plain = plain[self.chosen[:, 0], self.chosen[:, 1]]
        alike = np.corrcoef(self.found - self.exact, self.expected - self.exact)[0, 1]
        print(f"    of {len(self.found)} pixels, discs of {np.median(self.radius):.2f} m (median); expected and found differences "
              f"correlate by {alike:.2f}")
        print("    | h/a, root mean square | pixels | found | blur of the disc | noise at the threshold | chance | left "
              "| within 2 deviations and a timestep |")
        for name, of in [("no border in the disc", self.plain), ("a border in the disc", ~self.plain)]:
            differ, blur = (self.found - self.exact)[of], (self.blurred - self.exact)[of]
            noise, rest = (self.expected - self.blurred)[of], (self.found - self.expected)[of]
            within = np.abs(rest) <= 2 * self.deviation[of] + self.step_h
            cells = [rms(differ), rms(blur), rms(noise), rms(self.deviation[of]), rms(rest)]
            shown = " | ".join(f"{c:.1f}" for c in cells)
            print(f"    | {name} | {of.sum()} | {shown} | {100 * within.mean() if len(within) else 0:.1f} % |")


def discs(chosen, position, normal, kind, area, radius_m, looked):
    """For each chosen pixel the pixels of its disc and their weights."""
    (view, plan_m), (rows, columns) = looked, kind.shape
    out = []
    for row, column in chosen:
        r, here = radius_m[row, column], position[row, column]
        right = position[row, min(column + 1, columns - 1)]
        pixel_m = max(float(np.linalg.norm(right[:2] - here[:2])), 1e-3) if view != "plan" else plan_m / columns
        reach = int(np.ceil(r / pixel_m))
        stride = max(1, -(-reach // REACH))
        # The pixel itself is always one of them.
        steps = np.arange(-(reach // stride), reach // stride + 1) * stride
        dr, dc = (g.ravel() for g in np.meshgrid(steps, steps, indexing="ij"))
        at_row, at_column = row + dr, column + dc
        if view != "plan":
            at_column = at_column % columns
        inside = (at_row >= 0) & (at_row < rows) & (at_column >= 0) & (at_column < columns)
        at_row, at_column = at_row[inside], at_column[inside]
        there = position[at_row, at_column] - here
        same = ((there**2).sum(-1) <= r * r) & (normal[at_row, at_column] @ normal[row, column] >= 0.5)
        same &= np.isin(kind[at_row, at_column], RECEIVES)
        at, weight = at_row[same] * columns + at_column[same], area[at_row[same], at_column[same]]
        whole = weight.sum()
        if view == "plan":
            # An open disc is divided by its whole area: by that of the pixels that would be in it if
            # the surface went on as a plane, so that the raster's steps cancel.
            dx, dy, (nx, ny, nz) = dc[inside] * pixel_m, -dr[inside] * pixel_m, normal[row, column]
            dz = -(nx * dx + ny * dy) / (nz if abs(nz) > 0.05 else 0.05)
            flat = dx * dx + dy * dy + dz * dz <= r * r
            there_or_flat = np.where(same, area[at_row, at_column], area[row, column])
            whole = max(whole, there_or_flat[flat].sum())
        if len(at) == 0:
            at, weight, whole = np.array([row * columns + column]), np.ones(1), 1.0
        out.append((at, (weight / whole).astype(np.float32)))
    return out


def explain(photons, direct, material, view, threshold, plan_m=PLAN_M):
    import OpenEXR
    import zarr
    from scipy.sparse import csr_matrix
    from scipy.special import ndtr

    out = Explained()
    out.threshold, out.view = threshold, view
    with OpenEXR.File(str(photons / material / view / "noise.exr")) as file:
        photon, radius = (np.array(file.channels()[n].pixels) for n in ("photon.w_m2", "series_radius.m"))
    folders = [f / material / view for f in (photons, direct)]
    stores = [zarr.open_group(str(f / "series.zarr"), mode="r") for f in folders]
    values = [next(a for _, a in s.arrays() if a.ndim == 3) for s in stores]
    weight_h = stores[0]["weight_h"][:]
    steps, rows, columns = values[0].shape
    hours = [np.zeros((rows, columns)), np.zeros((rows, columns))]
    blocks = range(0, steps, BLOCK)
    for value, sum_h in zip(values, hours):
        for start in blocks:
            sum_h += np.tensordot(weight_h[start : start + BLOCK], value[start : start + BLOCK] > threshold, axes=1)
    out.hours, out.step_h = hours, float(weight_h.max())
    # Some of the pixels that are concerned.
    concerned = np.argwhere((photon > 0) & (radius > 0) & (np.maximum(*hours) > 0))
    chosen = concerned[np.random.default_rng(1).permutation(len(concerned))[:SAMPLES]]
    flat = chosen[:, 0] * columns + chosen[:, 1]
    out.chosen, out.radius = chosen, radius.ravel()[flat]
    out.found, out.exact = (h.ravel()[flat] for h in hours)
    blurred, expected, variance = (np.zeros(len(chosen)) for _ in range(3))
    if len(chosen):
        position, normal, kind = hits(photons / view / "hits.gmh")
        of = discs(chosen, position, normal, kind, footprints(view, position, normal), radius, (view, plan_m))
        # All discs as one sparse matrix.
        ends = np.cumsum([0] + [len(at) for at, _ in of])
        parts = np.concatenate([w for _, w in of]), np.concatenate([a for a, _ in of]), ends
        blur = csr_matrix(parts, shape=(len(of), rows * columns))
        q = photon.ravel()[flat][:, None]
        for start in blocks:
            weights = weight_h[start : start + BLOCK]
            smooth = blur @ values[1][start : start + BLOCK].reshape(len(weights), -1).T
            sigma = np.sqrt(np.maximum(smooth, 0) * q)
            p = np.where(sigma > 0, ndtr((smooth - threshold) / np.maximum(sigma, 1e-9)), smooth > threshold)
            blurred += (smooth > threshold) @ weights
            expected += p @ weights
            variance += (p * (1 - p)) @ weights**2
    out.blurred, out.expected, out.deviation = blurred, expected, np.sqrt(variance)
    return out


def figure(path, all_found):
    """Where durations differ, what was expected of that, and what is left."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    all_found = {k: f for k, f in all_found.items() if len(f.expected) > 1}
    if not all_found:
        return print("no figure: nothing is above the threshold")
    rows = len(all_found)
    shape, axes = plt.subplots(rows, 3, figsize=(13, 3.4 * rows), squeeze=False, width_ratios=[1.5, 1, 1])
    for (where, expect, left), ((material, view), f) in zip(axes, all_found.items()):
        differs = f.hours[0] - f.hours[1]
        most = max(np.percentile(np.abs(differs[differs != 0]), 98) if (differs != 0).any() else 1, 1e-3)
        drawn = where.imshow(differs, cmap="RdBu_r", vmin=-most, vmax=most, aspect="equal")
        where.set_title(f"{material}, {view}: hours above {f.threshold:g} W/m², photons less direct", fontsize=8)
        where.axis("off")
        shape.colorbar(drawn, ax=where, shrink=0.7, label="h/a")
        differ, predicted = f.found - f.exact, f.expected - f.exact
        x = np.linspace(-6, 6, 200)
        left.plot(x, np.exp(-x * x / 2) / np.sqrt(2 * np.pi), color="black", lw=0.8, label="chance alone")
        for of, color, name in [(~f.plain, "#c0504d", "a border in the disc"), (f.plain, "#1f4e79", "none")]:
            expect.plot(predicted[of], differ[of], ".", ms=2, color=color, label=name)
            chance = of & (f.deviation > 0.05 * f.step_h)
            units = np.clip((f.found - f.expected)[chance] / f.deviation[chance], -6, 6)
            left.hist(units, bins=48, range=(-6, 6), density=True, histtype="step", color=color)
        ends = [min(predicted.min(), differ.min()), max(predicted.max(), differ.max())]
        expect.plot(ends, ends, "-", lw=0.7, color="black")
        expect.set_xlabel("expected difference (h/a)", fontsize=8)
        expect.set_ylabel("found (h/a)", fontsize=8)
        expect.legend(fontsize=6, markerscale=3)
        left.legend(fontsize=6)
        left.set_xlabel("what is left, in standard deviations of chance", fontsize=8)
        for axis in (expect, left):
            axis.tick_params(labelsize=7)
    shape.tight_layout()
    shape.savefig(path, dpi=100)
