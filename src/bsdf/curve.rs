/// Intervals of the cosine.
const STEPS: usize = 2048;

/// A function of the cosine from 0 to 1 as 2,049 values, linear in between. Reflectances bend so
/// little that this is good to 1e-5.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    values: Vec<f64>,
    /// Largest value at this cosine or any larger one.
    above: Vec<f64>,
}

impl Curve {
    /// Takes the values of `of(cosine)`.
    pub(super) fn new(of: impl Fn(f64) -> f64) -> Self {
        let values: Vec<f64> = (0..=STEPS).map(|i| of(i as f64 / STEPS as f64)).collect();
        let mut above = values.clone();
        for i in (0..STEPS).rev() {
            above[i] = above[i].max(above[i + 1]);
        }
        Self { values, above }
    }

    /// The value at a cosine.
    #[inline]
    pub(super) fn at(&self, cos: f64) -> f64 {
        let x = cos.clamp(0.0, 1.0) * STEPS as f64;
        let i = (x as usize).min(STEPS - 1);
        let part = x - i as f64;
        self.values[i] * (1.0 - part) + self.values[i + 1] * part
    }

    /// The largest value at this cosine or any larger one.
    #[inline]
    pub(super) fn most_above(&self, cos: f64) -> f64 {
        self.above[((cos.clamp(0.0, 1.0) * STEPS as f64) as usize).min(STEPS)]
    }

    /// The largest value from one cosine to another.
    pub(super) fn most(&self, low: f64, high: f64) -> f64 {
        let from = (low.clamp(0.0, 1.0) * STEPS as f64) as usize;
        let to = ((high.clamp(0.0, 1.0) * STEPS as f64) as usize + 1).min(STEPS);
        self.values[from..=to].iter().fold(0.0, |m, &v| m.max(v))
    }

    /// Mean over a hemisphere of even radiance, `2 integral f cos dcos`.
    pub(super) fn mean(&self) -> f64 {
        let step = 1.0 / STEPS as f64;
        // Exact for what is linear in between.
        let parts = self.values.windows(2).enumerate().map(|(i, v)| {
            let (a, b) = (i as f64 * step, (i + 1) as f64 * step);
            step * (v[0] * (2.0 * a + b) + v[1] * (a + 2.0 * b)) / 3.0
        });
        parts.sum()
    }
}
