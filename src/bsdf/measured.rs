use std::sync::Arc;

use glam::DVec3;

use super::block::Table;
use crate::base::Stream;

/// One side's reflection from a file, piecewise constant over the file's patches or cells, as
/// Radiance evaluates it (without interpolation).
///
/// In the local frame x lies horizontal to the right as seen from outside and y up the slope:
/// Radiance's frame of a BSDF material whose up vector is the zenith.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    table: Arc<Table>,
    /// Seen from Radiance's back: x counts the other way, so that the frame stays right-handed.
    mirrored: bool,
}

impl Measured {
    pub(super) fn new(table: Arc<Table>, mirrored: bool) -> Self {
        Self { table, mirrored }
    }

    /// The values behind it.
    pub fn table(&self) -> &Table {
        &self.table
    }

    #[inline]
    pub(super) fn turned(&self, v: DVec3) -> DVec3 {
        if self.mirrored { DVec3::new(-v.x, v.y, v.z) } else { v }
    }

    /// Share of the light from a direction that is scattered.
    #[inline]
    pub fn reflectance(&self, incident: DVec3) -> f64 {
        let from = self.turned(incident);
        match &*self.table {
            Table::Matrix(m) => m.incident_patch(from).map_or(0.0, |i| m.total(i)),
            Table::Tree(t) => t.total(from),
        }
    }

    /// Largest reflectance for incident cosines of a range.
    pub(super) fn most(&self, cos_low: f64, cos_high: f64) -> f64 {
        match &*self.table {
            Table::Matrix(m) => m.most(cos_low, cos_high),
            Table::Tree(t) => t.most(cos_low, cos_high),
        }
    }

    /// A direction with density `f cos / reflectance`; the reflectance is above 0.
    #[inline]
    pub(super) fn sample(&self, incident: DVec3, random: &mut Stream) -> Option<DVec3> {
        let from = self.turned(incident);
        let out = match &*self.table {
            Table::Matrix(m) => m.sample(m.incident_patch(from)?, random),
            Table::Tree(t) => t.sample(from, random),
        };
        Some(self.turned(out))
    }

    /// 1/sr.
    pub fn evaluate(&self, incident: DVec3, out: DVec3) -> f64 {
        let (from, to) = (self.turned(incident), self.turned(out));
        match &*self.table {
            Table::Matrix(m) => m.evaluate(from, to),
            Table::Tree(t) => t.evaluate(from, to),
        }
    }
}
