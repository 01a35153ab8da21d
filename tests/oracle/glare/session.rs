//! A year that is handed over piece by piece must give what it gives as a whole.

use std::ops::Range;

use glintmap::base::limits::TILE_EDGE;
use glintmap::base::{SeriesEntry, Silent, TileSink, tiles};
use glintmap::glare::{Calendar, Error, Session, Settings, Slices, TileBatch};

use super::volumes::{Dice, Memory, segments};
use super::{Case, Found, assert_same, plan, run, whole};
use crate::support::series::Dense;

/// The timesteps of `range` as a renderer would deliver them.
fn batch(volume: &Memory, range: Range<usize>) -> TileBatch {
    let [_, rows, columns] = volume.shape;
    let out = TileBatch::new(volume.shape, range.clone());
    for tile in tiles(columns, rows, TILE_EDGE) {
        let mut entries = Vec::new();
        for timestep in range.clone() {
            for pixel in 0..tile.pixels() {
                let row = tile.row + pixel / tile.columns;
                let column = tile.column + pixel % tile.columns;
                let value = volume.data[(timestep * rows + row) * columns + column];
                if value != 0.0 {
                    entries.push(SeriesEntry {
                        timestep: timestep as u32,
                        pixel: pixel as u16,
                        irradiance_w_m2: value,
                    });
                }
            }
        }
        assert!(!out.has(tile));
        out.put(tile, &entries).unwrap();
        assert!(out.has(tile));
        assert!(out.put(tile, &entries).is_err(), "twice");
    }
    out
}

fn in_pieces(case: &Case, most: usize, steps: glintmap::glare::Plan) -> (Found, Vec<f32>) {
    let mut filtered = Vec::new();
    let mut keep = |_: usize, slice: &[f32]| {
        filtered.extend_from_slice(slice);
        Ok(())
    };
    let calendar = case.volume.calendar();
    let mut session = Session::begin(case.volume.shape, calendar, &case.settings, &steps).unwrap();
    for part in case.segments.chunks(most) {
        let range = part[0].start..part[part.len() - 1].end;
        let rendered = batch(&case.volume, range);
        session.push(&rendered, part, Some(&mut keep), &Silent).unwrap();
    }
    (session.finish().unwrap().into(), filtered)
}

#[test]
fn pieces_do_not_show() {
    for number in 0..40 {
        let dice = &mut Dice::new(12_000 + number);
        let shape = [2 + dice.below(60), 1 + dice.below(80), 1 + dice.below(150)];
        let mut case = super::random_case(5000 + number as usize);
        let lit = dice.one_of(&[0.02, 0.2, 0.7]);
        case.volume = Memory::new(shape, Dense::random(shape, lit, number).numbers);
        case.segments = segments(dice, shape[0]);
        if number % 2 == 0 {
            let day = (0..shape[0] as u32).map(|t| t / 4).collect();
            case.volume.calendar = Some(Calendar { day, weight_h: vec![0.25; shape[0]] });
        }
        let expected = run(&case, None);
        for (most, batch, block) in [(1, 8, 16), (2, 1, 1), (3, 3, 5), (1000, 8, 64)] {
            let found = in_pieces(&case, most, plan(batch, block));
            assert_same(&found, &expected, &format!("{}, {most} segments", case.name));
        }
    }
}

#[test]
fn pieces_that_do_not_follow_are_refused() {
    let volume = Memory::from_fn([6, 2, 3], |_, _, _| 20.0);
    let begin = || Session::begin(volume.shape, None, &Settings::default(), &plan(2, 2)).unwrap();
    let push = |session: &mut Session, range: Range<usize>| {
        session.push(&volume, std::slice::from_ref(&range), None, &Silent)
    };
    let mut session = begin();
    push(&mut session, 0..2).unwrap();
    assert!(matches!(push(&mut session, 3..6), Err(Error::Segments { index: 1, .. })));
    let mut session = begin();
    push(&mut session, 0..2).unwrap();
    assert!(matches!(session.finish(), Err(Error::Segments { .. })));
    let other = Memory::from_fn([6, 3, 2], |_, _, _| 20.0);
    let refused = begin().push(&other, &whole(&other), None, &Silent);
    assert!(matches!(refused, Err(Error::Source { .. })));
    // A batch that doesn't hold what it is asked for.
    let part = batch(&volume, 0..2);
    assert!(begin().push(&part, &whole(&volume), None, &Silent).is_err());
}
