//! What is above the threshold: runs of pixels, connected in space and time to events, and how long
//! each event lasts at each pixel.
//!
//! `threshold` finds row runs, `slab` joins those of a box, `track` follows events from slab to slab
//! by the numbers of `label`; `counts` and `duration` count at each pixel, `paged` takes what has no
//! room in memory, `list` keeps the events that are over.

pub(in crate::glare) mod counts;
pub(in crate::glare) mod duration;
pub(in crate::glare) mod event;
pub(in crate::glare) mod label;
pub(in crate::glare) mod list;
pub(in crate::glare) mod paged;
pub(in crate::glare) mod sheet;
pub(in crate::glare) mod slab;
pub(in crate::glare) mod threshold;
pub(in crate::glare) mod track;

pub use event::Event;
pub use list::Events;
pub use sheet::{EventRow, EventTimes, ListedEvent, write_events};
