//! Volumes for the tests: in memory, random, and shaped to be difficult.

use std::ops::Range;

use glintmap::base::{Purpose, Stream};
use glintmap::glare::{Calendar, ReadFailure, Slices};

/// A volume in memory.
#[derive(Clone, Debug)]
pub struct Memory {
    pub shape: [usize; 3],
    pub data: Vec<f32>,
    pub calendar: Option<Calendar>,
}

impl Memory {
    pub fn new(shape: [usize; 3], data: Vec<f32>) -> Self {
        assert_eq!(data.len(), shape.iter().product::<usize>());
        Self { shape, data, calendar: None }
    }

    /// From a rule that says what each voxel `(timestep, row, column)` holds.
    pub fn from_fn(shape: [usize; 3], mut voxel: impl FnMut(usize, usize, usize) -> f32) -> Self {
        let [t, y, x] = shape;
        let data = (0..t * y * x).map(|i| voxel(i / (y * x), i / x % y, i % x)).collect();
        Self::new(shape, data)
    }
}

impl Slices for Memory {
    fn shape(&self) -> [usize; 3] {
        self.shape
    }

    fn read_lit(
        &self,
        range: Range<usize>,
        picked: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), ReadFailure> {
        lit.fill(true);
        let [_, rows, columns] = self.shape;
        for (timestep, out) in range.zip(out.chunks_exact_mut(picked.len() * columns)) {
            let first = (timestep * rows + picked.start) * columns;
            out.copy_from_slice(&self.data[first..first + out.len()]);
        }
        Ok(())
    }

    fn calendar(&self) -> Option<Calendar> {
        self.calendar.clone()
    }
}

/// A source of choices.
pub struct Dice(Stream);

impl Dice {
    pub fn new(number: u64) -> Self {
        Self(Stream::new(20_260_101, Purpose::Survey, number))
    }

    pub fn unit(&mut self) -> f64 {
        self.0.uniform()
    }

    pub fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n - 1)
    }

    pub fn one_of<T: Clone>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())].clone()
    }
}

/// A random volume: noise of some density, blobs, plateaus, all clear, all set.
pub fn random(dice: &mut Dice, shape: [usize; 3]) -> Memory {
    let [t, y, x] = shape;
    match dice.below(9) {
        0 => Memory::from_fn(shape, |_, _, _| 0.0),
        1 => Memory::from_fn(shape, |_, _, _| 100.0),
        // Zeros of both signs: SciPy keeps the sign, so such voxels must not be skipped.
        2 => Memory::from_fn(shape, |a, b, _| if (a + b) % 40 < 20 { 0.0 } else { -0.0 }),
        3 | 4 => {
            let blobs: Vec<[f64; 4]> = (0..1 + dice.below(5))
                .map(|_| {
                    let place = |n: usize, d: &mut Dice| d.unit() * n as f64;
                    [place(t, dice), place(y, dice), place(x, dice), 1.0 + 4.0 * dice.unit()]
                })
                .collect();
            Memory::from_fn(shape, |a, b, c| {
                let inside = blobs.iter().any(|[p, q, r, size]| {
                    let d = [a as f64 - p, b as f64 - q, c as f64 - r];
                    d.iter().map(|d| d * d).sum::<f64>() < size * size
                });
                if inside { 20.0 + (c % 7) as f32 } else { 0.0 }
            })
        }
        _ => {
            let share = dice.one_of(&[0.02, 0.2, 0.3, 0.4, 0.6, 1.0]);
            Memory::from_fn(shape, |_, _, _| {
                let value = (dice.unit() * 40.0) as f32;
                if dice.unit() < share { value } else { 0.0 }
            })
        }
    }
}

/// Cuts `timesteps` into random segments.
pub fn segments(dice: &mut Dice, timesteps: usize) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    let likely = dice.one_of(&[0.0, 0.1, 0.5, 1.0]);
    for t in 0..timesteps {
        match out.last_mut() {
            Some(last) if dice.unit() >= likely => last.end = t + 1,
            _ => out.push(t..t + 1),
        }
    }
    out
}

