//! The integral over the PV, without photons: for the pixels of a view ([`direct_series`]), for
//! eyes ([`eye`]), and for the mirror rule of the authorities ([`MirrorRule`]).

pub(in crate::render) mod direct;
pub mod eye;
pub(in crate::render) mod facet;
pub(in crate::render) mod lobe;
pub(in crate::render) mod mirror;

pub use direct::{
    Direct, DirectScene, DirectScratch, DirectSinks, DirectSummary, DirectYear, FusedDirect,
    PvSight, TileYear, direct_series,
};
pub use mirror::{
    Anywhere, Lit, MirrorDay, MirrorReceiver, MirrorRule, MirrorRun, MirrorSummary, MirrorTimes,
    MirrorYear, SEPARATION_DEG,
};
