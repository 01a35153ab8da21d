//! The integral over the PV, without photons: for the pixels of a view ([`direct_series`]), for eyes
//! ([`eye`]), and for the mirror rule of the authorities ([`MirrorRule`]).
//!
//! The PV seen from a point exists once for all of them: its sides that shine (`facet`), their cells
//! and what something sees of them (`pv`), the sun's disc (`disc`), lobes of microfacets (`lobe`)
//! and measured BSDFs under that disc (`sunlit`).

pub(in crate::render) mod direct;
pub(in crate::render) mod disc;
pub mod eye;
pub(in crate::render) mod facet;
pub(in crate::render) mod lobe;
pub(in crate::render) mod mirror;
pub(in crate::render) mod pv;
pub(in crate::render) mod sunlit;

pub use direct::{
    Direct, DirectScene, DirectScratch, DirectSinks, DirectSummary, DirectYear, FusedDirect,
    PvSight, TileYear, direct_series,
};
pub use mirror::{
    Anywhere, Lit, MirrorDay, MirrorReceiver, MirrorRule, MirrorRun, MirrorSummary, MirrorTimes,
    MirrorYear, SEPARATION_DEG,
};