/// Volumes whose events are hard to follow, each with its name.
pub fn adversarial() -> Vec<(&'static str, Memory)> {
    let lit = |on: bool| if on { 20.0 } else { 0.0 };
    let comb = Memory::from_fn([9, 8, 21], |t, _, x| lit(x % 2 == 0 || t == 8));
    let comb_rows = Memory::from_fn([3, 21, 9], |_, y, x| lit(y % 2 == 0 || x == 8));
    let board = Memory::from_fn([7, 9, 70], |t, y, x| lit((t + y + x) % 2 == 0));
    // The arms part in the first timestep, run apart, and meet in the last.
    let late = Memory::from_fn([40, 5, 5], |t, y, x| {
        lit(y == 2 && ((t < 39 && (x == 0 || x == 4)) || t == 39))
    });
    // Pixel (0, 0) blinks; what keeps the event alive is (0, 1) .. in every second blink's gap.
    let blinking = Memory::from_fn([60, 1, 4], |t, _, x| match x {
        0 => lit(t % 3 == 0),
        1 => lit(t % 3 != 1 || t % 9 == 4),
        2 => lit(t % 7 != 0),
        _ => lit(t % 2 == 0),
    });
    // Two events take turns at the pixel in the middle, then become one.
    let turns = Memory::from_fn([50, 3, 7], |t, y, x| {
        let rails = y == 1 && (x == 0 || x == 6);
        let reach = y == 1 && if t % 4 == 0 { x <= 3 } else { t % 4 == 2 && x >= 3 };
        lit(rails || reach || (t == 49 && y == 1))
    });
    // A square spiral that grows inwards with time.
    let spiral = Memory::from_fn([30, 15, 15], |t, y, x| {
        let ring = y.min(x).min(14 - y).min(14 - x);
        let gap = y == ring + 1 && x == ring && ring < 6;
        lit(ring % 2 == 0 && !gap && t >= 2 * ring || ring % 2 == 1 && y == ring + 1 && x == ring)
    });
    // The same across the strips in which the picture is worked through, and over more timesteps
    // than are read at once.
    let tall_comb =
        Memory::from_fn([35, 150, 9], |t, y, x| lit(x % 2 == 0 || (t == 34 && y == 127)));
    let tall_teeth = Memory::from_fn([20, 140, 9], |t, y, x| lit(y % 2 == 0 || (x == 8 && t > 17)));
    let far_arms = Memory::from_fn([40, 200, 3], |t, y, x| {
        lit(x == 1 && ((t < 39 && (y == 0 || y == 199)) || t == 39))
    });
    // A staircase whose steps touch by edges and corners, also from strip to strip.
    let stairs = Memory::from_fn([70, 140, 72], |t, y, x| {
        lit(y == 2 * t && x == t || y == 2 * t + 1 && x == t + 1)
    });
    let worm = Memory::from_fn([50, 135, 6], |t, y, x| {
        let turn = (t * 7) % 135;
        lit(y.abs_diff(turn) < 3 && x != 3 || (x == 3 && t % 2 == 0 && y % 64 > 61))
    });
    let tall_board = Memory::from_fn([19, 131, 5], |t, y, x| lit((t + y + x) % 2 == 0));
    vec![
        ("comb across strips", tall_comb),
        ("teeth across strips", tall_teeth),
        ("late merge across strips", far_arms),
        ("stairs across strips", stairs),
        ("worm across strips", worm),
        ("checkerboard across strips", tall_board),
        ("comb in time", comb),
        ("comb in space", comb_rows),
        ("checkerboard", board),
        ("late merge", late),
        ("blinking pixel", blinking),
        ("two events at one pixel", turns),
        ("spiral", spiral),
    ]
}
