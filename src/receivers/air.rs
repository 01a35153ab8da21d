//! Receivers in free air: which points of a set stand there, and the photons that crossed the discs
//! at them, in a store of their own.

use crate::base::SensorSheet;
use crate::pages::{Access, OpenOptions, Store};
use crate::project::{Folder, PlannedView};
use crate::render::sensors::Footing;
use crate::render::{HitKind, HitMap};

use super::error::Error;
use super::points::PointSet;

/// Radius of a disc, m; smaller where `max_radius_m` of the view is, or a surface is nearer.
const GATE_M: f64 = 0.1;

/// Which points of a set stand in free air, and where their crossings lie.
pub struct InAir {
    /// Their numbers in the set, ascending.
    pub points: Vec<usize>,
    /// Their discs, side by side.
    pub sheet: SensorSheet,
    /// Of a disc, m.
    pub radius_m: f64,
}

impl InAir {
    /// `None` where all points stand on surfaces.
    pub fn of(set: &PointSet, view: &PlannedView) -> Option<Self> {
        let footing = set.groups.iter().flat_map(|g| &g.footing);
        let points: Vec<usize> =
            footing.enumerate().filter(|(_, f)| **f == Footing::Air).map(|(i, _)| i).collect();
        let max_radius_m = view.photons().and_then(|gather| gather.annual.max_radius_m);
        let radius_m = max_radius_m.map_or(GATE_M, |m| GATE_M.min(f64::from(m)));
        let sheet = SensorSheet::new(points.len(), radius_m);
        (!points.is_empty()).then_some(Self { points, sheet, radius_m })
    }

    /// Hits in which these points receive light: for what needs no photons.
    pub fn lifted(&self, mut hits: HitMap) -> HitMap {
        for &point in &self.points {
            if let Some(hit) = hits.hits.get_mut(point) {
                hit.kind = HitKind::Receiver;
            }
        }
        hits
    }
}

/// The photons that crossed the virtual sensors of a set.
pub struct Crossings {
    pub air: InAir,
    pub store: Store,
}

impl Crossings {
    /// Those that a finished run left; `None` where no point stands in free air.
    ///
    /// # Errors
    /// When they can't be read.
    pub fn open(
        folder: &Folder,
        candidate: &str,
        (set, view): (&PointSet, &PlannedView),
        cache_bytes: u64,
    ) -> Result<Option<Self>, Error> {
        let Some(air) = InAir::of(set, view) else { return Ok(None) };
        let path = folder.at(&folder.air(candidate, &view.name));
        let options = OpenOptions { cache_bytes, access: Access::Mapped };
        Ok(Some(Self { air, store: Store::open(&path, &options)? }))
    }

    /// Calls `each` with timestep, flux (W) and PV surface of the photons at a point of the set;
    /// never where it doesn't stand in free air.
    ///
    /// # Errors
    /// When the store is damaged.
    pub fn photons(&self, point: usize, mut each: impl FnMut(u32, f32, u16)) -> Result<(), Error> {
        if let Ok(sensor) = self.air.points.binary_search(&point) {
            self.store.in_box(self.air.sheet.cell(sensor), |_, photon| {
                each(photon.timestep, photon.flux_w, photon.surface);
            })?;
        }
        Ok(())
    }
}
