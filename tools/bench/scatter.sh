#!/bin/sh
# What scattering costs: Lambertian against a tensor-tree BSDF of 12 MB (the preset `standard`,
# 2^7 cells, unpruned), the same incident rays, in turn in one process, in processor time.
# Three rounds; the last column is the ratio, which is to stay below 1.5 for an emitted photon.
#   tools/bench/scatter.sh [--release]
set -e
cd "$(dirname "$0")/../.."
exec cargo test "$@" --test all physics::bsdf_write::what_scattering_costs -- --ignored --nocapture
