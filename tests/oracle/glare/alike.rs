//! The slow twin, and all that must not show: the window's seams, threads.

use glintmap::glare::Calendar;

use super::volumes::Dice;
use super::{Case, assert_same, plan, random_case, run, shaped_cases, twin};

#[test]
fn volumes_give_what_the_slow_twin_gives() {
    let mut cases: Vec<Case> = (1000..1200).map(random_case).collect();
    cases.extend(shaped_cases());
    for (number, case) in cases.iter_mut().enumerate() {
        if number % 2 == 0 {
            let steps = case.volume.shape[0];
            let mut dice = Dice::new(number as u64);
            case.volume.calendar = Some(Calendar {
                day: (0..steps as u32).map(|t| t / 3).collect(),
                weight_h: (0..steps).map(|_| dice.unit()).collect(),
            });
        }
        let expected = twin::analyse(&case.volume, &case.segments, &case.settings);
        assert_same(&run(case, None), &expected, &case.name);
    }
}

#[test]
fn seams_of_the_window_do_not_show() {
    let mut cases: Vec<Case> = (2000..2040).map(random_case).collect();
    cases.extend(shaped_cases().into_iter().skip(1).step_by(5));
    for case in &cases {
        let all = case.volume.shape[0];
        let expected = run(case, Some(plan(all, all)));
        for batch in [1, 2, 3, 7, 8, all] {
            for block in [1, 2, 3, 7, all] {
                let found = run(case, Some(plan(batch, block)));
                assert_same(&found, &expected, &format!("{}, {batch} by {block}", case.name));
            }
        }
    }
}

#[test]
fn threads_do_not_show() {
    let case = shaped_cases().pop().unwrap();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&case, None))
    };
    let expected = with(1);
    for threads in [2, 5] {
        assert_same(&with(threads), &expected, &format!("{threads} threads"));
    }
}
