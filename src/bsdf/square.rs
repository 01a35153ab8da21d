/// A part of the scattering that is drawn from the unit square: two numbers make a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Chart {
    /// All of it, by [`Bsdf::sample_within`](super::Bsdf::sample_within); nothing is known of where
    /// a part of the square goes.
    Whole,
    /// A single direction for each incident one.
    Mirrored,
    /// All outgoing directions, by the square of the sine and the azimuth.
    Hemisphere,
    /// All outgoing directions, by the square of a tensor tree's cells: within a square they are
    /// drawn in proportion to the cells' values, so that its density is the same all over.
    Cells,
    /// Facets that the incident direction sees.
    Facets,
}

/// A part of a lobe's unit square: the whole halved `level` times along each edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Of which lobe.
    pub chart: Chart,
    /// Times that the edges were halved.
    pub level: u8,
    /// Column, from 0 to `2^level - 1`.
    pub x: u16,
    /// Row.
    pub y: u16,
}

impl Square {
    /// Squares can't be halved further.
    pub const FINEST: u8 = 14;

    /// The whole square of a lobe.
    pub fn whole(chart: Chart) -> Self {
        Self { chart, level: 0, x: 0, y: 0 }
    }

    /// Its four quarters; `None` where there are none, or they would say nothing new.
    pub fn quarters(self) -> Option<[Self; 4]> {
        let parts = !matches!(self.chart, Chart::Whole | Chart::Mirrored);
        (parts && self.level < Self::FINEST).then(|| {
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| Self {
                level: self.level + 1,
                x: self.x * 2 + x,
                y: self.y * 2 + y,
                ..self
            })
        })
    }

    /// Area, as a share of the lobe's square.
    pub fn area(self) -> f64 {
        let edge = self.edge();
        edge * edge
    }

    /// Length of an edge.
    #[inline]
    fn edge(self) -> f64 {
        1.0 / f64::from(1_u32 << self.level)
    }

    /// Lower left and upper right corner.
    pub(super) fn corners(self) -> ([f64; 2], [f64; 2]) {
        let edge = self.edge();
        let low = [f64::from(self.x) * edge, f64::from(self.y) * edge];
        (low, low.map(|a| a + edge))
    }

    /// The lobe's coordinates at a point of this square.
    #[inline]
    pub fn at(self, u: f64, v: f64) -> (f64, f64) {
        let edge = self.edge();
        ((f64::from(self.x) + u) * edge, (f64::from(self.y) + v) * edge)
    }

    /// Orders squares so that neighbours lie near each other: by lobe, then along a Z curve.
    pub fn order(self) -> (Chart, u64) {
        let shift = Self::FINEST - self.level;
        let spread = |x: u16| {
            (0..u64::from(Self::FINEST))
                .fold(0, |out, bit| out | ((u64::from(x) >> bit) & 1) << (2 * bit))
        };
        (self.chart, (spread(self.x) | spread(self.y) << 1) << (2 * shift))
    }
}
