//! What is dark is neither filled nor looked at: the result must not show it.

use std::ops::Range;

use glintmap::base::Silent;
use glintmap::base::limits::TILE_EDGE;
use glintmap::glare::{self, Calendar, ReadFailure, Slices};
use glintmap::volume::Volume;

use super::volumes::{Dice, Memory, segments};
use super::{Case, Found, assert_same, plan, run, twin};
use crate::support::series::Dense;

/// A volume that knows which tiles of a slice are dark, and touches nothing that it needn't.
struct Knowing(Memory);

impl Slices for Knowing {
    fn shape(&self) -> [usize; 3] {
        self.0.shape()
    }

    fn read_lit(
        &self,
        range: Range<usize>,
        picked: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), ReadFailure> {
        let [_, rows, columns] = self.shape();
        let across = columns.div_ceil(TILE_EDGE);
        assert!(picked.start.is_multiple_of(TILE_EDGE));
        assert!(picked.end == rows || picked.end.is_multiple_of(TILE_EDGE));
        let (down, tall) = (picked.len().div_ceil(TILE_EDGE), picked.len());
        assert_eq!(lit.len(), range.len() * down * across);
        for (slice, timestep) in range.enumerate() {
            let from = &self.0.data[(timestep * rows + picked.start) * columns..][..tall * columns];
            let out = &mut out[slice * tall * columns..][..tall * columns];
            for tile in 0..down * across {
                let flag = &mut lit[slice * down * across + tile];
                let (row, column) = (tile / across * TILE_EDGE, tile % across * TILE_EDGE);
                let places = (row..(row + TILE_EDGE).min(tall)).flat_map(|y| {
                    (column..(column + TILE_EDGE).min(columns)).map(move |x| y * columns + x)
                });
                let places: Vec<usize> = places.collect();
                let bright = places.iter().any(|&i| from[i].to_bits() != 0);
                if !*flag {
                    assert!(places.iter().all(|&i| out[i].to_bits() == 0), "not dark before");
                }
                if bright || *flag {
                    places.iter().for_each(|&i| out[i] = from[i]);
                }
                *flag = bright;
            }
        }
        Ok(())
    }

    fn calendar(&self) -> Option<Calendar> {
        self.0.calendar()
    }
}

fn analyse(case: &Case, volume: &dyn Slices, steps: glare::Plan) -> (Found, Vec<f32>) {
    let mut filtered = Vec::new();
    let mut keep = |_: usize, slice: &[f32]| {
        filtered.extend_from_slice(slice);
        Ok(())
    };
    let analysis = glare::analyse_planned(
        volume,
        &case.segments,
        &case.settings,
        &steps,
        Some(&mut keep),
        &Silent,
    )
    .unwrap_or_else(|e| panic!("{}: {e}", case.name));
    (analysis.into(), filtered)
}

#[test]
fn dark_tiles_do_not_show() {
    for number in 0..60 {
        let dice = &mut Dice::new(9000 + number);
        let shape = [2 + dice.below(50), 1 + dice.below(100), 1 + dice.below(200)];
        let lit = dice.one_of(&[0.02, 0.2, 0.7]);
        let mut case = super::random_case(3000 + number as usize);
        let numbers = Dense::random(shape, lit, number).numbers;
        case.volume = Memory::new(shape, numbers);
        case.segments = segments(dice, shape[0]);
        let expected = twin::analyse(&case.volume, &case.segments, &case.settings);
        assert_same(&run(&case, None), &expected, &case.name);
        let knowing = Knowing(case.volume.clone());
        for (batch, block) in [(1, 1), (3, 2), (8, 16), (8, 5), (2, 64)] {
            let found = analyse(&case, &knowing, plan(batch, block));
            assert_same(&found, &expected, &format!("{}, {batch} by {block}", case.name));
        }
    }
}

#[test]
fn volumes_on_disk_say_what_is_dark() {
    let folder = tempfile::tempdir().unwrap();
    for (number, lit) in [0.0, 0.05, 0.4].into_iter().enumerate() {
        let dense = Dense::random([70, 100, 170], lit, 5);
        let path = folder.path().join(number.to_string());
        dense.write(&path);
        let volume = Volume::open(&path).unwrap();
        let tiles = volume.tiles().unwrap();
        for step in [1, 7, 16, 48] {
            let (mut out, mut flags) = (Vec::new(), Vec::new());
            for first in (0..70).step_by(step) {
                let range = first..(first + step).min(70);
                out.resize(range.len() * 100 * 170, 0.0);
                flags.resize(range.len() * tiles, false);
                volume.read_rows(range.clone(), 0..100, &mut out, &mut flags).unwrap();
                assert!(out == dense.numbers[range.start * 17_000..range.end * 17_000]);
                if lit == 0.0 {
                    assert!(!flags.contains(&true));
                }
                for (slice, flags) in out.chunks_exact(17_000).zip(flags.chunks_exact(tiles)) {
                    for (at, value) in slice.iter().enumerate() {
                        let tile = at / 170 / TILE_EDGE * 6 + at % 170 / TILE_EDGE;
                        assert!(*value == 0.0 || flags[tile]);
                    }
                }
            }
        }
        assert!(volume.read_rows(0..1, 0..100, &mut vec![0.0; 17_000], &mut []).is_err());
    }
}
