use crate::base::{FaultKind, Interrupted, SinkError, Tally};

/// Why photons can't be traced.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The site has no PV.
    #[error("the scene has no PV surface, so nothing emits; check [[pv]] select")]
    NoPv,
    /// The timeline is empty.
    #[error("no timestep has the sun above the horizon; check [time] days and hours")]
    NoSun,
    /// The caller gave the wrong number of BSDFs.
    #[error("{expected} PV surfaces need as many BSDFs, found {found}")]
    Bsdfs {
        /// PV surfaces of the site.
        expected: usize,
        /// BSDFs given.
        found: usize,
    },
    /// A setting is outside its range.
    #[error("{name} must be {expected}, found {found}")]
    Setting {
        /// The setting's name in a project.
        name: &'static str,
        /// What it may be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// No sun ever shines onto the front of any PV surface, or the PV reflects nothing.
    #[error(
        "no sun of the {timesteps} timesteps is reflected by the PV: it faces away from all of \
         them, the irradiance is zero, or the material reflects nothing"
    )]
    NoFlux {
        /// Timesteps looked at.
        timesteps: usize,
    },
    /// The pilot's photons all end elsewhere.
    #[error(
        "{stored} of {emitted} photons landed on the scene within {max_path_m} m, too few to go \
         on: {absorbed:.1} % of the flux was absorbed by the PV, {blocked:.1} % blocked on the way \
         from the sun, {escaped:.1} % left towards the sky, {too_far:.1} % flew further, \
         {on_pv:.1} % fell onto PV. Check [scene] files, the PV's orientation and \
         photons.max_path_m"
    )]
    NothingLands {
        /// Photons that landed.
        stored: u64,
        /// Photons sent.
        emitted: u64,
        /// The path limit.
        max_path_m: f64,
        /// Per cent of the flux.
        absorbed: f64,
        /// Per cent of the flux.
        blocked: f64,
        /// Per cent of the flux, with what wasn't sampled.
        escaped: f64,
        /// Per cent of the flux.
        too_far: f64,
        /// Per cent of the flux.
        on_pv: f64,
    },
    /// So small a part lands that the target would need too many photons.
    #[error(
        "to store {stored} photons {emitted:.2e} would have to be emitted (at most 2^48): \
         lower photons.stored"
    )]
    TooMany {
        /// The target.
        stored: u64,
        /// What it would need.
        emitted: f64,
    },
    /// The photons can't be kept.
    #[error("landed photons could not be kept")]
    Sink(#[source] std::io::Error),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl Error {
    /// What it means for the process.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::NoPv
            | Self::NoSun
            | Self::Bsdfs { .. }
            | Self::Setting { .. }
            | Self::NoFlux { .. }
            | Self::NothingLands { .. }
            | Self::TooMany { .. } => FaultKind::Input,
            Self::Sink(_) => FaultKind::Failed,
            Self::Interrupted(_) => FaultKind::Interrupted,
        }
    }

    pub(super) fn nothing_lands(tally: &Tally, max_path_m: f64) -> Self {
        let share = |flux_w: f64| 100.0 * flux_w / tally.sent.flux_w.max(f64::MIN_POSITIVE);
        Self::NothingLands {
            stored: tally.stored.photons,
            emitted: tally.sent.photons,
            max_path_m,
            absorbed: share(tally.absorbed.flux_w),
            blocked: share(tally.blocked.flux_w),
            escaped: share(tally.escaped.flux_w + tally.not_sampled.flux_w),
            too_far: share(tally.too_far.flux_w),
            on_pv: share(tally.on_pv.flux_w),
        }
    }
}

impl From<SinkError> for Error {
    fn from(error: SinkError) -> Self {
        match error {
            SinkError::Io(e) => Self::Sink(e),
            SinkError::Interrupted(e) => Self::Interrupted(e),
        }
    }
}
