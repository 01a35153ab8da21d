//! What can't be analysed is refused by name.

use std::ops::Range;

use glintmap::base::Silent;
use glintmap::glare::{self, Error, Plan, Settings};

use super::volumes::Memory;
use super::whole;

fn refusal(volume: &Memory, settings: &Settings) -> Error {
    glare::analyse(volume, &whole(volume), settings, None, &Silent)
        .expect_err("it should be refused")
}

#[test]
fn a_voxel_that_is_not_finite_is_named() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut volume = Memory::from_fn([20, 30, 70], |_, _, _| 1.0);
        volume.data[(11 * 30 + 7) * 70 + 64] = bad;
        volume.data[(11 * 30 + 8) * 70 + 3] = bad;
        volume.data[(19 * 30 + 2) * 70 + 3] = bad;
        let error = refusal(&volume, &Settings::default());
        assert!(
            matches!(error, Error::NonFinite { timestep: 11, row: 7, column: 64, .. }),
            "{error}"
        );
        assert_eq!(error.kind().exit_code(), 2);
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let volume = Memory::from_fn([3, 4, 5], |_, _, _| 1.0);
    let refused = |change: &dyn Fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        let error = refusal(&volume, &settings);
        assert_eq!(error.kind().exit_code(), 2, "{error}");
        error
    };
    for threshold in [-1.0, f64::NAN, f64::INFINITY, 1e39] {
        assert!(matches!(refused(&|s| s.threshold = threshold), Error::Threshold(_)));
    }
    assert!(matches!(refused(&|s| s.sigma[1] = -1.0), Error::Sigma { axis: 'y', .. }));
    assert!(matches!(refused(&|s| s.sigma[2] = 1e12), Error::Radius { axis: 'x', .. }));
    assert!(matches!(refused(&|s| s.truncate = f64::NAN), Error::Truncate(_)));
    assert!(matches!(refused(&|s| s.memory_bytes = 1), Error::Memory { .. }));
    let all = |segments: &[Range<usize>]| {
        let settings = Settings::default();
        glare::analyse(&volume, segments, &settings, None, &Silent).map(|_| ())
    };
    assert!(all(&[0..2, 2..3]).is_ok());
    for wrong in [
        vec![],
        std::iter::once(0..2).collect(),
        vec![0..2, 1..3],
        vec![0..2, 2..4],
        vec![0..0, 0..3],
    ] {
        assert!(matches!(all(&wrong), Err(Error::Segments { .. })), "{wrong:?}");
    }
}

#[test]
fn too_many_events_for_the_memory_are_refused_by_name() {
    let volume = Memory::from_fn([4, 200, 200], |t, y, x| ((t + y + x) % 2 * 20) as f32);
    let settings = Settings { sigma: [0.0; 3], ..Settings::default() };
    let tight = Plan { events_bytes: 1000, ..glare::plan(&volume, &settings, false).unwrap() };
    let found = glare::analyse_planned(&volume, &whole(&volume), &settings, &tight, None, &Silent);
    assert!(matches!(found.map(|_| ()), Err(Error::Events { timestep: 0, .. })));
}
