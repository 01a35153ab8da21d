//! The stages of a run, and how to run them.

use serde::{Deserialize, Serialize};

use crate::project::Shard;

/// The stages of a run, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// The timesteps and their suns.
    Suns,
    /// Photons from the PV onto the scene.
    Trace,
    /// The photon store.
    Pages,
    /// Hits, annual maps, time series.
    Render,
    /// Glare durations and events.
    Glare,
    /// What people look at.
    Pictures,
    /// The document.
    Report,
}

impl Stage {
    /// All stages, in their order.
    pub const ALL: [Self; 7] = [
        Self::Suns,
        Self::Trace,
        Self::Pages,
        Self::Render,
        Self::Glare,
        Self::Pictures,
        Self::Report,
    ];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Suns => "suns",
            Self::Trace => "trace",
            Self::Pages => "pages",
            Self::Render => "render",
            Self::Glare => "glare",
            Self::Pictures => "pictures",
            Self::Report => "report",
        }
    }
}

/// How to run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The last stage to run.
    pub until: Stage,
    /// Redo this stage and what follows.
    pub force: Option<Stage>,
    /// Only this share of the photons: nothing but the stage `trace` is run.
    pub shard: Option<Shard>,
    /// Bound of anonymous memory, bytes.
    pub memory_bytes: u64,
    /// Of the photon store's page cache, bytes.
    pub page_cache_bytes: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            until: Stage::Report,
            force: None,
            shard: None,
            memory_bytes: 1 << 30,
            page_cache_bytes: 256 << 20,
        }
    }
}
