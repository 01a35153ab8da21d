#!/usr/bin/env python3
"""Runs the glare reference on many volumes in one process.

    glare_cases.py DIR

DIR/cases.json lists the cases, DIR/NUMBER.f32 holds each volume. For each case this writes
NUMBER.filtered.f32, NUMBER.maps.i32 (cumulative, sustained, longest run) and
NUMBER.events.json.
"""
import json
import pathlib
import sys
import warnings

import numpy as np
from scipy.ndimage._filters import _gaussian_kernel1d

from glare_reference import analyse

warnings.simplefilter("ignore")  # overflow and NaN are wanted here
folder = pathlib.Path(sys.argv[1])
for case in json.loads((folder / "cases.json").read_text()):
    number = case["number"]
    volume = np.fromfile(folder / f"{number}.f32", "<f4").reshape(case["shape"])
    filtered, cumulative, sustained, longest, events = analyse(
        volume, case["threshold"], tuple(case["sigma"]), case["truncate"], case["connectivity"],
        case["segments"])
    filtered.astype("<f4").tofile(folder / f"{number}.filtered.f32")
    np.stack([cumulative, sustained, longest]).astype("<i4").tofile(folder / f"{number}.maps.i32")
    (folder / f"{number}.events.json").write_text(json.dumps(events))

kernels = {}
for sigma in (folder / "sigmas.txt").read_text().split():
    radius = int(4.0 * float(sigma) + 0.5)
    kernels[sigma] = [int(w) for w in _gaussian_kernel1d(float(sigma), 0, radius)[radius:].view("u8")]
(folder / "kernels.json").write_text(json.dumps(kernels))
