#!/usr/bin/env python3
"""Compares an analysis with SciPy, cell by cell.

    glare_cells.py DIR THRESHOLD CELL ROW,COLUMN...

DIR/volume.zarr is a volume whose rows and columns of pixels are dark in the first 32 of each CELL,
so that no event and no filter joins two cells; DIR/days.npy has the segments, DIR/out the maps of
`glintmap glare analyse`. Each cell named is read with zarr, and computed with glare_reference.py.
"""
import csv
import pathlib
import sys

import numpy as np
import zarr

from glare_reference import analyse

folder, threshold, cell = pathlib.Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
array = zarr.open_group(str(folder / "volume.zarr"), mode="r")["irradiance"]
days = np.load(folder / "days.npy")
maps = {name: np.load(folder / "out" / f"{name}.npy") for name in ("cumulative", "sustained", "longest_run")}
events = [
    (int(e["first"]), int(e["last"]), int(e["voxels"]), int(e["pixels"]), float(e["centroid_row"]), float(e["centroid_column"]))
    for e in csv.DictReader(open(folder / "out" / "events.csv"))
]
assert events == sorted(events, key=lambda e: e[:4]), "events.csv isn't sorted"
wrong = 0
for word in sys.argv[4:]:
    row, column = (int(n) * cell for n in word.split(","))
    rows, columns = slice(row, min(row + cell + 32, array.shape[1])), slice(column, min(column + cell + 32, array.shape[2]))
    volume = np.ascontiguousarray(array[:, rows, columns])
    _, cumulative, sustained, longest, expected = analyse(volume, threshold, seg=days)
    for name, ours in (("cumulative", cumulative), ("sustained", sustained), ("longest_run", longest)):
        differ = int((maps[name][rows, columns] != ours).sum())
        print(f"cell {word}: {name} up to {ours.max()}, {differ} pixels differ")
        wrong += differ + (ours.max() == 0)
    found = [e[:4] for e in events if rows.start <= e[4] < rows.stop and columns.start <= e[5] < columns.stop]
    same = found == [(e["first"], e["last"], e["voxels"], e["pixels"]) for e in expected]
    print(f"cell {word}: {len(expected)} events, {'the same' if same else f'{len(found)} others'}")
    wrong += not same
# A NumPy bool isn't a status: sys.exit would print it and fail.
sys.exit(int(wrong != 0))
