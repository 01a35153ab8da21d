//! What is above the threshold: runs of pixels, connected in space and time to events, and how long
//! each event lasts at each pixel.
//!
//! `threshold` finds runs, `label` joins them, `track` follows events from slice to slice,
//! `duration` counts, `list` keeps the events that are over.

pub(in crate::glare) mod duration;
pub(in crate::glare) mod event;
pub(in crate::glare) mod label;
pub(in crate::glare) mod list;
pub(in crate::glare) mod paged;
pub(in crate::glare) mod runs;
pub(in crate::glare) mod sheet;
pub(in crate::glare) mod slab;
pub(in crate::glare) mod threshold;
pub(in crate::glare) mod track;

pub use event::Event;
pub use list::Events;
pub use sheet::{EventRow, EventTimes, ListedEvent, write_events};
