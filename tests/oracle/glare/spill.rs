//! Events that don't fit into memory go to the disk and come back the same.

use glintmap::base::Silent;
use glintmap::glare::{self, Error, Plan, Settings};

use super::volumes::{Dice, Memory, segments};
use super::{Case, assert_same, plan, random_case, run, shaped_cases, twin};

/// Hundreds of events take turns at every pixel, stay alive together, and merge now and then:
/// lines in time at the left that reach out to the right in turn.
fn crowded(lines: usize, timesteps: usize) -> Memory {
    Memory::from_fn([timesteps, 2 * lines, 12], |t, y, x| {
        let rail = y % 2 == 0 && x == 0;
        let arm = y % 2 == 0 && t % 5 == y % 5;
        let bridge = x == 11 && t % 17 == 3 && y / 8 % 2 == 0;
        // All arms of one timestep bend into the same row of pixels, one after the other.
        let shared = y == 2 * (t / 2 % lines) + 1 && x > 3;
        if rail || arm || bridge || (shared && t % 2 == 0) { 20.0 + (x % 3) as f32 } else { 0.0 }
    })
}

#[test]
fn a_tiny_budget_gives_the_same() {
    let mut cases: Vec<Case> = (7000..7120).map(random_case).collect();
    cases.extend(shaped_cases());
    let dice = &mut Dice::new(31);
    for (number, lines) in [(0, 5), (1, 20), (2, 40)] {
        for connectivity in super::ALL {
            let volume = crowded(lines, 90);
            let settings = Settings { connectivity, sigma: [0.0; 3], ..Settings::default() };
            let segments = if number == 1 { segments(dice, 90) } else { super::whole(&volume) };
            cases.push(Case { name: format!("crowd of {lines}"), volume, segments, settings });
        }
    }
    for case in &cases {
        let expected = twin::analyse(&case.volume, &case.segments, &case.settings);
        for spill_bytes in [0, 200, 3000] {
            let steps = Plan { spill_bytes, ..plan(8, 5) };
            let found = run(case, Some(steps));
            assert_same(&found, &expected, &format!("{}, {spill_bytes} bytes", case.name));
        }
    }
}

#[test]
fn a_folder_that_takes_no_file_is_named_as_the_reason() {
    let dice = &mut Dice::new(1);
    let volume = Memory::from_fn([9, 20, 20], |_, _, _| 20.0 * dice.unit() as f32);
    let spill = std::path::PathBuf::from("/nowhere at all");
    let settings = Settings { threshold: 12.0, sigma: [0.0; 3], spill, ..Settings::default() };
    let steps = Plan { spill_bytes: 0, ..plan(8, 5) };
    let all = std::iter::once(0..9).collect::<Vec<_>>();
    let error = glare::analyse_planned(&volume, &all, &settings, &steps, None, &Silent)
        .expect_err("there is no such folder");
    assert!(matches!(error, Error::Spill(_)), "{error}");
    assert_eq!(error.kind().exit_code(), 1);
}
