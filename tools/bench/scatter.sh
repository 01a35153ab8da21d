#!/bin/sh
# What scattering costs: Lambertian against a tensor-tree BSDF of 12 MB (the preset `standard`,
# 2^7 cells, unpruned), the same rays, in turn in one process, in processor time: for a photon with
# its ray to the sun and its ray onwards, and for the draw alone. The ratio for a photon is to stay
# below 1.5.
#   tools/bench/scatter.sh [--release]
set -e
cd "$(dirname "$0")/../.."
exec cargo test "$@" --test all physics::bsdf_write::what_scattering_costs -- --ignored --nocapture
